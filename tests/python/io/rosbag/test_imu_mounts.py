# SPDX-License-Identifier: Apache-2.0
"""Samples of an IMU are turned into the body's axes where transforms say how it is mounted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.decode import ImuRow
from locfuse.io.rosbag.encode import Publication
from locfuse.ros.adapter import Adapter
from support_bags import MS, T0, drive, world, write_messages
from support_ros import message

RATE, FORCE = (0.1, 0.2, 0.3), (1.0, 2.0, -9.5)
IN_BODY = (0.2, 0.1, -0.3, 2.0, 1.0, 9.5)  # of a sensor upside down that points to the left


def mounted(frame: str = "imu_link") -> Publication:
    """Return a transform by roll 180 degrees, then yaw 90."""
    given = encode.transform(T0, "base_link", frame, (0.1, 0.0, 0.0), 0.2)
    half = np.sqrt(0.5)
    given["transform"]["rotation"] = {"x": half, "y": half, "z": 0.0, "w": 0.0}
    return encode.transforms([given], static=True)


def sample(stamp_ns: int, frame: str = "imu_link") -> Publication:
    return encode.imu("imu", ImuRow(stamp_ns, RATE, FORCE), frame)


def vectors(row: Any) -> list[float]:
    return [float(np.ravel(row[f"{kind}{axis}_{unit}"])[-1])
            for kind, unit in (("w", "radps"), ("a", "mps2")) for axis in "xyz"]  # fmt: skip


@pytest.mark.parametrize("first", [True, False])
def test_a_bag_says_how_its_sensor_is_mounted(first: bool, tmp_path: Path) -> None:
    """Wherever in the bag it says so."""
    messages = drive()
    messages += [(T0 + k * 10 * MS, sample(T0 + k * 10 * MS)) for k in range(100)]
    messages.append((T0 - MS if first else T0 + 500 * MS, mounted()))
    bag = write_messages(tmp_path / "drive.mcap", sorted(messages, key=lambda one: one[0]))
    imu = read_bag(bag, world=world())["imu"]
    for row in range(100):
        assert vectors({key: column[row] for key, column in imu.items()}) == pytest.approx(IN_BODY)


def test_a_sensor_that_nothing_places_keeps_its_axes(tmp_path: Path) -> None:
    messages = [*drive(), *[(T0 + k * MS, sample(T0 + k * MS, "base_link")) for k in range(9)]]
    bag = write_messages(tmp_path / "drive.bag", sorted(messages, key=lambda one: one[0]))
    assert vectors(read_bag(bag, world=world())["imu"]) == [*RATE, *FORCE]


def test_a_node_waits_for_the_transform_of_its_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    config = parse_config({"estimator": {"kind": "air", "air": {"motion": "inertial"}},
                           "start": [0, 0, 0]})  # fmt: skip
    adapter = Adapter(config)
    fed: list[list[float]] = []
    monkeypatch.setattr(adapter, "_feed", lambda _, row: fed.append(vectors(row)))
    for k in range(3):
        adapter.on("imu", "imu", message(sample(T0 + k * 10 * MS)), T0)
    assert fed == []
    adapter.on("transforms", "tf_static", message(mounted()), T0)
    adapter.on("imu", "imu", message(sample(T0 + 30 * MS)), T0)
    assert fed[-1] == pytest.approx(IN_BODY)
    other = Adapter(config)
    monkeypatch.setattr(other, "_feed", lambda _, row: fed.append(vectors(row)))
    for k in (0, 60):  # no transform comes: then its axes are the body's
        other.on("imu", "imu", message(sample(T0 + k * 10 * MS)), T0 + k * 10 * MS)
    assert len(fed) == 2
    assert fed[-1] == [*RATE, *FORCE]
