# SPDX-License-Identifier: Apache-2.0
"""Readers of published datasets name the line that is wrong, or the file that is missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from locfuse.types import LogError
from papers.datasets import convert
from support_recordings import damaged
from support_runs import recording

SCANS, REFERENCE = "scans.csv.gz", "reference.csv.gz"
WALK = "filtering_state_estimation1"
DAMAGES = [
    ("wean_hall", "robotdata1.log.gz", 3, "O 1 2 0.5", ", line 3: 4 fields, expected 5"),
    ("wean_hall", "robotdata3.log.gz", 1, "L 1 2 3 4 5 6 7", ", line 1: 8 fields, expected 188"),
    ("wean_hall", "robotdata1.log.gz", 4, "O 1 2 nan 0.2", ", line 4: .*nan"),
    ("wean_hall", "robotdata1.log.gz", 5, "P 1 2 3 0.2", ", line 5: begins with 'P 1 2 3 0.', exp"),
    ("wean_hall", "reference_robotdata1.csv.gz", 7, "1.1,2,nan,3", ", line 7: .*nan"),
    ("turtlebot4_mac", "odometry.csv.gz", 9, "1,2,3", ", line 9: 3 fields, expected 6"),
    ("turtlebot4_mac", SCANS, 2, "0.0,1,2", ", line 2: 3 fields, expected 721"),
    ("turtlebot4_mac", SCANS, 2, "0.0" + 720 * ",nan", ", line 2: .*nan"),
    ("turtlebot4_mac", REFERENCE, 3, "0.1,nan,2,3", ", line 3: .*nan"),
    ("intel_lab", "odometry.csv.gz", 4, "7,0.3,0,0,0", ", line 4: raw_index is 7, expected 2"),
    ("intel_lab", "trajectory_refined.csv.gz", 4, "", ", line 5: raw_index is 3, expected 2"),
    ("intel_lab", "trajectory_refined.csv.gz", 13632, "",
     ", line 13631: the last of 13630 rows, expected 13631"),
    ("intel_lab", SCANS, 2, "13631,0,0" + 180 * ",1",
     ", line 2: raw_index is 13631, expected one of 0 to 13630"),
    ("intel_lab", SCANS, 2, "1,0,2" + 180 * ",1",
     ", line 2: mapping_keyframe is 2, expected 0 or 1"),
    ("intel_lab", SCANS, 2, "1,0,0" + 180 * ",nan", ", line 2: .*nan"),
    ("intel_lab", "relations.csv.gz", 6, "1,2,3", ", line 6: 3 fields, expected 5"),
    ("intel_lab", "relations.csv.gz", 6, "57.559628,99.99,1,2,3",
     r", line 6: t2_s is 99\.990000, the time of no odometry row"),
    ("utias_tubes", "log.csv.gz", 3, "1,2", ", line 3: 2 fields, expected 41"),
    ("utias_tubes", "landmarks.csv", 1, "id,x,y", ", line 1: expected the header id,x_m,y_m"),
    ("utias_tubes", "parameters.csv", 2, "1,2,3,4,nan", ", line 2: .*nan"),
    ("mrclam6", "Robot3_Odometry.dat.gz", 9, "1248444188 0.1", ", line 9: 2 fields, expected 3"),
    ("mrclam6", "Robot5_Measurement.dat.gz", 5, "1248444196 5 nan 0", ", line 5: .*nan"),
    ("mrclam6", "Barcodes.dat", 6, "1 2 3", ", line 6: 3 fields, expected 2"),
    ("acfr_carpark", "laser_ranges.csv.gz", 2, "45.1,1,2", ", line 2: 3 fields, expected 362"),
    ("acfr_carpark", "laser_intensity.csv.gz", 2, "45.0" + 361 * ",0",
     ": stamps or beams differ from those of laser_ranges"),
    ("acfr_carpark", "drive.csv.gz", 2, "45.0,inf,0", ", line 2: .*inf"),
    ("lego_arena", "robot4_motors.txt", 3, "S 735" + 12 * " 1", ", row 3: begins with 'S', exp"),
    ("lego_arena", "robot4_scan.txt.gz", 2, "S 551 660 190", ", line 2: 4 fields, expected 663"),
    ("lego_arena", "robot4_reference.txt", 2, "P 494 1853 nan", ", line 2: .*nan"),
    ("victoria_park", "trees_reference_detector.csv.gz", 2, "0.8,1,2", ", line 2: 3 fields, exp"),
    ("victoria_park", "gps.csv.gz", 1, "t,x,y", ", line 1: expected the header t_s,x_m,y_m"),
    ("rcv_uwb_drone", "seq3_ranges.csv.gz", 4, "1,2,3", ", line 4: 3 fields, expected 11"),
    ("rcv_uwb_drone", "seq5_groundtruth.csv.gz", 2, "0,0,0,nan,0,0,0,1", ", line 2: .*nan"),
    ("rcv_uwb_drone", "seq1_anchors.csv", 1, "a,b", ", line 1: expected the header anchor,x,y,z"),
    ("starloc", "loop-2d_s5_uwb.csv.gz", 3, "1,2", ", line 3: 2 fields, expected 15"),
    ("starloc", "loop-2d-fast_s1_anchors.csv", 2, "4,1,2,inf", ", line 2: .*inf"),
    ("hanyang_outdoor", "los_b3_ranges.csv.gz", 3, "1,2", ", line 3: 2 fields, expected 8"),
    ("hanyang_outdoor", "nlos_a1_groundtruth.csv", 2, "0,1,nan,0,0", ", line 2: .*nan"),
    ("inrol_uwb_imu", f"{WALK}_uwb.csv.gz", 2, "0,0.1,4", ", line 2: 3 fields, expected 4"),
    ("inrol_uwb_imu", f"{WALK}_anchors.csv", 2, "1,inf,0,0,0,0,0,1", ", line 2: .*inf"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "file", "line", "text", "message"), DAMAGES)
def test_a_damaged_line_is_named_and_nothing_is_written(
    name: str, file: str, line: int, text: str, message: str, tmp_path: Path
) -> None:
    source = damaged(recording(name.replace("_", "-")), tmp_path / "source", file, line, text)
    with pytest.raises(LogError, match=rf"{file}{message}"):
        convert(name, source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("utias_tubes", "parameters.csv"),
        ("mrclam6", "Robot3_Groundtruth.dat.gz"),
        ("mrclam6", "Landmark_Groundtruth.dat"),
        ("acfr_carpark", "beacons.csv"),
        ("lego_arena", "robot_arena_landmarks.txt"),
        ("victoria_park", "laser.csv.gz"),
        ("rcv_uwb_drone", "seq5_anchors.csv"),
        ("starloc", "loop-2d_s5_anchors.csv"),
        ("hanyang_outdoor", "nlos_b3_ranges.csv.gz"),
        ("inrol_uwb_imu", f"{WALK}_imu_pose.csv.gz"),
        *(("wean_hall", f) for f in ("reference_robotdata3.csv.gz", "wean_map.yaml",
                                     "wean_map.pgm")),
        *(("intel_lab", f) for f in ("odometry.csv.gz", SCANS, "relations.csv.gz",
                                     "trajectory_refined.csv.gz", "intel_map.yaml")),
        *(("turtlebot4_mac", f) for f in ("odometry.csv.gz", SCANS, REFERENCE,
                                          "mac_1st_floor_final.pgm")),
    ],
)  # fmt: skip
def test_a_missing_file_is_named_and_nothing_is_written(
    name: str, file: str, tmp_path: Path
) -> None:
    source = damaged(recording(name.replace("_", "-")), tmp_path / "source", file)
    with pytest.raises(LogError, match=rf"{file}: no such file"):
        convert(name, source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_anchor_that_is_missing_is_reported_and_nothing_is_written(tmp_path: Path) -> None:
    folder = recording("ieu-gazebo-uwb-lidar")
    source = damaged(folder, tmp_path / "source", "home_anchors.csv", 3)
    with pytest.raises(LogError, match=r"home_anchors.csv: 3 anchors, .* columns of ranges, 4"):
        convert("ieu_gazebo", source, tmp_path / "out")
    assert not (tmp_path / "out").exists()
