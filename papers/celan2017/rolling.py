# SPDX-License-Identifier: Apache-2.0
"""A filter of one's own: a body that rolls ahead, of which nobody tells the motion, by ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from locfuse import _core
from locfuse.types import NANOSECONDS, FloatArray
from papers.celan2017.antennas import Antennas

# What a trolley does that is pushed: speed and turn rate come and go about their means.
SPEED_MPS, SIGMA_SPEED_MPS, SPEED_S = 0.4, 0.2, 2.0
SIGMA_TURN_RADPS, TURN_S = 0.5, 1.0
SLIP_M = 0.03  # to the side and along, per root of a second
STEP_S = 0.1  # the longest
NO_GATE = _core.Gate(1.0)


class Rolling:
    """Pose, speed ahead and turn rate; ranges correct them all, without a gate.

    Parameters
    ----------
    start : PoseEstimate
    anchors : mapping of id to (x, y, z)
    tags : sequence of Tag
    antennas : Antennas, optional
        Errors of the ranges that are told.

    Attributes
    ----------
    tails : NoiseShape
        Of ranges: Cauchy's unless told otherwise.
    """

    def __init__(
        self, start: _core.PoseEstimate, anchors: Mapping[int, FloatArray],
        tags: Sequence[_core.Tag], antennas: Antennas | None = None,
    ) -> None:  # fmt: skip
        known = _core.AnchorMap([_core.Anchor(k, at.tolist()) for k, at in anchors.items()])
        self._model = _core.RangeModel(_core.RangeConfig(), known, list(tags))
        self._anchors = {k: at[:2] for k, at in anchors.items()}
        self._arms = {tag.id: np.array(tag.position[:2]) for tag in tags}
        self._antennas = antennas
        self.tails = _core.NoiseShape(_core.NoiseKind.CAUCHY)
        self._belief = _core.GaussianBelief()
        self._belief.stamp = start.stamp
        pose = np.array([start.pose.x, start.pose.y, start.pose.heading])
        self._body = self._belief.add("body", _core.SlotKind.POSE2, pose, start.covariance)
        speed, turn = (self._belief.add(name, _core.SlotKind.SCALAR, np.array([mean]),
                                        np.array([[sigma**2]]))
                       for name, mean, sigma in (("speed", SPEED_MPS, SIGMA_SPEED_MPS),
                                                 ("turn rate", 0.0, SIGMA_TURN_RADPS)))  # fmt: skip
        self._slots = [self._body, speed, turn]

    def on(self, z: _core.Range) -> _core.Outcome | None:
        """Fuse a range; None if anchor or tag is unknown."""
        self.advance_to(z.stamp)
        lin = self.linearize(z)
        if lin is None:
            return None
        return _core.update(self._belief, lin, [self._body], NO_GATE, self.tails)

    def linearize(self, z: _core.Range) -> _core.Linearization | None:
        """Return what a range says of the pose as it is believed."""
        pose = self._belief.pose(self._body)
        lin = self._model.linearize(pose, z)
        if lin is None or self._antennas is None:
            return lin
        return self._antennas.linearize(lin, z, *self._direction(pose, z))

    def advance_to(self, stamp: int) -> None:
        """Carry the belief to a stamp."""
        while self._belief.stamp < stamp:
            until = min(stamp, self._belief.stamp + round(STEP_S * NANOSECONDS))
            step = rolled(self._belief.x, (until - self._belief.stamp) / NANOSECONDS)
            _core.predict(self._belief, step, self._slots)
            self._belief.stamp = until

    def estimate(self, stamp: int) -> _core.PoseEstimate:
        """Return the pose at a stamp, to which the belief is carried."""
        self.advance_to(stamp)
        return _core.PoseEstimate(stamp, self._belief.pose(self._body),
                                  self._belief.marginal([self._body]))  # fmt: skip

    def _direction(self, pose: _core.Pose2, z: _core.Range) -> tuple[float, FloatArray]:
        """Return the direction to an anchor in body, and its derivative by the pose."""
        arm = np.array(pose.act(self._arms[z.tag])) - [pose.x, pose.y]
        vx, vy = self._anchors[z.anchor] - arm - [pose.x, pose.y]
        by_x, by_y = vy / (vx * vx + vy * vy), -vx / (vx * vx + vy * vy)
        by_heading = -by_x * arm[1] + by_y * arm[0] - 1.0
        return float(np.arctan2(vy, vx)) - pose.heading, np.array([[by_x, by_y, by_heading]])


def rolled(x: FloatArray, seconds: float) -> _core.BodyPropagation:
    """Return one step of (x, y, heading, speed, turn rate); docs/models/rolling.md."""
    _, _, heading, speed, turn = x.tolist()
    middle = heading + 0.5 * turn * seconds
    ahead = np.array([np.cos(middle), np.sin(middle)])
    side = np.array([-ahead[1], ahead[0]])
    keep_speed, keep_turn = np.exp(-seconds / SPEED_S), np.exp(-seconds / TURN_S)
    moved = x.copy()
    moved[:2] += speed * seconds * ahead
    moved[2:] = (heading + turn * seconds, SPEED_MPS + keep_speed * (speed - SPEED_MPS),
                 keep_turn * turn)  # fmt: skip
    F = np.diag([1.0, 1.0, 1.0, keep_speed, keep_turn])
    F[:2, 2] = speed * seconds * side
    F[:2, 3] = seconds * ahead
    F[:2, 4] = 0.5 * seconds * F[:2, 2]
    F[2, 4] = seconds
    q_speed = SIGMA_SPEED_MPS**2 * (1.0 - keep_speed**2)
    q_turn = SIGMA_TURN_RADPS**2 * (1.0 - keep_turn**2)
    Q = np.diag([SLIP_M**2 * seconds, SLIP_M**2 * seconds, q_turn * seconds**2 / 3.0,
                 q_speed, q_turn])  # fmt: skip
    Q[2, 4] = Q[4, 2] = 0.5 * q_turn * seconds
    return _core.BodyPropagation(moved, F, Q)
