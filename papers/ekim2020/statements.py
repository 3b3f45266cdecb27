# SPDX-License-Identifier: Apache-2.0
"""What ekim2020 reports."""

from __future__ import annotations

from papers.page.paper import Paper, Statement

_PATHS = ("circle", "eight", "square", "star", "waypoints")
_SIZES = ("2d_5", "2d_8", "3d_5", "3d_8")

PAPER = Paper(
    "ekim2020",
    "P. Oguz Ekim, 2020: Localization and initialization algorithms based on UWB, LiDAR and "
    "odometry",
    "A robot that is switched on anywhere finds itself by ranges and one scan, then an EKF fuses "
    "odometry, ranges and the poses of another localizer.",
    seeds=100,
    quick_seeds=12,
    statements=(
        Statement(
            "2.2.1, eq. 13", "start position from squared ranges",
            "SR-LS tells it, simply enough for a robot (no figure)",
            tuple(f"start_{size}_srls_bound" for size in _SIZES),
            lambda *over_bound: max(over_bound) <= 1.25,
            "start_bound",
            "at most a quarter above the Cramer-Rao bound; squares of ranges weigh far anchors "
            "more, which weights undo",
        ),
        Statement(
            "2.2.2, Table 1", "start heading from one scan",
            "the scan, turned in steps of 10 degrees, fits the map best at the robot's heading",
            ("start_search_paper", "start_gazebo_heading", "start_search_gain"),
            lambda search, ours, gain: search <= 5.0,
            "start_searches",
            "within half a step, and no finer than that",
        ),
        Statement(
            "2.3", "anchors that fail",
            "sensors may fail at random, and a wrong range has to be detected",
            ("start_culprit", "start_false_alarms"),
            lambda named, alarms: named >= 99.0 and alarms <= 2.6,
        ),
        Statement(
            "2.3, Fig. 2; abstract", "error of the EKF in simulation, several paths",
            "RMSE of 3 cm",
            tuple(f"room_{path}_rmse" for path in _PATHS),
            lambda *rmse: max(rmse) <= 3.0,
            "room_paths",
        ),
        Statement(
            "2.3, Fig. 2; abstract", "against AMCL alone",
            "6 cm, so almost twice as accurate",
            tuple(f"room_{path}_gain" for path in _PATHS),
            lambda *gain: min(gain) >= 2.0,
            "room_paths",
        ),
        Statement(
            "2.3, 3.1, Figs. 3 and 6a", "pose found on switching on",
            "scan and map fit almost perfectly after it (no figure)",
            ("start_gazebo_right", "start_gazebo_wrong", "start_gazebo_position_p95",
             "start_gazebo_heading_p95", "start_office"),
            lambda right, wrong, position, heading, office: (
                right >= 99.0 and wrong <= 0.2 and position <= 3.0 and heading <= 2.0
                and office >= 98.0),
            "start_ambiguous",
        ),
        Statement(
            "3.1, Fig. 7", "a start whose heading is 10 degrees wrong",
            "the robot ends in a totally wrong pose; with a good start it reaches the goal",
            ("start_bad_odometry", "start_bad_auto", "start_bad_filter"),
            lambda wrong, good, with_ranges: wrong > 10.0 * good,
            "start_bad",
            "by odometry alone; a filter that fuses ranges recovers",
        ),
        Statement(
            "3.2, Fig. 9", "when AMCL gives no pose",
            "the EKF goes on telling where the robot is (no figure)",
            ("ieu_run3_rmse", "ieu_straight_rmse", "ieu_home_rmse", "office_rmse"),
            lambda *rmse: max(rmse[:3]) <= 0.03 and rmse[3] <= 0.15,
            remark="odometry and ranges alone: Gazebo runs of the paper's authors, a real office",
        ),
    ),
    captions={
        "room_paths": "One drive in the simulated room: truth, the poses of the localizer that "
        "stands for AMCL, and the EKF on all of them, ranges and wheels; beside it their errors.",
        "start_bound": "Error of three solvers of a position from ranges over the noise of a "
        "range, and the Cramer-Rao bound, which no unbiased one beats.",
        "start_ambiguous": "Switched on in the middle of a square room: left, the poses that fit "
        "one scan; right, the one that is left once the robot has moved.",
        "start_searches": "Heading error of the search in steps of ten degrees and of ours, over "
        "the power-ups of the Gazebo recordings.",
        "start_bad": "What a start that is told a wrong heading costs: by odometry alone, with "
        "ranges, and started from nothing.",
    },
)  # fmt: skip
