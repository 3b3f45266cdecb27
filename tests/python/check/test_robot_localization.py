# SPDX-License-Identifier: Apache-2.0
"""Configurations of robot_localization become ours, and say what has no counterpart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from locfuse.check.robot_localization import from_robot_localization
from locfuse.config.load import parse_config
from locfuse.types import ConfigError
from support_runs import locfuse


def switches(*on: int) -> list[bool]:
    return [index in on for index in range(15)]


WHEELS = {"odom0": "wheel/odometry", "odom0_config": switches(6, 7, 11)}
IMU = {"imu0": "imu/data", "imu0_config": switches(5, 11, 12), "imu0_relative": False,
       "imu0_remove_gravitational_acceleration": True}  # fmt: skip
OUTDOORS = {
    "ekf_filter_node_odom": {
        "ros__parameters": {"frequency": 30.0, "two_d_mode": True, "world_frame": "odom",
                            **WHEELS, **IMU},
    },
    "ekf_filter_node_map": {
        "ros__parameters": {
            "frequency": 30.0, "sensor_timeout": 0.1, "two_d_mode": True, "publish_tf": True,
            "map_frame": "map", "odom_frame": "odom", "base_link_frame": "base_footprint",
            "world_frame": "map", **WHEELS, "odom1": "odometry/gps",
            "odom1_config": switches(0, 1), "odom1_queue_size": 10,
            "odom0_twist_rejection_threshold": 2.0, **IMU,
            "process_noise_covariance": [0.05] * 225,
        },
    },
    "navsat_transform": {
        "ros__parameters": {"magnetic_declination_radians": 0.04, "yaw_offset": 1.5707963,
                            "zero_altitude": True, "wait_for_datum": True,
                            "datum": [55.944904, -3.186693, 0.5]},
    },
}  # fmt: skip


def made_of(given: dict[str, Any]) -> tuple[dict[str, Any], str]:
    text = from_robot_localization(yaml.safe_dump(given))
    settings = yaml.safe_load(text)
    parse_config(settings)
    return settings, text


def test_wheels_imu_and_gps() -> None:
    settings, text = made_of(OUTDOORS)
    assert settings["use"] == ["odometry", "positions", "imu", "headings"] or set(
        settings["use"]
    ) == {"odometry", "positions", "imu", "headings"}
    ros = settings["ros"]
    assert ros["topics"] == {"odometry": "wheel/odometry", "imu": "imu/data",
                             "headings": "imu/data", "positions": "gps/fix"}  # fmt: skip
    assert ros["odometry_from"] == "twist"
    assert ros["frames"] == {"base": "base_footprint"}
    assert ros["gps_origin"] == pytest.approx([55.944904, -3.186693, 28.6478898])
    assert settings["estimator"]["heading"]["offset_rad"] == pytest.approx(-1.6107963)
    assert settings["start"] == "auto"
    for said in ("ekf_filter_node_odom", "odometry/gps", "frequency", "process_noise_covariance",
                 "accelerations are not fused", "rejection_threshold"):  # fmt: skip
        assert said in text.split("# Without counterpart:")[1]


def test_parameters_of_ros_1_without_a_node() -> None:
    settings, text = made_of({**WHEELS, "two_d_mode": True, "pose0": "amcl_pose",
                              "pose0_config": switches(0, 1, 5), "pose0_differential": False,
                              "initial_state": [1.0, 2.0, 0, 0, 0, 3.14159265] + [0] * 9,
                              "smooth_lagged_data": True, "history_length": 5.0,
                              "transform_time_offset": 0.2})  # fmt: skip
    assert set(settings["use"]) == {"odometry", "poses"}
    assert settings["start"] == pytest.approx([1.0, 2.0, 180.0])
    assert settings["history_s"] == 5.0
    assert settings["ros"]["transform_ahead_s"] == 0.2
    assert "Without counterpart" not in text


def test_what_one_filter_cannot_have_is_said() -> None:
    _, text = made_of({**WHEELS, "odom1": "visual", "odom1_config": switches(6),
                       "twist0": "cmd", "twist0_config": switches(6), "two_d_mode": False,
                       "pose0": "yaw", "pose0_config": switches(5)})  # fmt: skip
    missing = text.split("# Without counterpart:")[1]
    for said in ("odom1 (visual)", "twist0 (cmd)", "two_d_mode", "pose0 (yaw)", "start:"):
        assert said in missing


def test_wheels_that_report_positions_count_by_increments() -> None:
    settings, _ = made_of({"odom0": "odom", "odom0_config": switches(0, 1, 5)})
    assert settings["ros"]["odometry_from"] == "pose"


@pytest.mark.parametrize(
    ("text", "said"),
    [("{", "no YAML"), ("a: 1", "no odom0"), ("[1]", "a mapping"), ("x: {imu0: a, imu0_config: 3}",
     "imu0_config is 3")],
)  # fmt: skip
def test_other_files_are_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        from_robot_localization(text)


def test_the_command_writes_a_configuration_that_loads(tmp_path: Path) -> None:
    (tmp_path / "ekf.yaml").write_text(yaml.safe_dump(OUTDOORS), encoding="utf-8")
    out = tmp_path / "config.yaml"
    command = ("config", "from-robot-localization", str(tmp_path / "ekf.yaml"), "--out", str(out))
    made = locfuse(*command)
    assert made.status == 0
    assert "Without counterpart" in made.out
    parse_config(yaml.safe_load(out.read_text(encoding="utf-8")))
    again = locfuse(*command)
    assert again.status != 0
    assert "is there already" in again.err
    missing = str(tmp_path / "no.yaml")
    refused = locfuse("config", "from-robot-localization", missing, "--out", str(tmp_path / "a"))
    assert refused.status != 0
    assert "cannot be read" in refused.err
