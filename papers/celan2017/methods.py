# SPDX-License-Identifier: Apache-2.0
"""Estimators of celan2017 and bounds on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.sim.sensors import relative_poses, seconds
from locfuse.sim.trajectory import Drive
from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray
from papers.celan2017.world import (
    SIGMA_LONGITUDINAL,
    SIGMA_PER_SQRT_M,
    SIGMA_PER_SQRT_RAD,
    SIGMA_ROTATION,
    SIGMA_SCALE,
    SIGMA_TURN_BIAS_RADPS,
    SIZE_M,
    TAGS,
    Lap,
    radios_known,
)

Message: TypeAlias = _core.Increment | _core.LaserScan | _core.PositionFix | _core.Range


PARTICLES = 2000
# Of the wheels as a user may know them: wide enough for what they get wrong all the time.
SIGMAS = {
    "sigma_longitudinal_per_sqrt_m": 0.05,
    "sigma_lateral_per_sqrt_m": 0.02,
    "sigma_heading_per_sqrt_m": 0.03,
    "sigma_heading_per_sqrt_rad": 0.05,
}
# The same for the filter of UWB, which is asked where they may spin: as on a floor that is wet.
# Particles with that noise spread needlessly: the switch acts in clean laps (results/accuracy.md).
SIGMAS_WET = SIGMAS | {
    "sigma_longitudinal_per_sqrt_m": 0.2,
    "sigma_heading_per_sqrt_m": 0.06,
    "sigma_heading_per_sqrt_rad": 0.1,
}
SIGMA_UWB_M = 0.25  # of a range: its noise and what its calibration leaves
# Of the switch, chosen on seeds 100 to 111: half a metre is not to be passed, and a pose through
# walls, half a metre off, is better than none. Particles that are sure are never overruled, as in
# the paper: UWB that comes back after minutes may be certain of a place across the floor.
SWITCH = {
    "elsewhere_m": float(np.hypot(*SIZE_M)),
    "elsewhere_rad": np.pi,
    "sigma_unsure_m": 0.18,
    "sigma_sure_m": 0.18,
    "uwb_sigma_m": 0.18,
    "doubt_s": 1.0,
    "uwb_nis": 3.0,
}


class Estimator(Protocol):
    """What takes messages in order of time and says where the body is."""

    def on(self, message: Message, /) -> object: ...
    def estimate(self) -> _core.PoseEstimate: ...


class Wheels:
    """Odometry alone."""

    def __init__(self, start: _core.PoseEstimate) -> None:
        self._motion = _core.OdometryMotion(sigmas())
        self._start = start
        self._pose, self._stamp = start.pose, start.stamp

    def on(self, message: Message, /) -> None:
        if isinstance(message, _core.Increment):
            self._pose = self._pose * message.motion
            self._stamp = message.stamp

    def estimate(self) -> _core.PoseEstimate:
        return _core.PoseEstimate(self._stamp, self._pose, self._start.covariance)


def sigmas(values: Mapping[str, float] = SIGMAS) -> _core.OdometryConfig:
    """Return the noise of the wheels as estimators know it."""
    config = _core.OdometryConfig()
    for name, value in values.items():
        setattr(config, name, value)
    return config


def mcl(lap: Lap, start: _core.PoseEstimate, seed: int) -> _core.Mcl:
    """Return `Mcl` on the robot's map, at a known pose."""
    config = _core.MclConfig()
    config.min_particles = config.max_particles = PARTICLES
    config.seed = seed
    config.odometry = sigmas()
    config.range.sigma_m = SIGMA_UWB_M
    grid = lap.floor.map.occupancy_grid()
    made = _core.Mcl(config, _core.World(*radios_known(lap), grid=grid), start.stamp)
    made.start_at([_core.PoseHypothesis(start)])
    return made


def switching(lap: Lap, start: _core.PoseEstimate, seed: int) -> _core.SwitchingMcl:
    """Return `mcl` that UWB rescues: ranges and wheels in a filter of their own."""
    config = _core.RecoveringEkfConfig()
    config.start.estimator.odometry = sigmas(SIGMAS_WET)
    config.start.estimator.range.sigma_m = SIGMA_UWB_M
    uwb = _core.RecoveringEkf(config, _core.World(*radios_known(lap)))
    uwb.start_at(start)
    thresholds = _core.SwitchingMclConfig()
    for name, value in SWITCH.items():
        setattr(thresholds, name, value)
    return _core.SwitchingMcl(thresholds, mcl(lap, start, seed), uwb)


SIGMA_WRONG = (SIGMA_SCALE, SIGMA_ROTATION, SIGMA_TURN_BIAS_RADPS)  # of wheels, all the time


def covariance_bounds(
    drive: Drive, stamp_ns: StampArray, fixes: Columns, sigma_start: tuple[float, float, float]
) -> FloatArray:
    """Return the covariance of the pose that no causal estimator goes below along a drive.

    The information recursion over (x, y, heading, scale, turn scale, turn bias) with the Jacobians
    where the body is and the noise of `wheels` and `radios` (Tichavsky, Muravchik and Nehorai,
    1998, of a known path): of whatever knows this noise and takes the motion from the wheels.

    Parameters
    ----------
    drive : Drive
    stamp_ns : int64 array, shape (n,)
        Of the wheels, from the start on.
    fixes : columns
        As in `Lap`, in order of time, published when they are measured.
    sigma_start : (x, y, heading)
        Metres and radians.

    Returns
    -------
    float64 array, shape (n - 1, 3, 3)
        Of (x, y, heading) at every stamp but the first, fixes of that stamp included.
    """
    events = np.union1d(stamp_ns, fixes["stamp_ns"])
    pose = drive.pose_at(seconds(events))
    motion, dt_s = relative_poses(pose), np.diff(seconds(events))
    P = np.diag(np.square([*sigma_start, *SIGMA_WRONG]))
    found = []
    for k, stamp in enumerate(events[1:].tolist()):
        F, Q = _moved(pose[k, 2], motion[k], dt_s[k])
        P = F @ P @ F.T + Q
        for row in np.flatnonzero(fixes["stamp_ns"] == stamp).tolist():
            arm = TAGS[str(fixes["tag"][row])]
            P = _known(P, _by_pose(pose[k + 1, 2], arm), fixes["covariance"][row])
        found.append(P[:3, :3])
    return np.array(found)[np.isin(events[1:], stamp_ns)]


def _moved(heading: float, motion: FloatArray, dt_s: float) -> tuple[FloatArray, FloatArray]:
    """Return F and Q of a motion in body: docs/models/motion.md, eq. (1.2), (1.3) and (1.8)."""
    turn = _turn(heading)
    dx, dy = turn @ motion[:2]
    F = np.eye(6)
    F[:2, 2] = -dy, dx
    F[:2, 3] = -dx, -dy
    F[2, 4:] = -motion[2], -dt_s
    distance, angle = float(np.hypot(*motion[:2])), abs(float(motion[2]))
    Q = np.zeros((6, 6))
    Q[:2, :2] = SIGMA_LONGITUDINAL**2 * distance * np.outer(turn[:, 0], turn[:, 0])
    Q[2, 2] = SIGMA_PER_SQRT_M**2 * distance + SIGMA_PER_SQRT_RAD**2 * angle
    return F, Q


def _by_pose(heading: float, arm: tuple[float, float, float]) -> FloatArray:
    """Return how the place of a tag in world depends on the six states."""
    x, y = _turn(heading) @ np.array(arm[:2])
    return np.array([[1.0, 0.0, -y, 0.0, 0.0, 0.0], [0.0, 1.0, x, 0.0, 0.0, 0.0]])


def _known(P: FloatArray, H: FloatArray, R: NDArray[np.float64]) -> FloatArray:
    """Return the covariance once a measurement is known."""
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    kept = np.eye(len(P)) - K @ H
    return np.asarray(kept @ P @ kept.T + K @ R @ K.T)


def _turn(heading: float) -> FloatArray:
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s], [s, c]])


def best_causal(found: FloatArray, truth: FloatArray, taps: int) -> float:
    """Return the minimum RMSE of any weighing of a value with those before it.

    Weights sum up to one, so that a constant stays one; they and an offset are fitted to the truth
    of the very series, which no filter can know: whatever is linear and looks no further back is
    not better.

    Parameters
    ----------
    found, truth : float64 arrays, shape (n,)
        Angles unwrapped.
    taps : int
        How many values before, at least 1 and far below n.
    """
    now = found[taps:]
    before = np.column_stack([found[taps - k : len(found) - k] - now for k in range(1, taps + 1)])
    H = np.column_stack([before, np.ones(len(now))])
    wanted = truth[taps:] - now
    weights = np.linalg.lstsq(H, wanted, rcond=None)[0]
    return float(np.sqrt(np.mean((wanted - H @ weights) ** 2)))


ROUNDS = 20  # of reweighting; it settles in five
SCALE_M = 0.12  # beyond which an error at rest counts less: walls, people


@dataclass(frozen=True)
class Antennas:
    """What ranges read long by: b = c + k d + a cos(2 beta) + s sin(2 beta).

    d is the distance from tag to anchor, and beta the direction to the anchor in body. Antennas are
    symmetric about their axis, so the first direction that matters is twice the angle; a
    term in the angle itself is the same as a tag elsewhere on the body.

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
        Errors of the ranges.

    Attributes
    ----------
    tails : NoiseShape
        Of ranges: Cauchy by default.
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
    """Return one step of (x, y, heading, speed, turn rate); results/rolling.md."""
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
