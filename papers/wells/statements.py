# SPDX-License-Identifier: Apache-2.0
"""What wells reports: no table, but words and pictures."""

from __future__ import annotations

from papers.page.paper import Paper, Statement

PAPER = Paper(
    "wells",
    "J. Wells and O. Omotuyi: Laser based EKF localization on TurtleBot",
    "An EKF on cylinders that a laser sees; the paper trusts the heading of its odometry.",
    seeds=20,
    quick_seeds=5,
    statements=(
        Statement(
            "IV, Figs. 3 to 6", "its EKF against its laser alone",
            "the EKF is much more accurate",
            ("wells_paper_las", "wells_paper_ekf"),
            lambda laser, ekf: ekf < laser,
            "wells_clean",
        ),
        Statement(
            "V, Figs. 4 and 6", "its EKF against the truth",
            "a near perfect match (no figure)",
            ("wells_paper_ekf", "wells"),
            lambda ekf, ours: ekf <= 5.0,
            "wells_clean",
            "taken as within 5 cm; its heading is that of the odometry, which drifts",
        ),
        Statement(
            "V", "clean odometry against the laser",
            "odometry is nearer to the truth",
            ("wells_odometry_first", "wells_odometry_rmse", "wells_paper_las"),
            lambda first, whole, laser: first < laser,
            remark="of the first quarter of a drive, as theirs was short; it drifts past it later",
        ),
        Statement(
            "V", "with slip, the laser",
            "is then more reliable than the odometry",
            ("wells_spoilt_odometry_rmse", "wells_spoilt_paper_las", "wells_spoilt"),
            lambda odometry, laser, ours: laser < 0.5 * odometry,
            "wells_spoilt",
            "taken as half its error; one beam is turned by the heading of that odometry, ours "
            "estimates the heading",
        ),
        Statement(
            "V", "odometry over a long way",
            "errors add up with the distance; its tests were too short to show it",
            ("wells_odometry_first", "wells_odometry_rmse"),
            lambda first, whole: whole > 1.5 * first,
        ),
        Statement(
            "V", "why the laser is off: resolution",
            "beams a degree apart miss the closest point; finer ones would help",
            ("wells_laser_exact", "wells_laser_beam", "wells_laser_fine"),
            lambda exact, beam, fine: fine < 0.5 * beam,
            remark="taken as half the error; without noise the resolution costs what the first row "
            "says, with noise the closest of many beams is the one that errs most",
        ),
        Statement(
            "V", "why the laser is off: one beam",
            "the arc of several beams could improve it",
            ("wells_laser_beam", "wells_laser_arc"),
            lambda beam, arc: arc < beam,
        ),
        Statement(
            "VI", "heading from the laser",
            "takes several objects in view at once",
            ("wells_two_heading", "wells_heading"),
            lambda two, all_: two < all_,
            remark="best with two in view; between, gyro and single cylinders keep it",
        ),
        Statement(
            "VI", "where the heading is disturbed",
            "the paper's method depends on it; estimating it becomes a necessity",
            ("wells_spoilt_odometry", "wells_spoilt_paper_ekf", "wells_spoilt"),
            lambda turned, paper, ours: paper > 10.0 * ours,
            "wells_spoilt",
        ),
    ),
    captions={
        "wells_clean": "One drive among the four cylinders with clean wheels, and a metre of it: "
        "where the closest beam puts the robot, the paper's EKF, ours, and the truth.",
        "wells_spoilt": "The same drive with wheels that slip and a gyro that drifts: the paper's "
        "EKF is turned away with its odometry, ours stays on the truth.",
    },
)  # fmt: skip
