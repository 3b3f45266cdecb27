# SPDX-License-Identifier: Apache-2.0
"""Starts that are as wrong as they say."""

from __future__ import annotations

import numpy as np

from locfuse import _core
from locfuse.config.schema import RunConfig
from locfuse.run.messages import Messages
from locfuse.run.start import start_of
from locfuse.types import Trajectory


def drawn_start(
    config: RunConfig,
    truth: Trajectory | None,
    messages: Messages,
    seed: int,
    sigma_factor: float = 1.0,
) -> _core.PoseEstimate:
    """Return a start as wrong as its covariance says: that of `start_of` plus a draw.

    Its covariance is that of the draw times `sigma_factor` squared.
    """
    start = start_of(config, truth, messages)
    rng = np.random.default_rng([seed, 1])
    dx, dy, turn = rng.standard_normal(3) * np.sqrt(np.diag(start.covariance))
    pose = _core.Pose2(start.pose.x + dx, start.pose.y + dy,
                       _core.wrap_angle(start.pose.heading + turn))  # fmt: skip
    return _core.PoseEstimate(start.stamp, pose, sigma_factor**2 * start.covariance)
