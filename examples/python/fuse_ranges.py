# SPDX-License-Identifier: Apache-2.0
"""Fuse odometry and three ranges into a pose with its uncertainty."""

import numpy as np

import locfuse as lf

anchors = lf.AnchorMap([lf.Anchor(i, p) for i, p in enumerate([[0, 0, 2], [8, 0, 2], [4, 6, 2]])])
tags = [lf.Tag(0, [0, 0, 1.1])]  # 1.1 m above the middle of the robot
start = lf.PoseEstimate(0, lf.Pose2(3, 2, 0), np.diag([0.5, 0.5, 0.1]) ** 2)
ekf = lf.PoseEkf(lf.PoseEkfConfig(), lf.World(anchors, tags), start)
ekf.on(lf.Increment(begin=0, stamp=100_000_000, motion=lf.Pose2(0.05, 0, 0)))  # nanoseconds
for anchor, range_m in enumerate([3.63, 5.52, 4.22]):
    print(ekf.on(lf.Range(100_000_000, tag=0, anchor=anchor, range=range_m, sigma=0.1)))
now = ekf.estimate()
print(now.pose, "+-", np.sqrt(np.diag(now.covariance)).round(3))
