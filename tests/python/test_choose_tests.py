# SPDX-License-Identifier: Apache-2.0
"""`./dev test cpp` and `./dev test py` run the tests of what they are given."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import choose_tests

ROOT = Path(__file__).parents[2]


def commands(build: Path) -> None:
    """Write compile commands as CMake does, with precompiled headers of another target."""
    headers = "-include /b/tests/cpp/CMakeFiles/test_support.dir/cmake_pch.hxx"
    entries = [
        {
            "file": str(ROOT / f"tests/cpp/{file}"),
            "command": f"c++ {headers} -o tests/cpp/CMakeFiles/{target}.dir/{file}.o -c {file}",
        }
        for file, target in (
            ("filters/test_gate.cpp", "test_filters"),
            ("maps/test_ray_caster.cpp", "test_maps"),
        )
    ]
    (build / "compile_commands.json").write_text(json.dumps(entries))


@pytest.mark.parametrize(
    ("name", "target", "test"),
    [("cpp/src/filters/gate.cpp", "test_filters", "Gate."),
     ("tests/cpp/maps/test_ray_caster.cpp", "test_maps", "RayCaster.")],
)  # fmt: skip
def test_a_source_runs_its_tests_in_their_executable(
    tmp_path: Path, name: str, target: str, test: str
) -> None:
    commands(tmp_path)
    (line,) = choose_tests.cpp(tmp_path, name)
    assert line.startswith(f"{target} ")
    assert test in line


def test_a_module_runs_its_tests() -> None:
    assert list(choose_tests.python("python/locfuse/eval/ape.py")) == [
        "tests/python/eval/test_ape.py"
    ]
