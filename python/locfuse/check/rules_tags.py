# SPDX-License-Identifier: Apache-2.0
"""Checks of tags on the body, and of their positions reported by an RTLS."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, warning
from locfuse.check.positions import BRIDGED_S, epochs, located
from locfuse.eval.verdicts import series_of
from locfuse.types import NANOSECONDS, Columns, FloatArray

_ONE_PLACE_M = 0.05
_LINE = 0.05  # width over length below which tags count as on one line
_EPOCHS = 500  # that are looked at
_CLEARLY, _MAX_NIS = 2.0, 6.0  # times as well in another order; of three rows, half of all
_CORRELATED = 10.0  # consecutive fixes with correlated errors
_FROZEN = 3  # fixes in a row
_SILENT_S, _SILENT_PERIODS = 5.0, 10.0


def tags_in_one_place(context: Context) -> Iterator[Finding]:
    """Name tags in use that share a place, or stand in one line, on the body."""
    arms = context.arms
    for a, b in combinations(arms, 2):
        apart = float(np.hypot(*(arms[a] - arms[b])))
        if apart < _ONE_PLACE_M:
            yield warning(f"tags {a} and {b} are {apart:.2g} m apart in body: together they give "
                          "no heading", "log.yaml, tags",
                          "measure both; put them at the corners of the machine")  # fmt: skip
    at = np.array(list(arms.values())).reshape(-1, 2)
    if len(at) < 3:
        return
    _, size, _ = np.linalg.svd(at - at.mean(axis=0), full_matrices=False)
    if size[0] > _ONE_PLACE_M and size[1] < _LINE * size[0]:
        yield warning(f"tags {', '.join(arms)} are in one line on the body: their triangle gives "
                      "no swapped ids, and TagTriangleEkf refuses it", "log.yaml, tags",
                      "put one of them well off the line")  # fmt: skip


def tags_inconsistent_with_fixes(context: Context) -> Iterator[Finding]:
    """Name swapped ids of tags, else pairs that are not as far apart as on the body."""
    table = context.used("positions")
    if table is None or "tag" not in table:
        return
    swapped = _swapped(context, table, "positions.csv")
    if swapped is not None:
        yield swapped
        return
    frozen = {run.tag for run in _frozen(context)}
    for a, b in combinations(context.arms, 2):
        if not {a, b} & frozen:
            yield from _apart(context, table, a, b)


def tags_inconsistent_with_ranges(context: Context) -> Iterator[Finding]:
    """Name swapped ids of tags by the positions that the ranges of each give."""
    table = _by_ranges(context)
    swapped = None if table is None else _swapped(context, table, "ranges.csv")
    if swapped is not None:
        yield swapped


def _swapped(context: Context, table: Columns, source: str) -> Finding | None:
    """Return that the fixes of three tags fit their triangle in another order, if so."""
    for names in combinations(context.arms, 3):
        tags = [_core.Tag(k, list(context.log.tags[name])) for k, name in enumerate(names)]
        epochs = list(_epochs(table, names))
        try:
            nis = {ids: _misfit(tags, epochs, ids) for ids in permutations(range(3))}
        except ValueError:  # in one place or line, which has a finding of its own
            continue
        best = min(nis, key=lambda ids: nis[ids])
        if nis[0, 1, 2] < _CLEARLY * nis[best] or nis[0, 1, 2] < _MAX_NIS:
            continue
        similar = [ids for ids in nis if nis[ids] < _CLEARLY * nis[best]]
        wrong = ", ".join(f"{names[k]} is {names[right]}"
                          for k, right in enumerate(best) if k != right)  # fmt: skip
        which = wrong if len(similar) == 1 else "which of them is unknown"
        return error(f"ids of tags {', '.join(names)} are swapped: {which}. The median NIS of "
                     f"{len(epochs)} fits to their triangle is {nis[0, 1, 2]:.3g}, and "
                     f"{nis[best]:.2g} then ({source})", "log.yaml, tags",
                     f"exchange their places in log.yaml, or their names in {source}"
                     )  # fmt: skip
    return None


def _misfit(
    tags: list[_core.Tag], epochs: list[list[_core.PositionFix]], ids: tuple[int, ...]
) -> float:
    """Return the median NIS with which fixes fit the triangle if they are of other tags."""
    if not epochs:
        return 0.0
    orders = (
        _core.tag_order(tags, [_core.PositionFix(z.stamp, z.position, z.covariance, k)
                               for z, k in zip(fixes, ids, strict=True)])
        for fixes in epochs
    )  # fmt: skip
    return float(np.median([order.nis for order in orders]))


def _epochs(table: Columns, names: tuple[str, ...]) -> Iterator[list[_core.PositionFix]]:
    """Yield the fixes of all these tags at stamps at which each has one."""
    rows = {name: _by_stamp(table, name) for name in names}
    shared = sorted(set.intersection(*(set(found) for found in rows.values())))
    for stamp in shared[:: max(1, len(shared) // _EPOCHS)]:
        yield [_core.PositionFix(stamp, at, sigma**2 * np.eye(2), k)
               for k, (at, sigma) in enumerate(rows[name][stamp] for name in names)]  # fmt: skip


def _by_stamp(table: Columns, name: str) -> dict[int, tuple[list[float], float]]:
    mine = table["tag"] == name
    columns = (table[key][mine].tolist() for key in ("stamp_ns", "x_m", "y_m", "sigma_m"))
    return {stamp: ([x, y], sigma) for stamp, x, y, sigma in zip(*columns, strict=True)
            if sigma > 0.0}  # fmt: skip


def _apart(context: Context, table: Columns, a: str, b: str) -> Iterator[Finding]:
    """Report if fixes of two tags are farther apart, or nearer, than the tags on the body."""
    one, other = _by_stamp(table, a), _by_stamp(table, b)
    shared = sorted(set(one) & set(other))
    if len(shared) < 10:
        return
    off = np.array([one[stamp][0] for stamp in shared]) - [other[stamp][0] for stamp in shared]
    measured = np.hypot(*off.T)
    noise = 1.4826 * float(np.median(np.abs(measured - np.median(measured))))
    # The median of a distance with that noise along and across is longer than the distance.
    found = float(np.sqrt(max(np.median(measured) ** 2 - noise**2, 0.0)))
    body = float(np.hypot(*(context.arms[a] - context.arms[b])))
    scatter = 3.0 * noise / float(np.sqrt(max(len(shared) / _CORRELATED, 1.0)))
    bent = noise**2 / max(found, noise, _ONE_PLACE_M)  # of a distance as short as its noise
    if abs(found - body) > 0.1 + scatter + bent:
        yield error(f"tags {a} and {b} are {body:.2f} m apart on the body, but their fixes "
                    f"{found:.2f} m: places or ids are wrong", "log.yaml, tags",
                    "measure where each tag is, in body coordinates")  # fmt: skip


@dataclass(frozen=True)
class _Frozen:
    tag: str
    count: int
    begin_ns: int
    end_ns: int
    driven_m: float


def frozen_fixes(context: Context) -> Iterator[Finding]:
    """Name tags whose position stays bit for bit the same while the machine drives."""
    for run in _frozen(context):
        begin, end = ((at - context.begin_ns) / NANOSECONDS for at in (run.begin_ns, run.end_ns))
        of = f"of tag {run.tag} " if run.tag else ""
        yield error(f"the position {of}is frozen: {run.count} fixes from {begin:.3g} s to "
                    f"{end:.3g} s after the start are bit for bit the same while the wheels drive "
                    f"{run.driven_m:.3g} m", "positions.csv",
                    "remove those rows and restart the RTLS; tag_conditioner rejects them as they "
                    "come")  # fmt: skip


def _frozen(context: Context) -> Iterator[_Frozen]:
    """Yield the longest run of equal fixes of each tag through which the wheels drive."""
    table, odometry = context.used("positions"), context.odometry
    if table is None or odometry is None:
        return
    name = table.get("tag", np.full(len(table["stamp_ns"]), ""))
    step = np.linalg.norm(np.diff(odometry.position, axis=0), axis=1)
    driven, zero = np.concatenate([[0.0], np.cumsum(step)]), odometry.stamp_ns[0]
    for tag in sorted(set(name.tolist())):
        rows = np.flatnonzero(name == tag)
        rows = rows[np.argsort(table["stamp_ns"][rows], kind="stable")]
        stamp, sigma = table["stamp_ns"][rows], float(np.median(table["sigma_m"][rows]))
        begin, end = _longest_same(np.column_stack([table["x_m"], table["y_m"]])[rows])
        way = np.interp((stamp[[begin, end]] - zero) / NANOSECONDS,
                        (odometry.stamp_ns - zero) / NANOSECONDS, driven)  # fmt: skip
        gone = float(way[1] - way[0])
        if end - begin + 1 >= _FROZEN and gone > max(0.3, sigma):
            yield _Frozen(tag, end - begin + 1, int(stamp[begin]), int(stamp[end]), gone)


def _longest_same(at: FloatArray) -> tuple[int, int]:
    """Return the first and last row of the longest run of equal rows of (n, 2)."""
    runs = series_of(np.all(np.diff(at, axis=0) == 0.0, axis=1))
    return max(runs, key=lambda run: run[1] - run[0], default=(0, 0))


def silent_tags(context: Context) -> Iterator[Finding]:
    """Name tags without measurements for long while others of the same source are."""
    for source in ("positions", "ranges"):
        table = context.used(source)
        if table is None or "tag" not in table:
            continue
        for tag in sorted(set(table["tag"].tolist()) - {""}):
            mine = table["tag"] == tag
            yield from _silence(context, source, tag, np.sort(table["stamp_ns"][mine]),
                                np.sort(table["stamp_ns"][~mine]))  # fmt: skip


def _silence(
    context: Context, source: str, tag: str, mine: NDArray[np.int64], others: NDArray[np.int64]
) -> Iterator[Finding]:
    if len(others) == 0:
        return
    edges = np.concatenate([[min(mine[0], others[0])], mine, [max(mine[-1], others[-1])]])
    gap = int(np.argmax(np.diff(edges)))
    begin, end = int(edges[gap]), int(edges[gap + 1])
    length_s = (end - begin) / NANOSECONDS
    period_s = float(np.median(np.diff(mine))) / NANOSECONDS if len(mine) > 1 else 0.0
    # Not a place where radio is poor: there the others fall silent too.
    between = np.unique(others[(others > begin) & (others < end)])
    received = len(between) > 0.5 * length_s / max(period_s, 0.1)
    if length_s > max(_SILENT_S, _SILENT_PERIODS * period_s) and received:
        of = (begin - context.begin_ns) / NANOSECONDS
        until = "to the end" if end > mine[-1] else f"for {length_s:.3g} s"
        yield warning(f"tag {tag} is silent from {of:.3g} s after the start {until} while other "
                      f"tags are received ({source})", f"{source}.csv",
                      "look at its battery and its mount; the heading rests on the others"
                      )  # fmt: skip


def _by_ranges(context: Context) -> Columns | None:
    """Return positions of each tag as its ranges give them, at the stamps of one of the tags.

    Radios that range to one tag after the other measure each at another time: the positions of the
    other tags are interpolated, over at most `BRIDGED_S`.
    """
    table = context.used("ranges")
    if table is None or "tag" not in table or len(context.anchors) < 3:
        return None
    paths = {name: path for name in context.arms
             if len((path := _path_by_ranges(context, table, name))[0]) > 1}  # fmt: skip
    if len(paths) < 3:
        return None
    stamp = min((at for at, _ in paths.values()), key=len)
    rows = {name: _at(stamp, *path) for name, path in paths.items()}
    measured = np.concatenate(list(rows.values()))
    known = np.isfinite(measured[:, 0])
    return {
        "stamp_ns": np.tile(stamp, len(rows))[known],
        "tag": np.repeat(np.array(list(rows)), len(stamp))[known],
        "x_m": measured[known, 0],
        "y_m": measured[known, 1],
        "sigma_m": measured[known, 2],
    }


def _path_by_ranges(
    context: Context, table: Columns, name: str
) -> tuple[NDArray[np.int64], FloatArray]:
    """Return stamps, and x, y and sigma per axis (n, 3) at each, where ranges fix a position."""
    rows = np.flatnonzero(context.placed & (table["tag"] == name))
    rows = rows[np.argsort(table["stamp_ns"][rows], kind="stable")]
    mine = {key: values[rows] for key, values in table.items()}
    if not len(rows):
        return np.empty(0, np.int64), np.empty((0, 3))
    stamp, ranges = epochs(mine, context.index(mine["anchor"]), context.corrected(mine),
                           len(context.anchors))  # fmt: skip
    at, covariance, _ = located(context.anchors, ranges, context.typical_sigma,
                             height=context.log.tags[name][2])  # fmt: skip
    sigma = np.sqrt(0.5 * np.trace(covariance, axis1=1, axis2=2))
    good = np.isfinite(at[:, 0]) & np.isfinite(sigma)
    return stamp[good], np.column_stack([at, sigma])[good]


def _at(stamp_ns: NDArray[np.int64], path_ns: NDArray[np.int64], path: FloatArray) -> FloatArray:
    """Return the rows (n, 3) of a path in time; NaN before, behind and in its gaps."""
    after = np.clip(np.searchsorted(path_ns, stamp_ns), 1, len(path_ns) - 1)
    begin, end = path_ns[after - 1], path_ns[after]
    share = (stamp_ns - begin) / np.maximum(end - begin, 1)
    measured = path[after - 1] + share[:, None] * (path[after] - path[after - 1])
    bridged = (share >= 0.0) & (share <= 1.0) & (end - begin <= BRIDGED_S * NANOSECONDS)
    return np.where((bridged | (share == 0.0) | (share == 1.0))[:, None], measured, np.nan)
