# SPDX-License-Identifier: Apache-2.0
"""Recordings of ranges in space as log folders: the figures of their notes."""

from __future__ import annotations

import csv
import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse.io.log_folder import read_log
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError
from papers.datasets import convert
from papers.datasets.source import heading_of
from support_recordings import converted, robust_sigma, rows_in
from support_runs import recording

Logs = dict[str, Log]


@pytest.fixture(scope="module")
def drone(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    return converted("rcv_uwb_drone", tmp_path_factory.mktemp("converted"))


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    return converted("starloc", tmp_path_factory.mktemp("converted"))


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    return converted("hanyang_outdoor", tmp_path_factory.mktemp("converted"))


@pytest.fixture(scope="module")
def head(tmp_path_factory: pytest.TempPathFactory) -> Log:
    (log,) = converted("inrol_uwb_imu", tmp_path_factory.mktemp("converted")).values()
    return log


def packed(path: Path, text: str) -> None:
    path.write_bytes(gzip.compress(text.encode()))


def published(folder: str, file: str) -> list[dict[str, str]]:
    with gzip.open(recording(folder) / file, "rt", newline="") as lines:
        return list(csv.DictReader(lines))


def tags_in_world(log: Log) -> FloatArray:
    """Return where the tag of every range was, from the truth at its stamp, shape (n, 3)."""
    truth, ranges = log["truth"], log["ranges"]
    places = {"z_m": np.zeros(len(truth["x_m"])), **truth}
    at = [np.interp(ranges["stamp_ns"], truth["stamp_ns"], places[f"{axis}_m"]) for axis in "xyz"]
    turned = np.unwrap(truth["heading_rad"])
    heading = np.interp(ranges["stamp_ns"], truth["stamp_ns"], turned)
    forward, left, up = np.array([log.tags[tag] for tag in ranges["tag"].tolist()]).T
    c, s = np.cos(heading), np.sin(heading)
    return np.column_stack(
        [at[0] + c * forward - s * left, at[1] + s * forward + c * left, at[2] + up]
    )


def range_errors(log: Log) -> dict[str, FloatArray]:
    """Return range minus distance in space, by anchor, in metres."""
    ranges, anchors, tags = log["ranges"], log["anchors"], tags_in_world(log)
    places = np.column_stack([anchors[f"{axis}_m"] for axis in "xyz"])
    found = {}
    for name, place in zip(anchors["anchor"].tolist(), places, strict=True):
        rows = ranges["anchor"] == name
        found[name] = ranges["range_m"][rows] - np.linalg.norm(tags[rows] - place, axis=1)
    return found


def test_the_forward_axis_of_a_rotation_is_its_heading_in_the_plane() -> None:
    yaw, pitch = 2.5, 0.6  # first up or down, then around
    half = np.array([yaw, pitch]) / 2.0
    (cz, cy), (sz, sy) = np.cos(half), np.sin(half)
    found = heading_of(*(np.array([v]) for v in (cz * cy, -sz * sy, cz * sy, sz * cy)))
    assert found == pytest.approx([yaw])


# Drone ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("run", "ranges", "negative", "seconds", "medians", "sigmas", "low", "high"),
    [
        ("seq1", 3366, 27, 170.0, [0.279, 0.259, 0.249, 0.285], [0.127, 0.134, 0.131, 0.115],
         [-1.5, -1.6, 0.1], [1.7, 1.5, 2.1]),
        ("seq3", 3841, 12, 225.1, [0.242, 0.216, 0.189, 0.252], [0.102, 0.092, 0.097, 0.074],
         [-1.1, -1.1, 0.1], [1.1, 1.1, 1.0]),
        ("seq5", 5630, 1, 329.6, [0.196, 0.216, 0.241, 0.243], [0.065, 0.068, 0.063, 0.070],
         [-2.9, -0.2, 0.1], [1.9, 0.2, 1.4]),
    ],
)  # fmt: skip
def test_rcv_uwb_drone_has_the_rows_and_figures_of_its_notes(
    drone: Logs, run: str, ranges: int, negative: int, seconds: float, medians: list[float],
    sigmas: list[float], low: list[float], high: list[float],
) -> None:  # fmt: skip
    log = drone[run]
    truth = log["truth"]
    assert rows_in(log)["ranges"] == ranges - negative
    assert float(np.ptp(truth["stamp_ns"])) / NANOSECONDS == pytest.approx(seconds, abs=0.1)
    flown = np.column_stack([truth[f"{axis}_m"] for axis in "xyz"])
    assert flown.min(axis=0) == pytest.approx(low, abs=0.06)
    assert flown.max(axis=0) == pytest.approx(high, abs=0.06)
    errors = range_errors(log)
    # The notes count negative ranges, too, of which anchor 4 of seq1 has 15.
    assert [np.median(e) for e in errors.values()] == pytest.approx(medians, abs=0.004)
    assert [robust_sigma(e) for e in errors.values()] == pytest.approx(sigmas, abs=0.004)
    assert 0.3 < max(np.abs(e).max() for e in errors.values()) < 1.73


@pytest.mark.parametrize("run", ["seq1", "seq3", "seq5"])
def test_rcv_uwb_drone_leaves_out_what_no_range_can_be_and_nothing_else(
    drone: Logs, run: str
) -> None:
    rows = [r for r in published("rcv-uwb-drone", f"{run}_ranges.csv.gz") if r["range"][0] != "-"]
    table = drone[run]["ranges"]
    assert table["range_m"].tolist() == [float(row["range"]) for row in rows]
    assert table["anchor"].tolist() == [row["anchor"] for row in rows]
    assert table["stamp_ns"].tolist() == [round(float(row["t"]) * 1e9) for row in rows]
    places = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    assert np.abs(tags_in_world(drone[run]) - places).max() < 0.02


# Rig ------------------------------------------------------------------------------------------

FAST = ["4", "5", "6", "7", "9", "10", "11", "12"]


@pytest.mark.parametrize(
    ("run", "anchors", "medians", "sigmas", "largest"),
    [
        ("loop-2d-fast_s1", FAST, [0.259, 0.147, 0.157, 0.358, 0.207, 0.154, 0.220, 0.266],
         [0.084, 0.049, 0.094, 0.241, 0.094, 0.102, 0.077, 0.110], 2.22),
        ("loop-2d_s5", ["4", "9", "11", "12"], [-0.114, -0.092, -0.074, -0.098],
         [0.031, 0.041, 0.052, 0.043], 4.88),
    ],
)  # fmt: skip
def test_starloc_has_the_figures_of_its_notes(
    rig: Logs, run: str, anchors: list[str], medians: list[float], sigmas: list[float],
    largest: float,
) -> None:  # fmt: skip
    errors = range_errors(rig[run])
    assert list(errors) == anchors
    # A body that does not tilt moves tags by some centimetres; see the converter.
    found = {
        "median": [np.median(e) for e in errors.values()],
        "sigma": [robust_sigma(e) for e in errors.values()],
    }
    assert found["median"] == pytest.approx(medians, abs=0.017)
    assert found["sigma"] == pytest.approx(sigmas, abs=0.005)
    assert max(np.abs(e).max() for e in errors.values()) == pytest.approx(largest, abs=0.02)


def test_starloc_has_calibrated_ranges_beside_those_measured(rig: Logs) -> None:
    assert set(rig) == {"loop-2d-fast_s1", "loop-2d-fast_s1_calibrated", "loop-2d_s5"}
    measured, log = rig["loop-2d-fast_s1"], rig["loop-2d-fast_s1_calibrated"]
    assert rows_in(measured) == rows_in(log) == {"ranges": 7602, "truth": 7602, "anchors": 8}
    assert rows_in(rig["loop-2d_s5"]) == {"ranges": 2680, "truth": 1853, "anchors": 4}
    errors = np.concatenate(list(range_errors(log).values()))
    assert [np.median(errors), robust_sigma(errors), errors.std()] == pytest.approx(
        [0.088, 0.086, 0.234], abs=0.004
    )
    assert "sigma_m" not in measured["ranges"]
    first = published("starloc", "loop-2d-fast_s1_uwb.csv.gz")[0]
    for table, name in ((measured["ranges"], "range"), (log["ranges"], "range_calib")):
        assert table["range_m"][0] == float(first[name])
    assert log["ranges"]["sigma_m"][0] == float(first["std"])


@pytest.mark.parametrize(
    ("run", "file", "arms"),
    [
        ("loop-2d-fast_s1", "loop-2d-fast_s1_uwb.csv.gz",
         {"1": (-0.085, -0.207, 0.069), "2": (-0.085, 0.0, 0.069)}),
        ("loop-2d_s5", "loop-2d_s5_uwb.csv.gz", {"1": (-0.186, -0.113, 0.098)}),
    ],
)  # fmt: skip
def test_starloc_tags_are_where_their_arms_are_on_a_tilted_rig(
    rig: Logs, run: str, file: str, arms: dict[str, tuple[float, float, float]]
) -> None:
    log, rows = rig[run], published("starloc", file)
    true = np.array([[float(row[f"tag_pos_{axis}"]) for axis in "xyz"] for row in rows])
    off = np.linalg.norm(tags_in_world(log) - true, axis=1)
    assert np.median(off) < 0.01
    assert off.max() < 0.055
    for tag, arm in arms.items():  # of the same length, turned by the tilt
        assert np.linalg.norm(log.tags[tag]) == pytest.approx(np.linalg.norm(arm), abs=0.006)
    level = Log(tables=log.tables, tags=arms)
    assert np.median(np.linalg.norm(tags_in_world(level) - true, axis=1)) > 0.028


# Yard -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("run", "ranges", "seconds", "medians", "sigmas", "largest"),
    [
        ("los_a1", 8405, 235.1, [0.069, 0.076, 0.043, 0.033], [0.163, 0.178, 0.173, 0.157],
         17.42),
        ("nlos_a1", 9447, 314.4, [0.160, 0.093, 0.106, 0.110], [0.140, 0.139, 0.145, 0.146],
         19.33),
        ("los_b3", 6645, 185.0, [0.018, -0.035, -0.032, -0.025], [0.211, 0.248, 0.201, 0.212],
         15.85),
        ("nlos_b3", 6297, 174.6, [0.038, -0.038, -0.037, -0.024], [0.276, 0.257, 0.271, 0.258],
         9.81),
    ],
)  # fmt: skip
def test_hanyang_outdoor_has_the_rows_and_figures_of_its_notes(
    yard: Logs, run: str, ranges: int, seconds: float, medians: list[float], sigmas: list[float],
    largest: float,
) -> None:  # fmt: skip
    log = yard[run]
    assert rows_in(log)["ranges"] == ranges
    stamps = log["truth"]["stamp_ns"]
    assert float(np.ptp(stamps)) / NANOSECONDS == pytest.approx(seconds, abs=0.1)
    errors = range_errors(log)
    assert list(errors) == ["12", "3", "5", "9"]
    assert [np.median(e) for e in errors.values()] == pytest.approx(medians, abs=0.003)
    assert [robust_sigma(e) for e in errors.values()] == pytest.approx(sigmas, abs=0.003)
    assert max(np.abs(e).max() for e in errors.values()) == pytest.approx(largest, abs=0.01)


def test_hanyang_outdoor_ranges_fit_where_the_truth_was_a_fifth_of_a_second_before(
    yard: Logs,
) -> None:
    for log in yard.values():
        sigmas = []
        for late_ms in (0, 100, 200, 300, 400):
            stamps = log["truth"]["stamp_ns"] + late_ms * 1_000_000
            truth = {**log["truth"], "stamp_ns": stamps}
            shifted = replace(log, tables={**log.tables, "truth": truth})
            sigmas.append(robust_sigma(np.concatenate(list(range_errors(shifted).values()))))
        assert np.argmin(sigmas) == 2
        assert 0.08 < sigmas[2] < 0.13 < sigmas[0]


def test_hanyang_outdoor_heads_along_its_course(yard: Logs) -> None:
    truth = yard["los_a1"]["truth"]
    steps = np.diff(truth["x_m"]) + 1j * np.diff(truth["y_m"])
    driving = np.abs(steps) > 0.05
    off = np.angle(steps[driving] * np.exp(-1j * truth["heading_rad"][1:][driving]))
    assert np.median(np.abs(off)) < 0.1


YARD = "t,anchor,ax,ay,az,range,rssi,rssi_fp\n"


def in_a_yard(source: Path, ranges: str) -> Path:
    """Write a drive as the publishers do, a range from the west and one from the east."""
    source.mkdir()
    packed(source / "day_ranges.csv.gz", YARD + ranges)
    (source / "day_groundtruth.csv").write_text(
        "t,x,y,z_rel,heading_deg\n0.0000,3.0,0.0,0.0,-532.66\n0.5000,3.5,0.0,0.1,90\n"
    )
    return source


def test_a_yard_by_hand_becomes_its_log(tmp_path: Path) -> None:
    source = in_a_yard(
        tmp_path / "source",
        "-0.1853,9,0.0,4.0,1.0,5.02,-79.5,-81.0\n0.2500,3,7.0,0.0,1.5,3.9,-60,-61\n",
    )
    (folder,) = convert("hanyang_outdoor", source, tmp_path / "out")
    log = read_log(folder)
    assert folder.name == "day"
    assert log["ranges"]["stamp_ns"].tolist() == [-185_300_000, 250_000_000]
    assert log["ranges"]["range_m"].tolist() == [5.02, 3.9]
    assert log["anchors"]["anchor"].tolist() == ["3", "9"]
    assert np.column_stack([log["anchors"][f"{axis}_m"] for axis in "xyz"]).tolist() == [
        [7.0, 0.0, 1.5],
        [0.0, 4.0, 1.0],
    ]
    assert log["truth"]["heading_rad"] == pytest.approx([np.radians(187.34 - 360), np.pi / 2])
    assert range_errors(log)["9"] == pytest.approx([0.02])


def test_an_anchor_that_moves_is_refused_by_line(tmp_path: Path) -> None:
    moves = "0.1,9,0,4,1,5,-79,-81\n0.2,3,7,0,1,4,-60,-61\n0.3,9,0,4,1.1,5,-79,-81\n"
    with pytest.raises(LogError, match=r"day_ranges.csv.gz, line 4: anchor 9 is not where"):
        convert("hanyang_outdoor", in_a_yard(tmp_path / "source", moves), tmp_path / "out")
    assert not (tmp_path / "out").exists()


# Head -----------------------------------------------------------------------------------------


def test_inrol_uwb_imu_has_the_rows_and_figures_of_its_notes(head: Log) -> None:
    assert rows_in(head) == {"ranges": 32422, "imu": 19139, "truth": 22496, "anchors": 8}
    errors = range_errors(head)
    assert [np.median(e) for e in errors.values()] == pytest.approx(
        [-0.053, 0.059, -0.027, 0.080, -0.005, -0.011, -0.017, -0.046], abs=0.002
    )
    assert [robust_sigma(e) for e in errors.values()] == pytest.approx(
        [0.107, 0.112, 0.112, 0.119, 0.067, 0.069, 0.079, 0.071], abs=0.002
    )
    together = np.concatenate(list(errors.values()))
    assert [together.std(), np.abs(together).max()] == pytest.approx([0.135, 3.11], abs=0.004)


def test_the_sensor_of_the_head_measures_gravity_in_its_attitude(head: Log) -> None:
    truth, imu = head["truth"], head["imu"]
    rows = np.searchsorted(truth["stamp_ns"], imu["stamp_ns"]).clip(max=len(truth["stamp_ns"]) - 1)
    w, x, y, z = (truth[name][rows] for name in ("qw", "qx", "qy", "qz"))
    force = np.stack([imu[f"a{axis}_mps2"] for axis in "xyz"])
    up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
    assert np.mean(np.sum(up * force, axis=0)) == pytest.approx(9.81, abs=0.05)
    assert np.linalg.norm(force, axis=0).mean() == pytest.approx(9.84, abs=0.05)


def test_a_head_by_hand_becomes_its_log_in_order_of_time(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    packed(source / "walk_uwb.csv.gz", "index,timestamp,anchor_id,r\n0,0.2,4,2.5\n1,0.1,6,3\n")
    pose = "tx,ty,tz,qx,qy,qz,qw\n"
    packed(
        source / "walk_imu_pose.csv.gz",
        f"timestamp,{pose}0.0,1,0,2,0,0,0,1\n0.3,1,0,2,0,0,0.70710678,0.70710678\n",
    )
    (source / "walk_anchors.csv").write_text(f"anchor,{pose}4,1,0,0,0,0,0,1\n6,-2,0,2.01,0,0,0,1\n")
    (folder,) = convert("inrol-uwb-imu", source, tmp_path / "out")
    log = read_log(folder)
    assert folder.name == "walk"
    assert log["ranges"]["stamp_ns"].tolist() == [100_000_000, 200_000_000]
    assert log["ranges"]["anchor"].tolist() == ["6", "4"]
    assert log["truth"]["heading_rad"] == pytest.approx([0.0, np.pi / 2])
    assert range_errors(log)["4"] == pytest.approx([0.49])  # the tag is 1 cm over the head
    assert range_errors(log)["6"] == pytest.approx([0.0])
