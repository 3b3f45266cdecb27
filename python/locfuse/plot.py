# SPDX-License-Identifier: Apache-2.0
"""Pictures of one run: path, errors, NIS and the verdict on every message.

Each function takes a `RunResult` and returns a free-standing matplotlib `Figure`; nothing touches
pyplot or the process-wide settings. Long runs are thinned to what a picture can show, and never so
that an extreme error or a rejected stretch disappears.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from numpy.typing import NDArray
from scipy.stats import chi2

from locfuse.types import NANOSECONDS, FloatArray, Outcomes, RunResult, StampArray, Trajectory

__all__ = [
    "BAND_SIGMAS",
    "ELLIPSE_SIGMAS",
    "NOTABLE_SHARE",
    "Errors",
    "MessageRow",
    "Stretch",
    "ellipse_axes",
    "errors_against_truth",
    "interpolate",
    "longest_rejected_stretch",
    "message_rows",
    "nis_band",
    "plot_errors",
    "plot_nis",
    "plot_outcomes",
    "plot_path",
    "save",
    "start_ns",
]

# Okabe and Ito's palette: distinguishable with every common colour blindness.
INK = "#222222"
MUTED = "#6b6b6b"
GRID = "#e4e4e4"
ESTIMATE = "#0072B2"
ESTIMATE_PALE = "#cfe3f1"
TRUTH = "#222222"
REJECTED = "#D55E00"
ANCHOR = "#009E73"
MEAN = "#222222"
VERDICT_COLOURS = {
    "gated": REJECTED,
    "not_modelled": "#CC79A7",
    "stale": "#E69F00",
    "ignored": "#8c8c8c",
}
VERDICT_LABELS = {
    "gated": "rejected by the gate",
    "not_modelled": "not modelled",
    "stale": "too late",
    "ignored": "ignored",
}

ELLIPSE_SIGMAS = 3.0
BAND_SIGMAS = 3.0
CONFIDENCE = 0.95
NOTABLE_SHARE = 0.10  # rejected share from which an anchor is drawn as suspect

_DPI = 130
_WIDTH_IN = 10.0
_ELLIPSES = 30
_MOST_POINTS = 4000
_MOST_PATH_POINTS = 20000
_DASHED = (0, (4, 2))
_TIME_BINS = 600
_MEAN_BINS = 60
_LEAST_PER_MEAN = 15
_LEAST_BAR = 0.3
_MOST_NAMED = 60
_SOURCE_ORDER = ("odometry", "ranges", "positions", "poses")


# --- numbers behind the pictures ------------------------------------------------------------------


@dataclass(frozen=True)
class Errors:
    """Estimate minus truth where truth is known.

    Attributes
    ----------
    stamp_ns : int64 array, shape (n,)
        Estimate stamps inside the time span of truth.
    error : float64 array, shape (n, 2) or (n, 3)
        x and y in metres and, where truth has a heading, heading in radians in [-pi, pi).
    sigma : float64 array, same shape as ``error``, or None
        Standard deviations the estimator claimed; None without covariance.
    """

    stamp_ns: StampArray
    error: FloatArray
    sigma: FloatArray | None


@dataclass(frozen=True)
class Stretch:
    """Consecutive rejected messages: how many, and the stamps of the first and the last."""

    messages: int
    first_ns: int
    last_ns: int


@dataclass(frozen=True)
class MessageRow:
    """All messages of one source, or of one anchor for ranges.

    Attributes
    ----------
    source, anchor : str
        The anchor is empty for sources that have none.
    stamp_ns : int64 array, shape (n,)
        In order of time, which may differ from the order of delivery.
    verdict : array of str, shape (n,)
    """

    source: str
    anchor: str
    stamp_ns: StampArray
    verdict: NDArray[np.str_]

    @property
    def label(self) -> str:
        """Name of the row: the anchor if there is one, else the source."""
        if not self.anchor:
            return self.source
        named = self.anchor.lower().startswith("anchor")
        return self.anchor if named else f"anchor {self.anchor}"

    @property
    def rejected(self) -> int:
        """Messages that the gate turned down."""
        return int(np.count_nonzero(self.verdict == "gated"))

    @property
    def rejected_share(self) -> float:
        """Rejected messages over all messages of the row, 0 to 1."""
        return self.rejected / len(self.stamp_ns)


def start_ns(result: RunResult) -> int:
    """Return the stamp that pictures and tables call 0 s: the first message or estimate.

    Parameters
    ----------
    result : RunResult

    Returns
    -------
    int
        Nanoseconds.

    Raises
    ------
    ValueError
        If the run has neither estimates nor messages.
    """
    firsts = [int(s.min()) for s in (result.estimate.stamp_ns, result.outcomes.stamp_ns) if len(s)]
    if not firsts:
        raise ValueError("the run has no estimate and no message; expected at least one")
    return min(firsts)


def interpolate(track: Trajectory, stamp_ns: StampArray) -> tuple[FloatArray, FloatArray | None]:
    """Interpolate positions linearly and headings along the shorter arc.

    Parameters
    ----------
    track : Trajectory
    stamp_ns : int64 array, shape (n,)
        Inside the time span of `track`.

    Returns
    -------
    position : float64 array, shape (n, 2)
        Metres.
    heading : float64 array, shape (n,), or None
        Radians in [-pi, pi); None if `track` has no heading.

    Raises
    ------
    ValueError
        If a stamp lies outside the track.
    """
    if len(stamp_ns) == 0:
        return np.empty((0, 2)), None if track.heading is None else np.empty(0)
    low, high = (int(track.stamp_ns[0]), int(track.stamp_ns[-1])) if len(track) else (0, -1)
    if int(stamp_ns.min()) < low or int(stamp_ns.max()) > high:
        raise ValueError(
            f"stamps {int(stamp_ns.min())}..{int(stamp_ns.max())} ns leave the track, "
            f"expected them inside {low}..{high} ns"
        )
    # Differences first: nanoseconds since 1970 do not fit a double.
    at = (stamp_ns - low).astype(np.float64)
    knots = (track.stamp_ns - low).astype(np.float64)
    position = np.column_stack([np.interp(at, knots, track.position[:, k]) for k in range(2)])
    if track.heading is None:
        return position, None
    return position, _wrap(np.interp(at, knots, np.unwrap(track.heading)))


def errors_against_truth(result: RunResult) -> Errors | None:
    """Return estimate minus truth at the estimate's stamps, nothing aligned.

    Parameters
    ----------
    result : RunResult

    Returns
    -------
    Errors or None
        None without truth. Estimate stamps outside the span of truth are left out, so the arrays
        may be empty.
    """
    truth, estimate = result.truth, result.estimate
    if truth is None or len(truth) == 0:
        return None
    inside = (estimate.stamp_ns >= truth.stamp_ns[0]) & (estimate.stamp_ns <= truth.stamp_ns[-1])
    stamps = estimate.stamp_ns[inside]
    position, heading = interpolate(truth, stamps)
    columns = [estimate.position[inside] - position]
    if heading is not None and estimate.heading is not None:
        columns.append(_wrap(estimate.heading[inside] - heading)[:, np.newaxis])
    error = np.hstack(columns)
    sigma = None
    if estimate.covariance is not None:
        variance = np.diagonal(estimate.covariance[inside], axis1=1, axis2=2)
        sigma = np.sqrt(variance[:, : error.shape[1]])
    return Errors(stamps, error, sigma)


def ellipse_axes(covariance: FloatArray, sigmas: float) -> tuple[float, float, float]:
    """Return the axes of the covariance ellipse of a planar position.

    Parameters
    ----------
    covariance : float64 array, shape (2, 2)
        Square metres.
    sigmas : float
        Half axes in standard deviations.

    Returns
    -------
    major, minor : float
        Full lengths of the axes, metres.
    angle : float
        Direction of the major axis, radians from x towards y.

    Raises
    ------
    ValueError
        If the shape differs or an eigenvalue is negative beyond rounding.
    """
    if covariance.shape != (2, 2):
        raise ValueError(f"covariance has shape {covariance.shape}, expected (2, 2)")
    values, vectors = np.linalg.eigh(covariance)
    if values[0] < -1e-9 * max(float(values[1]), 1e-12):
        raise ValueError(f"covariance has the eigenvalue {values[0]:g}, expected none below zero")
    minor, major = (2.0 * sigmas * float(np.sqrt(max(v, 0.0))) for v in values)
    return major, minor, float(np.arctan2(vectors[1, 1], vectors[0, 1]))


def nis_band(dof: int) -> tuple[float, float]:
    """Return the two-sided 95 % band of a chi-square value with `dof` degrees of freedom.

    Parameters
    ----------
    dof : int
        At least 1.

    Returns
    -------
    low, high : float

    Raises
    ------
    ValueError
        If `dof` is below 1.
    """
    if dof < 1:
        raise ValueError(f"dof is {dof}, expected at least 1")
    tail = (1.0 - CONFIDENCE) / 2.0
    return float(chi2.ppf(tail, dof)), float(chi2.ppf(1.0 - tail, dof))


def message_rows(outcomes: Outcomes) -> list[MessageRow]:
    """Split messages by source and, for ranges, by anchor.

    Parameters
    ----------
    outcomes : Outcomes

    Returns
    -------
    list of MessageRow
        Odometry, ranges, positions, poses, then others; anchors in natural order (A2 before A10).
        No row is empty.
    """
    if len(outcomes) == 0:
        return []
    source_id = np.unique(outcomes.source, return_inverse=True)[1]
    anchor_id = np.unique(outcomes.anchor, return_inverse=True)[1]
    key = source_id * (int(anchor_id.max()) + 1) + anchor_id
    order = np.lexsort((outcomes.stamp_ns, key))
    rows = [
        MessageRow(
            source=str(outcomes.source[index[0]]),
            anchor=str(outcomes.anchor[index[0]]),
            stamp_ns=outcomes.stamp_ns[index],
            verdict=outcomes.verdict[index],
        )
        for index in np.split(order, np.flatnonzero(np.diff(key[order])) + 1)
    ]
    return sorted(rows, key=lambda row: (_source_rank(row.source), _natural(row.anchor)))


def longest_rejected_stretch(row: MessageRow) -> Stretch | None:
    """Return the longest unbroken series of rejected messages.

    Parameters
    ----------
    row : MessageRow

    Returns
    -------
    Stretch or None
        The series with the most messages, the earliest of equals; None if nothing was rejected.
    """
    gated = np.concatenate(([False], row.verdict == "gated", [False]))
    edges = np.flatnonzero(gated[1:] != gated[:-1])
    if len(edges) == 0:
        return None
    first, end = edges[0::2], edges[1::2]
    best = int(np.argmax(end - first))
    return Stretch(
        messages=int(end[best] - first[best]),
        first_ns=int(row.stamp_ns[first[best]]),
        last_ns=int(row.stamp_ns[end[best] - 1]),
    )


# --- pictures -------------------------------------------------------------------------------------


def plot_path(result: RunResult) -> Figure:
    """Draw estimate with 3-sigma ellipses, truth, anchors and landmarks in the world frame.

    Parameters
    ----------
    result : RunResult

    Returns
    -------
    Figure
        One axes, equal scales, metres. Anchors with at least 10 % of their ranges rejected are
        marked and carry that share.

    Raises
    ------
    ValueError
        If the estimate is empty.
    """
    estimate = result.estimate
    if len(estimate) == 0:
        raise ValueError("the estimate has no rows; expected at least one pose to draw")
    anchors = _places(result, "anchors", "anchor")
    landmarks = _places(result, "landmarks", "landmark")
    shown = [estimate.position, anchors.xy, landmarks.xy]
    if result.truth is not None:
        shown.append(result.truth.position)
    low, high = _extent(np.vstack(shown))
    figure = _figure(_WIDTH_IN, 0.94 * _WIDTH_IN * (high - low)[1] / (high - low)[0] + 1.1)
    axes = figure.add_subplot()
    _dress(axes)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x in world [m]")
    axes.set_ylabel("y in world [m]")

    handles = _draw_tracks(axes, estimate, result.truth)
    shares = {row.anchor: row.rejected_share for row in message_rows(result.outcomes)}
    labels = _draw_anchors(axes, handles, anchors, shares)
    labels += _draw_landmarks(axes, handles, landmarks)
    _legend(figure, handles)
    _place_labels(figure, axes, _join_same_spot(labels), estimate.position)
    return figure


def plot_errors(result: RunResult) -> Figure | None:
    """Draw the errors of x, y and heading over time with the 3-sigma bands the estimator claims.

    Parameters
    ----------
    result : RunResult

    Returns
    -------
    Figure or None
        One axes per component, heading in degrees and only if truth has one. None without truth or
        where truth and estimate do not overlap in time.
    """
    errors = errors_against_truth(result)
    if errors is None or len(errors.stamp_ns) == 0:
        return None
    panels = [("x", "m", 1.0), ("y", "m", 1.0), ("heading", "deg", float(np.degrees(1.0)))]
    panels = panels[: errors.error.shape[1]]
    figure = _figure(_WIDTH_IN, 2.1 * len(panels) + 0.8)
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    time_s = _seconds(errors.stamp_ns, start_ns(result))
    for k, (axes, (name, unit, scale)) in enumerate(zip(grid, panels, strict=True)):
        sigma = None if errors.sigma is None else errors.sigma[:, k] * scale
        _draw_error(axes, time_s, errors.error[:, k] * scale, sigma, name, unit)
    _time_axis(grid[-1], time_s)
    figure.align_ylabels(list(grid))
    handles: list[_Handle] = [Line2D([], [], color=ESTIMATE, lw=1.0, label="estimate minus truth")]
    if errors.sigma is not None:
        label = f"±{BAND_SIGMAS:g} sigma claimed by the estimator"
        handles.append(Patch(facecolor=ESTIMATE_PALE, label=label))
    _legend(figure, handles)
    return figure


def plot_nis(result: RunResult) -> Figure:
    """Draw the normalised innovation squared of each source over time, with its 95 % band.

    Parameters
    ----------
    result : RunResult

    Returns
    -------
    Figure
        One axes per source and number of innovation rows, logarithmic; values below an axes lie on
        its lower edge. A sentence instead if no message was compared with a prediction.
    """
    outcomes = result.outcomes
    compared = np.isfinite(outcomes.nis) & (outcomes.dof > 0)
    groups = sorted(
        {
            (_source_rank(str(s)), str(s), int(d))
            for s in np.unique(outcomes.source[compared])
            for d in np.unique(outcomes.dof[compared & (outcomes.source == s)])
        }
    )
    if not groups:
        return _sentence("No message was compared with a prediction, so there is no NIS.")
    figure = _figure(_WIDTH_IN, 2.5 * len(groups) + 0.9)
    grid = figure.subplots(len(groups), 1, sharex=True, squeeze=False)[:, 0]
    time_s = _seconds(outcomes.stamp_ns, start_ns(result))
    gated = outcomes.verdict == "gated"
    for axes, (_, source, dof) in zip(grid, groups, strict=True):
        member = compared & (outcomes.source == source) & (outcomes.dof == dof)
        _draw_nis(axes, time_s[member], outcomes.nis[member], gated[member], source, dof)
    _time_axis(grid[-1], time_s[compared])
    figure.align_ylabels(list(grid))
    handles: list[_Handle] = [_dot(ESTIMATE, "fused")]
    if (gated & compared).any():
        handles.append(_dot(REJECTED, VERDICT_LABELS["gated"]))
    handles.append(Line2D([], [], color=MEAN, lw=1.4, label="mean of fused"))
    handles.append(Line2D([], [], color=MUTED, lw=1.0, ls=_DASHED, label="expected mean"))
    handles.append(Patch(facecolor=ESTIMATE_PALE, label="two-sided 95 % band"))
    _legend(figure, handles)
    return figure


def plot_outcomes(result: RunResult) -> Figure:
    """Draw which messages were rejected when: one row per anchor or source.

    Parameters
    ----------
    result : RunResult

    Returns
    -------
    Figure
        Time runs to the right. Pale: messages arrived. Strong: some were not fused; the height is
        their share in that slice of time (at least 30 % of the row, so that a single one is seen).
        At the right of each row stand the rejected share and the number of messages.
    """
    rows = message_rows(result.outcomes)
    if not rows:
        return _sentence("The run received no message.")
    figure = _figure(_WIDTH_IN, 0.34 * len(rows) + 1.6)
    axes = figure.add_subplot()
    _dress(axes)
    axes.grid(visible=False, axis="y")
    first, last = int(result.outcomes.stamp_ns.min()), int(result.outcomes.stamp_ns.max())
    last = max(last, first + NANOSECONDS)
    seen: set[str] = set()
    for level, row in enumerate(rows):
        seen |= _draw_row(axes, level, row, first, last, start_ns(result))
        notable = row.rejected_share >= NOTABLE_SHARE
        colour = REJECTED if notable else INK if row.rejected else MUTED
        _beside(axes, level, 58, _percent(row.rejected_share), colour, bold=notable)
        _beside(axes, level, 118, _count(len(row.stamp_ns)), MUTED)
    _beside(axes, -0.75, 58, "rejected", MUTED)
    _beside(axes, -0.75, 118, "messages", MUTED)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_yticks(range(len(rows)))
    axes.set_yticklabels([_short(row.label) for row in rows], parse_math=False)
    axes.tick_params(axis="y", length=0)
    for name, row in zip(axes.get_yticklabels(), rows, strict=True):
        if row.rejected_share >= NOTABLE_SHARE:
            name.set_color(REJECTED)
            name.set_fontweight("bold")
    _time_axis(axes, _seconds(np.array([first, last]), start_ns(result)))
    handles: list[_Handle] = [Patch(facecolor=ESTIMATE_PALE, label="message arrived")]
    handles += [
        Patch(facecolor=colour, label=VERDICT_LABELS[verdict])
        for verdict, colour in VERDICT_COLOURS.items()
        if verdict in seen
    ]
    _legend(figure, handles)
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, without version marks, so that equal runs give equal files.

    Parameters
    ----------
    figure : Figure
    path : Path
    """
    figure.savefig(path, format="png", dpi=_DPI, metadata={"Software": None})


# --- parts of pictures ----------------------------------------------------------------------------

_Handle = Line2D | Patch


@dataclass(frozen=True)
class _Places:
    names: list[str]
    xy: FloatArray


@dataclass(frozen=True)
class _Label:
    text: str
    xy: FloatArray
    colour: str


def _draw_tracks(axes: Axes, estimate: Trajectory, truth: Trajectory | None) -> list[_Handle]:
    handles: list[_Handle] = []
    if truth is not None and len(truth):
        line = truth.position[_stride(len(truth), _MOST_PATH_POINTS)]
        handles += axes.plot(*line.T, color=TRUTH, lw=1.2, ls=_DASHED, label="truth", zorder=3)
    line = estimate.position[_stride(len(estimate), _MOST_PATH_POINTS)]
    handles += axes.plot(*line.T, color=ESTIMATE, lw=1.5, label="estimate", zorder=4)
    face, edge = (*_rgb(ESTIMATE), 0.13), (*_rgb(ESTIMATE), 0.75)
    if estimate.covariance is not None:
        for row in _evenly_along(estimate.position, _ELLIPSES):
            major, minor, angle = ellipse_axes(estimate.covariance[row, :2, :2], ELLIPSE_SIGMAS)
            x, y = estimate.position[row].tolist()
            ellipse = Ellipse((x, y), major, minor, angle=float(np.degrees(angle)), zorder=2)
            ellipse.set(facecolor=face, edgecolor=edge, linewidth=0.7)
            axes.add_patch(ellipse)
        label = f"{ELLIPSE_SIGMAS:g}-sigma ellipse"
        handles.append(Patch(facecolor=face, edgecolor=edge, label=label))
    for row, marker, size, fill, label in (
        (0, "o", 8, "white", "start"),
        (-1, "s", 10, "none", "end"),
    ):
        handles += axes.plot(
            *estimate.position[row],
            marker=marker,
            markersize=size,
            markerfacecolor=fill,
            markeredgecolor=ESTIMATE,
            markeredgewidth=2.0,
            ls="none",
            label=label,
            zorder=6,
        )
    return handles


def _draw_anchors(
    axes: Axes, handles: list[_Handle], anchors: _Places, shares: Mapping[str, float]
) -> list[_Label]:
    """Draw the anchors, add their legend handles to `handles`, return what to write beside them."""
    suspect = np.array([shares.get(n, 0.0) >= NOTABLE_SHARE for n in anchors.names], dtype=bool)
    for chosen, colour, label in (
        (~suspect, ANCHOR, "anchor"),
        (suspect, REJECTED, f"anchor, {100 * NOTABLE_SHARE:.0f} % or more rejected"),
    ):
        if chosen.any():
            handles += axes.plot(
                *anchors.xy[chosen].T,
                marker="^",
                markersize=9,
                markerfacecolor=colour,
                markeredgecolor="white",
                ls="none",
                label=label,
                zorder=8,
            )
    labels: list[_Label] = []
    for name, at, bad in zip(anchors.names, anchors.xy, suspect, strict=True):
        if bad:
            text = f"{_short(name)}: {_percent(shares[name])} rejected"
            labels.append(_Label(text, at, REJECTED))
        elif len(anchors.names) <= _MOST_NAMED:
            labels.append(_Label(_short(name), at, INK))
    return labels


def _draw_landmarks(axes: Axes, handles: list[_Handle], landmarks: _Places) -> list[_Label]:
    if not landmarks.names:
        return []
    handles += axes.plot(
        *landmarks.xy.T, marker="D", markersize=5, color=MUTED, ls="none", label="landmark"
    )
    if len(landmarks.names) > _MOST_NAMED:
        return []
    pairs = zip(landmarks.names, landmarks.xy, strict=True)
    return [_Label(_short(name), at, MUTED) for name, at in pairs]


def _draw_error(
    axes: Axes,
    time_s: FloatArray,
    error: FloatArray,
    sigma: FloatArray | None,
    name: str,
    unit: str,
) -> None:
    _dress(axes)
    rows = _keep_extremes(error, _MOST_POINTS)
    axes.axhline(0.0, color=MUTED, lw=0.8, zorder=1)
    axes.plot(time_s[rows], error[rows], color=ESTIMATE, lw=1.0)
    top = float(np.max(np.abs(error)))
    title = f"{name}: RMS {np.sqrt(np.mean(error**2)):.3g} {unit}, largest {top:.3g} {unit}"
    if sigma is not None:
        bound = BAND_SIGMAS * sigma
        axes.fill_between(
            time_s[rows], -bound[rows], bound[rows], color=ESTIMATE_PALE, linewidth=0, zorder=0
        )
        title += f", outside the band {_percent(float(np.mean(np.abs(error) > bound)))}"
        # An unknown start may claim kilometres: the band may leave the picture, the error not.
        top = max(top, float(np.quantile(bound, 0.95)))
    top = 1.12 * max(top, 1e-6)
    axes.set_ylim(-top, top)
    axes.set_ylabel(f"{name} error [{unit}]")
    axes.set_title(title, loc="left", fontsize=9, color=INK)


def _draw_nis(
    axes: Axes,
    time_s: FloatArray,
    nis: FloatArray,
    gated: NDArray[np.bool_],
    source: str,
    dof: int,
) -> None:
    _dress(axes)
    low, high = nis_band(dof)
    floor = low / 3.0
    axes.set_yscale("log")
    axes.axhspan(low, high, color=ESTIMATE_PALE, linewidth=0, zorder=0)
    axes.axhline(dof, color=MUTED, lw=1.0, ls=_DASHED, zorder=1)
    for chosen, colour, size, alpha, order in (
        (~gated, ESTIMATE, 2.2, 0.65, 2),
        (gated, REJECTED, 3.0, 0.9, 3),
    ):
        rows = np.flatnonzero(chosen)
        rows = rows[_keep_cloud(nis[rows], _MOST_POINTS)]
        axes.plot(
            time_s[rows],
            np.maximum(nis[rows], floor),
            ls="none",
            marker="o",
            markersize=size,
            markeredgewidth=0,
            color=colour,
            alpha=alpha,
            zorder=order,
        )
    axes.plot(*_binned_mean(time_s[~gated], nis[~gated]), color=MEAN, lw=1.4, zorder=4)
    axes.set_ylim(floor, max(3.0 * high, 1.6 * float(nis.max())))
    axes.set_ylabel("NIS")
    inside = float(np.mean((nis >= low) & (nis <= high)))
    axes.set_title(
        f"{source}, {dof} {'row' if dof == 1 else 'rows'}: {_percent(inside)} of "
        f"{_count(len(nis))} inside the band {low:.3g} to {high:.3g}, "
        f"{_percent(float(gated.mean()))} rejected",
        loc="left",
        fontsize=9,
        color=INK,
        parse_math=False,
    )


def _draw_row(
    axes: Axes, level: int, row: MessageRow, first_ns: int, last_ns: int, origin_ns: int
) -> set[str]:
    """Draw one row of the rejection picture; return the verdicts other than fused it shows."""
    slices = (row.stamp_ns - first_ns) * _TIME_BINS // (last_ns - first_ns + 1)
    arrived = np.bincount(slices, minlength=_TIME_BINS)
    left_s, right_s = _slice_edges(row.stamp_ns, first_ns, last_ns, arrived)
    shift_s = (first_ns - origin_ns) / NANOSECONDS
    left_s, right_s = left_s + shift_s, right_s + shift_s
    base = np.full(_TIME_BINS, level + 0.4)
    whole = np.full(_TIME_BINS, 0.8)
    _bars(axes, arrived > 0, left_s, right_s, base, whole, ESTIMATE_PALE)
    seen: set[str] = set()
    for verdict, colour in VERDICT_COLOURS.items():
        count = np.bincount(slices[row.verdict == verdict], minlength=_TIME_BINS)
        if not count.any():
            continue
        seen.add(verdict)
        share = np.where(count > 0, np.maximum(count / np.maximum(arrived, 1), _LEAST_BAR), 0.0)
        height = np.minimum(0.8 * share, base - (level - 0.4))
        _bars(axes, count > 0, left_s, right_s, base, height, colour)
        base = base - height
    return seen


def _figure(width_in: float, height_in: float) -> Figure:
    figure = Figure(figsize=(width_in, height_in), dpi=_DPI)
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.08)
    figure.set_facecolor("white")
    FigureCanvasAgg(figure)
    return figure


def _sentence(text: str) -> Figure:
    figure = _figure(_WIDTH_IN, 1.2)
    figure.text(0.5, 0.5, text, ha="center", va="center", fontsize=11, color=MUTED)
    return figure


def _dress(axes: Axes) -> None:
    axes.grid(visible=True, color=GRID, lw=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
    axes.tick_params(labelsize=9, color=MUTED, labelcolor=INK)
    axes.xaxis.label.set_fontsize(10)
    axes.yaxis.label.set_fontsize(10)


def _legend(figure: Figure, handles: Sequence[_Handle]) -> None:
    figure.legend(
        handles=list(handles),
        loc="outside lower center",
        ncols=min(len(handles), 5),
        frameon=False,
        fontsize=9,
    )


def _dot(colour: str, label: str) -> Line2D:
    return Line2D([], [], color=colour, ls="none", marker="o", markersize=5, label=label)


def _time_axis(axes: Axes, time_s: FloatArray) -> None:
    axes.set_xlabel("time since start [s]")
    low, high = float(time_s.min()), float(time_s.max())
    margin = 0.01 * (high - low) if high > low else 0.5
    axes.set_xlim(low - margin, high + margin)


def _slice_edges(
    stamp_ns: StampArray, first_ns: int, last_ns: int, arrived: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Return where the slices of a row begin and end, seconds after `first_ns`.

    A slice with a message reaches to the next one with a message if that comes on time, so a
    steady source is one block and a silence is a gap.
    """
    step = (last_ns - first_ns + 1) / NANOSECONDS / _TIME_BINS
    left: FloatArray = np.arange(_TIME_BINS, dtype=np.float64) * step
    right: FloatArray = left + step
    intervals = np.diff(stamp_ns)
    intervals = intervals[intervals > 0]
    if len(intervals):
        on_time = 1.6 * float(np.median(intervals)) / NANOSECONDS
        at = np.flatnonzero(arrived)
        following = np.append(left[at[1:]], left[at[-1]] + on_time)
        late = following - left[at] > on_time + step
        right[at] = np.where(late, left[at] + np.maximum(step, on_time / 1.6), following)
    return left, right


def _beside(
    axes: Axes, level: float, offset: float, text: str, colour: str, *, bold: bool = False
) -> None:
    """Write right-aligned text `offset` points right of the axes at the height of a row."""
    axes.annotate(
        text,
        (1.0, level),
        xycoords=axes.get_yaxis_transform(),
        xytext=(offset, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=9,
        color=colour,
        fontweight="bold" if bold else "normal",
        annotation_clip=False,
    )


def _bars(
    axes: Axes,
    chosen: NDArray[np.bool_],
    left_s: FloatArray,
    right_s: FloatArray,
    base: FloatArray,
    height: FloatArray,
    colour: str,
) -> None:
    """Fill time slices with bars that grow from `base` upwards in a picture whose y points down."""
    at = np.flatnonzero(chosen)
    x0, x1 = left_s[at], right_s[at]
    y0, y1 = base[at], base[at] - height[at]
    corners = np.stack([x0, y0, x0, y1, x1, y1, x1, y0], axis=1).reshape(-1, 4, 2)
    # Without smoothing neighbours join seamlessly; a slice is wider than a pixel, so none is lost.
    axes.add_collection(
        PolyCollection(list(corners), facecolors=colour, linewidths=0, antialiaseds=False),
        autolim=False,
    )


def _join_same_spot(labels: Sequence[_Label]) -> list[_Label]:
    """Return one label for points within a centimetre, as of anchors above one another."""
    spots: dict[tuple[float, float], list[_Label]] = {}
    for label in labels:
        spots.setdefault((round(float(label.xy[0]), 2), round(float(label.xy[1]), 2)), []).append(
            label
        )
    return [
        _Label(
            ", ".join(label.text for label in group),
            group[0].xy,
            next((g.colour for g in group if g.colour == REJECTED), group[0].colour),
        )
        for group in spots.values()
    ]


def _place_labels(figure: Figure, axes: Axes, labels: Sequence[_Label], path: FloatArray) -> None:
    """Write each label beside its mark, at the side where it covers least."""
    figure.draw_without_rendering()  # settles the layout, so that metres become pixels
    pixel = figure.dpi / 72.0
    marks = axes.transData.transform(np.array([label.xy for label in labels]).reshape(-1, 2))
    line = axes.transData.transform(path[_stride(len(path), 1500)])
    frame = axes.bbox
    taken: list[tuple[float, float, float, float]] = [
        (x - 6 * pixel, y - 6 * pixel, x + 6 * pixel, y + 6 * pixel) for x, y in marks
    ]
    covered = [patch.get_window_extent().extents for patch in axes.patches]
    sides = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)]
    places = [(dx, dy, gap) for gap in (8.0, 16.0, 26.0) for dx, dy in sides]
    for own, (label, (x, y)) in enumerate(zip(labels, marks, strict=True)):
        width, height = (5.4 * len(label.text) + 2) * pixel, 11.0 * pixel
        best: tuple[float, int, tuple[float, float, float, float]] | None = None
        for rank, (dx, dy, gap) in enumerate(places):
            shift = gap * pixel * (0.75 if dx and dy else 1.0)
            cx = x + dx * (shift + width / 2)
            cy = y + dy * (shift + height / 2)
            box = (cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2)
            others = taken[:own] + taken[own + 1 :]
            cost = rank * 0.02 + 10.0 * sum(_overlap(box, other) for other in others)
            inside = (
                (line[:, 0] > box[0])
                & (line[:, 0] < box[2])
                & (line[:, 1] > box[1])
                & (line[:, 1] < box[3])
            )
            cost += 0.3 * min(int(inside.sum()), 10)
            cost += sum(_overlap(box, other) for other in covered)
            cost += 20.0 * (
                box[0] < frame.x0 or box[2] > frame.x1 or box[1] < frame.y0 or box[3] > frame.y1
            )
            if best is None or cost < best[0]:
                best = (cost, rank, box)
        assert best is not None
        box = best[2]
        taken.append(box)
        centre = axes.transData.inverted().transform(((box[0] + box[2]) / 2, (box[1] + box[3]) / 2))
        axes.text(
            centre[0],
            centre[1],
            label.text,
            ha="center",
            va="center",
            fontsize=9,
            color=label.colour,
            fontweight="bold" if label.colour == REJECTED else "normal",
            parse_math=False,
            zorder=9,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.8},
        ).set_in_layout(False)


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Return the common area of two boxes as a share of the first."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    return width * height / ((a[2] - a[0]) * (a[3] - a[1]))


def _places(result: RunResult, stem: str, name: str) -> _Places:
    """Return the named points of a table of the log, none if the log has no such table."""
    if stem not in result.log or len(result.log[stem][name]) == 0:
        return _Places([], np.empty((0, 2)))
    table = result.log[stem]
    xy = np.column_stack([table["x_m"], table["y_m"]]).astype(np.float64)
    return _Places([str(n) for n in table[name]], xy)


def _extent(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a box around finite points, 0.4 to 0.9 times as high as wide."""
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.07 * max(float((high - low).max()), 1.0)
    low, high = low - margin, high + margin
    width, height = (high - low).tolist()
    grow = np.array([max(height / 0.9 - width, 0.0), max(width * 0.4 - height, 0.0)]) / 2.0
    return low - grow, high + grow


def _evenly_along(position: FloatArray, most: int) -> NDArray[np.intp]:
    """Return at most `most` rows, evenly spaced along the path rather than in time."""
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    way = np.concatenate(([0.0], np.cumsum(step)))
    if not np.isfinite(way[-1]) or way[-1] == 0.0:
        return np.array([len(position) - 1], dtype=np.intp)
    return np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], most)))


def _stride(n: int, most: int) -> NDArray[np.intp]:
    """Return evenly spaced rows including first and last, at most `most`."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, most)).astype(np.intp))


def _keep_extremes(values: FloatArray, most: int) -> NDArray[np.intp]:
    """Return at most about `most` rows: first, last, and the extremes of each block between."""
    n = len(values)
    if n <= most:
        return np.arange(n, dtype=np.intp)
    edges = np.linspace(0, n, most // 2 + 1).astype(np.intp)
    chosen = [0, n - 1]
    for a, b in pairwise(edges.tolist()):
        block = values[a:b]
        chosen += [int(a + np.argmin(block)), int(a + np.argmax(block))]
    return np.unique(np.array(chosen, dtype=np.intp))


def _keep_cloud(values: FloatArray, most: int) -> NDArray[np.intp]:
    """Return about `most` rows that keep the density of a cloud, and its highest values."""
    n = len(values)
    if n <= most:
        return np.arange(n, dtype=np.intp)
    # Multiples of the golden ratio spread evenly and never fall in step with anchors taking turns.
    even = np.flatnonzero(np.mod(np.arange(n) * 0.6180339887498949, 1.0) < most / n)
    return np.union1d(even, np.argsort(values)[-20:])


def _binned_mean(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of `values` in equal slices of time; empty slices give NaN, a gap."""
    slices = min(_MEAN_BINS, len(values) // _LEAST_PER_MEAN)
    if slices < 2 or time_s.max() == time_s.min():
        return np.empty(0), np.empty(0)
    low, high = float(time_s.min()), float(time_s.max())
    width = (high - low) / slices
    at = np.minimum(((time_s - low) / width).astype(np.intp), slices - 1)
    count = np.bincount(at, minlength=slices)
    total = np.bincount(at, weights=values, minlength=slices)
    mean: FloatArray = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    centre: FloatArray = low + (np.arange(slices, dtype=np.float64) + 0.5) * width
    return centre, mean


def _seconds(stamp_ns: StampArray, origin_ns: int) -> FloatArray:
    return (stamp_ns - origin_ns) / float(NANOSECONDS)


def _wrap(angle: FloatArray) -> FloatArray:
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi, dtype=np.float64)


def _source_rank(source: str) -> int:
    return _SOURCE_ORDER.index(source) if source in _SOURCE_ORDER else len(_SOURCE_ORDER)


def _natural(name: str) -> list[tuple[int, int, str]]:
    """Return a sort key that puts A2 before A10."""
    parts = re.split(r"(\d+)", name)
    return [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in parts if p]


def _short(name: str) -> str:
    return name if len(name) <= 24 else name[:23] + "…"


def _percent(share: float) -> str:
    """Return a share as text, never rounding something to nothing or to all."""
    if 0.0 < share < 0.001:
        return "<0.1 %"
    if 0.999 < share < 1.0:
        return ">99.9 %"
    return f"{100.0 * share:.1f} %"


def _count(n: int) -> str:
    return f"{n:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue
