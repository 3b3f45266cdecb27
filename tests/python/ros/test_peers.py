# SPDX-License-Identifier: Apache-2.0
"""A UWB system that is simulated, and a log that is told as a robot would."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.config.ros import Ros
from locfuse.config.schema import RunConfig
from locfuse.ros import decode
from locfuse.ros.peers import UwbSimulator, in_order_of_arrival, static_of, uwb_of
from locfuse.run import load_log
from locfuse.types import NANOSECONDS, ConfigError, Log
from support_ros import message

ANCHORS = {"A": (3.0, 4.0, 0.0), "B": (30.0, 40.0, 0.0)}
TAGS = {"tag": (0.0, 0.0, 0.0)}
NOW = 10**12


def test_ranges_without_noise_are_distances_of_the_turned_tag() -> None:
    uwb = UwbSimulator({"A": (3.0, 4.0, 2.0)}, {"front": (1.0, 0.0, 2.0)}, sigma_m=0.0)
    [row] = uwb.ranges(NOW, 3.0, 1.0, np.pi / 2.0)
    assert row._replace(range_m=2.0) == decode.RangeRow(NOW, "front", "A", 2.0, None, "")
    assert row.range_m == pytest.approx(2.0)


def test_noise_loss_offset_and_reach_are_as_told() -> None:
    uwb = UwbSimulator(ANCHORS, TAGS, sigma_m=0.1, offset_m=0.5, reach_m=20.0, loss=0.25, seed=1)
    rows = [row for _ in range(4_000) for row in uwb.ranges(NOW, 0.0, 0.0, 0.0)]
    told = np.array([row.range_m for row in rows])
    assert {row.anchor for row in rows} == {"A"}
    assert {row.sigma_m for row in rows} == {0.1}
    assert abs(len(rows) - 3_000) < 4.0 * np.sqrt(4_000 * 0.25 * 0.75)
    assert abs(told.mean() - 5.5) < 4.0 * 0.1 / np.sqrt(len(told))
    assert told.std() == pytest.approx(0.1, rel=0.06)


def test_a_seed_gives_the_same_ranges_again() -> None:
    one, two, other = (UwbSimulator(ANCHORS, TAGS, seed=s).ranges(NOW, 1.0, 2.0, 3.0)
                       for s in (1, 1, 2))  # fmt: skip
    assert one == two != other


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"loss": 1.5}, "loss is 1.5, expected 0 <= loss <= 1"),
        ({"sigma_m": float("nan")}, "sigma_m is nan"),
        ({"offset_m": float("inf")}, "offset_m is inf"),
        ({"anchors": {}}, "without anchors"),
        ({"tags": {}}, "without tags"),
    ],
)
def test_a_uwb_system_that_cannot_be_is_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        UwbSimulator(**{"anchors": ANCHORS, "tags": TAGS, **options})


def drive(**simulation: Any) -> tuple[RunConfig, Log]:
    keys = {"duration_s": 5.0, "laser": {}, "map": {}, "positions": {}, **simulation}
    config = parse_config({"simulation": keys})
    log = load_log(config, None, 1)
    later = {
        stem: {k: v + NOW if k.endswith("_ns") else v for k, v in table.items()}
        for stem, table in log.tables.items()
    }
    return config, Log(later, log.tags, log.laser, log.map, log.grid)


def test_a_world_tells_where_its_uwb_system_is() -> None:
    _, log = drive()
    rows = uwb_of(log, sigma_m=0.0).ranges(NOW, 1.0, 1.0, 0.0)
    assert [row.anchor for row in rows] == list(log["anchors"]["anchor"])


def test_messages_are_those_of_the_log_in_order_of_arrival() -> None:
    _, log = drive()
    told = list(in_order_of_arrival(log, Ros()))
    arrivals = [one.arrival_ns for one in told]
    assert arrivals == sorted(arrivals)
    of = {topic: [message(one.publication) for one in told if one.publication.topic == topic]
          for topic in ("odom", "uwb", "scan", "fix", "amcl_pose", "ground_truth")}  # fmt: skip
    assert len(of["odom"]) == len(log["odometry"]["stamp_ns"])
    assert len(of["scan"]) == len(log["scans"]["stamp_ns"])
    assert len(of["ground_truth"]) == len(log["truth"]["stamp_ns"])
    ranges = [row for one in of["uwb"] for row in decode.ranges(one)]
    assert [row.range_m for row in ranges] == log["ranges"]["range_m"].tolist()
    assert [row.stamp_ns for row in ranges] == log["ranges"]["stamp_ns"].tolist()
    fixes = [decode.fix(one) for one in of["fix"]]
    assert [row.x for row in fixes if row is not None] == log["positions"]["x_m"].tolist()
    poses = [decode.pose(one) for one in of["amcl_pose"]]
    assert [row.y for row in poses] == log["poses"]["y_m"].tolist()


def test_increments_are_told_as_the_poses_they_add_up_to() -> None:
    _, log = drive()
    rows = [decode.odometry(message(one.publication)) for one in in_order_of_arrival(log, Ros())
            if one.publication.topic == "odom"]  # fmt: skip
    step = rows[1].x, rows[1].y, rows[1].heading
    table = log["odometry"]
    assert (rows[0].x, rows[0].y, rows[0].heading) == (0.0, 0.0, 0.0)
    assert step == pytest.approx([table[k][1] for k in ("dx_m", "dy_m", "dheading_rad")])
    turned = sum(table["dheading_rad"][1:])
    assert rows[-1].heading == pytest.approx(np.remainder(turned + np.pi, 2 * np.pi) - np.pi)


def test_velocities_are_told_as_they_are() -> None:
    _, log = drive(odometry={"output": "velocities"})
    rows = [decode.odometry(message(one.publication), "twist")
            for one in in_order_of_arrival(log, Ros())
            if one.publication.topic == "odom"]  # fmt: skip
    assert [row.v for row in rows] == log["odometry"]["v_mps"].tolist()


def test_what_arrives_late_is_told_late() -> None:
    _, log = drive()
    late = {**log["ranges"], "arrival_ns": log["ranges"]["stamp_ns"] + NANOSECONDS}
    told = in_order_of_arrival(Log({**log.tables, "ranges": late}, log.tags), Ros())
    waits = {one.arrival_ns - one.publication.fields["ranges"][0]["header"]["stamp"]["ns"]
             for one in told if one.publication.topic == "uwb"}  # fmt: skip
    assert waits == {NANOSECONDS}


def test_what_has_no_topic_is_not_told() -> None:
    _, log = drive()
    ros = Ros.model_validate({"topics": {"scans": None, "ranges": "/uwb/all"}})
    topics = {one.publication.topic for one in in_order_of_arrival(log, ros)}
    assert "scan" not in topics
    assert "/uwb/all" in topics


def test_the_world_is_told_latched() -> None:
    _, log = drive()
    told = {one.topic: one for one in static_of(log, Ros())}
    assert set(told) == {"tf_static", "anchors", "map"}
    assert all(one.latched for one in told.values())
    frames = {row.child for row in decode.transforms(message(told["tf_static"]))}
    assert frames == {*log.tags, "laser"}


def test_noise_is_a_share_of_the_distance() -> None:
    anchors = {"near": (2.0, 0.0, 0.0), "far": (40.0, 0.0, 0.0)}
    uwb = UwbSimulator(anchors, {"t": (0.0, 0.0, 0.0)}, sigma_m=0.0, sigma_relative=0.015, seed=1)
    epochs = [uwb.ranges(1, 0.0, 0.0, 0.0) for _ in range(4000)]
    heard = np.array([[row.range_m for row in epoch] for epoch in epochs])
    assert np.allclose(heard.mean(axis=0), [2.0, 40.0], rtol=0.002)
    assert np.allclose(heard.std(axis=0), [0.03, 0.6], rtol=0.05)
    assert [row.sigma_m for row in epochs[0]] == pytest.approx([0.03, 0.6])


def test_what_fails_or_is_out_of_reach_is_not_heard_and_changes_nothing_else() -> None:
    anchors = {str(i): (float(i), 3.0, 1.0) for i in range(1, 200)}
    tags = {"t": (0.5, 0.0, 1.0)}
    all_of = UwbSimulator(anchors, tags, seed=2).ranges(1, 0.0, 0.0, np.pi / 2)
    some = UwbSimulator(anchors, tags, loss=0.3, reach_m=100.0, seed=2).ranges(
        1, 0.0, 0.0, np.pi / 2
    )
    assert set(some) < set(all_of)
    assert 50 < len(some) < 90
    assert max(int(row.anchor) for row in some) <= 100
