# SPDX-License-Identifier: Apache-2.0
"""Files that readers once met with an error of another library, found by fuzzing and by review.

Each is refused in the reader's own words now, so that the command line says one sentence.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from locfuse.config.load import load_config, parse_config
from locfuse.io.log_folder import read_log
from locfuse.io.log_yaml import read_log_yaml
from locfuse.io.maps import read_map
from locfuse.types import ConfigError, LogError
from support_pictures import MAP, png_of
from support_runs import ROOT

HUGE = "0x" + "f" * 4000  # an integer without a text
DEEP = "[&a0 [1]" + "".join(f", &a{i + 1} [*a{i}]" for i in range(2000)) + "]"  # by its aliases


@pytest.mark.parametrize(
    "text",
    [
        "a: !!bool x",  # PyYAML: KeyError
        "a: !!int ''",  # IndexError
        "a: !!float _",  # IndexError
        "a: !!timestamp x",  # AttributeError
        "!!map [a]",  # TypeError
        "a: " + "[" * 2000,  # RecursionError
        "tags: " + "{a: " * 1500,  # RecursionError, once it was parsed
        f"estimator: {{range: {{gate: {HUGE}}}}}",  # ValueError where its text was made
        f"description: [{HUGE}]",
        f"description: {DEEP}",  # RecursionError, too
        "description: " + "1:" * 200 + "1.5",  # OverflowError: a power of 60 that is no float
        'description: "\\UFFFFFFFF"',  # OverflowError: of what chr() makes no character
        'description: "\\ud800"',  # UnicodeEncodeError where the report was written
        'tags: {"\\udfff": [0, 0, 0]}',
    ],
)
@pytest.mark.parametrize(("read", "error"), [(load_config, ConfigError), (read_log_yaml, LogError)])
def test_yaml_that_its_parser_stumbles_over_is_refused(
    read: Callable[[Path], Any], error: type[ValueError], text: str, tmp_path: Path
) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(text)
    with pytest.raises(error, match=r"file\.yaml") as caught:
        read(path)
    assert len(str(caught.value).encode()) < 1000


@pytest.mark.parametrize(
    "text",
    [
        f"clock_jump: {HUGE}",  # ValueError where its text was made
        f"use: [{HUGE}]",
        f"start: [1{'0' * 299}0000000000, 0, 0]",  # OverflowError in math.isfinite
        f"start: [0x{'f' * 280}, 0, 0]",
        "seed: 18446744073709551616\nmcl: {}",  # TypeError where the filter was built
    ],
)
def test_an_integer_that_does_not_fit_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text(text)
    with pytest.raises(ConfigError, match=r"config\.yaml"):
        load_config(tmp_path / "config.yaml")


@pytest.mark.parametrize("config", [{"start": [10**400, 0, 0]}, {"clock_jump": 10**5000}])
def test_an_integer_from_elsewhere_than_yaml_is_refused_as_well(config: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(config))):
        parse_config(config)


@pytest.mark.parametrize(
    "image",
    [
        png_of(20_000, 20_000, 8, b""),  # Pillow: DecompressionBombError
        png_of(1, 1, 8, b"\0\0", (b"iCCP", b"")),  # IndexError
        b"P5 " + b"9" * 5000 + b" 1 255 \0",  # more digits than Python makes an integer of
        b"P2 1 1 255 " + b"9" * 5000,  # too long as well
        b"P2 1 1 255 " + b"9" * 400,  # an integer that is no float
    ],
)
def test_a_picture_with_impossible_numbers_is_refused(image: bytes, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    (tmp_path / "map.pgm").write_bytes(image)
    with pytest.raises(LogError, match=r"map\.pgm"):
        read_map(tmp_path / "map.yaml")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("map.pgm", '"a\\0b"'),  # no name of a file: ValueError
        ("0.05", "1" + "0" * 400),  # an integer that is no float: OverflowError
        ("0.05", "0x" + "f" * 4000),  # and one without a text
    ],
)
def test_a_map_of_impossible_settings_is_refused(old: str, new: str, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP.replace(old, new))
    with pytest.raises(LogError, match=r"cannot be read|out of bounds"):
        read_map(tmp_path / "map.yaml")


@pytest.mark.parametrize("key", ["image", "mode", "negate", "origin"])
@pytest.mark.parametrize("value", [HUGE, DEEP])
def test_a_setting_of_a_map_that_has_no_text_is_refused(
    key: str, value: str, tmp_path: Path
) -> None:
    lines = [line for line in MAP.splitlines() if not line.startswith(key)]
    (tmp_path / "map.yaml").write_text("\n".join([*lines, f"{key}: {value}"]))
    with pytest.raises(LogError, match=r"map\.yaml"):
        read_map(tmp_path / "map.yaml")


def test_a_name_that_is_too_long_is_that_of_no_folder() -> None:
    with pytest.raises(LogError, match="no such folder"):  # OSError in Path.is_dir
        read_log("a" * 300)


def test_every_target_begins_with_inputs() -> None:
    """The fuzzer ends at once where the folder of a target is missing."""
    listed = (ROOT / "fuzz/CMakeLists.txt").read_text(encoding="utf-8")
    targets = listed.split("ITEMS", 1)[1].split(")", 1)[0].split()
    assert "pose_ekf" in targets
    assert {t for t in targets if not any((ROOT / "fuzz/corpus" / t).glob("*"))} == set()
