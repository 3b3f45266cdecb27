# SPDX-License-Identifier: Apache-2.0
"""Robots that the studio sets up: in a folder each, one at a time, and no file but theirs."""

from __future__ import annotations

from pathlib import Path

import pytest

from locfuse.config.load import parse_config
from locfuse.io.log_folder import write_log
from locfuse.run.run import load_log
from locfuse.studio.setups import Setups

ENOUGH_S = 120.0


def recorded(folder: Path) -> Path:
    drive = {"path": {"shape": "waypoints"}, "poses": None, "duration_s": 40}
    write_log(load_log(parse_config({"simulation": drive}), None, 1), folder)
    return folder


def test_a_robot_has_a_folder_of_its_own(tmp_path: Path) -> None:
    setups = Setups(tmp_path / "robots")
    assert setups.names() == []
    for name in ("drive", "drive-2"):
        assert setups.start(recorded(tmp_path / "drive")) == name
        with pytest.raises(ValueError, match="a robot is being set up"):
            setups.start(tmp_path / "drive")
        setups.wait(ENOUGH_S)
        assert setups.error == ""
    assert setups.names() == ["drive-2", "drive"]
    report = setups.file_of("drive", "report.html")
    assert report == tmp_path / "robots" / "drive" / "report.html"
    assert setups.file_of("drive", "drive/report.html") is not None
    secret = tmp_path / "robots" / "drive" / "map.png"
    secret.symlink_to(tmp_path / "drive" / "odometry.csv")
    for name, file in (("drive", "map.png"), ("drive", "world/anchors.csv"), ("..", "report.html"),
                       ("absent", "report.html")):  # fmt: skip
        assert setups.file_of(name, file) is None


def test_what_goes_wrong_is_one_sentence_and_leaves_no_robot(tmp_path: Path) -> None:
    setups = Setups(tmp_path / "robots")
    (tmp_path / "empty").mkdir()
    setups.start(tmp_path / "empty")
    setups.wait(ENOUGH_S)
    assert "no message, expected rows" in setups.error
    assert setups.names() == []


def test_it_can_be_cancelled(tmp_path: Path) -> None:
    setups = Setups(tmp_path / "robots")
    setups.start(recorded(tmp_path / "drive"))
    setups.cancel()
    setups.wait(ENOUGH_S)
    assert setups.error == ""
    assert not setups.busy
    assert setups.names() == []
