# SPDX-License-Identifier: Apache-2.0
"""How good an estimate with its covariance is: beyond errors, how rightly it says how large."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.eval.ape import ape
from locfuse.eval.errors import Errors, interpolate
from locfuse.eval.relations import RelationErrors, relation_errors, relations_along
from locfuse.eval.verdicts import series_of
from locfuse.types import NANOSECONDS, FloatArray, Trajectory, rows_of

LEVELS = (0.5, 0.68, 0.8, 0.9, 0.95, 0.99)  # nominal coverage of a calibration curve
RELATIVE_S = 1.0  # between both ends of a relative error
CALM_LEVEL = 0.99  # a position error inside this ellipse is what the covariance says
CALM_S = 1.0  # so long it must stay there to be back


def negative_log_likelihood(estimate: Trajectory, errors: Errors) -> FloatArray:
    """Return how unlikely truth is under an estimate, -log N(e; 0, P).

    Lower is better. It is least where P is the covariance that the errors have, so it asks for
    small errors and for an honest covariance at once.

    `estimate` has covariance, and `errors` are its own. The result, shape (n,), has one number for
    each compared stamp: nats, of a density in metres and radians. Raises ValueError if there is no
    covariance.

    Examples
    --------
    >>> from locfuse.eval.errors import errors_against
    >>> here = Trajectory(np.array([0]), np.zeros((1, 2)), np.zeros(1), np.eye(3)[None])
    >>> value = negative_log_likelihood(here, errors_against(here, here))
    >>> round(float(value[0]), 3)  # 3/2 log(2 pi)
    2.757
    """
    if errors.nees is None:
        raise ValueError("the estimate has no covariance; expected one for each row")
    volume = np.linalg.slogdet(2.0 * np.pi * _covariance(estimate, errors, errors.dof))[1]
    return np.asarray(0.5 * (errors.nees + volume))


def coverage(errors: Errors, levels: Sequence[float] = LEVELS) -> FloatArray:
    """Return the share of errors inside the ellipsoid that should hold each level of them.

    `errors` have `nees` and at least one row; `levels` are nominal shares, each inside (0, 1). The
    result has their shape; a consistent estimate gives the levels themselves.
    """
    if errors.nees is None or len(errors) == 0:
        raise ValueError("no errors with a covariance; expected at least one")
    return np.array(
        [np.mean(errors.nees <= _core.chi_squared_quantile(errors.dof, p)) for p in levels]
    )


def aligned_rmse(estimate: Trajectory, truth: Trajectory) -> float | None:
    """Return the absolute trajectory error: the RMSE left after the best rigid motion [m].

    Truth is interpolated to the stamps of the estimate. None where fewer than two compare, or where
    nothing moves, so that every rotation fits.
    """
    at, inside = interpolate(truth, estimate.stamp_ns)
    try:
        return ape(rows_of(estimate, inside), at, "se2").rmse
    except ValueError:
        return None


def relative_errors(
    estimate: Trajectory, truth: Trajectory, seconds: float = RELATIVE_S
) -> RelationErrors | None:
    """Return the errors of the motions over some seconds each; None where there are none.

    Both trajectories have headings. One motion follows the other; see `relation_errors`.
    """
    relations = relations_along(truth, seconds)
    try:
        return relation_errors(estimate, relations)
    except ValueError:
        return None


def recovery(
    estimate: Trajectory, errors: Errors, ends_ns: Iterable[int], limit_m: float | None = None
) -> tuple[float | None, int]:
    """Return how long it takes from the ends of faults until the position error is back.

    It is back where it stays for a second, or to the end, inside the ellipse that holds 99 % of a
    consistent estimate's errors, or, where one is given, below `limit_m`.

    `errors` are those of `estimate`, `ends_ns` when faults ended; those behind the last compared
    stamp do not count. Returns the longest time in seconds of those after which it came back, None
    if there is none, and after how many it did not.
    """
    calm = _calm(estimate, errors, limit_m)
    taken = [_back(errors, calm, end) for end in ends_ns
             if len(errors) and end <= errors.stamp_ns[-1]]  # fmt: skip
    back = [seconds for seconds in taken if seconds is not None]
    return max(back, default=None), len(taken) - len(back)


def _calm(estimate: Trajectory, errors: Errors, limit_m: float | None) -> NDArray[np.bool_]:
    if limit_m is not None:
        return np.asarray(np.hypot(*errors.position.T) <= limit_m)
    if errors.nees is None:
        raise ValueError("the estimate has no covariance; expected one, or a limit in metres")
    solved = np.linalg.solve(_covariance(estimate, errors, 2), errors.position[:, :, None])
    nees = np.einsum("ni,nij->n", errors.position, solved)
    return np.asarray(nees <= _core.chi_squared_quantile(2, CALM_LEVEL))


def _back(errors: Errors, calm: NDArray[np.bool_], end_ns: int) -> float | None:
    stamp_ns = errors.stamp_ns
    for first, after in series_of(calm):
        begin = max(int(stamp_ns[first]), end_ns)
        stays = int(stamp_ns[after - 1]) - begin
        if stays >= CALM_S * NANOSECONDS or (after == len(calm) and stays >= 0):
            return (begin - end_ns) / NANOSECONDS
    return None


def _covariance(estimate: Trajectory, errors: Errors, size: int) -> FloatArray:
    assert estimate.covariance is not None
    return estimate.covariance[errors.row][:, :size, :size]
