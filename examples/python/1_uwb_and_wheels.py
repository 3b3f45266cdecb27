# SPDX-License-Identifier: Apache-2.0
"""A robot with a UWB tag is switched on anywhere: it finds its pose and says how sure it is."""

import numpy as np

import locfuse as lf

SECOND = 1_000_000_000  # stamps are nanoseconds
rng = np.random.default_rng(1)
corners = [[0, 0, 2], [10, 0, 2], [10, 8, 2], [0, 8, 2]]
anchors = lf.AnchorMap([lf.Anchor(i, corner) for i, corner in enumerate(corners)])
tag = lf.Tag(0, [0.2, 0.0, 1.0])  # forward, left and up in the body [m]
ekf = lf.RecoveringEkf(lf.RecoveringEkfConfig(), lf.World(anchors, [tag]))

x, y, heading = 3.0, 2.0, 1.0  # of which the filter knows nothing
for step in range(200):  # ten a second
    stamp = step * SECOND // 10
    ekf.on(lf.Velocity(stamp, forward=0.5, turn_rate=0.3))
    antenna = np.array([x + 0.2 * np.cos(heading), y + 0.2 * np.sin(heading), 1.0])
    for i, corner in enumerate(corners):
        measured = np.linalg.norm(antenna - corner) + rng.normal(0, 0.1)
        ekf.on(lf.Range(stamp, tag=0, anchor=i, range=measured, sigma=0.1))
    if step % 40 == 39:
        if ekf.health().state is lf.HealthState.INITIALIZING:
            print(f"{stamp / SECOND:4.1f} s: {ekf.state().reason}")
        else:
            now = ekf.current()
            off = np.hypot(now.pose.x - x, now.pose.y - y)
            print(f"{stamp / SECOND:4.1f} s: {off:.3f} m off, sigma {now.sigma_position:.3f} m, "
                  f"{ekf.health().state.name}")  # fmt: skip
    x, y = x + 0.05 * np.cos(heading + 0.015), y + 0.05 * np.sin(heading + 0.015)
    heading += 0.03
