# SPDX-License-Identifier: Apache-2.0
"""Errors of relative poses, for trajectories of which only relations are known, not the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.errors import LONGEST_GAP_S, interpolate
from locfuse.types import NANOSECONDS, Columns, FloatArray, Trajectory, wrap_angle

COLUMNS = ("begin_ns", "end_ns", "dx_m", "dy_m", "dheading_rad")
SHORT_S = 5.0  # below it a relation is short
LOOP_S = 60.0  # above it the robot came back: a loop


@dataclass(frozen=True)
class RelationErrors:
    """By how much the relative poses of a trajectory differ from reference relations.

    All have shape (n,); `row` are the rows of the relations that were compared. `seconds` between
    both ends are never negative; `translation` is the distance between both relative positions [m],
    `rotation` the absolute difference of both relative headings, radians in [0, pi].
    """

    row: NDArray[np.intp]
    seconds: FloatArray
    translation: FloatArray
    rotation: FloatArray

    def __len__(self) -> int:
        return len(self.row)


def relation_errors(
    estimate: Trajectory, relations: Columns, longest_gap_s: float = LONGEST_GAP_S
) -> RelationErrors:
    """Compare the relative poses of a trajectory with reference relations.

    For each relation the trajectory is interpolated at both ends. With T = inverse(T_world_begin) *
    T_world_end of the trajectory and T' the reference, the errors are the length of the translation
    and the angle of inverse(T') * T (R. Kuemmerle et al., "On measuring the accuracy of SLAM
    algorithms", Autonomous Robots 27, 2009, with absolute in place of squared errors). The
    frame of the trajectory does not matter, and nothing is aligned.

    Parameters
    ----------
    estimate : Trajectory
        With headings.
    relations : mapping of column name to array, shape (n,)
        As in a log: ``begin_ns`` and ``end_ns`` (int64), in any order; ``dx_m``, ``dy_m`` and
        ``dheading_rad``, the pose of the body at the end in the body frame at the begin.
    longest_gap_s : float
        Between rows of the estimate that are further apart nothing is interpolated.

    Returns
    -------
    RelationErrors
        Of the relations both of whose ends lie on the estimate.

    Raises
    ------
    ValueError
        If the estimate is empty or has no headings; if a column of the relations is missing, has
        another shape or a value that is not finite; if no relation lies on the estimate.

    Examples
    --------
    A relation says 1 m straight ahead in 2 s; the robot went 1.1 m:

    >>> import numpy as np
    >>> from locfuse import Trajectory
    >>> from locfuse.eval.relations import relation_errors, relation_metrics
    >>> track = Trajectory(
    ...     stamp_ns=np.array([0, 2_000_000_000]),
    ...     position=np.array([[5.0, 1.0], [5.0, 2.1]]),
    ...     heading=np.array([np.pi / 2, np.pi / 2]),
    ... )
    >>> relations = {
    ...     "begin_ns": np.array([0]),
    ...     "end_ns": np.array([2_000_000_000]),
    ...     "dx_m": np.array([1.0]),
    ...     "dy_m": np.array([0.0]),
    ...     "dheading_rad": np.array([0.0]),
    ... }
    >>> errors = relation_errors(track, relations)
    >>> round(float(errors.translation[0]), 3)
    0.1
    >>> round(relation_metrics(errors)["short"]["translation_mean_m"], 3)
    0.1
    """
    _check(relations)
    if estimate.heading is None:
        raise ValueError("the estimate has no headings, without which there are no relative poses")
    begin_ns, end_ns = relations["begin_ns"], relations["end_ns"]
    stamp_ns, of_end = np.unique(np.concatenate([begin_ns, end_ns]), return_inverse=True)
    at, inside = interpolate(estimate, stamp_ns, longest_gap_s)
    begin, end = of_end[: len(begin_ns)], of_end[len(begin_ns) :]
    row = np.flatnonzero(inside[begin] & inside[end])
    if len(row) == 0:
        raise ValueError(
            f"none of {len(begin_ns)} relations lies on the estimate: do both count time from the "
            f"same origin, and are its rows at most {longest_gap_s:g} s apart?"
        )
    pose_of = np.cumsum(inside) - 1
    x, y, turn = _relative(at, pose_of[begin[row]], pose_of[end[row]])
    return RelationErrors(
        row=row,
        seconds=np.abs(end_ns[row] - begin_ns[row]) / NANOSECONDS,
        translation=np.hypot(x - relations["dx_m"][row], y - relations["dy_m"][row]),
        rotation=np.abs(wrap_angle(turn - relations["dheading_rad"][row])),
    )


def relations_along(track: Trajectory, seconds: float) -> Columns:
    """Return the relations between poses of a trajectory that are some seconds apart.

    The track has headings and is interpolated; there is no relation where it has a gap. `seconds`
    are between both ends of a relation, and from the begin of one to that of the next. The columns
    are as `relation_errors` takes them. Raises ValueError if the trajectory is empty or has no
    headings, or `seconds` is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import Trajectory
    >>> from locfuse.eval.relations import relations_along
    >>> track = Trajectory(
    ...     stamp_ns=np.array([0, 1_000_000_000]),
    ...     position=np.array([[0.0, 0.0], [0.0, 2.0]]),
    ...     heading=np.array([np.pi / 2, np.pi / 2]),
    ... )
    >>> relations_along(track, 0.5)["dx_m"].round(3).tolist()  # straight ahead
    [1.0, 1.0]
    """
    if track.heading is None or len(track) == 0:
        raise ValueError("the trajectory is empty or has no headings; expected poses")
    if not seconds > 0.0:
        raise ValueError(f"seconds is {seconds}, expected > 0")
    step = max(round(seconds * NANOSECONDS), 1)
    stamp_ns = np.arange(track.stamp_ns[0], track.stamp_ns[-1] + 1, step, dtype=np.int64)
    at, inside = interpolate(track, stamp_ns)
    begin = np.flatnonzero(inside[:-1] & inside[1:])
    pose_of = np.cumsum(inside) - 1
    x, y, turn = _relative(at, pose_of[begin], pose_of[begin + 1])
    return {
        "begin_ns": stamp_ns[begin],
        "end_ns": stamp_ns[begin + 1],
        "dx_m": x,
        "dy_m": y,
        "dheading_rad": wrap_angle(turn),
    }


def relation_metrics(errors: RelationErrors) -> dict[str, dict[str, Any]]:
    """Sum up errors of relations in numbers, short ones and loops apart.

    Ready for JSON: ``all``, ``short`` (less than 5 s) and ``loop`` (more than 60 s), each with
    ``count``, and mean, standard deviation and median of the absolute errors:
    ``translation_mean_m``, ``translation_std_m``, ``translation_median_m``, ``rotation_mean_deg``,
    ``rotation_std_deg``, ``rotation_median_deg``; None where the count is 0.
    """
    chosen = {
        "all": np.ones(len(errors), np.bool_),
        "short": errors.seconds < SHORT_S,
        "loop": errors.seconds > LOOP_S,
    }
    return {
        name: {
            "count": int(rows.sum()),
            **_spread("translation", "m", errors.translation[rows]),
            **_spread("rotation", "deg", np.rad2deg(errors.rotation[rows])),
        }
        for name, rows in chosen.items()
    }


def _check(relations: Columns) -> None:
    for name in COLUMNS:
        if name not in relations:
            raise ValueError(f"relations have no column {name!r}, expected {', '.join(COLUMNS)}")
        values, expected = np.asarray(relations[name]), np.shape(relations[COLUMNS[0]])
        if values.ndim != 1 or values.shape != expected:
            raise ValueError(
                f"column {name!r} of the relations has shape {values.shape}, expected "
                f"{expected if len(expected) == 1 else '(n,)'}"
            )
        for row in np.flatnonzero(~np.isfinite(values))[:1]:
            raise ValueError(f"column {name!r} of the relations, row {row}: {values[row]}")


def _relative(
    track: Trajectory, begin: NDArray[np.intp], end: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x, y and heading at the end in the body frame at the begin."""
    assert track.heading is not None
    dx, dy = (track.position[end] - track.position[begin]).T
    cos, sin = np.cos(track.heading[begin]), np.sin(track.heading[begin])
    turn = track.heading[end] - track.heading[begin]
    return cos * dx + sin * dy, cos * dy - sin * dx, turn


def _spread(name: str, unit: str, values: FloatArray) -> dict[str, float | None]:
    known = len(values) > 0
    return {
        f"{name}_mean_{unit}": float(np.mean(values)) if known else None,
        f"{name}_std_{unit}": float(np.std(values)) if known else None,
        f"{name}_median_{unit}": float(np.median(values)) if known else None,
    }
