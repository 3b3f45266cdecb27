# SPDX-License-Identifier: Apache-2.0
"""The block `ros` of a configuration: what is where, and what it cannot mean."""

from __future__ import annotations

import re
from typing import Any

import pytest

from locfuse.config.load import parse_config
from locfuse.config.ros import PUBLISHED, SUBSCRIBED, Ros, Topics


def test_without_a_block_the_usual_names_count() -> None:
    ros = parse_config({}).ros
    assert ros == Ros()
    assert (ros.topics.odometry, ros.topics.scans, ros.topics.estimate) == (
        "odom", "scan", "locfuse/pose")  # fmt: skip
    assert (ros.frames.map, ros.frames.odom, ros.frames.base) == ("map", "odom", "base_link")


def test_every_topic_is_subscribed_or_published() -> None:
    assert set(SUBSCRIBED) | set(PUBLISHED) == set(Topics.model_fields)
    assert not set(SUBSCRIBED) & set(PUBLISHED)


def test_a_topic_is_switched_off_by_null() -> None:
    assert parse_config({"ros": {"topics": {"scans": None}}}).ros.topics.scans is None


def test_the_start_may_go_where_starts_come_from() -> None:
    assert parse_config({"ros": {"topics": {"start": "initialpose"}}}).ros.topics.start


@pytest.mark.parametrize(
    ("ros", "said"),
    [
        ({"topcs": {}}, "ros: unknown key 'topcs'; did you mean 'topics'?"),
        ({"topics": {"odometri": "odom"}}, "did you mean 'odometry'?"),
        ({"topics": {"odometry": ""}}, "ros.topics.odometry"),
        ({"topics": {"truth": "/odom"}}, "odometry and truth are both 'odom'"),
        ({"topics": {"path": "locfuse/pose"}}, "estimate and path are both 'locfuse/pose'"),
        ({"range_topics": {"/scan": "A"}}, "range_topics and topics.scans are both 'scan'"),
        ({"range_topics": {"/a": "A", "a": "B"}}, "range_topics names 'a' twice"),
        ({"frames": {"odom": "/map"}}, "map, odom and base are map, map, base_link"),
        ({"odometry_from": "poses"}, "did you mean 'pose'?"),
        ({"uwb_unit": "cm"}, "ros.uwb_unit"),
        ({"gps_origin": [91, 0, 0]}, "ros.gps_origin"),
        ({"gps_origin": [48, 11]}, "ros.gps_origin"),
        ({"publish_transform": "perhaps"}, "ros.publish_transform"),
        ({"path_hz": 0}, "ros.path_hz"),
        ({"transform_ahead_s": -0.1}, "ros.transform_ahead_s"),
    ],
)
def test_what_it_cannot_mean_is_one_sentence(ros: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        parse_config({"ros": ros})
