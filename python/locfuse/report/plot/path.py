# SPDX-License-Identifier: Apache-2.0
"""Picture of the path in the world frame: estimate with ellipses, truth, anchors, map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Patch

from locfuse.eval.verdicts import SUSPECT_SHARE, MessageRow, message_rows
from locfuse.report.decimation import evenly_along, stride
from locfuse.report.palette import ELLIPSE_SIGMAS
from locfuse.report.plot import style
from locfuse.report.plot.labels import Label, join_same_spot, place_labels
from locfuse.report.plot.world import box_around, draw_map, drawable, world_figure
from locfuse.report.text import percent, short
from locfuse.types import FloatArray, MappedLandmarks, RunResult, Trajectory

_ELLIPSES = 30
_MAX_PATH_POINTS = 20000
_MAX_NAMED = 60


def plot_path(result: RunResult) -> Figure:
    """Draw estimate with 3-sigma ellipses, truth, anchors, landmarks and map in the world frame.

    One axes, equal scales, metres. Landmarks that were mapped have ellipses, too. Anchors with at
    least 10 % of their ranges rejected are marked and carry that share. Raises ValueError if the
    estimate is empty.
    """
    estimate = result.estimate
    if len(estimate) == 0:
        raise ValueError("the estimate has no rows; expected at least one pose to draw")
    anchors = _places(result, "anchors", "anchor")
    landmarks = _places(result, "landmarks", "landmark")
    shown = [estimate.position, *anchors.values(), *landmarks.values()]
    if result.truth is not None:
        shown.append(result.truth.position)
    if result.landmarks is not None:
        shown.append(result.landmarks.position)
    low, high = box_around(np.vstack(shown), 0.07, 0.4, 0.9)
    figure, axes = world_figure(low, high, 0.95)
    if result.log.grid is not None:
        draw_map(axes, drawable(result.log.grid, (high - low)[0]))
        axes.grid(visible=False)
    handles = _draw_tracks(axes, estimate, result.truth)
    rows = {row.anchor: row for row in message_rows(result.outcomes) if row.anchor}
    labels = _draw_anchors(axes, handles, anchors, rows)
    labels += _draw_landmarks(axes, handles, landmarks)
    radii = result.log.tables.get("landmarks", {}).get("radius_m", np.empty(0)).tolist()
    for (x, y), radius in zip(landmarks.values(), radii, strict=False):
        axes.add_patch(Circle((x, y), radius, fc=style.GRID, ec=style.MUTED, zorder=0))
    if result.landmarks is not None:
        labels += _draw_map_of_landmarks(axes, handles, result.landmarks, set(landmarks))
    style.legend(figure, handles)
    place_labels(figure, axes, join_same_spot(labels), estimate.position)
    return figure


def ellipse_axes(covariance: FloatArray, sigmas: float) -> tuple[float, float, float]:
    """Return the axes of the covariance ellipse of a planar position.

    `covariance` (2, 2) is in square metres; half axes are `sigmas` standard deviations. Returns the
    full major and minor lengths, metres, and the major direction, radians from x towards y. Raises
    ValueError if the shape differs or an eigenvalue is negative beyond rounding.
    """
    if covariance.shape != (2, 2):
        raise ValueError(f"covariance has shape {covariance.shape}, expected (2, 2)")
    values, vectors = np.linalg.eigh(covariance)
    if values[0] < -1e-9 * max(float(values[1]), 1e-12):
        raise ValueError(f"covariance has the eigenvalue {values[0]:g}, expected none below zero")
    minor, major = (2.0 * sigmas * float(np.sqrt(max(v, 0.0))) for v in values)
    return major, minor, float(np.arctan2(vectors[1, 1], vectors[0, 1]))


def draw_ellipse(
    axes: Axes, at: FloatArray, covariance: FloatArray, sigmas: float, **look: Any
) -> Ellipse:
    """Draw the covariance ellipse (2, 2) of a position (2,), as `look` says, and return it."""
    major, minor, angle = ellipse_axes(covariance, sigmas)
    x, y = at.tolist()
    ellipse = Ellipse((x, y), major, minor, angle=float(np.degrees(angle)), **look)
    axes.add_patch(ellipse)
    return ellipse


def _places(result: RunResult, stem: str, name: str) -> dict[str, FloatArray]:
    """Return the named points of a table of the log, none if the log has no such table."""
    if stem not in result.log:
        return {}
    table = result.log[stem]
    xy = np.column_stack([table["x_m"], table["y_m"]]).astype(np.float64)
    return dict(zip(table[name].tolist(), xy, strict=True))


def _draw_tracks(axes: Axes, estimate: Trajectory, truth: Trajectory | None) -> list[style.Handle]:
    handles: list[style.Handle] = []
    if truth is not None and len(truth):
        line = truth.position[stride(len(truth), _MAX_PATH_POINTS)]
        dashed: dict[str, Any] = {"color": style.TRUTH, "lw": 1.2, "ls": style.DASHED}
        handles += axes.plot(*line.T, label="truth", zorder=3, **dashed)
    line = estimate.position[stride(len(estimate), _MAX_PATH_POINTS)]
    handles += axes.plot(*line.T, color=style.ESTIMATE, lw=1.5, label="estimate", zorder=4)
    if estimate.covariance is not None:
        handles.append(_draw_ellipses(axes, estimate.position, estimate.covariance))
    edge: dict[str, Any] = {"mec": style.ESTIMATE, "mew": 2.0, "zorder": 6}
    first, last = estimate.position[[0, -1]]
    handles += style.marks(axes, first, "o", 8, "white", "start", **edge)
    handles += style.marks(axes, last, "s", 10, "none", "end", **edge)
    return handles


def _draw_ellipses(axes: Axes, position: FloatArray, covariance: FloatArray) -> Patch:
    face, edge = to_rgba(style.ESTIMATE, 0.13), to_rgba(style.ESTIMATE, 0.75)
    for row in evenly_along(position, _ELLIPSES):
        draw_ellipse(axes, position[row], covariance[row, :2, :2], ELLIPSE_SIGMAS, facecolor=face,
                     edgecolor=edge, linewidth=0.7, zorder=2)  # fmt: skip
    return Patch(facecolor=face, edgecolor=edge, label=f"{ELLIPSE_SIGMAS:g}-sigma ellipse")


def _draw_anchors(
    axes: Axes,
    handles: list[style.Handle],
    anchors: Mapping[str, FloatArray],
    rows: Mapping[str, MessageRow],
) -> list[Label]:
    """Draw the anchors, add their legend handles to `handles`, return what to write beside them."""
    suspects = [name for name in anchors if name in rows and rows[name].suspect]
    labels: list[Label] = []
    for name, at in anchors.items():
        if name in suspects:
            text = f"{short(name)}: {percent(rows[name].rejected_share)} rejected"
            labels.append(Label(text, at, style.REJECTED))
        elif len(anchors) <= _MAX_NAMED:
            labels.append(Label(short(name), at, style.INK))
    suspect_label = f"anchor, at least {100 * SUSPECT_SHARE:.0f} % rejected"
    good = [at for name, at in anchors.items() if name not in suspects]
    bad = [anchors[name] for name in suspects]
    if good:
        handles += style.marks(axes, np.array(good), "^", 9, style.ANCHOR, "anchor")
    if bad:
        handles += style.marks(axes, np.array(bad), "^", 9, style.REJECTED, suspect_label)
    return labels


def _draw_map_of_landmarks(
    axes: Axes, handles: list[style.Handle], mapped: MappedLandmarks, named: set[str]
) -> list[Label]:
    """Draw mapped landmarks with 3-sigma ellipses; those in `named` have their labels already."""
    if len(mapped) == 0:
        return []
    colour = style.ESTIMATE
    handles += style.marks(
        axes, mapped.position, "o", 4, colour, "mapped landmark", mec=colour, zorder=7
    )
    outline: dict[str, Any] = {"facecolor": "none", "edgecolor": colour, "lw": 0.8, "zorder": 6}
    for at, covariance in zip(mapped.position, mapped.covariance, strict=True):
        draw_ellipse(axes, at, covariance, ELLIPSE_SIGMAS, **outline)
    if len(mapped) > _MAX_NAMED:
        return []
    places = zip(mapped.name.tolist(), mapped.position, strict=True)
    return [Label(short(name), at, colour) for name, at in places if name not in named]


def _draw_landmarks(
    axes: Axes, handles: list[style.Handle], landmarks: Mapping[str, FloatArray]
) -> list[Label]:
    if not landmarks:
        return []
    xy = np.array(list(landmarks.values()))
    handles += axes.plot(*xy.T, "D", ms=5, color=style.MUTED, label="landmark")
    if len(landmarks) > _MAX_NAMED:
        return []
    return [Label(short(name), at, style.MUTED) for name, at in landmarks.items()]
