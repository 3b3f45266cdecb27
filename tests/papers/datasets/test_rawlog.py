# SPDX-License-Identifier: Apache-2.0
"""The rawlog reader against an independent decoding of the same run, and against broken files."""

from __future__ import annotations

import csv
import gzip
import io
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest

from locfuse.types import Log, LogError
from papers.datasets.rawlog import read_gridmap, read_mrpt_office

DATASETS = Path("/usr/share/mrpt/datasets")
NAME = "uwb_ro-localization_demo"
DECODED = Path(__file__).resolve().parents[3] / ".." / "shared" / "data" / "mrpt-uwb-lidar"
FRAMES = 200  # the independent decoding holds the first of 343


@pytest.fixture(scope="module")
def office() -> Log:
    if not (DATASETS / f"{NAME}.rawlog").exists():
        pytest.skip(f"the Debian package mrpt-common is not installed: no {NAME}.rawlog")
    return read_mrpt_office(DATASETS)


@pytest.fixture
def decoded() -> Path:
    if not DECODED.exists():
        pytest.skip(f"no independent decoding to compare with: {DECODED} is absent")
    return DECODED


@pytest.fixture
def package(office: Log, tmp_path: Path) -> Path:
    """Return a writable copy of the package's files, to be damaged."""
    (tmp_path / "datasets").mkdir()
    (tmp_path / "config_files" / "ro-localization").mkdir(parents=True)
    for name in (f"datasets/{NAME}.rawlog", f"datasets/{NAME}_GT.txt"):
        shutil.copy(DATASETS.parent / name, tmp_path / name)
    ini = "config_files/ro-localization/UWB_localization_demo.ini"
    shutil.copy(DATASETS.parent / ini, tmp_path / ini)
    return tmp_path


def rows_of(path: Path) -> list[list[str]]:
    data = path.read_bytes()
    text = gzip.decompress(data) if path.suffix == ".gz" else data
    return list(csv.reader(io.StringIO(text.decode())))[1:]


def printed(values: np.ndarray, digits: int) -> list[str]:
    """Text as the decoded files print it: fixed digits, empty for a missing value."""
    return ["" if np.isnan(value) else f"{value:.{digits}f}" for value in values.ravel()]


def check_stamps(stamp_ns: np.ndarray, texts: list[str]) -> None:
    """Compare with stamps printed to 0.1 ms from doubles, which count from 1601 and hold 2 us."""
    printed_ns = np.array([round(float(text) * 1e9) for text in texts])
    assert len(stamp_ns) == len(texts)
    assert np.max(np.abs(stamp_ns - printed_ns)) <= 52_000


def column(rows: list[list[str]], index: int) -> list[str]:
    return [row[index] for row in rows]


def test_odometry_equals_the_independent_decoding_digit_by_digit(
    office: Log, decoded: Path
) -> None:
    rows = rows_of(decoded / "odometry.csv")
    table = {name: values[: FRAMES - 1] for name, values in office["odometry"].items()}
    check_stamps(table["stamp_ns"], column(rows, 1))
    assert printed(table["dx_m"], 6) == column(rows, 2)
    assert printed(table["dy_m"], 6) == column(rows, 3)
    assert printed(table["dheading_rad"], 7) == column(rows, 4)


def test_ranges_equal_the_independent_decoding_digit_by_digit(office: Log, decoded: Path) -> None:
    rows = [row for row in rows_of(decoded / "ranges.csv") if float(row[3]) != 0.0]
    table = {name: values[: len(rows)] for name, values in office["ranges"].items()}
    check_stamps(table["stamp_ns"], column(rows, 1))
    assert table["anchor"].tolist() == column(rows, 2)
    assert printed(table["range_m"], 4) == column(rows, 3)
    assert office["ranges"]["stamp_ns"][len(rows)] >= office["scans"]["stamp_ns"][FRAMES]


def test_scans_equal_the_independent_decoding_digit_by_digit(office: Log, decoded: Path) -> None:
    rows = rows_of(decoded / "scans.csv.gz")
    check_stamps(office["scans"]["stamp_ns"][:FRAMES], column(rows, 1))
    for row, ranges in zip(rows, office["scans"]["ranges_m"][:FRAMES], strict=True):
        assert printed(ranges, 2) == row[2:]


def test_truth_equals_the_independent_decoding_digit_by_digit(office: Log, decoded: Path) -> None:
    rows = rows_of(decoded / "groundtruth.csv")
    table = {name: values[: FRAMES - 1] for name, values in office["truth"].items()}
    check_stamps(table["stamp_ns"], column(rows, 1))
    for index, name in enumerate(("x_m", "y_m", "heading_rad"), start=2):
        assert printed(table[name], 6) == column(rows, index)


def test_anchors_equal_the_independent_decoding_in_the_map_frame(
    office: Log, decoded: Path
) -> None:
    rows = rows_of(decoded / "beacons.csv")
    assert office["anchors"]["anchor"].tolist() == column(rows, 0)
    for index, name in enumerate(("x_m", "y_m", "z_m"), start=1):
        assert printed(office["anchors"][name], 4) == column(rows, index)


def test_gridmap_equals_the_independent_decoding_in_every_cell(office: Log, decoded: Path) -> None:
    image, resolution, origin = read_gridmap(DATASETS / f"{NAME}_map.gridmap.gz")
    magic, size, depth, pixels = (decoded / "map.pgm").read_bytes().split(b"\n", 3)
    assert (magic, size, depth) == (b"P5", f"{image.shape[1]} {image.shape[0]}".encode(), b"255")
    assert image.tobytes() == pixels
    yaml = (decoded / "map.yaml").read_text()
    assert f"resolution: {resolution:.4f}\n" in yaml
    assert f"origin: [{origin[0]:.4f}, {origin[1]:.4f}, {origin[2]:.1f}]\n" in yaml


def test_whole_run_has_the_published_size_and_geometry(office: Log) -> None:
    truth, scans = office["truth"], office["scans"]
    assert scans["ranges_m"].shape == (343, 361)
    assert len(truth["stamp_ns"]) == len(office["odometry"]["stamp_ns"]) == 342
    assert scans["stamp_ns"][-1] / 1e9 == pytest.approx(363.15, abs=0.01)
    length = np.hypot(np.diff(truth["x_m"]), np.diff(truth["y_m"])).sum()
    assert length == pytest.approx(112.2, abs=0.1)
    assert np.all(office["ranges"]["range_m"] > 0.0)
    assert office.tags == {"antenna": (0.16, 0.0, 1.12)}
    assert office.laser is not None
    assert office.laser["pose_in_body"] == [0.095, 0.0, 0.0]
    assert office.laser["angle_min_rad"] == pytest.approx(-np.pi / 2)
    assert office.laser["angle_increment_rad"] == pytest.approx(np.deg2rad(0.5))
    assert office.laser["range_max_m"] == 80.0


def test_reference_and_anchors_share_a_frame(office: Log) -> None:
    """Beacon 2 is clean; a missed shift or a reference row off by one frame breaks this."""
    ranges, truth, anchors = office["ranges"], office["truth"], office["anchors"]
    clean = (ranges["anchor"] == "2") & (ranges["stamp_ns"] > 0)
    row = np.searchsorted(truth["stamp_ns"], ranges["stamp_ns"][clean])
    heading, (forward, _, height) = truth["heading_rad"][row], office.tags["antenna"]
    dx = truth["x_m"][row] + forward * np.cos(heading) - anchors["x_m"][1]
    dy = truth["y_m"][row] + forward * np.sin(heading) - anchors["y_m"][1]
    error = ranges["range_m"][clean] - np.sqrt(dx**2 + dy**2 + (height - anchors["z_m"][1]) ** 2)
    assert np.median(error) == pytest.approx(-0.04, abs=0.02)
    assert np.std(error) < 0.15


@pytest.mark.parametrize("kept", [0, 1, 20, 700, 2440, -1])
def test_a_cut_rawlog_is_an_error_that_names_file_and_byte(package: Path, kept: int) -> None:
    path = package / "datasets" / f"{NAME}.rawlog"
    data = gzip.decompress(path.read_bytes())
    path.write_bytes(data[:kept])
    with pytest.raises(LogError, match=rf"{NAME}\.rawlog: byte \d+: truncated"):
        read_mrpt_office(package / "datasets")


def test_a_cut_gzip_file_is_an_error(package: Path) -> None:
    path = package / "datasets" / f"{NAME}.rawlog"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(LogError, match="cannot be read or unpacked"):
        read_mrpt_office(package / "datasets")


def test_an_unknown_class_inside_a_frame_is_named_with_its_byte(package: Path) -> None:
    path = package / "datasets" / f"{NAME}.rawlog"
    data = gzip.decompress(path.read_bytes())
    start = data.index(b"CObservationBeaconRanges") - 1
    known = b"CObservationBeaconRanges"
    path.write_bytes(data.replace(known, b"CObservationBeaconThings", 1))
    with pytest.raises(LogError, match=f"byte {start}: cannot read CObservationBeaconThings"):
        read_mrpt_office(package / "datasets")


def test_a_reference_of_another_run_is_an_error(package: Path) -> None:
    path = package / "datasets" / f"{NAME}_GT.txt"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(LogError, match=r"_GT\.txt: table of \(341, 4\), expected \(342, 4\)"):
        read_mrpt_office(package / "datasets")


def test_a_missing_beacon_key_is_named(package: Path) -> None:
    path = package / "config_files" / "ro-localization" / "UWB_localization_demo.ini"
    path.write_text(path.read_text().replace("\nbeacon_002_Y", "\nbeacon_002_W"))
    with pytest.raises(LogError, match="key 'beacon_002_Y' is missing"):
        read_mrpt_office(package / "datasets")


def grid_bytes(version: int = 3, bits: int = 8, end: int = 0x88) -> bytes:
    """Return a grid map of 3 x 2 cells as MRPT lays it out."""
    name = b"COccupancyGridMap2D"
    return b"".join(
        [
            bytes([0x80 | len(name)]) + name + bytes([version]),
            struct.pack("<B2I5f", bits, 3, 2, -1.0, 0.5, 2.0, 3.0, 0.5),
            struct.pack("6b", -128, 0, 127, 16, -16, 0),
            struct.pack("<fBffBHf", 0, 0, 0, 0, 0, 0, 0),
            struct.pack("<i4fIfBfIfBifif", *([0] * 16)),
            struct.pack("<I2f", 2, 0.5, 0.5),
            bytes([0, 0, end]),
        ]
    )


@pytest.mark.parametrize("pack", [gzip.compress, bytes])
def test_a_hand_made_grid_is_read_top_row_first(tmp_path: Path, pack: object) -> None:
    path = tmp_path / "small.gridmap"
    path.write_bytes(pack(grid_bytes()))  # type: ignore[operator]
    image, resolution, origin = read_gridmap(path)
    # 255 / (1 + exp(-1)) = 186.4 and 255 / (1 + exp(1)) = 68.6
    assert image.tolist() == [[186, 69, 128], [0, 128, 255]]
    assert (resolution, origin) == (0.5, (-1.0, 2.0, 0.0))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "byte 0: truncated"),
        (b"hello, this is text", "byte 0: no MRPT object starts here"),
        (b"\x80\x03\x88", "byte 0: no MRPT object starts here"),
        (b"\x85\xff\xfe\xfd\xfc\xfb\x00", "byte 0: no MRPT object starts here"),
        (gzip.compress(b"garbage " * 9, mtime=0), "byte 0: no MRPT object starts here"),
        (gzip.compress(grid_bytes(), mtime=0)[:-9], "cannot be read or unpacked"),
        (b"\x1f\x8b" + b"\x00" * 40, "cannot be read or unpacked"),
        (grid_bytes()[:60], "byte 56: truncated: 20 more bytes expected, 4 left"),
        (grid_bytes()[:-1], "truncated: 1 more bytes expected, 0 left"),
        (grid_bytes(version=9), "byte 0: cannot read COccupancyGridMap2D version 9, expected"),
        (grid_bytes(bits=16), "byte 21: grid cells of 16 bits, expected 8"),
        (grid_bytes(end=0), "COccupancyGridMap2D from byte 0 does not end here"),
        (grid_bytes() + b"\x00", "data after the end of the grid map"),
    ],
)
def test_broken_bytes_are_an_error_that_says_where(
    tmp_path: Path, data: bytes, message: str
) -> None:
    path = tmp_path / "broken.gridmap"
    path.write_bytes(data)
    with pytest.raises(LogError, match=f"broken.gridmap: .*{message}|gridmap: {message}"):
        read_gridmap(path)


@pytest.mark.parametrize(
    "data", [b"", b"not a log", gzip.compress(b"garbage", mtime=0), grid_bytes()]
)
def test_a_file_that_is_no_rawlog_is_an_error(tmp_path: Path, data: bytes) -> None:
    (tmp_path / f"{NAME}.rawlog").write_bytes(data)
    with pytest.raises(LogError, match=rf"{NAME}\.rawlog: byte 0: "):
        read_mrpt_office(tmp_path)


def test_an_absent_file_is_an_error_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=rf"{NAME}\.rawlog: cannot be read"):
        read_mrpt_office(tmp_path)
