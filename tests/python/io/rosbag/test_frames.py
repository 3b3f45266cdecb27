# SPDX-License-Identifier: Apache-2.0
"""Where sensors sit is read off static transforms, up and down their tree."""

from __future__ import annotations

import math

import pytest

from locfuse.io.rosbag import encode
from locfuse.io.rosbag.decode import MessageError, TransformRow, transforms
from locfuse.io.rosbag.frames import FrameTree, check_frame
from support_ros import message

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
HEAD_DOWN = (1.0, 0.0, 0.0, 0.0)  # half a turn about x
QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


def tree(*rows: TransformRow) -> FrameTree:
    found = FrameTree("/base_link")
    found.add(rows)
    return found


def test_a_mount_is_the_product_of_its_transforms() -> None:
    found = tree(TransformRow("base_link", "mast", 1.0, 0.0, 0.5, QUARTER),
                 TransformRow("mast", "laser", 2.0, 0.0, 0.25, QUARTER))  # fmt: skip
    mount = found.mount("/laser")
    assert mount[:3] == pytest.approx((1.0, 2.0, 0.75))
    assert abs(mount.heading) == pytest.approx(math.pi)
    assert found.mount("base_link") == (0.0, 0.0, 0.0, 0.0)


def test_a_mount_may_lie_on_another_branch() -> None:
    found = tree(TransformRow("base_footprint", "base_link", 0.0, 0.0, 0.1, UPRIGHT),
                 TransformRow("base_footprint", "laser", 0.3, 0.2, 0.4, UPRIGHT))  # fmt: skip
    assert found.mount("laser") == pytest.approx((0.3, 0.2, 0.3, 0.0))
    assert found.mount("base_footprint") == pytest.approx((0.0, 0.0, -0.1, 0.0))


def test_a_mount_published_at_once_keeps_every_bit() -> None:
    heading = 0.1 + 0.2
    given = encode.transform(1, "base_link", "laser", (0.1, 0.7, heading), 0.3)
    found = tree(*transforms(message(given)))
    assert found.mount("laser") == (0.1, 0.7, 0.3, heading)


def test_what_hangs_head_down_is_known_and_what_is_tilted_refused() -> None:
    hanging = tree(TransformRow("base_link", "laser", 0.0, 0.0, 1.0, HEAD_DOWN))
    assert hanging.upside_down("laser")
    assert not tree(TransformRow("base_link", "laser", 0, 0, 1, QUARTER)).upside_down("laser")
    pitched = (0.0, math.sin(0.25), 0.0, math.cos(0.25))
    with pytest.raises(MessageError, match="laser is tilted by 29 deg against base_link"):
        tree(TransformRow("base_link", "laser", 0.0, 0.0, 1.0, pitched)).upside_down("laser")


def test_a_frame_that_nothing_leads_to_is_named() -> None:
    found = tree(TransformRow("other", "laser", 1.0, 0.0, 0.0, UPRIGHT))
    assert "laser" not in found
    said = "no static transform leads from laser to base_link; publish it on tf_static"
    with pytest.raises(MessageError, match=said):
        found.mount("laser")
    with pytest.raises(MessageError, match="a frame without name"):
        found.mount("")


def test_transforms_in_a_loop_end() -> None:
    found = tree(TransformRow("b", "a", 0.0, 0.0, 0.0, UPRIGHT),
                 TransformRow("a", "b", 0.0, 0.0, 0.0, UPRIGHT))  # fmt: skip
    assert "a" not in found


def test_the_last_transform_of_a_frame_counts() -> None:
    found = tree(TransformRow("base_link", "laser", 1.0, 0.0, 0.0, UPRIGHT),
                 TransformRow("base_link", "/laser", 2.0, 0.0, 0.0, UPRIGHT))  # fmt: skip
    assert found.mount("laser").x == 2.0


def test_a_frame_is_the_expected_one_or_none() -> None:
    check_frame("poses", "/map", "map")
    check_frame("poses", "", "map")
    with pytest.raises(
        MessageError, match=r"poses are in frame 'odom', expected 'map'; see ros.fr"
    ):
        check_frame("poses", "odom", "/map")
