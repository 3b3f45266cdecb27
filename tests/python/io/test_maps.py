# SPDX-License-Identifier: Apache-2.0
"""Maps are read as map_server reads them, and what it could not mean is refused by name."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from locfuse.io.maps import read_map, write_map
from locfuse.types import GridMap, LogError
from support_runs import recording

# Occupied, free, unknown on top; free, free, occupied below.
SHADES = np.array([[0, 254, 205], [255, 254, 89]], np.uint8)
CELLS = [[0, 0, 100], [100, 0, -1]]

SETTINGS = {
    "image": "map.pgm",
    "resolution": "0.05",
    "origin": "[-1.5, 2.0, 0.25]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def pgm(shades: NDArray[np.uint8]) -> bytes:
    height, width = shades.shape[0], shades.shape[1]
    return f"P5\n# by hand\n{width} {height}\n255\n".encode() + shades.tobytes()


def write(folder: Path, picture: bytes = pgm(SHADES), **changes: str | None) -> Path:
    """Write a map with some of its settings replaced, or left out (None)."""
    settings = {**SETTINGS, **changes}
    lines = [f"{key}: {value}\n" for key, value in settings.items() if value is not None]
    (folder / "map.yaml").write_text("".join(lines))
    (folder / "map.pgm").write_bytes(picture)
    return folder / "map.yaml"


def cells(path: Path) -> list[list[int]]:
    return [[int(cell) for cell in row] for row in read_map(path).cells]


def test_the_lowest_row_of_the_picture_is_row_0_and_thresholds_divide_the_cells(
    tmp_path: Path,
) -> None:
    grid = read_map(write(tmp_path))

    assert grid.cells.dtype == np.int8
    assert grid.cells.tolist() == CELLS
    assert (grid.resolution_m, grid.origin) == (0.05, (-1.5, 2.0, 0.25))


def test_a_shade_on_a_threshold_is_unknown(tmp_path: Path) -> None:
    shades = np.array([[51, 50, 204, 205]], np.uint8)  # 0.8, above it, 0.2, below it
    path = write(tmp_path, pgm(shades), occupied_thresh="0.8", free_thresh="0.2")

    assert cells(path) == [[-1, 100, -1, 0]]


def test_the_free_threshold_can_be_replaced_where_unexplored_would_count_as_free(
    tmp_path: Path,
) -> None:
    path = write(tmp_path, free_thresh="0.25")

    assert cells(path) == [[0, 0, 100], [100, 0, 0]]
    assert read_map(path, free_thresh=0.196).cells.tolist() == CELLS
    with pytest.raises(LogError, match=r"free_thresh and occupied_thresh are 0\.7 and 0\.65"):
        read_map(path, free_thresh=0.7)


@pytest.mark.parametrize("negate", ["1", "true"])
def test_negate_swaps_black_and_white(tmp_path: Path, negate: str) -> None:
    assert cells(write(tmp_path, pgm(255 - SHADES), negate=negate)) == CELLS


def test_scale_gives_no_grades_between_free_and_occupied(tmp_path: Path) -> None:
    assert cells(write(tmp_path, mode="scale")) == CELLS


def test_raw_pixels_are_percent_and_above_100_unknown(tmp_path: Path) -> None:
    raw = np.array([[0, 19, 20, 65, 66, 100, 101, 255]], np.uint8)

    path = write(tmp_path, pgm(raw), mode="raw")

    assert cells(path) == [[0, 0, -1, -1, 100, 100, -1, -1]]


def test_negated_raw_pixels_count_from_white(tmp_path: Path) -> None:
    raw = np.array([[255, 236, 189, 155, 154]], np.uint8)

    path = write(tmp_path, pgm(raw), mode="raw", negate="1")

    assert cells(path) == [[0, 0, 100, 100, -1]]


@pytest.mark.parametrize(
    "image",
    [
        b"P2 3 2 255\n0 254 205 # top\n255 254 89\n",
        b"P5 3 2 255 " + SHADES.tobytes() + b"trailing",
        b"P5\n3 2\n65535\n" + (SHADES.astype(np.uint16) * 256).astype(">u2").tobytes(),
        b"P2\n#a\n#b\n3 #c\n2\n100\n0 100 80 100 100 34\n",
    ],
    ids=["plain", "trailing bytes", "16 bits", "maximum 100"],
)
def test_every_kind_of_pgm_gives_the_same_cells(tmp_path: Path, image: bytes) -> None:
    assert cells(write(tmp_path, image)) == CELLS


@pytest.mark.parametrize("mode", ["L", "RGB", "P", "LA", "I;16"])
def test_every_kind_of_png_gives_the_same_cells(tmp_path: Path, mode: str) -> None:
    if mode == "I;16":
        picture = Image.fromarray(SHADES.astype(np.uint16) * np.uint16(257))
    else:
        picture = Image.fromarray(SHADES).convert(mode)
    picture.save(tmp_path / "map.png")

    assert cells(write(tmp_path, image="map.png")) == CELLS


def test_transparent_pixels_are_unknown(tmp_path: Path) -> None:
    opaque = np.array([[255, 0, 255], [255, 254, 255]], np.uint8)
    Image.fromarray(np.dstack([SHADES] * 3 + [opaque])).save(tmp_path / "map.png")

    path = write(tmp_path, image="map.png")

    assert cells(path) == [[0, -1, 100], [100, -1, -1]]


def test_a_map_without_occupied_cells_is_a_map(tmp_path: Path) -> None:
    assert cells(write(tmp_path, pgm(np.full((1, 2), 254, np.uint8)))) == [[0, 0]]


def test_keys_of_other_programs_are_left_alone(tmp_path: Path) -> None:
    path = write(tmp_path, elevators="[[1, 2]]", name="floor")
    with path.open("a") as file:
        file.write("mode: trinary\nmodes: [a]\n")  # near a key that is there, so no misspelling
    assert cells(path) == CELLS


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "missing": ({"resolution": None}, "map.yaml: resolution is missing"),
    "misspelt": ({"negate": None, "negated": "0"}, "'negated'; did you mean 'negate'?"),
    "misspelt mode": ({"mod": "raw"}, "unknown key 'mod'; did you mean 'mode'?"),
    "no number": ({"resolution": "five"}, "resolution is 'five', expected a finite number"),
    "yes": ({"free_thresh": "yes"}, "free_thresh is True, expected a finite number"),
    "nan": ({"occupied_thresh": ".nan"}, "occupied_thresh is nan, expected a finite"),
    "negative": ({"resolution": "-0.05"}, "resolution is -0.05, expected 1e-06 to 1e"),
    "zero": ({"resolution": "0"}, "resolution is 0, expected 1e-06 to 1e"),
    "two numbers": ({"origin": "[0, 0]"}, r"origin is \[0, 0\], expected \[x_m, y_m, yaw_rad\]"),
    "infinite": ({"origin": "[0, 0, .inf]"}, "origin is inf, expected a finite number"),
    "thresholds": ({"free_thresh": "0.7"}, "0.7 and 0.65, expected 0 <= free <= occupied <= 1"),
    "percent": ({"occupied_thresh": "65"}, "0.196 and 65, expected 0 <= free"),
    "negate": ({"negate": "2"}, "negate is 2, expected 0 or 1"),
    "mode": ({"mode": "binary"}, "mode is 'binary', expected one of trinary, scale, raw"),
    "no image": ({"image": "other.pgm"}, "other.pgm: no such file"),
    "image": ({"image": "3"}, "image is 3, expected a file name"),
    "twice": ({"resolution": "1\nresolution: 2"}, "line 3: key 'resolution' is given twice"),
    "no yaml": ({"origin": "[0, 0"}, "map.yaml: "),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_named_by_file_and_key(tmp_path: Path, case: str) -> None:
    changes, text = REFUSED[case]
    with pytest.raises(LogError, match=text) as caught:
        read_map(write(tmp_path, **changes))
    assert str(tmp_path) in str(caught.value)


def test_a_yaml_file_that_is_no_mapping_is_refused(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text("- 3\n")
    with pytest.raises(LogError, match=r"expected keys image, resolution"):
        read_map(tmp_path / "map.yaml")
    with pytest.raises(LogError, match="no such file"):
        read_map(tmp_path / "absent.yaml")


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (b"", "neither PGM .* nor PNG"),
        (b"BM6....", "neither PGM .* nor PNG"),
        (b"P5 3 2", "no PGM header"),
        (b"P5 3 2 255 " + bytes(5), "5 pixels, its header says 3 x 2"),
        (b"P2 3 2 255\n1 2 3 4 5", "5 pixels, its header says 3 x 2"),
        (b"P2 3 1 255\n1 -2 3", "'-2' is no pixel"),
        (b"P2 1 1 100\n101", "a pixel of 101, its header says at most 100"),
        (b"P5 0 2 255 ", "0 x 2 pixels"),
        (b"P5 1 1 65536 \0\0", "up to 65536, expected"),
        (b"\x89PNG\r\n\x1a\nnothing", "cannot be read"),
    ],
)
def test_a_damaged_picture_is_named(tmp_path: Path, image: bytes, text: str) -> None:
    with pytest.raises(LogError, match=text) as caught:
        read_map(write(tmp_path, image))
    assert "map.pgm" in str(caught.value)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_picture_that_breaks_off_is_named(tmp_path: Path, share: float) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (64, 64), np.uint8)
    Image.fromarray(noise).save(tmp_path / "whole.png")
    whole = (tmp_path / "whole.png").read_bytes()
    for image in (whole, pgm(noise), b"P2 64 64 255\n" + b"7 " * 4096):
        broken = write(tmp_path, image[: int(share * len(image))])
        with pytest.raises(LogError, match=r"map\.pgm: (cannot be read|.* pixels)"):
            read_map(broken)


@pytest.mark.parametrize("cell", [0, 100, -1])
def test_a_map_of_one_cell_is_written_and_read(tmp_path: Path, cell: int) -> None:
    write_map(GridMap(np.array([[cell]], np.int8), 0.1, (1.0, 2.0, -3.0)), tmp_path / "dot.yaml")
    again = read_map(tmp_path / "dot.yaml")
    assert (again.cells.tolist(), again.origin) == ([[cell]], (1.0, 2.0, -3.0))


def test_a_written_map_reads_back_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    grid = GridMap(
        rng.choice(np.array([-1, 0, 100], np.int8), (37, 23)), 0.1 / 3.0, (-7.1 / 3.0, 1e6, -3.0)
    )

    write_map(grid, tmp_path / "plan.yaml")
    again = read_map(tmp_path / "plan.yaml")

    np.testing.assert_array_equal(again.cells, grid.cells)
    assert (again.resolution_m, again.origin) == (grid.resolution_m, grid.origin)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.pgm", "plan.yaml"]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"cells": np.zeros((0, 3), np.int8)}, r"shape \(0, 3\), expected \(height, width\)"),
        ({"cells": np.zeros((2, 3))}, "array of float64, expected int8"),
        ({"cells": np.full((2, 3), 50, np.int8)}, "holds 50, expected 0, 100 or -1"),
        ({"resolution_m": float("nan")}, "resolution_m is nan"),
        ({"resolution_m": 0.0}, "resolution_m is 0.0, expected 1e-06 to 1e"),
        ({"resolution_m": -0.1}, "resolution_m is -0.1, expected 1e-06 to 1e"),
        ({"origin": (0.0, float("inf"), 0.0)}, "expected three numbers within 1e"),
    ],
)
def test_a_grid_of_other_values_is_refused(change: dict[str, Any], text: str) -> None:
    values: dict[str, Any] = {"cells": np.zeros((2, 3), np.int8), "resolution_m": 0.1}
    with pytest.raises(ValueError, match=text):
        GridMap(**{**values, **change})


@pytest.mark.parametrize(
    ("file", "shape", "occupied", "free"),
    [
        ("ieu-gazebo-uwb-lidar/map.yaml", (384, 384), 842, 7893),
        ("mrpt-uwb-lidar/map.yaml", (650, 700), 3317, 85787),
        ("intel-lab/intel_map.yaml", (816, 856), 12750, 685746),
        ("wean-hall/wean_map.yaml", (800, 800), 19159, 620841),
        ("turtlebot4-mac/mac_1st_floor_final.yaml", (1706, 903), 16871, 1523647),
    ],
)
def test_published_maps_have_the_cells_that_their_pictures_show(
    file: str, shape: tuple[int, int], occupied: int, free: int
) -> None:
    # Counted from the bytes: shades up to 89 are occupied, those from 206 on free. The last three
    # say free_thresh 0.25, by which the shade 205 that map_saver gives the unknown is free as well.
    folder, name = file.split("/")
    grid = read_map(recording(folder) / name)

    assert grid.cells.shape == shape
    assert int((grid.cells == 100).sum()) == occupied
    assert int((grid.cells == 0).sum()) == free


def test_a_png_without_pillow_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    (tmp_path / "map.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "map.yaml").write_text(
        "{image: map.png, resolution: 0.1, origin: [0, 0, 0], negate: 0, "
        "occupied_thresh: 0.65, free_thresh: 0.2}\n"
    )
    with pytest.raises(LogError, match=r"Pillow: pip install 'locfuse\[plots\]'"):
        read_map(tmp_path / "map.yaml")
