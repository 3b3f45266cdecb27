# SPDX-License-Identifier: Apache-2.0
"""Labels beside marks, placed so that they cover little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from locfuse.report.decimation import stride
from locfuse.report.plot.style import REJECTED
from locfuse.types import FloatArray

_Box: TypeAlias = tuple[float, float, float, float]  # left, bottom, right, top in pixels

_SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
_GAPS_PT = (8.0, 16.0, 26.0)


@dataclass(frozen=True)
class Label:
    """A text that belongs to a point of the plane.

    `xy` has shape (2,), metres.
    """

    text: str
    xy: FloatArray
    colour: str


def join_same_spot(labels: Sequence[Label]) -> list[Label]:
    """Return one label for points within a centimetre, as of anchors above one another."""
    spots: dict[tuple[float, float], list[Label]] = {}
    for label in labels:
        spot = (round(float(label.xy[0]), 2), round(float(label.xy[1]), 2))
        spots.setdefault(spot, []).append(label)
    return [
        Label(
            ", ".join(label.text for label in group),
            group[0].xy,
            next((g.colour for g in group if g.colour == REJECTED), group[0].colour),
        )
        for group in spots.values()
    ]


def place_labels(figure: Figure, axes: Axes, labels: Sequence[Label], path: FloatArray) -> None:
    """Write each label beside its mark, at the side where it covers least.

    Everything else must have been drawn. `path` (n, 2) is a line to keep clear of, metres.
    """
    figure.draw_without_rendering()  # settles the layout, so that metres become pixels
    pixel = figure.dpi / 72.0
    marks = axes.transData.transform(np.array([label.xy for label in labels]).reshape(-1, 2))
    line = axes.transData.transform(path[stride(len(path), 1500)])
    patches = [patch.get_window_extent().extents for patch in axes.patches]
    frame = axes.bbox.extents
    half = 6.0 * pixel
    taken: list[_Box] = [(x - half, y - half, x + half, y + half) for x, y in marks]
    for own, (label, (x, y)) in enumerate(zip(labels, marks, strict=True)):
        others = taken[:own] + taken[own + 1 :]
        size = ((5.4 * len(label.text) + 2.0) * pixel, 11.0 * pixel)
        boxes = _candidates(float(x), float(y), size, pixel)
        costs = [
            0.02 * rank
            + 10.0 * sum(_overlap(box, other) for other in others)
            + sum(_overlap(box, patch) for patch in patches)
            + 0.3 * min(_points_inside(line, box), 10)
            + 20.0 * (not _contains(frame, box))
            for rank, box in enumerate(boxes)
        ]
        box = boxes[int(np.argmin(costs))]
        taken.append(box)
        _write(axes, label, box)


def _candidates(x: float, y: float, size: tuple[float, float], pixel: float) -> list[_Box]:
    """Return the boxes around a mark where its text may stand, the most natural first."""
    width, height = size
    boxes: list[_Box] = []
    for gap in _GAPS_PT:
        for dx, dy in _SIDES:
            shift = gap * pixel * (0.75 if dx and dy else 1.0)
            cx = x + dx * (shift + width / 2)
            cy = y + dy * (shift + height / 2)
            boxes.append((cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2))
    return boxes


def _write(axes: Axes, label: Label, box: _Box) -> None:
    centre = ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)
    x, y = axes.transData.inverted().transform(centre).tolist()
    text = axes.text(
        x,
        y,
        label.text,
        ha="center",
        va="center",
        fontsize=9,
        color=label.colour,
        fontweight="bold" if label.colour == REJECTED else "normal",
        parse_math=False,
        zorder=9,
        bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.8},
    )
    text.set_in_layout(False)


def _overlap(a: _Box, b: _Box) -> float:
    """Return the common area of two boxes as a share of the first."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    return width * height / ((a[2] - a[0]) * (a[3] - a[1]))


def _contains(a: _Box, b: _Box) -> bool:
    return a[0] <= b[0] and a[1] <= b[1] and b[2] <= a[2] and b[3] <= a[3]


def _points_inside(points: FloatArray, box: _Box) -> int:
    x, y = points.T
    inside = (x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])
    return int(np.count_nonzero(inside))
