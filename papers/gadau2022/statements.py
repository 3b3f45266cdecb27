# SPDX-License-Identifier: Apache-2.0
"""What gadau2022 reports: no table, but observations in words and pictures."""

from __future__ import annotations

from papers.page.paper import Paper, Statement

_PATHS = ("circle", "star", "square", "pentagon", "random")
_SPEEDS = ("0", "0.3", "1")

PAPER = Paper(
    "gadau2022",
    "A. Gadau and others, 2022: Aerial localization using the extended Kalman filter",
    "Ranges and bearings to landmarks, recognition, GPS, kidnapping; the authors' filter diverges "
    "where ours has to converge.",
    seeds=100,
    quick_seeds=12,
    statements=(
        Statement(
            "IV.A.1, Fig. 4", "GPS, right start, circle",
            "almost at once on the robot's way",
            ("gadau_by_GPS_right_rmse",),
            lambda rmse_cm: rmse_cm < 50.0,
            "gadau_sensors",
            "taken as nearer than a single fix, 50 cm per axis",
        ),
        Statement(
            "IV.A.1, Fig. 5", "GPS, wrong start",
            "approaches the robot's way in a short time",
            ("gadau_by_GPS_wrong_rmse", "gadau_by_GPS_right_rmse"),
            lambda wrong, right: wrong <= 1.5 * right,
            "gadau_sensors",
        ),
        Statement(
            "IV.A.2; V", "one landmark, wrong start",
            "too few: the prediction does not come to the real pose",
            ("gadau_one", "gadau_one_error"),
            lambda converges, error: converges < 50.0,
            "gadau_start",
        ),
        Statement(
            "IV.A.2", "two landmarks, wrong start",
            "better, but still too few",
            ("gadau_two", "gadau_two_time", "gadau_two_error"),
            lambda converges, after, error: converges < 50.0,
            "gadau_start",
            "ranges and bearings of two tell the pose",
        ),
        Statement(
            "IV.A.2; V", "three landmarks in a triangle, wrong start",
            "comes to the real pose after some time, with good accuracy",
            ("gadau_triangle", "gadau_triangle_time", "gadau_triangle_error"),
            lambda converges, after, error: converges >= 99.0,
            "gadau_start",
        ),
        Statement(
            "Abstract; V", "three landmarks: a triangle",
            "better than another arrangement of three",
            ("gadau_triangle_right_rmse", "gadau_line_right_rmse"),
            lambda triangle, line: triangle < 0.9 * line,
            remark="taken as a tenth better; bearings tell the sides of a line apart",
        ),
        Statement(
            "IV.A.2", "four landmarks in a square, near",
            "more accurate than three, and after a little time",
            ("gadau_square_near", "gadau_square_near_right_rmse", "gadau_triangle_right_rmse"),
            lambda converges, four, three: converges >= 99.0 and four < three,
            "gadau_start",
        ),
        Statement(
            "IV.A.2", "more than four landmarks, far away",
            "works, too",
            ("gadau_five_far", "gadau_five_far_error"),
            lambda converges, error: converges >= 99.0,
            "gadau_start",
        ),
        Statement(
            "V", "more than four landmarks",
            "hardly any difference any more",
            ("gadau_square_near_right_rmse", "gadau_five_far_right_rmse"),
            lambda four, five: abs(five - four) <= 0.1 * four,
        ),
        Statement(
            "IV.A.3; V", "circle, star, pentagon, random path",
            "works well on every path",
            tuple(f"gadau_path_{path}" for path in _PATHS),
            lambda *converges: min(converges) >= 99.0,
        ),
        Statement(
            "IV.A.3", "time until it comes to the real pose",
            "changes with the path",
            tuple(f"gadau_path_{path}_time" for path in _PATHS),
            lambda *after: max(after) > min(after),
            remark="by tenths of a second",
        ),
        Statement(
            "IV.A.4, Fig. 7; V", "carried off to another place",
            "a Gaussian is sure to be where it was: the EKF does not find itself again",
            ("gadau_kidnapped_triangle_named", "gadau_kidnapped_triangle_named_after",
             "gadau_kidnapped_triangle_alone", "gadau_kidnapped_triangle_found"),
            lambda named, after, alone, ours: named < 50.0,
            "gadau_kidnapped",
            "asked of the first row, a filter that is told which landmark is which and gates "
            "nothing, as theirs: large residuals pull it over; without names it is lost for good, "
            "unless it notices",
        ),
        Statement(
            "IV.B.1, Figs. 3, 8 and 9", "landmarks recognized by single rays",
            "seems to work fine",
            ("gadau_rule_found", "gadau_rule_right", "gadau_rule_found_off",
             "gadau_rule_right_off"),
            lambda found, right, found_off, right_off: found >= 95.0 and right >= 95.0,
            remark="asked of the true pose; of one that is 0.3 m off it misses every other disc",
        ),
        Statement(
            "IV.B.2, Figs. 10 and 11", "second simulator: driving",
            "the estimate leaves the robot, the faster the larger the speed",
            tuple(f"gadau_rule_both_{speed}" for speed in _SPEEDS)
            + tuple(f"gadau_rays_5_{speed}" for speed in _SPEEDS),
            lambda standing, slow, fast, *ours: standing < slow < fast,
            "gadau_rays",
            "with its Jacobian, its rule and ranges to the surface; ours does not",
        ),
        Statement(
            "IV.B.2, Fig. 12", "one or two landmarks in view",
            "the estimate leaves the robot faster",
            ("gadau_one_right_rmse", "gadau_two_right_rmse", "gadau_triangle_right_rmse"),
            lambda one, two, three: one > two > three,
        ),
        Statement(
            "IV.B.2, Fig. 13", "route across the map",
            "no big influence on accuracy",
            tuple(f"gadau_path_{path}_right_rmse" for path in _PATHS),
            lambda *rmse: max(rmse) <= 1.25 * min(rmse),
        ),
        Statement(
            "IV.B.2, Fig. 14", "second simulator: standing still",
            "the estimate leaves the robot all the same",
            ("gadau_rule_derivatives_0", "gadau_rays_5_0_worst"),
            lambda theirs_m, ours_cm: theirs_m > 0.2 and ours_cm < 5.0,
            "gadau_rays",
            "by its rule and its Jacobian, to decimetres and no further; ours does not",
        ),
        Statement(
            "IV.B.2", "why: discs with a large radius",
            "a possible reason",
            ("gadau_surface", "gadau_rule_derivatives_0", "gadau_rule_both_0", "gadau_derivatives"),
            lambda surface, without, with_, derivatives: with_ > 1.5 * without,
            "gadau_mistakes",
            "ranges to the surface cost a metre, but do not diverge; the Jacobian of Fig. 2 does",
        ),
        Statement(
            "IV.B.2", "more landmarks",
            "would improve it (a proposal)",
            tuple(f"gadau_rays_{discs}_{speed}" for speed in _SPEEDS for discs in (5, 8)),
            lambda *rmse: all(
                eight < five for five, eight in zip(rmse[::2], rmse[1::2], strict=True)
            ),
        ),
        Statement(
            "V", "GPS against the laser",
            "GPS gives the better estimate, as it tells the position itself",
            ("gadau_by_GPS_right_rmse", "gadau_by_laser_right_rmse",
             "gadau_by_GPS_as_good_as_the_laser_right_rmse",
             "gadau_by_laser_one_landmark_wrong_rmse"),
            lambda gps, laser, as_good, one: gps < laser,
            "gadau_sensors",
            "three landmarks beat even fixes as good and frequent as they are; with one landmark "
            "and a wrong start it is so",
        ),
    ),
    captions={
        "gadau_start": "Error of the position after a start that is 2 m and 60 degrees wrong, for "
        "each arrangement of landmarks: one alone does not tell the pose.",
        "gadau_sensors": "One drive on a circle by GPS and by laser on three landmarks: the floor, "
        "and the errors of position and heading.",
        "gadau_mistakes": "Errors from the right start among four landmarks: ours, with the "
        "Jacobian as the paper's Fig. 2 prints it, and with ranges to the surface of discs.",
        "gadau_kidnapped": "A robot that is carried off: a PoseEkf alone stays where it believed "
        "to be, RecoveringEkf notices, is lost for a moment, and finds itself.",
        "gadau_rays": "Second simulator, 151 rays on five discs: errors of position by the paper's "
        "rule, Jacobian and ranges to the surface, at three speeds, and ours.",
    },
)  # fmt: skip
