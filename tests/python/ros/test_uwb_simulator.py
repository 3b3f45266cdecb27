# SPDX-License-Identifier: Apache-2.0
"""A UWB system that is simulated: ranges of true poses, when they are due, as which message."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag import decode, encode
from locfuse.io.rosbag.decode import MessageError
from locfuse.ros.parameters import values_of
from locfuse.ros.uwb_simulator import PARAMETERS, Epochs, UwbSimulator, UwbSystem, true_pose
from locfuse.run.run import load_log
from locfuse.types import ConfigError
from support_ros import message

ANCHORS = {"A": (3.0, 4.0, 0.0), "B": (30.0, 40.0, 0.0)}
TAGS = {"tag": (0.0, 0.0, 0.0)}
NOW = 10**12


def test_ranges_without_noise_are_distances_of_the_turned_tag() -> None:
    uwb = UwbSimulator({"A": (3.0, 4.0, 2.0)}, {"front": (1.0, 0.0, 2.0)}, sigma_m=0.0)
    [row] = uwb.ranges(NOW, 3.0, 1.0, np.pi / 2.0)
    assert row._replace(range_m=2.0) == decode.RangeRow(NOW, "front", "A", 2.0, None, "")
    assert row.range_m == pytest.approx(2.0)


def test_noise_loss_offset_and_reach_are_as_configured() -> None:
    uwb = UwbSimulator(ANCHORS, TAGS, sigma_m=0.1, offset_m=0.5, reach_m=20.0, loss=0.25, seed=1)
    rows = [row for _ in range(4_000) for row in uwb.ranges(NOW, 0.0, 0.0, 0.0)]
    given = np.array([row.range_m for row in rows])
    assert {row.anchor for row in rows} == {"A"}
    assert {row.sigma_m for row in rows} == {0.1}
    assert abs(len(rows) - 3_000) < 4.0 * np.sqrt(4_000 * 0.25 * 0.75)
    assert abs(given.mean() - 5.5) < 4.0 * 0.1 / np.sqrt(len(given))
    assert given.std() == pytest.approx(0.1, rel=0.06)


def test_a_seed_gives_the_same_ranges_again() -> None:
    one, two, other = (UwbSimulator(ANCHORS, TAGS, seed=s).ranges(NOW, 1.0, 2.0, 3.0)
                       for s in (1, 1, 2))  # fmt: skip
    assert one == two != other


@pytest.mark.parametrize(
    ("options", "says"), [({"anchors": {}}, "without anchors"), ({"tags": {}}, "without tags")]
)
def test_a_uwb_system_that_cannot_be_is_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        UwbSimulator(**{"anchors": ANCHORS, "tags": TAGS, **options})


def test_noise_is_a_share_of_the_distance() -> None:
    anchors = {"near": (2.0, 0.0, 0.0), "far": (40.0, 0.0, 0.0)}
    uwb = UwbSimulator(anchors, {"t": (0.0, 0.0, 0.0)}, sigma_m=0.0, sigma_relative=0.015, seed=1)
    epochs = [uwb.ranges(1, 0.0, 0.0, 0.0) for _ in range(4000)]
    measured = np.array([[row.range_m for row in epoch] for epoch in epochs])
    assert np.allclose(measured.mean(axis=0), [2.0, 40.0], rtol=0.002)
    assert np.allclose(measured.std(axis=0), [0.03, 0.6], rtol=0.05)
    assert [row.sigma_m for row in epochs[0]] == pytest.approx([0.03, 0.6])


def test_what_fails_or_is_out_of_reach_is_not_received_and_changes_nothing_else() -> None:
    anchors = {str(i): (float(i), 3.0, 1.0) for i in range(1, 200)}
    tags = {"t": (0.5, 0.0, 1.0)}
    all_of = UwbSimulator(anchors, tags, seed=2).ranges(1, 0.0, 0.0, np.pi / 2)
    some = UwbSimulator(anchors, tags, loss=0.3, reach_m=100.0, seed=2).ranges(
        1, 0.0, 0.0, np.pi / 2
    )
    assert set(some) < set(all_of)
    assert 50 < len(some) < 90
    assert max(int(row.anchor) for row in some) <= 100


def test_epochs_follow_the_rate_and_a_clock_that_goes_back() -> None:
    epochs = Epochs(5.0)
    due = [ms for ms in range(0, 1000, 30) if epochs.is_due(ms * 10**6)]
    assert due == [0, 210, 420, 600, 810]
    assert epochs.is_due(0)


def test_the_truth_of_gazebo_is_understood() -> None:
    turn = Message(x=0.0, y=0.0, z=0.0, w=1.0)
    floor, robot = (Message(position=Message(x=x, y=0.0, z=0.0), orientation=turn) for x in (0, 3))
    given = Message(name=["floor", "robot"], pose=[floor, robot])
    assert true_pose(given, "robot", 5) == (5, (3.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="no model 'robt' in the truth; did you mean 'robot'"):
        true_pose(given, "robt", 5)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    anchors = {"1": [3.0, 4.0, 0.0], "2": [0.0, 4.0, 0.0]}
    given = {"simulation": {"duration_s": 1.0, "anchors": anchors, "tags": {"tag": [0, 0, 0]}}}
    write_log(load_log(parse_config(given), None, 1), tmp_path / "world")
    return tmp_path / "world"


def system(folder: Path, **given: Any) -> UwbSystem:
    exact = {"world": str(folder), "sigma_relative": 0.0}
    return UwbSystem(values_of(PARAMETERS, exact | given))


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize(("given", "unit"), [({}, "m"), ({"format": "data", "unit": "mm"}, "mm")])
def test_the_truth_in_is_ranges_out_at_the_rate_asked_for(
    folder: Path, ros: str, given: dict[str, Any], unit: str
) -> None:
    uwb = system(folder, rate_hz=10.0, **given)
    out = []
    for i in range(101):
        truth = encode.odometry("ground_truth", NOW + i * 10**7, (0.0, 0.0, 0.0), (0.0, 0.0),
                                "map", "base_link")  # fmt: skip
        out.append(uwb.on(message(truth, ros), NOW))
    said = [one for one in out if one is not None]
    assert len(said) == 11
    assert {one.type for one in said} == {uwb.type}
    rows = decode.ranges(message(said[0], ros), unit=unit)
    assert [(row.anchor, row.range_m) for row in rows] == [("1", 5.0), ("2", 4.0)]


def test_what_is_out_of_reach_is_no_message(folder: Path) -> None:
    truth = encode.odometry("", NOW, (0.0, 0.0, 0.0), (0.0, 0.0), "map", "base_link")
    assert system(folder, reach_m=1.0).on(message(truth), NOW) is None


def test_a_truth_without_a_pose_is_refused(folder: Path) -> None:
    with pytest.raises(MessageError, match="has no pose"):
        system(folder).on(message(encode.text("ground_truth", "here")), NOW)


def test_a_world_that_uwb_data_cannot_name_is_refused(tmp_path: Path) -> None:
    write_log(load_log(parse_config({"simulation": {"duration_s": 1.0}}), None, 1), tmp_path / "w")
    with pytest.raises(ConfigError, match="format is data, but the world has anchor"):
        system(tmp_path / "w", format="data")
    with pytest.raises(ConfigError, match="world names no folder"):
        UwbSystem(values_of(PARAMETERS, {}))
