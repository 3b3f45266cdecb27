# SPDX-License-Identifier: Apache-2.0
"""The extension as a whole: every public name, its version, and examples that run as written."""

from __future__ import annotations

import doctest
import inspect
import os
import re
import subprocess
import sys

import pytest

import locfuse
from locfuse import _core, core, types
from support_runs import ROOT


def test_every_name_of_the_core_but_the_parser_is_public() -> None:
    names = {name for name in dir(_core) if not name.startswith("_")}
    assert names - set(core.__all__) == {"parse_table"}
    assert all(getattr(core, name) is getattr(_core, name) for name in core.__all__)


def test_at_most_60_names_are_at_the_top() -> None:
    assert len(locfuse.__all__) <= 60
    assert "__version__" in locfuse.__all__
    for name in set(locfuse.__all__) - {"__version__"}:
        assert name in core.__all__ or hasattr(types, name)


def test_the_version_is_that_of_the_build() -> None:
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    found = re.search(r"VERSION (\d+\.\d+\.\d+)", text)
    assert found is not None
    assert locfuse.__version__ == _core.__version__ == found[1]


def test_it_says_who_compiled_it_and_which_kernels_run() -> None:
    assert re.match(r"(GCC|Clang) \d+\.\d+", core.compiler())
    said = subprocess.run(
        [sys.executable, "-c", "import locfuse.core; print(locfuse.core.kernels())"],
        env={**os.environ, "LOCFUSE_PORTABLE": "1"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert said.stdout == "portable\n"
    assert core.kernels() in ("avx2", "portable")


WITH_EXAMPLES = [
    name for name in dir(_core)
    if not name.startswith("_") and ">>>" in (inspect.getdoc(getattr(_core, name)) or "")
]  # fmt: skip


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_the_example_in_the_docstring_runs_as_shown(name: str) -> None:
    text = inspect.getdoc(getattr(_core, name)) or ""
    names = {"parse_table": _core.parse_table}
    example = doctest.DocTestParser().get_doctest(text, names, name, None, 0)
    assert doctest.DocTestRunner().run(example).failed == 0


def test_the_entry_points_have_examples() -> None:
    assert {"PoseEkf", "Linearization", "GaussianBelief", "Pose2", "parse_table"} <= set(
        WITH_EXAMPLES
    )


def test_broken_numbers_are_an_arithmetic_error() -> None:
    assert issubclass(locfuse.NumericalError, ArithmeticError)
    assert issubclass(locfuse.ConfigError, ValueError)
    assert issubclass(locfuse.LogError, ValueError)
