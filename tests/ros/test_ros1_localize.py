# SPDX-License-Identifier: Apache-2.0
"""The node `localize` with a real roscore: a simulated robot in, estimates out."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.config.load import parse_config
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag.decode import heading_of, stamp_ns
from locfuse.run.run import load_log, run
from locfuse.types import Log, wrap_angle
from ros1_peer import Listener, Process, Robot, node, simulated_time, started
from support_logs import SCANNER_TOPICS, SCANNERS, as_messages_hold_it

pytestmark = pytest.mark.usefixtures("ros1")

SIMULATION: dict[str, Any] = {
    "room_m": [8, 6],
    "map": {"generate": "rooms", "seed": 1},
    "path": {"shape": "roam"},
    "duration_s": 20.0,
    "laser": {},
    "odometry": {"rate_hz": 30},
    "ranges": {"rate_hz": 5, "sigma_relative": 0.015},
    "anchors": {"1": [0, 0, 2], "2": [8, 0, 2], "3": [8, 6, 2], "4": [0, 6, 2], "5": [4, 3, 2.5]},
    "tags": {"tag": [0.1, 0.0, 0.5]},
}
CONFIG: dict[str, Any] = {
    "start": "auto",
    "use": ["odometry", "ranges"],
    "estimator": {"range": {"sigma_m": 0.0, "sigma_relative": 0.015}},
    "ros": {"estimate_at": "fused"},
}
TOPICS = ("odom", "uwb", "scan")


def simulated(seed: int, **changes: Any) -> Log:
    return load_log(parse_config({"simulation": {**SIMULATION, **changes}}), None, seed)


class Localizing:
    """A node, its robot, and its output."""

    def __init__(
        self, process: Process, robot: Robot, poses: Listener, diagnostics: Listener
    ) -> None:
        self.process, self.robot = process, robot
        self.poses, self.diagnostics = poses, diagnostics

    def last(self) -> dict[int, Any]:
        """Return the last pose of each stamp [ns of the log]."""
        return {
            stamp_ns(m.header.stamp) - Robot.FIRST_NS: m.pose for m in list(self.poses.messages)
        }

    def states(self) -> list[tuple[float, str, str]]:
        """Return time [s of the log], state and reason of each diagnostics message."""
        found = []
        for message in list(self.diagnostics.messages):
            for status in message.status:
                if status.name == "locfuse: localization":
                    at = (stamp_ns(message.header.stamp) - Robot.FIRST_NS) / 1e9
                    found.append((at, status.values[0].value, status.message))
        return found

    def statuses(self, name: str) -> list[Any]:
        return [s for m in list(self.diagnostics.messages) for s in m.status if s.name == name]


@contextmanager
def localizing(
    log: Log,
    tmp_path: Path,
    config: dict[str, Any] | None = None,
    topics: tuple[str, ...] = TOPICS,
    **overrides: Any,
) -> Iterator[Localizing]:
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import PoseWithCovarianceStamped

    path = tmp_path / "run.yaml"
    path.write_text(yaml.safe_dump(CONFIG | (config or {})))
    parameters = {"config": str(path), **overrides}
    robot = Robot(log, parse_config(CONFIG | (config or {})).ros)
    try:
        with simulated_time(), node("locfuse_ros", "localize", tmp_path / "node.log", parameters,
                                    "locfuse") as process:  # fmt: skip
            poses = Listener("locfuse/pose", PoseWithCovarianceStamped)
            diagnostics = Listener("/diagnostics", DiagnosticArray)
            robot.meet(topics)
            yield Localizing(process, robot, poses, diagnostics)
            poses.close()
            diagnostics.close()
    finally:
        robot.close()


def settle(listener: Listener, quiet_s: float = 0.3) -> None:
    """Wait until no more messages arrive."""
    count = -1
    while count != len(listener.messages):
        count = len(listener.messages)
        time.sleep(quiet_s)


def errors(log: Log, poses: dict[int, Any], after_s: float = 0.0) -> np.ndarray:
    """Return the errors (n, 3) of poses against the truth at their stamps."""
    truth = log["truth"]
    rows = {stamp: row for row, stamp in enumerate(truth["stamp_ns"].tolist())}
    found = []
    for stamp, pose in poses.items():
        if stamp in rows and stamp >= after_s * 1e9:
            row, at = rows[stamp], pose.pose.position
            turn = wrap_angle(heading_of(pose.pose.orientation) - truth["heading_rad"][row])
            found.append([at.x - truth["x_m"][row], at.y - truth["y_m"][row], float(turn)])
    return np.array(found)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_finds_itself_from_nothing_and_stays_there(tmp_path: Path, seed: int) -> None:
    log = simulated(seed)
    first_s = max(log["ranges"]["stamp_ns"][0], log["scans"]["stamp_ns"][0]) / 1e9
    with localizing(log, tmp_path) as it:
        it.robot.drive(speed=4.0)
        settle(it.poses)
        poses, states = it.last(), it.states()
    ready_s = min(poses) / 1e9
    assert ready_s - first_s <= 3.0
    ok = [at for at, state, _ in states if state == "ok"]
    assert ok
    assert ok[0] - first_s <= 3.0 + 1.0  # diagnostics come once a second
    rmse = np.sqrt(np.mean(errors(log, poses) ** 2, axis=0))
    print(f"\nseed {seed}: first pose after {ready_s - first_s:.2f} s, RMSE "
          f"{np.hypot(rmse[0], rmse[1]):.3f} m, {np.rad2deg(rmse[2]):.2f} deg")  # fmt: skip
    assert np.hypot(rmse[0], rmse[1]) < 0.1
    assert rmse[2] < np.deg2rad(3.0)


@pytest.mark.parametrize("start", ["auto", "given"])
def test_estimates_are_those_of_locfuse_run(tmp_path: Path, start: str) -> None:
    log = as_messages_hold_it(simulated(4))
    truth = log["truth"]
    heading = float(np.rad2deg(truth["heading_rad"][0]))
    given = [float(truth["x_m"][0]) + 0.05, float(truth["y_m"][0]), heading]
    write_log(log, tmp_path / "log")
    config = {
        **CONFIG,
        "start": "auto" if start == "auto" else given,
        "ros": {"estimate_at": "fused", "world": "log"},
    }
    estimate = run(parse_config(config), log).estimate
    with localizing(log, tmp_path, config, TOPICS if start == "auto" else TOPICS[:2]) as it:
        it.robot.drive(speed=1.0)  # ranges after the next odometry are published later
        settle(it.poses)
        poses = it.last()
    assert estimate.heading is not None
    assert estimate.covariance is not None
    rows = [row for row, stamp in enumerate(estimate.stamp_ns.tolist()) if stamp in poses]
    # Messages that arrive together from two sockets are fused and published together.
    assert len(rows) > 0.8 * len(estimate)
    for row in rows:
        pose = poses[int(estimate.stamp_ns[row])]
        at = [pose.pose.position.x, pose.pose.position.y]
        assert np.allclose(at, estimate.position[row], rtol=0.0, atol=1e-9)
        turn = wrap_angle(heading_of(pose.pose.orientation) - estimate.heading[row])
        assert abs(float(turn)) <= 1e-9
        covariance = np.array(pose.covariance).reshape(6, 6)[np.ix_((0, 1, 5), (0, 1, 5))]
        assert np.allclose(covariance, estimate.covariance[row], rtol=0.0, atol=1e-9)


def test_poses_by_two_scanners_are_those_of_locfuse_run(tmp_path: Path) -> None:
    """Each has a topic of its own; /tf_static and /map say where they are, and what they see."""
    log = as_messages_hold_it(simulated(4, laser=None, lasers=SCANNERS, duration_s=8.0))
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    config = {
        **CONFIG,
        "start": [x + 0.05, y, float(np.rad2deg(heading))],
        "mcl": {},
        "ros": {"estimate_at": "fused", "topics": {"scans": list(SCANNER_TOPICS)}},
    }
    estimate = run(parse_config(config), log).estimate
    with localizing(log, tmp_path, config, ("odom", "uwb", *SCANNER_TOPICS)) as it:
        it.robot.drive(speed=1.0)
        settle(it.poses)
        poses = it.last()
    assert estimate.heading is not None
    rows = [row for row, stamp in enumerate(estimate.stamp_ns.tolist()) if stamp in poses]
    print(f"{len(rows)} stamps in common of {len(poses)} and {len(estimate)}")
    assert len(rows) > 0.8 * len(estimate)
    found = [poses[int(estimate.stamp_ns[row])] for row in rows]
    at = np.array([[one.pose.position.x, one.pose.position.y] for one in found])
    turn = [heading_of(one.pose.orientation) for one in found]
    apart = np.abs(at - estimate.position[rows]).max()
    turned = np.abs(wrap_angle(np.array(turn) - estimate.heading[rows])).max()
    print(f"largest difference {apart:.2e} m, {turned:.2e} rad")
    assert apart < 1e-9
    assert turned < 1e-9


def test_a_source_that_stops_is_reported_and_returns(tmp_path: Path) -> None:
    log = simulated(5)
    with localizing(log, tmp_path) as it:
        it.robot.drive(0.0, 6.0)
        it.robot.drive(6.0, 13.0, silent=["uwb"])
        it.robot.drive(13.0)
        settle(it.poses)
        states, poses = it.states(), it.last()
    during = [(state, why) for at, state, why in states if 9.0 <= at <= 13.0]
    assert during
    assert {state for state, _ in during} == {"dead_reckoning"}
    assert all(why for _, why in during)
    assert states[-1][1] == "ok"
    stamps = sorted(poses)
    assert max(np.diff(stamps)) < 0.2e9  # odometry carried it
    assert np.hypot(*errors(log, poses, after_s=15.0)[:, :2].T).max() < 0.25


def test_a_node_that_is_killed_and_restarted_goes_on(tmp_path: Path) -> None:
    from geometry_msgs.msg import PoseWithCovarianceStamped

    log = simulated(6)
    with localizing(log, tmp_path) as it:
        it.robot.drive(0.0, 6.0)
        it.process.end(signal.SIGKILL)
        it.robot.drive(6.0, 8.0)
        before = len(it.poses.messages)
        command = ["rosrun", "locfuse_ros", "localize", "__name:=locfuse"]
        with started(command, tmp_path / "second.log"):
            again = Listener("locfuse/pose", PoseWithCovarianceStamped)
            it.robot.meet(TOPICS)
            it.robot.drive(8.0)
            settle(again)
            again.close()
        assert before < len(it.poses.messages)
    poses = {stamp_ns(m.header.stamp) - Robot.FIRST_NS: m.pose for m in again.messages}
    assert min(poses) / 1e9 - 8.0 <= 3.0
    assert np.hypot(*errors(log, poses, after_s=11.0)[:, :2].T).max() < 0.25


@pytest.mark.parametrize("jump", ["reset", "continue"])
def test_a_clock_that_jumps_back_is_followed(tmp_path: Path, jump: str) -> None:
    from tf2_msgs.msg import TFMessage

    log = simulated(7)
    with localizing(log, tmp_path, {"clock_jump": jump}) as it:
        transforms = Listener("/tf", TFMessage)
        it.robot.drive(0.0, 10.0)
        settle(it.poses)
        count, first_transform = len(it.poses.messages), len(transforms.messages)
        it.robot.drive(10.0, shift_s=-8.0)
        settle(it.poses)
        output = it.process.output()
        after = it.poses.messages[count:]
        back = transforms.messages[first_transform:]
        transforms.close()
    assert "the clock went back by" in output
    assert after
    # Messages after the jump are shifted by 8 s, and the pose follows the truth.
    poses = {stamp_ns(m.header.stamp) - Robot.FIRST_NS + 8 * 10**9: m.pose for m in after}
    late = errors(log, poses, after_s=15.0)
    assert len(late) > 50
    assert np.hypot(*late[:, :2].T).max() < 0.3
    stamps = [stamp_ns(t.header.stamp) for m in back for t in m.transforms]
    assert stamps
    assert np.all(np.diff(stamps) > 0)


def test_the_transform_leads_from_map_to_odom_and_never_goes_back(tmp_path: Path) -> None:
    from nav_msgs.msg import Odometry
    from tf2_msgs.msg import TFMessage

    log = simulated(8)
    with localizing(log, tmp_path) as it:
        transforms, wheels = Listener("/tf", TFMessage), Listener("odom", Odometry)
        it.robot.drive()
        settle(it.poses)
        sent = [t for m in transforms.messages for t in m.transforms]
        driven = {stamp_ns(m.header.stamp): m.pose for m in wheels.messages}
        transforms.close()
        wheels.close()
        poses = it.last()
    assert {(t.header.frame_id, t.child_frame_id) for t in sent} == {("map", "odom")}
    assert np.all(np.diff([stamp_ns(t.header.stamp) for t in sent]) > 0)
    # The last one, and odometry at the end, give the last pose.
    last = sent[-1].transform
    turn = heading_of(last.rotation)
    odometry = driven[max(driven)].pose.position
    x = last.translation.x + np.cos(turn) * odometry.x - np.sin(turn) * odometry.y
    y = last.translation.y + np.sin(turn) * odometry.x + np.cos(turn) * odometry.y
    at = poses[max(poses)].pose.position
    assert np.hypot(x - at.x, y - at.y) < 0.02


def test_two_publishers_on_a_topic_are_named(tmp_path: Path) -> None:
    log = simulated(9, duration_s=3.0)
    with localizing(log, tmp_path) as it:
        it.robot.drive()
        other = "{header: {stamp: {secs: 1002}}, pose: {pose: {orientation: {w: 1}}}}"
        command = ["rostopic", "pub", "-r", "20", "/odom", "nav_msgs/Odometry", other]
        with started(command, tmp_path / "other.log"):
            output = it.process.wait_for_output("has 2 publishers")
    assert "odom has 2 publishers, /peer and /rostopic" in output


def test_bad_messages_are_named_and_harm_nothing(tmp_path: Path) -> None:
    from locfuse_ros.fill import message_of

    log = simulated(10)
    ranging = {"header": {"stamp": {"ns": Robot.FIRST_NS + 6 * 10**9}}, "anchor": "1", "tag": "tag"}
    bad: list[tuple[str, str, dict[str, Any]]] = [
        ("uwb", "locfuse_msgs/UwbRanges", {"ranges": [{**ranging, "range": float("nan")}]}),
        ("uwb", "locfuse_msgs/UwbRanges", {"ranges": [{**ranging, "range": -3.0}]}),
        ("odom", "nav_msgs/Odometry", {"header": ranging["header"], "child_frame_id": "base_link"}),
        ("odom", "nav_msgs/Odometry", {}),
        ("scan", "sensor_msgs/LaserScan", {"header": ranging["header"], "ranges": [1.0]}),
    ]
    with localizing(log, tmp_path) as it:
        it.robot.drive(0.0, 6.0)
        for topic, kind, fields in bad:
            it.robot.publish_message(topic, message_of(kind, fields))
        for words in ("nan", "-3", "(0, 0, 0, 0)", "angle_increment is 0"):
            it.process.wait_for_output(words)
        it.robot.drive(6.0)
        settle(it.poses)
        poses = it.last()
        counted = it.statuses("locfuse: messages")[-1].values
    counts = {value.key: value.value for value in counted}
    assert counts["odometry refused"] == "2"
    assert counts["ranges refused"] == "2"
    assert counts["scans refused"] == "1"
    assert np.hypot(*errors(log, poses, after_s=3.0)[:, :2].T).max() < 0.25


@pytest.mark.parametrize(
    ("kind", "ros"),
    [
        ("uwb_data", {"uwb_unit": "mm"}),
        ("linktrack", {"fields": {"ranges": {"preset": "linktrack", "names": {9: "tag"}}}}),
    ],
)
def test_uwb_data_of_another_package_is_understood(
    tmp_path: Path, kind: str, ros: dict[str, Any]
) -> None:
    """The paper's driver has its own type with int32 ids and millimetres."""
    log = simulated(11, duration_s=6.0)
    with localizing(log, tmp_path, {"ros": ros}, ("odom", "scan")) as it:
        driver = started([sys.executable, str(Path(__file__).with_name("other_driver.py")), kind],
                         tmp_path / "driver.log")  # fmt: skip
        with driver as other:
            other.wait_for_output("ready")
            it.robot.drive(silent=["uwb"], speed=2.0)
            settle(it.poses)
        poses = it.last()
    assert poses
    assert np.hypot(*errors(log, poses, after_s=2.0)[:, :2].T).max() < 0.4


def test_services_reset_relocalize_and_switch(tmp_path: Path) -> None:
    import rospy
    from std_srvs.srv import SetBool, Trigger

    log = simulated(12)
    with localizing(log, tmp_path) as it:
        services = {
            name: rospy.ServiceProxy(f"/locfuse/{name}", kind)
            for name, kind in (("reset", Trigger), ("relocalize", Trigger),
                               ("enable/ranges", SetBool))
        }  # fmt: skip
        it.robot.drive(0.0, 4.0)
        settle(it.poses)
        assert services["enable/ranges"](False).message == "ranges is off"
        it.robot.drive(4.0, 8.0)
        settle(it.poses)
        assert it.states()[-1][1] == "dead_reckoning"
        assert services["enable/ranges"](True).message == "ranges is on"
        it.robot.drive(8.0, 10.0)
        settle(it.poses)
        assert it.states()[-1][1] == "ok"
        for name in ("relocalize", "reset"):
            count = len(it.poses.messages)
            assert services[name]().success
            begin_s = 10.0 if name == "relocalize" else 15.0
            it.robot.drive(begin_s, begin_s + 5.0)
            settle(it.poses)
            again = it.poses.messages[count:]
            first_s = (stamp_ns(again[0].header.stamp) - Robot.FIRST_NS) / 1e9
            assert begin_s < first_s <= begin_s + 3.0
        poses = it.last()
    assert np.hypot(*errors(log, poses, after_s=18.0)[:, :2].T).max() < 0.25


def test_degrees_become_places_of_the_map_and_back(tmp_path: Path) -> None:
    import rospy
    from geographic_msgs.msg import GeoPoint, GeoPose
    from geometry_msgs.msg import Point, Quaternion
    from robot_localization.srv import FromLL, SetDatum, ToLL

    use = {"use": ["odometry", "ranges", "positions"]}
    with localizing(simulated(12, duration_s=2.0), tmp_path, use):
        from_degrees, to_degrees, set_datum = (
            rospy.ServiceProxy(name, kind)
            for name, kind in (("fromLL", FromLL), ("toLL", ToLL), ("datum", SetDatum))
        )
        from_degrees.wait_for_service(10.0)
        here = GeoPoint(latitude=48.001, longitude=11.0)
        with pytest.raises(rospy.ServiceException, match="is not known yet"):
            from_degrees(here)
        set_datum(GeoPose(GeoPoint(48.0, 11.0, 0.0), Quaternion()))
        point = from_degrees(here).map_point
        assert (point.x, point.y) == pytest.approx((0.0, 111.2), abs=0.05)
        back = to_degrees(Point(point.x, point.y, 0.0)).ll_point
        assert (back.latitude, back.longitude) == pytest.approx((48.001, 11.0), abs=1e-9)


def test_the_start_is_published_to_another_localizer(tmp_path: Path) -> None:
    from geometry_msgs.msg import PoseWithCovarianceStamped

    log = simulated(13, duration_s=5.0)
    with localizing(log, tmp_path, {"ros": {"topics": {"start": "initialpose"}}}) as it:
        it.robot.drive()
        settle(it.poses)
        late = Listener("initialpose", PoseWithCovarianceStamped)  # like an AMCL that starts later
        received = late.wait()
        late.close()
    assert len(received) == 1
    at = {stamp_ns(received[0].header.stamp) - Robot.FIRST_NS: received[0].pose}
    assert np.hypot(*errors(log, at)[0, :2]) < 0.3


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"startt": "auto"}, "/locfuse: unknown key 'startt'; did you mean 'start'?"),
        ({"config": 3}, "/locfuse: config is 3, expected text"),
        ({"config": "/nowhere.yaml"}, "/nowhere.yaml: cannot be read"),
        ({"estimator": {"hold": 1}}, "did you mean 'hold_s'?"),
        ({"start": "truth"}, "start is 'truth', which a robot does not know"),
        ({"start": "auto", "ros": {"world": "/nowhere"}}, "/nowhere: no such folder"),
    ],
)
def test_what_is_wrong_with_parameters_is_a_sentence(
    tmp_path: Path, parameters: dict[str, Any], words: str
) -> None:
    with node("locfuse_ros", "localize", tmp_path / "log.txt", parameters, "locfuse") as process:
        assert process.process.wait(20.0) == 1
        assert words in process.output()
        assert "Traceback" not in process.output()
