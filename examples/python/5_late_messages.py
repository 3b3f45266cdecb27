# SPDX-License-Identifier: Apache-2.0
"""Ranges that come half a second late are fused where they belong: the same pose, bit for bit."""

import numpy as np

import locfuse as lf

SECOND = 1_000_000_000
rng = np.random.default_rng(5)
corners = [[0, 0, 2], [8, 0, 2], [4, 6, 2]]
anchors = lf.AnchorMap([lf.Anchor(i, corner) for i, corner in enumerate(corners)])
world = lf.World(anchors, [lf.Tag(0, [0, 0, 1])])
start = lf.PoseEstimate(0, lf.Pose2(3, 2, 0), np.diag([0.2, 0.2, 0.1]) ** 2)
messages: list[tuple[int, lf.Velocity | lf.Range]] = []  # when each arrives, and what it says
for step in range(100):
    stamp = step * SECOND // 10
    messages.append((stamp, lf.Velocity(stamp, forward=0.1, turn_rate=0.0)))
    for i, corner in enumerate(corners):
        away = np.linalg.norm(np.subtract([3 + 0.01 * step, 2, 1], corner))
        late = int(rng.integers(0, SECOND // 2))
        messages.append((stamp + late, lf.Range(stamp, 0, i, away + rng.normal(0, 0.1), 0.1)))

poses = []
for in_time in (True, False):
    live = lf.Live(lf.RecoveringEkf(lf.RecoveringEkfConfig(), world))
    live.start_at(start)
    for _, message in messages if in_time else sorted(messages, key=lambda each: each[0]):
        live.on(message)
    poses.append(live.current().pose)
print(poses[0])
print("the same:", poses[0] == poses[1])
