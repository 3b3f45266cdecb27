# SPDX-License-Identifier: Apache-2.0
"""Errors of ranges that depend on where an antenna is heard from: learnt at rest, known later."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray

ROUNDS = 20  # of reweighting; it settles in five
SCALE_M = 0.12  # beyond which an error at rest counts less: walls, people


@dataclass(frozen=True)
class Antennas:
    """What ranges read long by: b = c + k d + a cos(2 beta) + s sin(2 beta).

    d is the distance from tag to anchor, and beta the direction to the anchor in body. Antennas are
    alike to both ends of their axis, so the first direction that matters is twice the angle; what
    goes with the angle itself is no other than a tag elsewhere on the body.

    Attributes
    ----------
    constant_m : float64 array, shape (tags, anchors)
    scale : float
    cosine_m, sine_m : float64 arrays, shape (tags,)
    sigma_m : float
        Scatter that is left.
    """

    constant_m: FloatArray
    scale: float
    cosine_m: FloatArray
    sine_m: FloatArray
    sigma_m: float

    def linearize(
        self, lin: _core.Linearization, z: _core.Range, beta: float, beta_by_pose: FloatArray
    ) -> _core.Linearization:
        """Return what a range says once these errors are known.

        Parameters
        ----------
        lin : Linearization
            What it would say without them: 1 x 3.
        z : Range
        beta : float
            Direction to the anchor in body, radians.
        beta_by_pose : float64 array, shape (3,)
            Its derivative.
        """
        a, s = float(self.cosine_m[z.tag]), float(self.sine_m[z.tag])
        cos, sin = np.cos(2.0 * beta), np.sin(2.0 * beta)
        distance = z.range - lin.residual[0]
        bias = self.constant_m[z.tag, z.anchor] + self.scale * distance + a * cos + s * sin
        jacobian = (1.0 + self.scale) * lin.jacobian + 2.0 * (s * cos - a * sin) * beta_by_pose
        return _core.Linearization(lin.residual - bias, jacobian, lin.noise)


def learn(
    error: FloatArray, distance: FloatArray, beta: FloatArray, links: tuple[FloatArray, FloatArray]
) -> Antennas:
    """Return the errors that fit best, large ones counting less.

    Parameters
    ----------
    error, distance, beta : float64 arrays, shape (n,)
        Range minus distance [m], distance [m], direction to the anchor in body [rad].
    links : two int arrays, shape (n,)
        Tag and anchor.
    """
    tag, anchor = (np.asarray(ids, np.int64) for ids in links)
    tags, anchors = int(tag.max()) + 1, int(anchor.max()) + 1
    of_tag = np.eye(tags)[tag]
    H = np.column_stack([np.eye(tags * anchors)[tag * anchors + anchor],
                         np.cos(2.0 * beta)[:, None] * of_tag,
                         np.sin(2.0 * beta)[:, None] * of_tag, distance])  # fmt: skip
    found, left = np.zeros(H.shape[1]), error
    for _ in range(ROUNDS):
        root = 1.0 / np.hypot(1.0, left / SCALE_M)  # of the weight
        found = np.linalg.lstsq(root[:, None] * H, root * error, rcond=None)[0]
        left = error - H @ found
    constant, cosine, sine, scale = np.split(found, np.cumsum([tags * anchors, tags, tags]))
    return Antennas(constant.reshape(tags, anchors), float(scale[0]), cosine, sine,
                    float(np.std(left)))  # fmt: skip
