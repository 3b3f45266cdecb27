# SPDX-License-Identifier: Apache-2.0
"""What stands in a figure, for the tests of pictures."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from locfuse.types import FloatArray


def texts(figure: Figure) -> list[str]:
    """Return everything written inside and beside the axes, but their own labels."""
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def legend_of(figure: Figure) -> list[str]:
    """Return the names in the legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def colours_at(figure: Figure, points: FloatArray) -> list[str]:
    """Return the colours of the first axes at points of shape (n, 2)."""
    picture = io.BytesIO()
    figure.savefig(picture, format="rgba", dpi=figure.dpi)
    width, height = figure.canvas.get_width_height()
    pixels = np.frombuffer(picture.getvalue(), np.uint8).reshape(height, width, 4)
    column, row = np.floor(figure.axes[0].transData.transform(points)).astype(int).T
    return [to_hex(colour) for colour in pixels[height - 1 - row, column] / 255.0]


def corners(collection: PolyCollection) -> list[FloatArray]:
    """Return the corners of each polygon, shape (n, 2)."""
    return [np.asarray(path.vertices, dtype=np.float64) for path in collection.get_paths()]


def line_of(figure: Figure, panel: int, colour: str) -> tuple[FloatArray, FloatArray]:
    """Return x and y of the only line of a colour in a panel."""
    (line,) = [line for line in figure.axes[panel].lines if line.get_color() == colour]
    assert isinstance(line, Line2D)
    return np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
