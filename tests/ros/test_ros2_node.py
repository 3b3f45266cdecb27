# SPDX-License-Identifier: Apache-2.0
"""ROS 2 parts of the nodes: parameters, quality of service, types, publishers, losses."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag import decode, encode
from locfuse.io.rosbag.encode import Publication
from locfuse.ros.parameters import parameters
from locfuse.types import NANOSECONDS
from locfuse_ros.fill import message_of
from support_robot import EPOCH_NS, Robot, simulated, start_localize, write_config
from support_ros2 import Peer, peer_in

STARTS = {"start": "auto"}


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    with peer_in(tmp_path) as made:
        yield made


# Parameters -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (
            {**STARTS, "estimator.hold": 0.99},
            "estimator: unknown key 'hold'; did you mean 'hold_s'?",
        ),
        ({**STARTS, "cofnig": "x"}, "unknown key 'cofnig'"),
        ({**STARTS, "estimator.range.gate": 7.0}, "at most 1 (got 7.0)"),
        ({**STARTS, "estimator.range.gate": "wide"}, "estimator.range.gate: "),
        ({**STARTS, "ros.frames.odom": "map"}, "expected three names"),
        ({**STARTS, "config": "/no/such.yaml"}, "/no/such.yaml: cannot be read"),
        ({**STARTS, "ros.world": "/no/such/world"}, "/no/such/world: no such folder"),
        ({}, "start is 'truth', which a robot does not know"),
    ],
)
def test_what_is_not_allowed_ends_the_node_with_one_sentence(
    peer: Peer, given: dict[str, Any], says: str
) -> None:
    process = peer.start("localize", given)
    assert process.wait() == 1
    assert says in process.log()
    assert "Traceback" not in process.log()
    assert len(process.log().splitlines()) == 1


def test_parameters_are_declared_with_type_range_and_description(
    peer: Peer, tmp_path: Path
) -> None:
    config = write_config(tmp_path, start="auto", estimator={"range": {"gate": 0.9}, "hold_s": 2})
    peer.start("localize", {"config": config, "estimator.range.gate": 0.99, "history_s": 3})
    known = {p.name: p for p in parameters(RunConfig())}
    listed = set(peer.call("/locfuse/list_parameters", ListParameters).result.names)
    assert set(known) <= listed
    names = ["estimator.range.gate", "history_messages", "when_lost", "ros.topics.odometry"]
    gate, history, lost, topic = peer.call(
        "/locfuse/describe_parameters", DescribeParameters, names=names
    ).descriptors
    assert gate.type == ParameterType.PARAMETER_DOUBLE
    assert gate.floating_point_range[0].to_value == 1.0
    assert gate.description == known["estimator.range.gate"].description != ""
    assert history.type == ParameterType.PARAMETER_INTEGER
    assert history.integer_range[0].from_value == 512
    assert lost.additional_constraints == "restart or go_on"
    assert topic.type == ParameterType.PARAMETER_STRING
    names = ["estimator.range.gate", "estimator.hold_s", "history_s", "seed"]
    values = peer.call("/locfuse/get_parameters", GetParameters, names=names).values
    assert [v.double_value for v in values[:3]] == [0.99, 2.0, 3.0]
    assert values[3].integer_value == 0
    changed = Parameter("estimator.range.gate", value=0.5).to_parameter_msg()
    [result] = peer.call("/locfuse/set_parameters", SetParameters, parameters=[changed]).results
    assert not result.successful
    assert isinstance(gate, ParameterDescriptor)


def test_a_file_of_parameters_is_that_of_a_run(peer: Peer, tmp_path: Path) -> None:
    path = tmp_path / "localize.yaml"
    path.write_text(
        "/**:\n  ros__parameters:\n    start: [1.0, 2.0, 90.0]\n"
        "    use: [odometry, ranges]\n    anchors: {all: {offset_m: 0.1}}\n"
        "    estimator: {range: {sigma_m: 0.12, gate: 0.99}}\n"
        "    ros: {topics: {odometry: wheels, scans: ''}, range_topics: {uwb/a1: A1}}\n"
    )
    peer.start("localize", {}, "--params-file", str(path))
    peer.wait_for_subscriber("wheels", "uwb/a1")
    assert not peer.node.count_subscribers("/scan")
    names = ["anchors.all.offset_m", "estimator.range.sigma_m"]
    values = peer.call("/locfuse/get_parameters", GetParameters, names=names).values
    assert [v.double_value for v in values] == [0.1, 0.12]


# Quality of service -----------------------------------------------------------------------------


def offered(peer: Peer, topic: str, kind: str, **qos: Any) -> Any:
    return peer.publisher(topic, kind, QoSProfile(depth=10, **qos))


def words(peer: Peer, says: str) -> None:
    peer.wait(f"{says!r} in the log", lambda: says in peer.processes[0].log())


def test_a_map_that_is_not_latched_is_reported(peer: Peer) -> None:
    peer.start("localize", STARTS)
    offered(peer, "map", "nav_msgs/OccupancyGrid")
    words(peer, "its durability is lower than this node requests, transient_local")


def test_a_subscriber_with_incompatible_qos_is_reported(peer: Peer) -> None:
    peer.start("localize", STARTS)
    peer.subscribe("locfuse/pose", "geometry_msgs/PoseWithCovarianceStamped", latched=True)
    words(peer, "QoS mismatch on /locfuse/pose: a subscriber receives nothing")


@pytest.mark.parametrize("reliability", [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT])
def test_sensors_are_received_whether_reliable_or_not(
    peer: Peer, reliability: ReliabilityPolicy
) -> None:
    robot = Robot(peer, simulated(seed=0))
    process = start_localize(robot, peer.folder)
    out = offered(peer, "odom", "nav_msgs/Odometry", reliability=reliability,
                  durability=DurabilityPolicy.VOLATILE)  # fmt: skip
    peer.wait("a match", out.get_subscription_count)
    robot.drive(0.0, 2.0)
    assert "odometry fused" in robot.status("locfuse: messages") or "odom from /peer" in (
        robot.status("locfuse: topics")
    )
    assert "QoS" not in process.log()


# Types and publishers ---------------------------------------------------------------------------


def test_ranges_of_each_type_are_received(peer: Peer) -> None:
    robot = Robot(peer, simulated(seed=0))
    start_localize(robot, peer.folder)
    robot.publish_world()
    stamp = {"ns": EPOCH_NS}
    robot.set_time(EPOCH_NS)
    data = {"destination_id": [1], "distance": [2.0], "stamp": [stamp]}
    publication = encode.Publication("uwb", "locfuse_msgs/UwbData", data)
    for _ in range(40):
        robot.peer.publish(publication)
        robot.peer.spin(0.1)
        if "uwb from /peer" in robot.status("locfuse: topics"):
            break
    assert "uwb from /peer" in robot.status("locfuse: topics")


def test_ranges_in_text_of_a_driver_are_received_by_its_preset(peer: Peer) -> None:
    """The node takes the type of the publisher, which it has to wait for."""
    robot = Robot(peer, simulated(seed=0))
    start_localize(robot, peer.folder, "odom", ros={"fields": {"ranges": "makerfabs"}})
    robot.publish_world()
    robot.set_time(EPOCH_NS)
    text = '{"links": [{"A": "1", "R": "2.0"}, {"A": "2", "R": "0.0"}]}'
    publication = encode.Publication("uwb", "std_msgs/String", {"data": text})
    for _ in range(80):
        robot.peer.publish(publication)
        robot.peer.spin(0.1)
        if "uwb from /peer" in robot.status("locfuse: topics"):
            break
    assert "uwb from /peer" in robot.status("locfuse: topics")
    assert "ranges refused" not in robot.status("locfuse: messages")


def test_a_topic_of_another_type_is_reported(peer: Peer) -> None:
    peer.start("localize", STARTS)
    offered(peer, "odom", "nav_msgs/Path")
    words(peer, "/odom has messages of type nav_msgs/Path, which cannot be used; expected "
          "nav_msgs/Odometry, or another topic for ros.topics.odometry")  # fmt: skip


def test_two_publishers_of_one_sensor_are_reported(peer: Peer, tmp_path: Path) -> None:
    robot = Robot(peer, simulated(seed=0))
    process = start_localize(robot, tmp_path)
    with_another = peer.node.create_publisher(
        type(message_of("nav_msgs/Odometry", {})), "odom", QoSProfile(depth=10)
    )
    robot.drive(0.0, 2.0)
    words(peer, "odom has 2 publishers")
    assert process.log().count("odom has 2 publishers") == 1
    peer.node.destroy_publisher(with_another)


def test_silence_names_the_topic(peer: Peer) -> None:
    peer.start("localize", STARTS)
    words(peer, "nothing comes on odom (nav_msgs/Odometry); is its driver running, and is "
          "ros.topics.odometry the right name?")  # fmt: skip


# Losses -----------------------------------------------------------------------------------------


def counted(robot: Robot) -> tuple[int, int]:
    """Return how many messages of odometry the node received, and how many it reports lost."""
    robot.peer.spin(2.5)
    received, lost = robot.status("locfuse: topics")["odom from /peer"].split(", ")
    return int(received.split()[0]), int(lost.split()[0])


def test_lost_messages_are_reported(peer: Peer, tmp_path: Path) -> None:
    robot = Robot(peer, simulated(seed=0))
    process = start_localize(robot, tmp_path)
    robot.drive(0.0, 1.0)
    received, lost = counted(robot)  # messages before discovery count as neither
    assert lost == 0
    assert received > 20
    before, stamps = received, EPOCH_NS + NANOSECONDS + np.arange(3_000) * 100_000

    def publish(stamp: int) -> None:
        peer.publish(encode.odometry("odom", stamp, (1.0, 0.0, 0.0), (0.0, 0.0), "odom",
                                     "base_link"))  # fmt: skip

    process.process.send_signal(signal.SIGSTOP)  # while more messages arrive than its queue holds
    for stamp in stamps[:2_000].tolist():
        publish(stamp)
    process.process.send_signal(signal.SIGCONT)
    for stamp in stamps[2_000:].tolist():  # a loss of the last ones would not be detected
        publish(stamp)
        peer.spin(0.002)
    words(peer, "messages of odom from /peer were lost on the way (of ")
    received, lost = counted(robot)
    assert received + lost == before + 3_000
    assert lost > 500
    [sentence] = [line for line in process.log().splitlines() if "odom from /peer were" in line]
    assert 0 < int(sentence.rsplit("]: ")[1].split()[0]) <= lost  # once a minute


# The other nodes --------------------------------------------------------------------------------


def test_simulated_ranges_are_those_of_the_true_pose(peer: Peer, tmp_path: Path) -> None:
    log = simulated(seed=0)
    write_log(log, tmp_path / "world")
    given = {"world": str(tmp_path / "world"), "sigma_m": 0.1, "sigma_relative": 0.0,
            "rate_hz": 1000.0, "seed": 3}  # fmt: skip
    peer.start("simulate_uwb", given)
    received = peer.subscribe("uwb", "locfuse_msgs/UwbRanges")
    out = offered(peer, "ground_truth", "nav_msgs/Odometry")
    peer.wait("a match", lambda: out.get_subscription_count() and received is not None)
    peer.spin(0.5)
    for i in range(200):
        peer.publish(encode.odometry("ground_truth", EPOCH_NS + i * 10**7, (3.0, 4.0, 0.5),
                                     (0.0, 0.0), "map", "base_link"))  # fmt: skip
        peer.spin(0.005)
    peer.wait("ranges", lambda: len(received) >= 190)
    rows = [row for message in received for row in decode.ranges(message)]
    [tag] = log.tags.values()
    c, s = np.cos(0.5), np.sin(0.5)
    at = np.array([3.0 + c * tag[0] - s * tag[1], 4.0 + s * tag[0] + c * tag[1], tag[2]])
    table = log["anchors"]
    errors = []
    for row in rows:
        i = list(table["anchor"]).index(row.anchor)
        there = np.array([table[k][i] for k in ("x_m", "y_m", "z_m")])
        errors.append(row.range_m - np.linalg.norm(there - at))
    assert {row.anchor for row in rows} == set(table["anchor"])
    assert abs(np.mean(errors)) < 4.0 * 0.1 / np.sqrt(len(errors))
    assert np.std(errors) == pytest.approx(0.1, rel=0.1)


def test_the_truth_may_be_a_pose_and_ranges_those_of_the_paper(peer: Peer, tmp_path: Path) -> None:
    (tmp_path / "world").mkdir()
    (tmp_path / "world" / "anchors.csv").write_text("anchor,x_m,y_m,z_m\n7,3,4,0\n")
    (tmp_path / "world" / "log.yaml").write_text("tags: {tag: [0, 0, 0]}\n")
    given = {
        "world": str(tmp_path / "world"),
        "sigma_relative": 0.0,
        "format": "data",
        "unit": "mm",
    }
    peer.start("simulate_uwb", given)
    received = peer.subscribe("uwb", "locfuse_msgs/UwbData")
    out = offered(peer, "ground_truth", "geometry_msgs/PoseStamped")
    peer.wait("a match", out.get_subscription_count)
    fields = {"header": encode.header(EPOCH_NS, "map"),
              "pose": {"position": {}, "orientation": {"w": 1.0}}}  # fmt: skip
    number = iter(range(10**6))

    def answered() -> bool:
        fields["header"] = encode.header(EPOCH_NS + next(number) * 10**9, "map")
        peer.publish(Publication("ground_truth", "geometry_msgs/PoseStamped", fields))
        peer.spin(0.05)
        return bool(received)

    peer.wait("ranges", answered)
    [row] = decode.ranges(received[0], unit="mm")
    assert (row.anchor, row.range_m) == ("7", 5.0)


@pytest.mark.parametrize(
    ("node", "given", "says"),
    [
        ("simulate_uwb", {"world": "/no/such"}, "/no/such: no such folder"),
        ("simulate_uwb", {"rte_hz": 1.0}, "unknown 'rte_hz'; did you mean 'rate_hz'?"),
        ("simulate_uwb", {"loss": 2.0}, "loss is 2.0, expected a number from 0 to 1"),
        ("replay_log", {"log": "/no/such"}, "/no/such: no such folder"),
        ("replay_log", {"speed": "fast"}, "speed is 'fast', expected a number"),
    ],
)
def test_small_nodes_say_what_is_wrong(
    peer: Peer, node: str, given: dict[str, Any], says: str
) -> None:
    process = peer.start(node, given)
    assert process.wait() == 1
    assert says in process.log()
    assert "Traceback" not in process.log()


def test_a_log_is_replayed_to_the_node(peer: Peer, tmp_path: Path) -> None:
    robot = Robot(peer, simulated(seed=1))
    write_log(robot.log, tmp_path / "log")
    start_localize(robot, tmp_path)
    given = {"log": str(tmp_path / "log"), "speed": 5.0}
    replay = peer.start("replay_log", given)
    peer.wait("the end of the log", lambda: replay.process.poll() is not None, 30.0)
    peer.spin(0.5)
    assert "the log has ended" in replay.log()
    assert robot.rmse_m(50) < 0.1
    assert len(robot.poses) > 400
