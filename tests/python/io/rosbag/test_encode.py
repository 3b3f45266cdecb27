# SPDX-License-Identifier: Apache-2.0
"""What is published has the fields of standard messages; headings survive to the last bit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.io.rosbag import decode, encode
from locfuse.io.rosbag.decode import RangeRow
from support_ros import message


def test_every_heading_survives_its_quaternion_bit_for_bit() -> None:
    rng = np.random.default_rng(1)
    headings = [*rng.uniform(-math.pi, math.pi, 5000), *(10.0 ** rng.uniform(-300, 0, 500)), 0.0,
                -math.pi, math.nextafter(math.pi, 0.0), math.pi / 2, -math.pi / 2]  # fmt: skip
    for heading in headings:
        given = message(encode.quaternion(float(heading)))
        assert decode.heading_of(given) == heading
        assert given.z**2 + given.w**2 == pytest.approx(1.0, abs=1e-14)


def test_half_an_angle_and_back_would_not_do() -> None:
    headings = np.random.default_rng(1).uniform(-math.pi, math.pi, 1000)
    naive = 2.0 * np.arctan2(np.sin(headings / 2), np.cos(headings / 2))
    assert (naive != headings).any()


def test_a_heading_of_pi_and_more_is_wrapped() -> None:
    assert decode.heading_of(message(encode.quaternion(math.pi))) == -math.pi
    assert decode.heading_of(message(encode.quaternion(7.0))) == pytest.approx(7.0 - 2 * math.pi)


def test_map_to_odom_takes_the_body_from_odom_to_map() -> None:
    in_map, in_odom = (3.0, -4.0, 2.5), (1.0, 7.0, -1.5)
    x, y, heading = encode.map_to_odom(in_map, in_odom)
    c, s = math.cos(heading), math.sin(heading)
    assert (x + c * 1.0 - s * 7.0, y + s * 1.0 + c * 7.0) == pytest.approx(in_map[:2])
    assert math.remainder(heading + in_odom[2] - in_map[2], 2 * math.pi) == pytest.approx(0.0)


def test_a_covariance_sits_where_ros_keeps_x_y_and_yaw() -> None:
    full = encode.planar_covariance([[1, 2, 3], [2, 4, 5], [3, 5, 6]]).reshape(6, 6)
    assert full[0, 0] == 1
    assert full[0, 1] == full[1, 0] == 2
    assert full[0, 5] == full[5, 0] == 3
    assert (full[1, 1], full[1, 5], full[5, 5]) == (4, 5, 6)


def test_a_path_has_the_stamp_of_its_last_pose() -> None:
    given = encode.path("path", "map", [1, 2], [(0, 0, 0), (1, 2, 0)])
    assert given.fields["header"] == {"stamp": {"ns": 2}, "frame_id": "map"}
    assert [p["header"]["stamp"]["ns"] for p in given.fields["poses"]] == [1, 2]
    assert encode.path("path", "map", [], []).fields["poses"] == []


@pytest.mark.parametrize(
    ("state", "level"),
    [("ok", encode.OK), ("degraded", encode.WARN), ("lost", encode.ERROR), ("new", encode.WARN)],
)
def test_health_is_a_status_of_diagnostics(state: str, level: int) -> None:
    given = encode.health_status(state, "no anchor A any more", 0.25, 0.5, (1.0, math.inf, 0.1))
    assert (given["level"], given["message"]) == (level, "no anchor A any more")
    values = {pair["key"]: pair["value"] for pair in given["values"]}
    assert values["within"] == "0.25"
    assert values["protection_y_m"] == "inf"


def test_what_comes_late_is_latched() -> None:
    static = encode.transforms([encode.transform(1, "a", "b", (0, 0, 0))], static=True)
    assert (static.topic, static.latched) == ("tf_static", True)
    assert not encode.transforms([]).latched
    assert encode.named_points("anchors", [], np.zeros((0, 3)), None, "map").latched


def test_nothing_to_say_is_an_empty_message() -> None:
    assert encode.uwb_ranges("uwb", []).fields["ranges"] == []
    assert encode.landmark_sightings("s", []).fields["sightings"] == []
    rows = [RangeRow(5, "t", "A", 1.0, None, ""), RangeRow(9, "t", "B", 1.0, None, "")]
    assert encode.uwb_ranges("uwb", rows).fields["header"]["stamp"] == {"ns": 9}
