# SPDX-License-Identifier: Apache-2.0
"""Known errors of wheels, taken out of odometry before it is fused."""

from __future__ import annotations

import numpy as np

from locfuse.run.run import load_log, run
from support_live import assert_same
from support_runs import changed, room


def test_corrections_of_wheels_are_the_same_live_and_of_a_log() -> None:
    wheels = {"distance_scale": 1.03, "turn_scale": 0.96, "direction_rad": 0.05}
    for output in ("increments", "velocities"):
        config = room(simulation={"duration_s": 10.0, "odometry": {"output": output}},
                      estimator={"odometry": wheels})  # fmt: skip
        assert_same(config, load_log(config, None, 0))


def test_corrections_undo_what_they_name() -> None:
    config = room()
    log = load_log(config, None, 0)
    wheels = log["odometry"]
    angle = 0.05 + 0.5 * (0.96 - 1.0) * wheels["dheading_rad"] / 0.96
    c, s = np.cos(angle), np.sin(angle)
    dx, dy = wheels["dx_m"] / 1.03, wheels["dy_m"] / 1.03
    wrong = changed(log, "odometry", dx_m=c * dx + s * dy, dy_m=-s * dx + c * dy,
                    dheading_rad=wheels["dheading_rad"] / 0.96)  # fmt: skip
    corrected = room(estimator={"odometry": {"distance_scale": 1.03, "turn_scale": 0.96,
                                             "direction_rad": 0.05}})  # fmt: skip
    right, undone = run(config, log).estimate, run(corrected, wrong).estimate
    np.testing.assert_allclose(undone.position, right.position, atol=1e-12)
    assert np.abs(run(config, wrong).estimate.position - right.position).max() > 1e-3
