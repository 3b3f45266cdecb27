# SPDX-License-Identifier: Apache-2.0
"""Wheels, fixes of a metre and a compass that nobody aligned: its offset is learnt."""

import numpy as np

import locfuse as lf

SECOND = 1_000_000_000
rng = np.random.default_rng(4)
config = lf.PoseEkfConfig()
config.position.antenna_forward_m = 0.3
start = lf.PoseEstimate(0, lf.Pose2(0, 0, 0.5), np.diag([1.0, 1.0, 1.0]) ** 2)
ekf = lf.PoseEkf(config, lf.World(), start)

x, y, heading = 0.0, 0.0, 0.0
for step in range(1200):  # two minutes
    stamp = step * SECOND // 10
    ekf.on(lf.Velocity(stamp, forward=1.5, turn_rate=0.1))
    reads = heading + np.radians(100) + rng.normal(0, 0.03)  # mount and declination
    ekf.on(lf.Heading(stamp, reads, sigma=0.03))
    if step % 10 == 0:
        antenna = [x + 0.3 * np.cos(heading), y + 0.3 * np.sin(heading)]
        ekf.on(lf.PositionFix(stamp, antenna + rng.normal(0, 1.0, 2), np.eye(2)))
    x, y = x + 0.15 * np.cos(heading + 0.005), y + 0.15 * np.sin(heading + 0.005)
    heading += 0.01

now = ekf.estimate(stamp)
offset = ekf.errors[0]
off = np.degrees(np.angle(np.exp(1j * (now.pose.heading - heading))))
print(f"heading {abs(off):.1f} deg off, sigma {np.degrees(now.sigma_heading):.1f} deg")
print(f"{offset.name} {np.degrees(offset.value):.0f} deg, sigma {np.degrees(offset.sigma):.0f} deg")
