# SPDX-License-Identifier: Apache-2.0
"""The bag of an ordinary robot, from drivers alone: two scanners, wheels, a gyro, UWB, a map."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.config.load import parse_config
from locfuse.config.ros import Ros
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, FloatArray, Log
from support_adapter import LATER, later
from support_drivers import write
from support_runs import locfuse, rows_of
from test_front_ends import of_topics

SAFETY = {"rate_hz": 12.5, "beams": 541, "field_of_view_deg": 270.0, "range_max_m": 25.0}
ANCHORS = {"0": (0.5, 0.5, 2.4), "1": (11.5, 0.5, 2.2), "2": (11.5, 8.5, 2.4), "3": (0.5, 8.5, 2)}
TAG = (-0.1, 0.05, 0.9)
ROBOT: dict[str, Any] = {
    "room_m": [12, 9],
    "map": {"generate": "rooms", "seed": 2},
    "path": {"shape": "roam", "speed_mps": 0.6},
    "duration_s": 40.0,
    "lasers": {
        "scanner_front": {**SAFETY, "pose_in_body": [0.3, 0.22, 45]},
        "scanner_rear": {**SAFETY, "pose_in_body": [-0.3, -0.22, -135]},
    },
    "odometry": {"rate_hz": 50, "output": "velocities"},
    "imu": {"rate_hz": 100},
    "anchors": {name: list(at) for name, at in ANCHORS.items()},
    "tags": {"7": list(TAG)},
    "ranges": {"rate_hz": 10, "sigma_m": 0.08, "sigma_relative": 0.0},
    "poses": None,
}
RADIO = "nlink_linktrack_nodeframe2"
DRIVERS = Ros.model_validate(
    {"topics": {"scans": ["front/scan", "rear/scan"], "imu": "imu/data", "odometry": "wheels/odom"}}
)
RECORDED = ("wheels/odom", "imu/data", "front/scan", "rear/scan")


def simulated(seed: int) -> Log:
    return later(of_topics(load_log(parse_config({"simulation": ROBOT, "seed": seed}), None, seed)))


def stamped(fields: Any) -> Any:
    """Return fields with times as rosbags has them."""
    if isinstance(fields, dict):
        if set(fields) == {"ns"}:
            return dict(zip(("sec", "nanosec"), divmod(fields["ns"], NANOSECONDS), strict=True))
        return {key: stamped(value) for key, value in fields.items()}
    return [stamped(one) for one in fields] if isinstance(fields, list) else fields


def record(log: Log, path: Path, ros: str) -> Path:
    """Write what the drivers, a map server and robot_state_publisher publish."""
    mounts = [encode.transform(LATER, "base_link", name, laser["pose_in_body"], 0.3)
              for name, laser in log.lasers.items()]  # fmt: skip
    mounts.append(encode.transform(LATER, "base_link", "imu_link", (0.0, 0.0, 0.0), 0.2))
    known = [encode.transforms(mounts, static=True)]
    known += [one for one in world_of(log, DRIVERS) if one.type == "nav_msgs/OccupancyGrid"]
    messages = [(LATER, one.topic, one.type, stamped(one.fields)) for one in known]
    messages += [(one.arrival_ns, one.publication.topic, one.publication.type,
                  stamped(one.publication.fields))
                 for one in in_order_of_arrival(log, DRIVERS)
                 if one.publication.topic in RECORDED]  # fmt: skip
    ranges = log["ranges"]
    for stamp in np.unique(ranges["stamp_ns"]).tolist():
        nodes = [{"role": 1, "id": int(anchor), "dis": float(measured)}
                 for at, anchor, measured in zip(ranges["stamp_ns"], ranges["anchor"],
                                                 ranges["range_m"], strict=True)
                 if at == stamp]  # fmt: skip
        messages.append((stamp, RADIO, "nlink_parser/LinktrackNodeframe2",
                         {"role": 2, "id": 7, "nodes": nodes}))  # fmt: skip
    return write(path, sorted(messages, key=lambda one: one[0]), ros)


def typed(*words: str) -> str:
    """Return what `locfuse` prints, which must succeed."""
    said = locfuse(*words)
    assert said.status == 0, said.err
    return said.out


def fill_in(world: Path) -> None:
    """Write what a tape measure says into the files that `config init` left."""
    rows = list(csv.reader((world / "anchors.csv").read_text().splitlines()))
    assert rows == [["anchor", "x_m", "y_m", "z_m"], *([name, "", "", ""] for name in ANCHORS)]
    filled = [[name, *map(str, ANCHORS[name])] for name, *_ in rows[1:]]
    (world / "anchors.csv").write_text("\n".join(",".join(row) for row in [rows[0], *filled]))
    settings = yaml.safe_load((world / "log.yaml").read_text())
    assert settings == {"tags": {"7": ["forward", "left", "up"]}}
    (world / "log.yaml").write_text(yaml.safe_dump({"tags": {"7": list(TAG)}}))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("ros", ["ros1", "ros2"])
def test_two_commands_and_two_files_to_fill_in(
    ros: str, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = simulated(seed)
    bag = record(log, tmp_path / ("drive.bag" if ros == "ros1" else "drive"), ros)
    first = typed("config", "init", "--log", bag.name, "--out", "robot.yaml")
    assert "next: fill in robot_world/anchors.csv and robot_world/log.yaml" in first
    fill_in(tmp_path / "robot_world")
    said = typed("run", "robot.yaml", "--out", "out")
    for source, count in (("odometry", 2000), ("ranges", 1000), ("scans", 400)):
        fused = re.search(rf"{source} +fused (\d+)", said)
        assert fused, said
        assert int(fused[1]) >= count
    assert "at the end ok" in said
    error = errors(log, tmp_path / "out" / "estimate.csv")
    print(f"{ros}, seed {seed}: RMSE {100.0 * np.sqrt(np.mean(error**2)):.1f} cm, "
          f"largest {100.0 * np.max(error):.1f} cm of {len(error)}")  # fmt: skip
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.max(error) < 0.2


def errors(log: Log, estimate: Path) -> FloatArray:
    """Return how far an estimate, of at least 39 s, is off [m]."""
    rows = rows_of(estimate)
    stamp = np.array([float(row["stamp_s"]) for row in rows])
    assert stamp[-1] - stamp[0] > 39.0
    truth = log["truth"]
    seconds = truth["stamp_ns"] / NANOSECONDS
    off = [np.array([float(row[key]) for row in rows]) - np.interp(stamp, seconds, truth[key])
           for key in ("x_m", "y_m")]  # fmt: skip
    return np.asarray(np.hypot(*off))
