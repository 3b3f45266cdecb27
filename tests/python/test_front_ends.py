# SPDX-License-Identifier: Apache-2.0
"""Every front end is reached from every door, on the same path: the same poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import yaml

from locfuse.config.load import parse_config
from locfuse.config.schema import USABLE, Cylinders, Mcl, RunConfig
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.io.rosbag.decode import decimal, decimals
from locfuse.run.run import load_log, run
from locfuse.studio.document import checked
from locfuse.studio.estimators import choices, variant
from locfuse.types import Log
from support_adapter import Robot, assert_poses_are, later
from support_live import assert_same
from support_runs import ROOT

PROPOSALS = get_args(Mcl.model_fields["proposal"].annotation)
METHODS = get_args(Cylinders.model_fields["method"].annotation)
VELOCITIES: Mapping[str, Any] = {"output": "velocities"}
FLOOR: Mapping[str, Any] = {
    "path": {"shape": "roam", "speed_mps": 0.5},
    "map": {"generate": "rooms", "seed": 2},
    "laser": {"range_max_m": 8.0},
    "odometry": VELOCITIES,
    "duration_s": 10.0,
    "anchors": {},
    "poses": None,
    "ranges": None,
}
TWO_LASERS: Mapping[str, Any] = {
    **FLOOR,
    "laser": None,
    "lasers": {
        "front": {"pose_in_body": [0.2, 0, 0], "field_of_view_deg": 180, "beams": 181,
                  "range_max_m": 8.0},
        "rear": {"pose_in_body": [-0.2, 0.1, 175], "field_of_view_deg": 190, "beams": 120,
                 "range_max_m": 6.0, "mounting": "upside_down"},
    },
}  # fmt: skip
ANCHORS = {"A": [0, 0, 2], "B": [9, 0, 2], "C": [0, 8, 2], "D": [9, 8, 2]}
PARTICLES: Mapping[str, Mapping[str, Any]] = {
    **{f"proposal {name}": {"mcl": {"proposal": name, "max_particles": 1000}}
       for name in PROPOSALS},
    "beams": {"mcl": {"likelihood": "beams", "max_particles": 1000}},
    "poses": {"mcl": {"poses_hz": 2.0, "max_particles": 1000}},
    "scan_odometry": {"scan_odometry": {}},
    "two lasers": {"mcl": {"max_particles": 1000}, "simulation": TWO_LASERS},
    "two lasers, scan_odometry": {"scan_odometry": {}, "simulation": TWO_LASERS},
    "watched poses, scans": {"mcl": {"max_particles": 1000}, "watch_poses": True,
                             "simulation": {**FLOOR, "poses": {"rate_hz": 2}}},
    "switch": {"mcl": {"switch": {}, "max_particles": 1000},
               "simulation": {**FLOOR, "anchors": ANCHORS, "ranges": {"rate_hz": 5}}},
}  # fmt: skip
TAGS: Mapping[str, Any] = {
    "path": {"shape": "eight", "speed_mps": 0.31, "radius_m": 1.4},
    "odometry": {**VELOCITIES, "rate_hz": 7.5},
    "tags": {"front": [0.5, 0, 1], "left": [-0.4, 0.3, 1], "right": [-0.4, -0.3, 1]},
    "ranges": {"rate_hz": 1},
    "poses": None,
    "positions": {"rate_hz": 1, "sigma_xy_m": 0.12, "tags": ["front", "left", "right"]},
    "duration_s": 20.0,
}
WITHOUT_SCANS: Mapping[str, Mapping[str, Any]] = {
    "rigid": {"estimator": {"kind": "tag_triangle", "tag_triangle": {"shape": "rigid"}}},
    "watched poses": {"watch_poses": True, "simulation": {**TAGS, "poses": {"rate_hz": 2}}},
    "tag_conditioner": {"tag_conditioner": {}},
    "tag_conditioner, triangle": {"tag_conditioner": {}, "estimator": {"kind": "tag_triangle"}},
}
OUTSIDE: Mapping[str, Any] = {
    "room_m": [40, 40],
    "path": {"shape": "circle", "speed_mps": 1.2, "radius_m": 12, "center_m": [20, 20]},
    "odometry": VELOCITIES,
    "ranges": None,
    "poses": None,
    "positions": {"rate_hz": 1, "sigma_xy_m": 0.5},
    "duration_s": 20.0,
}
WITHOUT_SCANS = {
    **WITHOUT_SCANS,
    "compass": {"simulation": {**OUTSIDE, "headings": {"offset_deg": 100}}},
    "course": {"simulation": {**OUTSIDE, "headings": {"kind": "course", "rate_hz": 5}}},
}
HEADINGS = "srls_headings"
SCANS = [*PARTICLES, *(f"cylinders {name}" for name in METHODS)]
CASES = [*SCANS, *WITHOUT_SCANS, HEADINGS]


def document(case: str) -> dict[str, Any]:
    """Return what a user writes for a front end."""
    if case in WITHOUT_SCANS:
        return {"simulation": dict(TAGS), "seed": 1, **WITHOUT_SCANS[case]}
    if case == HEADINGS:
        world = {**FLOOR, "anchors": ANCHORS, "ranges": {"rate_hz": 5}}
        return {"simulation": world, "seed": 1, "start": HEADINGS}
    if not case.startswith("cylinders"):
        return {"simulation": dict(FLOOR), "seed": 1, **PARTICLES[case]}
    data = yaml.safe_load((ROOT / "examples/configs/gadau_discs.yaml").read_text())
    data["simulation"] = {**data["simulation"], "duration_s": 10.0, "odometry": dict(VELOCITIES)}
    return {**data, "cylinders": {**data["cylinders"], "method": case.split()[1]}}


@cache
def driven(case: str) -> tuple[RunConfig, Log]:
    """Return a run, with a given start where that is not searched, and its log.

    Its scans are of single precision, as those of topics are.

    Velocities pass a topic as they are; of the increments of poses the last bits change.
    """
    made = parse_config(document(case))
    log = load_log(made, None, made.seed)
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    start = HEADINGS if case == HEADINGS else (x, y, float(np.degrees(heading)))
    ros = made.ros.model_copy(update={"estimate_at": "fused", "odometry_from": "twist"})
    given = {"start": start, "simulation": None, "ros": ros}
    if case in WITHOUT_SCANS:
        return made.model_copy(update=given), log
    return made.model_copy(update=given), of_topics(log)


def of_topics(log: Log) -> Log:
    """Return a log with scans as they come out of a topic."""
    scans = log["scans"]
    reach = np.array([log.scan_geometry(row)[0]["range_max_m"]
                      for row in range(len(scans["stamp_ns"]))])  # fmt: skip
    ranges = decimals(scans["ranges_m"].astype(np.float32).ravel()).reshape(
        -1, scans["ranges_m"].shape[1]
    )
    ranges[ranges > 0.99 * reach[:, None]] = np.nan  # which of a topic are no returns
    angles = {key: np.array([decimal(value) for value in scans[key]])
              for key in ("angle_min_rad", "angle_increment_rad") if key in scans}  # fmt: skip
    tables = {**log.tables, "scans": {**scans, **angles, "ranges_m": ranges}}
    lasers = {name: single(laser) for name, laser in log.lasers.items()}
    return replace(log, tables=tables, laser=log.laser and single(log.laser), lasers=lasers)


def single(laser: Mapping[str, Any]) -> dict[str, Any]:
    """Return a geometry in single precision, but for the mount."""
    return {key: value if key == "pose_in_body" else decimal(value)
            for key, value in laser.items()}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_run_and_live(case: str) -> None:
    config, log = driven(case)
    assert run(config, log).metrics["position_rmse_m"] < 0.3
    assert_same(config, log, least=0.4)


@pytest.mark.parametrize("case", [case for case in CASES if case != HEADINGS])
def test_late_scans_give_the_bits_of_the_sorted_log(case: str) -> None:
    """One in five by half a second, more than a search waits.

    Poses that particles hand on to a filter stay as they were handed on, in a run as live.
    """
    config, log = driven(case)
    rng = np.random.default_rng(1)
    in_time, late = dict(log.tables), dict(log.tables)
    for source, table in log.tables.items():
        if source not in (*USABLE, "scans"):
            continue
        stamp = table["stamp_ns"]
        may_be_late = source in ("scans", "positions")
        is_late = (rng.random(len(stamp)) < 0.2) & may_be_late
        in_time[source] = {**table, "arrival_ns": stamp}
        late[source] = {**table, "arrival_ns": stamp + np.where(is_late, 500_000_000, 0)}
    assert_same(config, replace(log, tables=late), least=0.3)
    if case == "poses":
        return
    expected = run(config, replace(log, tables=in_time)).estimate
    found = run(config, replace(log, tables=late)).estimate
    assert found.position[-1].tolist() == expected.position[-1].tolist()
    assert found.heading is not None
    assert expected.heading is not None
    assert found.heading[-1] == expected.heading[-1]


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("case", CASES)
def test_nodes(case: str, ros: str) -> None:
    config, log = driven(case)
    log = later(log)
    robot = Robot(config, log, ros)
    robot.learn()
    robot.drive()
    assert_poses_are(robot, run(config, log).estimate, least=0.4)


@pytest.mark.parametrize("bag", ["drive.bag", "drive.mcap"])
@pytest.mark.parametrize("case", CASES)
def test_bags(case: str, bag: str, tmp_path: Path) -> None:
    config, log = driven(case)
    result = run(config, log)
    write_bag(log, tmp_path / bag, config.ros)
    again = run(config, read_bag(tmp_path / bag, config.ros)).estimate
    assert again.position[-1].tolist() == pytest.approx(
        result.estimate.position[-1].tolist(), abs=1e-6
    )


@pytest.mark.parametrize("case", SCANS)
def test_studio(case: str) -> None:
    """A document with the front end runs, and a choice that has it keeps its settings."""
    config, _ = driven(case)
    data = document(case)
    opened = checked({**data, "start": list(config.start)})
    assert run(opened).metrics["position_rmse_m"] < 0.3
    variants = [checked(variant(choice, data, opened)) for choice in choices(data, opened)]
    kept = [one for one in variants if setting(case, one) is not None]
    assert kept
    assert all(setting(case, one) == setting(case, opened) for one in kept)


def setting(case: str, config: RunConfig) -> object:
    """Return what a configuration says of the front end of a case; None without it."""
    if case.startswith("cylinders"):
        return config.cylinders and config.cylinders.method
    if case.endswith("scan_odometry"):
        return config.scan_odometry and "scan_odometry"
    mcl = config.mcl
    if mcl is None or (case == "switch" and mcl.switch is None):
        return None  # a choice of the studio without the switch
    return mcl.proposal, mcl.likelihood, mcl.max_particles
