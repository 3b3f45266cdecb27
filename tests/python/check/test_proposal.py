# SPDX-License-Identifier: Apache-2.0
"""A configuration that is proposed for a recording runs, and says where its values come from."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from locfuse.check.proposal import proposal
from locfuse.config.load import load_config, parse_config
from locfuse.config.ros import Ros, Topics
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.run.run import load_log, run
from locfuse.types import Log, LogError


def log_of(**changes: Any) -> Log:
    simulation = {"duration_s": 40, "ranges": {"rate_hz": 5, "sigma_m": 0.2, "sigma_relative": 0},
                  "poses": None, **changes}  # fmt: skip
    return load_log(parse_config({"simulation": simulation, "seed": 4}), None, 4)


def without_sigma(log: Log) -> Log:
    ranges = {key: column for key, column in log["ranges"].items() if key != "sigma_m"}
    return replace(log, tables={**log.tables, "ranges": ranges})


def test_values_are_those_of_the_data(tmp_path: Path) -> None:
    write_log(without_sigma(log_of()), tmp_path / "drive")
    text = proposal(tmp_path / "drive", tmp_path).text
    settings = yaml.safe_load(text)
    assert settings["log"] == "drive"
    assert settings["start"] == "truth"
    assert settings["estimator"]["range"]["sigma_m"] == pytest.approx(0.2, rel=0.2)
    assert all(re.search(r":$|: .*# ", line) for line in text.splitlines() if line[:1] not in "#")
    (tmp_path / "drive.yaml").write_text(text)
    config = load_config(tmp_path / "drive.yaml")
    assert run(config, base=tmp_path).metrics["nees_mean"] < 4.0


def test_a_robot_without_a_reference_starts_by_itself(tmp_path: Path) -> None:
    log = without_sigma(log_of(ranges={"rate_hz": 0.2}))
    tables = {key: table for key, table in log.tables.items() if key != "truth"}
    write_log(replace(log, tables=tables), tmp_path / "drive")
    text = proposal(tmp_path / "drive", tmp_path).text
    settings = yaml.safe_load(text)
    assert settings["start"] == "auto"
    assert settings["estimator"]["range"]["sigma_m"] == 0.3
    assert "a guess: too few ranges" in text


def test_scans_on_a_map_ask_for_particles(tmp_path: Path) -> None:
    write_log(log_of(laser={"rate_hz": 2}, map={}, ranges=None), tmp_path / "drive")
    assert yaml.safe_load(proposal(tmp_path / "drive", tmp_path).text)["mcl"] == {}


@pytest.mark.parametrize("has_truth", [True, False])
def test_altitudes_ask_for_a_flight(has_truth: bool, tmp_path: Path) -> None:
    log = log_of(flight={}, altitudes={}, laser={"rate_hz": 2}, map={})
    tables = {key: table for key, table in log.tables.items() if has_truth or key != "truth"}
    write_log(replace(log, tables=tables), tmp_path / "drive")
    text = proposal(tmp_path / "drive", tmp_path).text
    settings = yaml.safe_load(text)
    assert settings["estimator"]["kind"] == "air"
    assert settings["estimator"]["air"] == {"motion": "odometry"}
    assert settings["start"] == ("truth" if has_truth else [0.0, 0.0, 0.0])
    assert "mcl" not in settings
    (tmp_path / "drive.yaml").write_text(text)
    assert run(load_config(tmp_path / "drive.yaml"), base=tmp_path).estimate.height is not None


def test_topics_of_a_bag_are_found_by_their_types(tmp_path: Path) -> None:
    topics = Topics(odometry="husky/wheels", ranges="decawave")
    config = parse_config({"estimator": {"range": {"sigma_m": 0.2}}})
    write_bag(run(config, log_of()), tmp_path / "drive.mcap", Ros(topics=topics))
    text = proposal(tmp_path / "drive.mcap", tmp_path / "configs").text
    settings = yaml.safe_load(text)
    assert settings["log"] == str(tmp_path / "drive.mcap")
    assert settings["ros"]["topics"] == {"odometry": "husky/wheels", "ranges": "decawave"}
    assert "found: nav_msgs/Odometry" in text


def test_what_check_finds_stands_at_the_end(tmp_path: Path) -> None:
    log = log_of()
    ranges = {**log["ranges"], "range_m": 1000.0 * log["ranges"]["range_m"]}
    write_log(replace(log, tables={**log.tables, "ranges": ranges}), tmp_path / "drive")
    assert "# error: " in proposal(tmp_path / "drive", tmp_path).text


def test_a_log_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match="no message"):
        proposal(tmp_path / "empty", tmp_path)
