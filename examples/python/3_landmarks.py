# SPDX-License-Identifier: Apache-2.0
"""A robot maps posts that it has never seen while it localizes on them (SLAM)."""

import numpy as np

import locfuse as lf

SECOND = 1_000_000_000
rng = np.random.default_rng(3)
posts = np.array([[2.0, 3.0], [5.0, -1.0], [8.0, 2.0], [4.0, 6.0]])
start = lf.PoseEstimate(0, lf.Pose2(0, 0, 0), np.diag([0.01, 0.01, 0.01]) ** 2)
ekf = lf.LandmarkEkf(lf.LandmarkEkfConfig(), lf.World(), start)

x, y, heading = 0.0, 0.0, 0.0
for step in range(300):
    stamp = step * SECOND // 10
    ekf.on(lf.Velocity(stamp, forward=0.5, turn_rate=0.2))
    seen = []
    for post in posts:  # without names: the filter finds out which is which
        away = post - [x, y]
        distance, bearing = np.hypot(*away), np.arctan2(away[1], away[0]) - heading
        seen.append(lf.RangeBearing(stamp, None, distance + rng.normal(0, 0.05),
                                    bearing + rng.normal(0, 0.01)))  # fmt: skip
    ekf.on_joint(seen)
    x, y = x + 0.05 * np.cos(heading + 0.01), y + 0.05 * np.sin(heading + 0.01)
    heading += 0.02 + rng.normal(0, 0.002)

now = ekf.estimate()
print(
    f"pose {np.hypot(now.pose.x - x, now.pose.y - y):.3f} m off, sigma {now.sigma_position:.3f} m"
)
for landmark in ekf.landmarks():
    off = np.linalg.norm(posts - landmark.position, axis=1).min()
    print(f"post {landmark.id} at {landmark.position.round(2).tolist()}, {off:.3f} m off")
