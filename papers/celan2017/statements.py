# SPDX-License-Identifier: Apache-2.0
"""What celan2017 reports: Tables II and III, and words about them."""

from __future__ import annotations

from papers.page.paper import Paper, Statement


def _end(of: str) -> tuple[str, ...]:
    return tuple(f"celan_{of}_end{of_what}" for of_what in ("", "_x", "_y", "_heading"))


def _eight(of: str) -> tuple[str, ...]:
    return tuple(f"celan_eight_{of}_{axis}" for axis in "xy")


PAPER = Paper(
    "celan2017",
    "V. Celan, I. Stancic and J. Music, 2017: Ultra wideband assisted localization of "
    "semi-autonomous floor scrubber",
    "Three UWB tags on one body, and a switch that rescues a lost laser localizer.",
    seeds=20,
    quick_seeds=3,
    statements=(
        Statement(
            "V.A, Table II, Fig. 9", "a lap of 200 m by odometry",
            "ends 19 m off: it drifts considerably",
            _end("odometry"),
            lambda end, *rest: 9.0 <= end <= 38.0,
            "celan_laps",
            "taken as within twice and half of it",
        ),
        Statement(
            "V.A, Table II, Fig. 10", "by LiDAR and AMCL",
            "ends 0.78 m off: more accurate, the choice of primary localizer",
            _end("lidar"),
            lambda end, *rest: end <= 0.78,
            "celan_laps",
        ),
        Statement(
            "V.B, Fig. 11", "UWB against the LiDAR",
            "matches closely in range, but errs more behind walls",
            ("celan_covered_p95", "celan_covered_ranges_p95"),
            lambda without, always: always > without,
            "celan_radios",
            "taken as: UWB that always has a say, behind walls too, makes a lap worse",
        ),
        Statement(
            "V.B, Table II, Fig. 12", "half of the LiDAR covered",
            "ends 2.22 m off, and goes through a wall on the way",
            (*_end("covered"), "celan_covered_lost"),
            lambda end, x, y, heading, lost: end > 1.0,
            "celan_laps",
            "the particle filter here is not lost by it; a wet hall is what loses it (below)",
        ),
        Statement(
            "V.B, Table II, Fig. 13", "UWB put in where it is unsure",
            "ends 0.08 m off",
            _end("covered_switch"),
            lambda end, *rest: end <= 0.1,
            "celan_doubt",
        ),
        Statement(
            "V.B, Fig. 14", "uncertainty with the cover",
            "larger than without it",
            ("celan_covered_sigma_0", "celan_lidar_sigma_0"),
            lambda covered, lidar: covered > lidar,
            "celan_sigmas",
        ),
        Statement(
            "V.B, Fig. 14", "uncertainty ahead and to the side",
            "up to six times as large ahead (variance)",
            ("celan_covered_sigma_0", "celan_covered_sigma_1"),
            lambda ahead, aside: ahead > aside,
            "celan_sigmas",
        ),
        Statement(
            "V.C, Table III", "eights by odometry",
            "RMSE of 1.00 m in x, 3.19 m in y",
            _eight("odometry"),
            lambda x, y: y > x,
            "celan_eight",
            "worse along y; wheels here drift less in three minutes",
        ),
        Statement(
            "V.C, Table III", "eights by UWB",
            "1.10 m in x, 0.96 m in y",
            (*_eight("uwb"), *_eight("uwb_late")),
            lambda x, y, late_x, late_y: 0.5 <= x <= 2.2,
            "celan_eight",
            "taken as within twice and half of it; an RTLS that is 3 s late, as theirs seems to "
            "be, explains most of theirs",
        ),
        Statement(
            "V.C, Table III", "eights by the EKF of 12 states",
            "1.05 m in x, 0.91 m in y: better than UWB alone in both, odometry worst along y",
            (*_eight("triangle"), *_eight("uwb"), "celan_eight_triangle_better",
             "celan_eight_rigid_better"),
            lambda x, y, uwb_x, uwb_y, better, rigid: x < uwb_x and y < uwb_y,
            "celan_eight",
        ),
        Statement(
            "VI", "gain of the switch where the LiDAR is suboptimal",
            "up to 25 times in position",
            ("celan_switch_gain",),
            lambda gain: gain >= 25.0,
            "celan_doubt",
            "of laps that are lost without it, in a wet hall",
        ),
        Statement(
            "VI", "gain of the switch in heading",
            "twice as accurate (15.1 to 6.9 degrees)",
            ("celan_covered_end_heading", "celan_covered_switch_end_heading"),
            lambda without, with_: with_ <= 0.5 * without,
            remark="nothing to gain where half a LiDAR is enough",
        ),
    ),
    captions={
        "celan_laps": "A lap by six set-ups on the map, estimate and truth, with the error at the "
        "end: wheels alone drift away, a LiDAR does not, and in a wet hall half of one does.",
        "celan_radios": "A lap by LiDAR, and what UWB says in its reach: close in the room with "
        "the anchors, off behind walls.",
        "celan_doubt": "The end of a lap through a wet hall, in the room with the anchors: "
        "ellipses of two sigmas, and what each injection put in place of what.",
        "celan_sigmas": "Standard deviations ahead and to the side over a lap; grey: in the room "
        "with the anchors.",
        "celan_eight": "22 s of an eight: truth, wheels, UWB, and three filters.",
    },
)  # fmt: skip
