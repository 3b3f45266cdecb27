# SPDX-License-Identifier: Apache-2.0
"""True motion: body velocities that are constant piece by piece, and the poses they lead to."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from locfuse.config import scenario
from locfuse.sim.space import roam
from locfuse.types import FloatArray, GridMap, wrap_angle

Motion: TypeAlias = tuple[float, float, float]

_MIN_S = 1e-9  # shorter motions are rounding: stamps are nanoseconds


def sinc(angle: ArrayLike) -> FloatArray:
    """Return sin(angle) / angle, which is 1 at zero."""
    given = np.asarray(angle, dtype=np.float64)
    ratio = np.ones_like(given)
    np.divide(np.sin(given), given, out=ratio, where=given != 0.0)
    return ratio


def drive_on(
    pose: FloatArray, seconds: ArrayLike, speed: ArrayLike, turn_rate: ArrayLike
) -> FloatArray:
    """Return poses after driving on arcs; exact, also where the turn rate is zero.

    An arc of length L and turn a has a chord of length L sinc(a / 2) in direction heading + a / 2.
    `pose`, shape (..., 3), is x, y [m] and heading [rad] at the start, the rest, shape (...), s,
    m/s forward and rad/s counter-clockwise. Headings of the result, shape (..., 3), are not
    wrapped.
    """
    turn = np.multiply(seconds, turn_rate)
    chord = np.multiply(seconds, speed) * sinc(0.5 * turn)
    direction = pose[..., 2] + 0.5 * turn
    x = pose[..., 0] + chord * np.cos(direction)
    y = pose[..., 1] + chord * np.sin(direction)
    return np.stack([x, y, pose[..., 2] + turn], axis=-1)


@dataclass(frozen=True)
class Drive:
    """Motions one after another; the last one goes on for ever.

    `start` [s], strictly increasing, `speed` [m/s] forward and `turn_rate` [rad/s]
    counter-clockwise have shape (n,); `start_pose`, shape (n, 3), is x, y [m] and heading [rad] in
    world at each start. Raises ValueError where shapes disagree, there is no motion, or the starts
    do not increase.

    Examples
    --------
    >>> drive = drive_of((0.0, 0.0, 0.0), [(2.0, 0.5, 0.0)])
    >>> drive.pose_at([0.0, 2.0]).tolist()
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    """

    start: FloatArray
    speed: FloatArray
    turn_rate: FloatArray
    start_pose: FloatArray

    def __post_init__(self) -> None:
        n = len(self.start)
        if n == 0:
            raise ValueError("Drive has no motion, expected at least one")
        expected = {"start": (n,), "speed": (n,), "turn_rate": (n,), "start_pose": (n, 3)}
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                found = getattr(self, name).shape
                raise ValueError(f"Drive.{name} has shape {found}, expected {shape}")
        if not np.all(np.diff(self.start) > 0.0):
            row = int(np.argmin(np.diff(self.start) > 0.0)) + 1
            raise ValueError(f"Drive.start must increase strictly; row {row} does not")

    def pose_at(self, t: ArrayLike) -> FloatArray:
        """Return the true poses at times [s] in any order.

        The result, shape (n, 3), is x, y [m] and heading [rad, in -pi to pi] in world. Raises
        ValueError where a time lies before the first motion or is not a number.
        """
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        if not np.all(times >= self.start[0]):
            worst = float(times[~(times >= self.start[0])][0])
            raise ValueError(f"t is {worst} s, expected at least {float(self.start[0])} s")
        row = np.searchsorted(self.start, times, side="right") - 1
        pose = drive_on(
            self.start_pose[row], times - self.start[row], self.speed[row], self.turn_rate[row]
        )
        pose[:, 2] = wrap_angle(pose[:, 2])
        return pose


def drive_of(start_pose: Motion, motions: Sequence[Motion], *, repeat: int = 1) -> Drive:
    """Return the drive that makes motions one after another, beginning at 0 s.

    `start_pose` is (x, y, heading), metres and radians; `motions` are (seconds, speed, turn rate),
    s, m/s, rad/s, made `repeat` times; they must lead back to the start where that is more than
    once. Raises ValueError where a motion lasts no time.
    """
    seconds, speed, turn_rate = np.array(motions, dtype=np.float64).reshape(-1, 3).T
    start = np.concatenate([[0.0], np.cumsum(seconds)])
    poses = np.empty((len(motions) + 1, 3))
    poses[0] = start_pose
    for k in range(len(motions)):
        poses[k + 1] = drive_on(poses[k], seconds[k], speed[k], turn_rate[k])
        poses[k + 1, 2] = wrap_angle(poses[k + 1, 2])
    # Each lap starts from the same poses, so that a closed path stays closed to the last bit.
    return Drive(
        start=(np.arange(repeat)[:, None] * start[-1] + start[:-1]).ravel(),
        speed=np.tile(speed, repeat),
        turn_rate=np.tile(turn_rate, repeat),
        start_pose=np.tile(poses[:-1], (repeat, 1)),
    )


def carried(drive: Drive, at_s: float, to: Motion) -> Drive:
    """Return the drive that is interrupted: from an instant on it goes on from another pose.

    `at_s` is not before the first motion; `to` is (x, y, heading), metres and radians. Speeds and
    turn rates stay what they were.
    """
    pose = drive.pose_at([at_s])[0]
    after = int(np.searchsorted(drive.start, at_s, side="right"))
    before = int(np.searchsorted(drive.start, at_s, side="left"))
    turn = to[2] - pose[2]
    c, s = np.cos(turn), np.sin(turn)
    off = drive.start_pose[after:] - pose
    moved = np.column_stack([to[0] + c * off[:, 0] - s * off[:, 1],
                             to[1] + s * off[:, 0] + c * off[:, 1],
                             wrap_angle(to[2] + off[:, 2])])  # fmt: skip
    return Drive(
        start=np.concatenate([drive.start[:before], [at_s], drive.start[after:]]),
        speed=np.concatenate([drive.speed[:before], drive.speed[after - 1 :]]),
        turn_rate=np.concatenate([drive.turn_rate[:before], drive.turn_rate[after - 1 :]]),
        start_pose=np.concatenate([drive.start_pose[:before], [to], moved]),
    )


def plan(
    path: scenario.Path,
    room_m: tuple[float, float],
    duration_s: float,
    rng: np.random.Generator,
    grid: GridMap | None = None,
) -> Drive:
    """Return the drive along a path of a scenario, long enough for its duration.

    Random waypoints lie from (0, 0) to `room_m`, (width, depth), less their margin; they and
    roaming use `rng`, and `grid` is where to roam. Raises ValueError if there is no map to roam, or
    no room on it.
    """
    if isinstance(path, scenario.Circle):
        x, y = path.center_m
        start = (x + path.radius_m, y, 0.5 * math.pi)
        return drive_of(start, [(duration_s, path.speed_mps, path.speed_mps / path.radius_m)])
    if isinstance(path, scenario.Eight):
        rate = path.speed_mps / path.radius_m
        lap = 2.0 * math.pi / rate
        loop = [(lap, path.speed_mps, rate), (lap, path.speed_mps, -rate)]
        return _laps((*path.center_m, 0.5 * math.pi), loop, duration_s)
    if isinstance(path, scenario.Square):
        x, y = (c - 0.5 * path.side_m for c in path.center_m)
        turn = 0.5 * math.pi
        loop = _strokes(4, path.side_m, turn, path.speed_mps, path.turn_rate_radps)
        return _laps((x, y, 0.0), loop, duration_s)
    if isinstance(path, scenario.Star | scenario.Polygon):
        x, y = path.center_m
        if isinstance(path, scenario.Star):
            points, around = path.points, (path.points - 1) // 2
        else:
            points, around = path.corners, 1
        turn = 2.0 * math.pi * around / points  # from one stroke to the next
        side = 2.0 * path.radius_m * math.sin(0.5 * turn)
        loop = _strokes(points, side, turn, path.speed_mps, path.turn_rate_radps)
        heading = float(wrap_angle(math.pi + 0.5 * turn))  # along the chord from the northern tip
        return _laps((x, y + path.radius_m, heading), loop, duration_s)
    if isinstance(path, scenario.Waypoints):
        return _along(_random_points(path, room_m, rng), path, duration_s)
    if isinstance(path, scenario.Points):
        return _through(path, duration_s)
    if grid is None:
        raise ValueError("a roaming robot needs a map, got none")
    return _along(roam(grid, path, rng), path, duration_s)


def _strokes(strokes: int, length: float, turn: float, speed: float, rate: float) -> list[Motion]:
    """Return the motions once around: a stroke, a turn in place to the left, and so on."""
    return [(length / speed, speed, 0.0), (turn / rate, 0.0, rate)] * strokes


def _laps(start_pose: Motion, loop: Sequence[Motion], duration_s: float) -> Drive:
    lap_s = sum(seconds for seconds, _, _ in loop)
    return drive_of(start_pose, loop, repeat=math.ceil(duration_s / lap_s))


def _random_points(
    path: scenario.Waypoints, room_m: tuple[float, float], rng: np.random.Generator
) -> Iterator[FloatArray]:
    low = np.full(2, path.margin_m)
    high = np.array(room_m) - path.margin_m
    while True:
        yield rng.uniform(low, high)


def _along(
    points: Iterator[FloatArray], path: scenario.Waypoints | scenario.Roam, duration_s: float
) -> Drive:
    """Return the drive from point to point: turn in place the short way, drive straight."""
    position, target = next(points), next(points)
    heading = math.atan2(*(target - position)[::-1])
    begin = (float(position[0]), float(position[1]), float(wrap_angle(heading)))
    motions: list[Motion] = []
    elapsed = 0.0
    while elapsed < duration_s:
        bearing = math.atan2(*(target - position)[::-1])
        steps = _leg(math.dist(position, target), bearing - heading, path.speed_mps,
                     path.turn_rate_radps)  # fmt: skip
        motions += steps
        elapsed += sum(seconds for seconds, _, _ in steps)
        position, target, heading = target, next(points), bearing
    return drive_of(begin, motions)


def _through(path: scenario.Points, duration_s: float) -> Drive:
    """Return the drive through given points, which ends at the last one or goes on in laps."""
    points = np.array([*path.points_m, *path.points_m[: int(path.closed)]])
    start, motions, back = legs(points, path.speed_mps, path.turn_rate_radps)
    if path.closed:
        return _laps(start, motions + back, duration_s)
    return drive_of(start, [*motions, (1.0, 0.0, 0.0)])


def legs(
    points: FloatArray, speed: float, rate: float
) -> tuple[Motion, list[Motion], list[Motion]]:
    """Return the start, the motions from point to point, and the turn to the first heading."""
    step = np.diff(points, axis=0)
    bearing = np.arctan2(step[:, 1], step[:, 0])
    turn = np.diff(bearing, prepend=bearing[0])
    motions = [motion for length, by in zip(np.hypot(*step.T).tolist(), turn.tolist(), strict=True)
               for motion in _leg(length, by, speed, rate)]  # fmt: skip
    back = _leg(0.0, float(bearing[0] - bearing[-1]), speed, rate)
    start = (float(points[0][0]), float(points[0][1]), float(bearing[0]))
    return start, motions, back


def _leg(length: float, turn: float, speed: float, rate: float) -> list[Motion]:
    """Return a turn in place the short way, then a straight."""
    turn = float(wrap_angle(turn))
    steps = [(abs(turn) / rate, 0.0, math.copysign(rate, turn)), (length / speed, speed, 0.0)]
    return [step for step in steps if step[0] > _MIN_S]
