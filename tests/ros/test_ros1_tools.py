# SPDX-License-Identifier: Apache-2.0
"""Replay of a log, the simulator of UWB ranges, and common parts of the nodes."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag.decode import odometry, ranges, scan, stamp_ns
from locfuse.ros.dropped_messages import SequenceGaps
from locfuse.run.run import load_log
from locfuse.types import ConfigError, Log
from ros1_peer import Listener, connected_publisher, node, wait_for

pytest.importorskip("rospy", reason="no rospy; run ./dev test-ros")
from locfuse_ros.fill import message_of, time_of

pytestmark = pytest.mark.usefixtures("ros1")

ROOM: dict[str, Any] = {
    "simulation": {
        "room_m": [8, 6],
        "map": {"generate": "rooms", "seed": 1},
        "path": {"shape": "roam"},
        "duration_s": 5.0,
        "laser": {},
        "anchors": {"1": [0, 0, 2], "2": [8, 0, 2], "3": [8, 6, 2], "4": [0, 6, 2]},
        "tags": {"tag": [0.1, 0.0, 0.5]},
    }
}
FIRST_NS = 1000 * 10**9


@pytest.fixture(scope="module")
def log() -> Log:
    return load_log(parse_config(ROOM), None, seed=1)


@pytest.fixture(scope="module")
def folder(log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    write_log(log, tmp_path_factory.mktemp("logs") / "room")
    return tmp_path_factory.getbasetemp() / "logs0" / "room"


# Common parts


def test_fields_become_messages_at_any_depth() -> None:
    one = {"header": {"stamp": {"ns": 1_500_000_000}, "frame_id": "map"}, "child_frame_id": "odom"}
    message = message_of("tf2_msgs/TFMessage", {"transforms": [one]})
    assert message.transforms[0].header.stamp.to_nsec() == 1_500_000_000
    assert message.transforms[0].child_frame_id == "odom"
    data = message_of("locfuse_msgs/UwbData", {"stamp": [{"ns": 3}], "destination_id": [7]})
    assert data.stamp[0].to_nsec() == 3


def test_what_a_message_cannot_hold_is_refused() -> None:
    with pytest.raises(AttributeError, match="heading"):
        message_of("geometry_msgs/Pose", {"heading": 1.0})
    with pytest.raises(ConfigError, match="no Python package 'nobody_msgs'"):
        message_of("nobody_msgs/Nothing", {})
    for stamp in (-1, 2**32 * 10**9):
        with pytest.raises(ValueError, match="1970 to 2106"):
            time_of(stamp)


def test_gaps_in_sequence_numbers_are_reported_once() -> None:
    lines = SequenceGaps("the network is too slow")
    for number in (4_294_967_294, 4_294_967_295, 0, 1, 5):
        lines.record("/scan", "/laser", number)
    assert lines.lost == 3
    assert "3 messages of /scan from /laser were lost on the way (of 8)" in lines.new_losses()[0]
    assert lines.new_losses() == []
    lines.record("/scan", "/laser", 0)  # restarted
    lines.record("/scan", "/other", 77)
    assert lines.lost == 3
    assert lines.publishers("/scan") == ["/laser", "/other"]


# Replay


def played(log_folder: Path, tmp_path: Path, **parameters: Any) -> dict[str, list[Any]]:
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from locfuse_msgs.msg import NamedPoints, UwbRanges
    from nav_msgs.msg import OccupancyGrid, Odometry
    from rosgraph_msgs.msg import Clock
    from sensor_msgs.msg import LaserScan
    from tf2_msgs.msg import TFMessage

    kinds = {"odom": Odometry, "uwb": UwbRanges, "scan": LaserScan, "map": OccupancyGrid,
             "anchors": NamedPoints, "tf_static": TFMessage, "amcl_pose": PoseWithCovarianceStamped,
             "ground_truth": Odometry, "clock": Clock}  # fmt: skip
    overrides = {"log": str(log_folder), "speed": 0.0, **parameters}
    with node("locfuse_ros", "replay_log", tmp_path / "log.txt", overrides) as process:
        listeners = {topic: Listener(f"/{topic}", kind) for topic, kind in kinds.items()}
        assert process.process.wait(30.0) == 0, process.output()
        time.sleep(0.2)
    for listener in listeners.values():
        listener.close()
    return {topic: listener.messages for topic, listener in listeners.items()}


@pytest.fixture(scope="module")
def replayed(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    return played(folder, tmp_path_factory.mktemp("played"))


def test_a_log_comes_out_of_its_topics_as_it_went_in(
    log: Log, replayed: dict[str, list[Any]]
) -> None:
    rows = [row for message in replayed["uwb"] for row in ranges(message)]
    assert [row.stamp_ns - FIRST_NS for row in rows] == log["ranges"]["stamp_ns"].tolist()
    assert [row.range_m for row in rows] == log["ranges"]["range_m"].tolist()
    assert [row.anchor for row in rows] == log["ranges"]["anchor"].tolist()
    poses = [odometry(message) for message in replayed["odom"]]
    steps = np.hypot(np.diff([p.x for p in poses]), np.diff([p.y for p in poses]))
    logged = np.hypot(log["odometry"]["dx_m"], log["odometry"]["dy_m"])[1:]
    assert np.allclose(steps, logged, atol=1e-12)
    scans = [scan(message) for message in replayed["scan"]]
    assert len(scans) == len(log["scans"]["stamp_ns"])
    assert np.allclose(scans[3].ranges, log["scans"]["ranges_m"][3], atol=1e-5, equal_nan=True)
    assert log.grid is not None
    assert list(replayed["map"][0].data) == log.grid.cells.ravel().tolist()
    assert replayed["anchors"][0].names == ["1", "2", "3", "4"]
    assert {t.child_frame_id for t in replayed["tf_static"][0].transforms} == {"tag", "laser"}
    assert len(replayed["amcl_pose"]) == len(log["poses"]["stamp_ns"])


def test_the_clock_is_never_behind_a_message_and_never_goes_back(
    replayed: dict[str, list[Any]],
) -> None:
    ticks = [message.clock.to_nsec() for message in replayed["clock"]]
    assert ticks == sorted(ticks)
    assert np.diff(ticks).max() <= 5_000_000
    assert ticks[-1] == max(stamp_ns(message.header.stamp) for message in replayed["ground_truth"])


def test_a_log_takes_as_long_as_the_speed_says(folder: Path, tmp_path: Path) -> None:
    from rosgraph_msgs.msg import Clock

    parameters = {"log": str(folder), "speed": 2.5, "wait_s": 0.0}
    with node("locfuse_ros", "replay_log", tmp_path / "log.txt", parameters) as process:
        listener = Listener("/clock", Clock)
        process.process.wait(30.0)
    listener.close()
    took_s = listener.received_s[-1] - listener.received_s[0]
    logged_s = (listener.messages[-1].clock - listener.messages[0].clock).to_sec()
    assert took_s == pytest.approx(logged_s / 2.5, rel=0.05)


def test_a_missing_log_is_a_sentence(tmp_path: Path) -> None:
    parameters = {"log": str(tmp_path / "nothing")}
    with node("locfuse_ros", "replay_log", tmp_path / "log.txt", parameters) as process:
        assert process.process.wait(20.0) == 1
        assert "nothing: no such folder" in process.output()


# Simulator


@pytest.mark.parametrize("form", ["ranges", "data"])
def test_ranges_come_at_the_rate_asked_for(folder: Path, tmp_path: Path, form: str) -> None:
    from locfuse_msgs.msg import UwbData, UwbRanges
    from nav_msgs.msg import Odometry

    parameters = {"world": str(folder), "rate_hz": 10.0, "format": form, "unit": "mm", "seed": 4}
    with node("locfuse_ros", "simulate_uwb", tmp_path / "log.txt", parameters, name="sim"):
        listener = Listener("uwb", UwbData if form == "data" else UwbRanges)
        out = connected_publisher("ground_truth", Odometry)
        for i in range(101):
            truth = message_of(
                "nav_msgs/Odometry", {"header": {"stamp": {"ns": 10**12 + i * 10**7}}}
            )
            truth.pose.pose.orientation.w = 1.0
            out.publish(truth)
        received = listener.wait(11)
        time.sleep(0.1)
        out.unregister()
        listener.close()
    assert len(received) == 11
    rows = ranges(received[0], unit="mm")
    assert [row.anchor for row in rows] == ["1", "2", "3", "4"]
    expected = [np.linalg.norm(np.array(at) - (0.1, 0.0, 0.5)) for at in
                ROOM["simulation"]["anchors"].values()]  # fmt: skip
    assert np.allclose([row.range_m for row in rows], expected, rtol=0.06)


def test_the_simulator_needs_a_world(tmp_path: Path) -> None:
    with node("locfuse_ros", "simulate_uwb", tmp_path / "log.txt", name="sim") as process:
        assert process.process.wait(20.0) == 1
        assert "world names no folder" in process.output()
    wait_for("the end", lambda: process.process.poll() is not None)
