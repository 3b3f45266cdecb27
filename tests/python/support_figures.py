# SPDX-License-Identifier: Apache-2.0
"""What stands in a figure, for the tests of pictures."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from locfuse.types import FloatArray


def texts(figure: Figure) -> list[str]:
    """Return everything written inside and beside the axes, but their own labels."""
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def legend_of(figure: Figure) -> list[str]:
    """Return the names in the legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def corners(collection: PolyCollection) -> list[FloatArray]:
    """Return the corners of each polygon, shape (n, 2)."""
    return [np.asarray(path.vertices, dtype=np.float64) for path in collection.get_paths()]


def line_of(figure: Figure, panel: int, colour: str) -> tuple[FloatArray, FloatArray]:
    """Return x and y of the only line of a colour in a panel."""
    (line,) = [line for line in figure.axes[panel].lines if line.get_color() == colour]
    assert isinstance(line, Line2D)
    return np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
