# SPDX-License-Identifier: Apache-2.0
"""Positions from ranges alone: each epoch of a file independently."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.io.csv_table import number_texts, stamp_texts, write_table
from locfuse.io.log_folder import read_log_file
from locfuse.types import (
    NANOSECONDS,
    Columns,
    ConfigError,
    FloatArray,
    LogError,
    StampArray,
    nearest,
)

SOLVERS = ("both", "newton", "ceres", "srls", "srwls")
MLS = ("newton", "ceres", "both")
LOSSES = ("none", "huber", "cauchy", "one_sided")
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Epochs:
    """Ranges that were measured together, one row per epoch.

    `names` and `anchors` (metres, shape (m, 3)) are in the order of the columns; `stamp_ns`, shape
    (n,), is of the first range of each epoch, `tag` has shape (n,). `ranges` and `sigma`, shape
    (n, m), are in metres; NaN where an anchor has no range.
    """

    names: list[str]
    anchors: FloatArray
    stamp_ns: StampArray
    tag: NDArray[np.str_]
    ranges: FloatArray
    sigma: FloatArray

    def __len__(self) -> int:
        return len(self.stamp_ns)


@dataclass(frozen=True)
class Fix:
    """Position of a tag from the ranges of one epoch.

    Attributes
    ----------
    stamp_ns : int
    tag : str
    status, reason : str
        ``unique``, ``ambiguous`` and so on, and why.
    position : float64 array, shape (k, d)
        Every position that fits, the best one first; none where the ranges fix none.
    covariance : float64 array, shape (k, d, d)
    cost : float64 array, shape (k,)
    agree : bool or None
        Whether SR-LS and maximum likelihood agree; None where only one was asked.
    difference : float
        Between the two, in its own standard deviations; NaN where only one was asked.
    ml_distance, ml_sigmas : float
        Between the minima of Newton and of Ceres, metres and standard deviations; NaN where only
        one was asked.
    residual : float64 array, shape (k, m)
        Range minus distance at each position, metres; NaN where an anchor has no range.
    culprit : str
        Anchor whose removal explains a bad fit best; empty if the fit is good.
    culprit_test : float
        How much its removal lowers the cost; NaN without one.
    explained : bool or None
        Whether the other ranges fit; None without a culprit.
    """

    stamp_ns: int
    tag: str
    status: str
    reason: str
    position: FloatArray
    covariance: FloatArray
    cost: FloatArray
    agree: bool | None
    difference: float
    residual: FloatArray
    culprit: str
    culprit_test: float
    explained: bool | None = None
    ml_distance: float = float("nan")
    ml_sigmas: float = float("nan")

    @property
    def residual_rms(self) -> float:
        """Root mean square of the residuals at the best position, metres; NaN without one."""
        if len(self.position) == 0:
            return float("nan")
        return float(np.sqrt(np.nanmean(self.residual[0] ** 2)))

    @property
    def sigma(self) -> float:
        """Expected error of the best position: root of the sum of variances; NaN without one."""
        if len(self.position) == 0:
            return float("nan")
        return float(np.sqrt(np.trace(self.covariance[0])))


def read_epochs(
    anchors: str | Path, ranges: str | Path, sigma_m: float = 0.1, epoch_s: float = 0.0
) -> Epochs:
    """Read ranges and group them into epochs.

    An epoch of a tag begins with a range and takes those that follow within `epoch_s`, until one of
    its anchors has another range.

    Parameters
    ----------
    anchors, ranges : paths
        CSV files as in a log folder (docs/log_format.md).
    sigma_m : float
        Of ranges, where the file has no column ``sigma_m``.
    epoch_s : float
        0: only ranges of the same stamp belong together.

    Raises
    ------
    LogError
        If a file cannot be read, a range is 0 or names an anchor that is not in the file of
        anchors, or a tag has two ranges to an anchor at one stamp.
    ConfigError
        If `sigma_m` is not positive or `epoch_s` negative.
    """
    if not 0.0 < sigma_m < float("inf"):
        raise ConfigError(f"sigma is {sigma_m}, expected > 0")
    if not 0.0 <= epoch_s <= 1e9:
        raise ConfigError(f"epoch is {epoch_s}, expected 0 to 1e9 seconds")
    places = read_log_file(Path(anchors), "anchors")
    table = read_log_file(Path(ranges), "ranges")
    order = np.argsort(table["stamp_ns"], kind="stable")  # arrival_s may have left it in another
    table = {name: values[order] for name, values in table.items()}
    names = [str(name) for name in places["anchor"]]
    column = _columns_of(table, names, ranges)
    rows = _epoch_of_each(table, column, round(epoch_s * NANOSECONDS), ranges)
    n = int(rows.max()) + 1 if len(rows) > 0 else 0
    _, first = np.unique(rows, return_index=True)
    epochs = Epochs(
        names=names,
        anchors=np.column_stack([places[f"{axis}_m"] for axis in AXES]),
        stamp_ns=table["stamp_ns"][first],
        tag=table["tag"][first],
        ranges=np.full((n, len(names)), np.nan),
        sigma=np.full((n, len(names)), np.nan),
    )
    epochs.ranges[rows, column] = table["range_m"]
    epochs.sigma[rows, column] = table.get("sigma_m", np.full(len(rows), sigma_m))
    return epochs


def positions(
    epochs: Epochs, *, height: float | None = None, solver: str = "both", loss: str = "none",
    ml: str = "newton",
) -> list[Fix]:  # fmt: skip
    """Return where the tag was at each epoch.

    Parameters
    ----------
    epochs : Epochs
    height : float, optional
        Of the tag, metres: positions in the plane. Without it they are in space.
    solver : str
        ``both`` runs SR-LS and maximum likelihood, compares them and looks for every other position
        that fits; ``newton``, ``ceres``, ``srls`` and ``srwls`` give the position of that alone.
    loss : str
        Of maximum likelihood: ``none``, ``huber``, ``cauchy`` or ``one_sided``.
    ml : str
        Whose maximum likelihood is returned where `solver` is ``both``: ``newton`` or ``ceres``;
        ``both`` returns that of ``newton``, and how far from it Ceres ends.

    Raises
    ------
    ConfigError
        If there is no such solver, loss or `ml`, or the height is not a finite number.
    """
    for key, value, known in (("solver", solver, SOLVERS), ("loss", loss, LOSSES), ("ml", ml, MLS)):
        if value not in known:
            raise ConfigError(f"{key} is {value!r}; {nearest(value, known)}")
    if height is not None and not np.isfinite(height):
        raise ConfigError(f"height is {height}, expected a finite number")
    if solver != "both" and ml != "newton":
        raise ConfigError(f"ml is {ml!r}, which solver {solver} alone does not use; leave it out")
    if solver != "both" and len(epochs) > 0:
        return _alone(epochs, height, solver, loss)
    return [_compared(epochs, row, height, loss, ml) for row in range(len(epochs))]


def _compared(epochs: Epochs, row: int, height: float | None, loss: str, ml: str) -> Fix:
    """Return the position of an epoch by both solvers."""
    measured = np.flatnonzero(~np.isnan(epochs.ranges[row]))
    anchors, ranges = epochs.anchors[measured], epochs.ranges[row, measured]
    solution = _core.locate(anchors, ranges, epochs.sigma[row, measured], height=height, loss=loss,
                            ml=ml)  # fmt: skip
    d = 3 if height is None else 2
    position = np.array([h.position for h in solution.hypotheses]).reshape(-1, d)
    culprit, compared = solution.culprit, solution.comparison
    if compared is not None and compared.dof == 0:
        compared = None
    apart = solution.ml_comparison
    return Fix(
        stamp_ns=int(epochs.stamp_ns[row]),
        tag=str(epochs.tag[row]),
        status=solution.status.name.lower(),
        reason=solution.reason,
        position=position,
        covariance=np.array([h.covariance for h in solution.hypotheses]).reshape(-1, d, d),
        cost=np.array([h.cost for h in solution.hypotheses]),
        agree=None if compared is None else compared.agree,
        difference=float("nan") if compared is None else float(np.sqrt(compared.statistic)),
        residual=_residuals(epochs, row, position, height),
        culprit="" if culprit is None else epochs.names[measured[culprit.index]],
        culprit_test=float("nan") if culprit is None else culprit.statistic,
        explained=None if culprit is None else culprit.explains,
        ml_distance=float("nan") if apart is None else apart.distance,
        ml_sigmas=float("nan") if apart is None else apart.sigmas,
    )


def _alone(epochs: Epochs, height: float | None, solver: str, loss: str) -> list[Fix]:
    """Return the positions of all epochs by one solver."""
    fixes: dict[int, Fix] = {}
    missing = np.isnan(epochs.sigma)
    filled = np.where(missing, np.nanmax(epochs.sigma, axis=1, keepdims=True), epochs.sigma)
    sigmas, group = np.unique(filled, axis=0, return_inverse=True)
    for number, sigma in enumerate(sigmas):
        rows = np.flatnonzero(group.ravel() == number)
        found = _core.locate_batch(epochs.anchors, epochs.ranges[rows], sigma, height=height,
                                   solver=solver, loss=loss)  # fmt: skip
        for k, row in enumerate(rows.tolist()):
            there = slice(k, k + 1) if np.isfinite(found.position[k]).all() else slice(0)
            fixes[row] = Fix(
                stamp_ns=int(epochs.stamp_ns[row]),
                tag=str(epochs.tag[row]),
                status=_core.PositionStatus(int(found.status[k])).name.lower(),
                reason="",
                position=found.position[there],
                covariance=found.covariance[there],
                cost=found.cost[there],
                agree=None,
                difference=float("nan"),
                residual=_residuals(epochs, row, found.position[there], height),
                culprit="",
                culprit_test=float("nan"),
            )
    return [fixes[row] for row in range(len(epochs))]


def _residuals(epochs: Epochs, row: int, position: FloatArray, height: float | None) -> FloatArray:
    """Return range minus distance of each position (row) and anchor (column), metres."""
    if height is not None:
        position = np.column_stack([position, np.full(len(position), height)])
    difference = position[:, None, :] - epochs.anchors
    distance = np.linalg.norm(difference, axis=2)
    return np.asarray(epochs.ranges[row] - distance, dtype=np.float64)


def in_one_plane(epochs: Epochs) -> bool:
    """Return whether no anchor stands out of a plane by more than a millionth of their spread."""
    spread = np.linalg.svd(epochs.anchors - epochs.anchors.mean(axis=0), compute_uv=False)
    return len(spread) < 3 or bool(spread[-1] <= 1e-6 * spread[0])


def write_fixes(fixes: Sequence[Fix], names: Sequence[str], path: str | Path) -> None:
    """Write one row per position that fits, and one without a position where none does.

    Parameters
    ----------
    fixes : sequence of Fix
    names : sequence of str
        Anchors, in the order of the residuals.
    path : str or Path
        CSV; docs/cli.md lists its columns.
    """
    d = max((fix.position.shape[1] for fix in fixes), default=2)
    covariances = [(i, j) for i in range(d) for j in range(i, d)]
    header = ["stamp_s", "tag", "status", "reason", "agree", "difference", "culprit",
              "culprit_test", "explained", "ml_distance_m", "ml_sigmas", "hypothesis",
              "hypotheses", "cost", "residual_rms_m",
              *(f"{axis}_m" for axis in AXES[:d]),
              *(f"cov_{AXES[i]}_{AXES[j]}" for i, j in covariances),
              *(f"residual_{name}_m" for name in names)]  # fmt: skip
    rows = [row for fix in fixes for row in _rows(fix, d, covariances, len(names))]
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(header)
    write_table(Path(path), header, columns)


def _rows(
    fix: Fix, d: int, covariances: Sequence[tuple[int, int]], anchors: int
) -> Iterator[list[str]]:
    words = {True: "yes", False: "no", None: ""}
    reason = fix.reason.replace(",", ";").replace('"', "'")  # nothing is quoted in our files
    when = stamp_texts(np.array([fix.stamp_ns], dtype=np.int64))
    difference, test = _texts(fix.difference, fix.culprit_test)
    shared = [*when, fix.tag, fix.status, reason, words[fix.agree], difference, fix.culprit, test]
    shared += [words[fix.explained], *_texts(fix.ml_distance, fix.ml_sigmas)]
    count = len(fix.position)
    if count == 0:
        blank = 2 + d + len(covariances) + anchors
        yield [*shared, "0", "0", *[""] * blank]
    for k in range(count):
        rms = float(np.sqrt(np.nanmean(fix.residual[k] ** 2)))
        covariance = [float(fix.covariance[k, i, j]) for i, j in covariances]
        numbers = [float(fix.cost[k]), rms, *fix.position[k].tolist(), *covariance]
        residual = fix.residual[k].tolist()
        yield [*shared, str(k + 1), str(count), *_texts(*numbers, *residual)]


def _texts(*values: float) -> list[str]:
    return number_texts(np.array(values, dtype=np.float64))


def _columns_of(table: Columns, names: Sequence[str], path: str | Path) -> NDArray[np.int64]:
    """Return the number of the anchor of each range."""
    for row in np.flatnonzero(table["range_m"] == 0.0)[:1]:
        stamp, anchor = stamp_texts(table["stamp_ns"][row : row + 1])[0], table["anchor"][row]
        raise LogError(f"{path}: the range to anchor {anchor} at {stamp} s is 0, expected > 0; "
                       "leave out ranges that were not measured")  # fmt: skip
    index = {name: number for number, name in enumerate(names)}
    for name in np.unique(table["anchor"]).tolist():
        if name not in index:
            raise LogError(f"{path}: anchor {name!r} has no place; {nearest(name, names)}")
    return np.array([index[name] for name in table["anchor"].tolist()], dtype=np.int64)


def _epoch_of_each(
    table: Columns, column: NDArray[np.int64], length_ns: int, path: str | Path
) -> NDArray[np.int64]:
    """Return the number of the epoch of each range; the table is sorted by stamp."""
    rows = np.empty(len(column), np.int64)
    epoch: dict[str, tuple[int, int]] = {}  # the open one of each tag: number, begin
    last: dict[tuple[str, int], tuple[int, int]] = {}  # each link's last range: epoch, stamp
    count = 0
    for row, (stamp, tag, anchor) in enumerate(
        zip(table["stamp_ns"].tolist(), table["tag"].tolist(), column.tolist(), strict=True)
    ):
        number, begin = epoch.get(tag, (-1, 0))
        before, at = last.get((tag, anchor), (-1, 0))
        if before >= 0 and at == stamp:
            name, when = table["anchor"][row], stamp_texts(table["stamp_ns"][row : row + 1])[0]
            raise LogError(f"{path}: tag {tag} has two ranges to anchor {name} at {when} s, "
                           "expected one")  # fmt: skip
        if number < 0 or stamp - begin > length_ns or before == number:
            number, count = count, count + 1
            epoch[tag] = (number, stamp)
        last[tag, anchor] = (number, stamp)
        rows[row] = number
    return rows
