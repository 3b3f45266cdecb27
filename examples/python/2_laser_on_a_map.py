# SPDX-License-Identifier: Apache-2.0
"""A robot with a laser starts anywhere on its map: particles gather where the scans fit."""

import numpy as np

import locfuse as lf
from locfuse.core import RayCaster

SECOND = 1_000_000_000
rng = np.random.default_rng(2)
cells = np.zeros((120, 160), dtype=np.int8)  # 8 by 6 m, 5 cm a cell; 0 free, 100 a wall
cells[[0, -1], :] = cells[:, [0, -1]] = 100
cells[:60, 70] = cells[90:, 100] = cells[40, :30] = 100
grid = lf.OccupancyGrid(cells, resolution=0.05)
walls = RayCaster(grid)
laser = lf.LaserGeometry(lf.Pose2(), angle_min=-np.pi, angle_increment=np.pi / 90,
                         range_min=0.1, range_max=10.0)  # fmt: skip
config = lf.MclConfig()
config.seed = 1
mcl = lf.Mcl(config, lf.World(grid=grid))

x, y, heading = 2.0, 4.5, 0.0
for step in range(100):
    stamp = step * SECOND // 5
    mcl.on(lf.Velocity(stamp, forward=0.3, turn_rate=-0.3))
    ranges = walls.scan(lf.Pose2(x, y, heading), -np.pi, np.pi / 90, 180)
    mcl.on(lf.LaserScan(stamp, laser, ranges + rng.normal(0, 0.02, 180)))
    if step % 20 == 19:
        now = mcl.estimate()
        off = np.hypot(now.pose.x - x, now.pose.y - y)
        state = mcl.health().state.name if mcl.ready else "searching"
        print(f"{stamp / SECOND:4.1f} s: {off:.3f} m off, {state}, {len(mcl.particles)} "
              "particles")  # fmt: skip
    x, y = x + 0.06 * np.cos(heading - 0.03), y + 0.06 * np.sin(heading - 0.03)
    heading -= 0.06
