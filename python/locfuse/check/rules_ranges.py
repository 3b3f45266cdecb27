# SPDX-License-Identifier: Apache-2.0
"""Checks of what the ranges say against anchors, truth and one another."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.check.context import Context, Fits, Residuals
from locfuse.check.finding import Finding, error, note, warning
from locfuse.check.positions import EPOCH_S, dop, limit_of, residuals_of
from locfuse.eval.verdicts import series_of
from locfuse.types import NANOSECONDS, Columns, FloatArray

_SCATTER = 1.4826  # standard deviation over median absolute deviation of a Gaussian
_MAX_SWAPS = 3
_MAX_ANCHORS = 24
_SOME_EPOCHS = 300
_MIN_ROWS = 20
_SOME, _MANY = 0.05, 0.1  # outliers that are too many of one anchor, and of all
_AT_THE_TAG = "keep range.gate below 1; is the tag behind a body or beside metal?"
_RISES_M = np.arange(-12, 13) * 0.25


def units_of_ranges(context: Context) -> Iterator[Finding]:
    """Name ranges and anchors that differ by a unit."""
    table = context.used("ranges")
    if table is None or context.extent <= 0.0:
        return
    typical = float(np.median(table["range_m"]))
    ratio = typical / context.extent
    longer, shorter = _triangles(context, table)
    unit = "centimetres" if abs(math.log10(2.0 * ratio)) < 2.5 else "millimetres"
    if ratio > 30.0 or (longer and ratio > 10.0):
        yield error(f"ranges are typically {typical:.4g} m, the anchors span {context.extent:.3g} m"
                    f" ({ratio:.3g} times): {unit}?", "ranges.csv, range_m",
                    "write ranges in metres")  # fmt: skip
    elif ratio < 0.005 or (shorter and ratio < 0.1):
        yield error(f"ranges are typically {typical:.3g} m, the anchors span {context.extent:.4g} m"
                    f": are the anchors in {unit}?", "anchors.csv",
                    "write anchors in metres")  # fmt: skip


def _triangles(context: Context, table: Columns) -> tuple[bool, bool]:
    """Return whether most ranges of a moment are too long, or short, for a triangle with anchors.

    Wherever the tag is, two ranges differ by less than their anchors are apart, and add up to more.
    """
    rows = np.flatnonzero(context.placed)
    rows = rows[np.lexsort((table["stamp_ns"][rows], table["tag"][rows]))]
    of, length = context.index(table["anchor"][rows]), table["range_m"][rows]
    apart = np.linalg.norm(np.diff(context.anchors[of], axis=0), axis=1)
    near = (apart > 0.0) & (np.diff(table["stamp_ns"][rows]) < EPOCH_S * NANOSECONDS)
    if np.count_nonzero(near) < _MIN_ROWS:
        return False, False
    differ, add_up = np.abs(np.diff(length)), length[1:] + length[:-1]
    return (float(np.mean(differ[near] > apart[near])) > 0.5,
            float(np.mean(add_up[near] < apart[near])) > 0.5)  # fmt: skip


def invalid_ranges(context: Context) -> Iterator[Finding]:
    """Name ranges of zero, ranges far beyond the floor, and radios that repeat one number."""
    table = context.used("ranges")
    if table is None or context.extent <= 0.0:
        return
    zero = float(np.mean(table["range_m"] == 0.0))
    if zero > 0.0:
        yield warning(f"{100 * zero:.3g} % of the ranges are exactly 0: a radio's way to say that "
                      "it received nothing", "ranges.csv", "drop them when recording")  # fmt: skip
    assert context.floor is not None
    reach = 3.0 * float(np.hypot(*(context.floor[1] - context.floor[0])))
    moves = context.odometry is not None and np.ptp(context.odometry.position, axis=0).max() > 1.0
    for name in context.names:
        mine = table["range_m"][table["anchor"] == name]
        far = float(np.mean(mine > reach)) if len(mine) else 0.0
        if 0.0 < far < 0.5:
            yield warning(f"{100 * far:.3g} % of the ranges to {name} are beyond {reach:.3g} m, "
                          f"three times across the floor (up to {mine.max():.4g} m)",
                          "ranges.csv", "find the multipath, and keep range.gate below 1"
                          )  # fmt: skip
        if moves and len(mine) >= _MIN_ROWS and _longest_run(mine) >= 20:
            yield warning(f"ranges to {name} repeat one number for {_longest_run(mine)} rows while "
                          "the robot drives", "ranges.csv",
                          "the radio sends old values; restart it")  # fmt: skip


def _longest_run(values: FloatArray) -> int:
    """Return how many equal values follow one another at most; there is at least one."""
    return 1 + max((end - first for first, end in series_of(np.diff(values) == 0.0)), default=0)


def anchors_swapped(context: Context) -> Iterator[Finding]:
    """Try to exchange the names of two anchors; report it if the ranges fit clearly better."""
    by_truth = list(_swapped_by_truth(context))
    if by_truth:
        yield from by_truth
    elif context.fits is not None and len(context.names) <= _MAX_ANCHORS:
        yield from _swapped_by_fit(context, context.fits)


def _swapped_by_fit(context: Context, fits: Fits) -> Iterator[Finding]:
    rows = np.unique(np.linspace(0, len(fits.ranges) - 1, _SOME_EPOCHS).astype(np.intp))
    ranges = fits.ranges[rows]
    order = np.arange(len(context.names))
    before = best = _misfit(context.anchors, ranges, fits.height)
    swaps: list[str] = []
    for _ in range(_MAX_SWAPS):
        trials = _trials(context, fits, ranges, order)
        after, pair = min(trials)
        if after > 0.6 * best or best - after < 0.02:
            break
        equal = [_named(context, p) for misfit, p in trials if misfit < 1.02 * after and p != pair]
        swaps.append(" or, fitting as well, ".join([_named(context, pair), *equal]))
        best = after
        order[list(pair)] = order[list(pair)[::-1]]
    if swaps and best < limit_of(context.typical_sigma):
        yield error(f"exchanging {' and '.join(swaps)} makes the ranges fit: residual {best:.3f} m "
                    f"instead of {before:.3f} m", "anchors.csv",
                    "exchange the names, or find out what else the two have in common"
                    )  # fmt: skip


def _named(context: Context, pair: tuple[int, int]) -> str:
    return f"{context.names[pair[0]]} with {context.names[pair[1]]}"


def _trials(
    context: Context, fits: Fits, ranges: FloatArray, order: NDArray[np.intp]
) -> list[tuple[float, tuple[int, int]]]:
    """Return the misfit after each exchange of two."""
    found = []
    for i, j in combinations(range(len(order)), 2):
        trial = order.copy()
        trial[[i, j]] = trial[[j, i]]
        found.append((_misfit(context.anchors[trial], ranges, fits.height), (i, j)))
    return found


def _misfit(anchors: FloatArray, ranges: FloatArray, height: float) -> float:
    """Return the typical residual of a moment, as a standard deviation."""
    found = _core.locate_batch(anchors, ranges, height=height)  # both sides have the same residuals
    left = residuals_of(anchors, ranges, found.position, height)
    free = np.isfinite(left).sum(axis=1) - 2
    good = free > 0
    if not good.any():
        return float("inf")
    return float(np.median(np.sqrt(np.nansum(left[good] ** 2, axis=1) / free[good])))


def _swapped_by_truth(context: Context) -> Iterator[Finding]:
    """Compare with the truth, which also shows exchanges that mirror the layout."""
    if context.residuals is None or context.residuals.against != "truth.csv":
        return
    table = context.used("ranges")
    assert table is not None
    typical = _typical_by_anchor(context, np.arange(len(context.names)))
    bad = [k for k in range(len(typical)) if typical[k] > max(0.3, 4.0 * context.typical_sigma)]
    for i, j in combinations(bad, 2):
        order = np.arange(len(context.names))
        order[[i, j]] = order[[j, i]]
        after = _typical_by_anchor(context, order)
        if max(after[i], after[j]) < 0.4 * min(typical[i], typical[j]):
            yield error(f"exchanging {_named(context, (i, j))} makes the ranges fit the truth: "
                        f"residual {max(after[i], after[j]):.3f} m instead of "
                        f"{min(typical[i], typical[j]):.3f} m", "anchors.csv",
                        "exchange the names")  # fmt: skip


def _typical_by_anchor(context: Context, order: NDArray[np.intp]) -> list[float]:
    """Return the median size of the residuals to each anchor, anchors in another order."""
    tables = dict(context.log.tables)
    table = tables["anchors"]
    tables["anchors"] = {key: v if key == "anchor" else v[order] for key, v in table.items()}
    log = type(context.log)(tables, context.log.tags)
    found = Context(context.config, log).against_truth()
    if found is None:
        return [0.0] * len(context.names)
    return [
        float(np.median(np.abs(found.value[found.anchor == k])))
        if (found.anchor == k).any()
        else 0.0
        for k in range(len(context.names))
    ]


def _scatter(values: FloatArray) -> float:
    """Return the standard deviation that outliers do not move."""
    return float(_SCATTER * np.median(np.abs(values - np.median(values))))


def _medians(context: Context, residuals: Residuals) -> dict[int, float]:
    """Return the median residual of each anchor with enough ranges."""
    found = {}
    for index in range(len(context.names)):
        mine = residuals.value[residuals.anchor == index]
        if len(mine) >= _MIN_ROWS:
            found[index] = float(np.median(mine))
    return found


def ranges_with_a_common_error(context: Context) -> Iterator[Finding]:
    """Report an offset or a scale that the ranges to all anchors share."""
    residuals = context.residuals
    if residuals is None:
        return
    explained = _explained(context)
    if residuals.against != "truth.csv":
        yield from _common_by_fit(explained, context.typical_sigma)
    elif explained is None or not explained.by_height:
        yield from _common_by_truth(context, residuals)


def _common_by_truth(context: Context, residuals: Residuals) -> Iterator[Finding]:
    medians = list(_medians(context, residuals).values())
    if len(medians) < 2:
        return
    limit = max(0.05, context.typical_sigma)
    long = float(np.median(medians))
    same = np.mean(np.sign(medians) == np.sign(long))
    if abs(long) < limit or same < 0.75:
        return
    slope = float(np.median(residuals.value / np.maximum(residuals.distance, 0.1)))
    as_offset = float(np.median(np.abs(residuals.value - long)))
    as_scale = float(np.median(np.abs(residuals.value - slope * residuals.distance)))
    if as_scale < as_offset:
        text = f"{100 * slope:+.2g} % of the distance, which leaves {as_scale:.2g} m"
        yield _common(long, text, "anchors.all.scale", f"{1 + slope:.4g}")
    else:
        text = f"an offset, which leaves {as_offset:.2g} m"
        yield _common(long, text, "anchors.all.offset_m", f"{long:.2g}")


def _common_by_fit(explained: Explained | None, sigma: float) -> Iterator[Finding]:
    if explained is None or explained.by_height:
        return
    before, after, offset = explained.before, explained.without_offset, explained.offset
    if abs(offset) > max(0.1, sigma) and after < 0.7 * before:
        text = f"the residual falls from {before:.2g} m to {after:.2g} m without it"
        yield _common(offset, text, "anchors.all.offset_m", f"{offset:.2g}")


@dataclass(frozen=True)
class Explained:
    """How well one offset of all ranges, or another height of the tag, lets positions fit.

    Both make ranges read long, so only the better of the two is reported.
    """

    before: float
    offset: float
    without_offset: float
    height: float
    at_height: float

    @property
    def by_height(self) -> bool:
        """Whether the height explains the ranges, and better than the offset."""
        return self.at_height < min(0.6 * self.before, 0.8 * self.without_offset)


def _explained(context: Context) -> Explained | None:
    """Search offset and height; needs four anchors in a moment."""
    fits = context.fits
    if fits is None:
        return None
    rows = np.flatnonzero(np.isfinite(fits.ranges).sum(axis=1) >= 4)
    if len(rows) < _MIN_ROWS:
        return None
    ranges = fits.ranges[rows[:: max(1, len(rows) // _SOME_EPOCHS)]]

    def misfit(offset: float, rise: float) -> float:
        return _misfit(context.anchors, ranges - offset, fits.height + rise)

    offset = 0.0
    for step in (0.4, 0.2, 0.1, 0.05, 0.02):
        offset = min((offset + k * step for k in range(-3, 4)), key=lambda b: misfit(b, 0.0))
    rises = sorted(_RISES_M.tolist(), key=abs)  # of equal ones, as above and below, the nearest
    at = [misfit(0.0, rise) for rise in rises]
    best = next(k for k in range(len(at)) if at[k] < 1.05 * min(at))
    return Explained(at[0], offset, misfit(offset, 0.0), fits.height + rises[best], at[best])


def _common(long: float, text: str, key: str, value: str) -> Finding:
    word = "long" if long > 0.0 else "short"
    return warning(f"ranges to all anchors read {word} by about {abs(long):.2g} m ({text}): a "
                   "fault of the radios that no filter should absorb", key,
                   f"calibrate the antenna delay, or set {key} to {value}")  # fmt: skip


def anchor_errors(context: Context) -> Iterator[Finding]:
    """Name anchors whose ranges are off from what the others read."""
    residuals = context.residuals
    if residuals is None or residuals.against != "truth.csv":
        return
    medians = _medians(context, residuals)
    if len(medians) < 3:
        return
    common = float(np.median(list(medians.values())))
    limit = limit_of(context.typical_sigma)
    for index, value in medians.items():
        mine = residuals.value[residuals.anchor == index]
        if _has_outliers(mine, limit):
            continue  # which `outliers_by_anchor` reports
        if abs(value - common) > max(0.15, 3.0 * context.typical_sigma, 0.5 * _scatter(mine)):
            name = context.names[index]
            yield warning(f"ranges to {name} read {value - common:+.2g} m against the others: "
                          "an offset of its own, no line of sight, or a wrong place", "anchors.csv",
                          f"measure {name} again, or set anchors.{name}.offset_m")  # fmt: skip


def outliers_by_anchor(context: Context) -> Iterator[Finding]:
    """Name anchors with many ranges that no noise explains; if most have, what they share."""
    residuals = context.residuals
    if residuals is None:
        return
    limit = limit_of(context.typical_sigma)
    against = f"off by more than {limit:.2g} m from {residuals.against}"
    off = {k: _off(residuals.value[residuals.anchor == k], limit)
           for k in _medians(context, residuals)}  # fmt: skip
    share = {k: float(np.mean(off[k] > limit)) for k in off}
    typical = sorted(share.values())[(len(share) - 1) // 2] if share else 0.0
    if residuals.contradictory > _MANY:
        yield warning(f"in {100 * residuals.contradictory:.0f} % of the moments the ranges "
                      f"contradict one another by more than {limit:.2g} m, and no single anchor "
                      "explains it", "ranges.csv", _AT_THE_TAG)  # fmt: skip
    elif typical > _MANY:
        shares = ", ".join(f"{100 * share[k]:.0f} % to {context.names[k]}" for k in share)
        yield warning(f"ranges to most anchors are often {against}: {shares}; no single anchor "
                      "explains it", "ranges.csv", _AT_THE_TAG)  # fmt: skip
    # Where several ranges are wrong at once, leaving out one of them fits by chance, now and then.
    least = max(_SOME, 2.0 * typical, residuals.contradictory)
    for k in (k for k in share if share[k] > least):
        yield warning(f"{100 * share[k]:.0f} % of the ranges to {context.names[k]} are {against} "
                      f"(up to {off[k].max():.3g} m)", "ranges.csv",
                      "keep range.gate below 1; is there a wall in between?")  # fmt: skip


def _has_outliers(value: FloatArray, limit: float) -> bool:
    """Return whether residuals are good or outliers, and no offset makes most of them good."""
    median = float(np.median(value))
    good, shifted = (float(np.mean(np.abs(value - by) <= limit)) for by in (0.0, median))
    return abs(median) > limit and good > _SOME and shifted < 0.5


def _off(value: FloatArray, limit: float) -> FloatArray:
    """Return how far residuals are from what an anchor's good ones have in common."""
    good = value[np.abs(value) <= limit] if _has_outliers(value, limit) else value
    return np.abs(value - np.clip(np.median(good), -limit, limit))


def sigma_against_the_scatter(context: Context) -> Iterator[Finding]:
    """Compare the sigma of ranges with what they scatter by."""
    residuals = context.residuals
    if residuals is None or residuals.freedom < 0.2:
        return
    medians = _medians(context, residuals)
    left = [residuals.value[residuals.anchor == k] - m for k, m in medians.items()]
    if not left:
        return
    spread = float(np.median([_scatter(part) for part in left])) / np.sqrt(residuals.freedom)
    sigma = context.typical_sigma
    text = f"the filter takes {sigma:.2g} m for the noise of ranges, they scatter by {spread:.2g} m"
    brings = "sigma_m" in context.log["ranges"]
    where = "ranges.csv, sigma_m" if brings else "estimator.range"
    if sigma < 0.4 * spread:
        yield warning(f"{text}: good ranges will be gated and the covariance too small", where,
                      f"set a sigma near {spread:.2g} m")  # fmt: skip
    elif sigma > 5.0 * max(spread, 0.005):
        yield warning(f"{text}: ranges will hardly count", where,
                      f"set a sigma near {max(2 * spread, 0.01):.2g} m")  # fmt: skip
    else:
        yield note(f"{text} about {residuals.against}", where)


def tag_height_mismatch(context: Context) -> Iterator[Finding]:
    """Try other heights of the tag; report one that fits clearly better."""
    found = _explained(context)
    if found is None or not found.by_height:
        return
    if abs(found.height - context.height) > 0.3 and found.before - found.at_height > 0.02:
        yield warning(f"the ranges fit a tag at {found.height:.1f} m better than the "
                      f"{context.height:g} m given: residual {found.at_height:.2g} m instead of "
                      f"{found.before:.2g} m", "log.yaml, tags",
                      "measure heights of tag and anchors from the same floor")  # fmt: skip


def frame_of_the_truth(context: Context) -> Iterator[Finding]:
    """Report that truth and anchors are in different frames."""
    found = context.frame_of_truth
    if found is None:
        return
    angle, (x, y) = found
    yield error("truth and anchors are in different frames: positions from ranges lie on the truth "
                f"after a turn of {np.degrees(angle):.0f} deg and a shift of ({x:.2f}, {y:.2f}) m",
                "truth.csv", "bring both into one frame; start: truth starts in the wrong place"
                )  # fmt: skip


def clock_of_the_ranges(context: Context) -> Iterator[Finding]:
    """Report an offset between the clocks of ranges and truth."""
    if context.frame_of_truth is not None or context.residuals is None:
        return
    shifts = np.arange(-20, 21) * 0.1
    sizes = []
    for shift in shifts:
        found = context.against_truth(round(shift * NANOSECONDS))
        if found is None:
            return
        sizes.append(float(np.median(np.abs(found.value - np.median(found.value)))))
    best = int(np.argmin(sizes))
    if abs(shifts[best]) > 0.15 and sizes[best] < 0.75 * sizes[20]:
        yield warning(f"ranges fit the truth best if its clock is shifted by {shifts[best]:+.1f} s "
                      f"(residual {sizes[best]:.2g} m instead of {sizes[20]:.2g} m)", "ranges.csv",
                      "stamp both with one clock, when the range is taken")  # fmt: skip


def precision_to_expect(context: Context) -> Iterator[Finding]:
    """Report the precision of one epoch of ranges in the middle of the floor."""
    if context.used("ranges") is None or len(context.anchors) < 3 or context.floor is None:
        return
    middle = 0.5 * (context.floor[0] + context.floor[1])[None]
    bound = dop(_core.cramer_rao(context.anchors, middle, context.typical_sigma, context.height))
    if np.isfinite(bound[0]):
        yield note(f"in the middle of the floor one range to each anchor gives a position to "
                   f"{bound[0]:.2g} m at best (Cramer-Rao)", "anchors.csv")  # fmt: skip
