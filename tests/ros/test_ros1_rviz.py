# SPDX-License-Identifier: Apache-2.0
"""rviz with the configuration that is shipped shows map, scan, pose with covariance and path.

The picture is left in build/ros1/rviz.png; the one in docs/images is such a one.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ros1_peer import started, wait_for

pytestmark = pytest.mark.usefixtures("ros1")

ROOT = Path(__file__).resolve().parents[2]
SEEN_S = 10.0  # of the drive, before the picture is taken
# What is drawn, in the colours of localize.rviz, which light and transparency blend.
COLOURS = {
    "wall": ((72, 72, 70), 12),
    "free": ((250, 250, 250), 6),
    "scan": ((204, 0, 0), 30),
    "path": ((32, 74, 135), 25),
    "pose": ((215, 110, 10), 45),
    "heading's sigma": ((246, 240, 170), 25),
}
LEAST = {"wall": 2000, "free": 20_000, "scan": 300, "path": 300, "pose": 60, "heading's sigma": 20}
DEMO = ROOT / "ros1" / "locfuse_ros" / "config" / "demo.yaml"


def picture(folder: Path) -> np.ndarray:
    """Return the screen (height, width, 3) that Xvfb keeps in a file in the format of xwd."""
    data = (folder / "Xvfb_screen0").read_bytes()
    head = np.frombuffer(data[:100], ">u4").astype(int)
    width, height, line, colours = head[4], head[5], head[12], head[19]
    begin = head[0] + 12 * colours
    pixels = np.frombuffer(data[begin : begin + line * height], np.uint8)
    return pixels.reshape(height, line // 4, 4)[:, :width, 2::-1]


def seen(image: np.ndarray) -> dict[str, int]:
    """Return how many pixels of the drawing have each colour; the panels are left out."""
    drawing = image[60:, 360:].astype(int)
    return {
        name: int((np.abs(drawing - colour).max(axis=2) <= near).sum())
        for name, (colour, near) in COLOURS.items()
    }


def test_all_is_shown(tmp_path: Path) -> None:
    import rospy

    screen = ["Xvfb", ":77", "-screen", "0", "1200x720x24", "-nolisten", "tcp", "-fbdir",
              str(tmp_path)]  # fmt: skip
    os.environ |= {"DISPLAY": ":77", "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"}
    launch = ["roslaunch", "locfuse_ros", "replay.launch", f"config:={DEMO}", "rviz:=true",
              "speed:=2"]  # fmt: skip
    try:
        with started(screen, tmp_path / "xvfb.log"):
            wait_for("a screen", (tmp_path / "Xvfb_screen0").exists)
            time.sleep(1.0)
            empty = seen(picture(tmp_path))
            with started(launch, tmp_path / "launch.log"):
                wait_for("all in rviz", lambda: is_all(seen(picture(tmp_path))), 90.0)
                time.sleep(SEEN_S)
                image = picture(tmp_path)
    finally:
        rospy.delete_param("/use_sim_time")
    Image.fromarray(np.ascontiguousarray(image)).save(ROOT / "build" / "ros1" / "rviz.png")
    assert not is_all(empty)
    assert is_all(seen(image)), seen(image)


def is_all(counts: dict[str, int]) -> bool:
    return all(counts[name] >= least for name, least in LEAST.items())
