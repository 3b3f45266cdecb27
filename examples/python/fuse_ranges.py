# SPDX-License-Identifier: Apache-2.0
"""Twelve lines: a map, a start, odometry, ranges, a pose with its uncertainty."""

import numpy as np

from locfuse import Anchor, AnchorMap, Increment, Pose2, PoseEkf, PoseEkfConfig, PoseEstimate, Range, Tag

anchors = AnchorMap([Anchor(1, [0, 0, 2]), Anchor(2, [8, 0, 2]), Anchor(3, [4, 6, 2])])
start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.5, 0.5, 0.1]) ** 2)
ekf = PoseEkf(PoseEkfConfig(), anchors, [Tag(0, [0, 0, 1.1])], start)
ekf.on(Increment(begin=0, stamp=100_000_000, motion=Pose2(0.05, 0, 0)))  # stamps are nanoseconds
for anchor, range_m in [(1, 3.63), (2, 5.52), (3, 4.22)]:
    print(ekf.on(Range(100_000_000, tag=0, anchor=anchor, range=range_m)))
now = ekf.estimate()
print(now.pose, "+-", np.sqrt(np.diag(now.covariance)).round(3))
