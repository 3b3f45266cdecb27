# SPDX-License-Identifier: Apache-2.0
"""Which rows of a long run are drawn, so that a picture stays small and still tells all."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from locfuse.types import FloatArray


def stride(n: int, most: int) -> NDArray[np.intp]:
    """Return evenly spaced rows including first and last, at most `most`."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, most)).astype(np.intp))


def evenly_along(position: FloatArray, most: int) -> NDArray[np.intp]:
    """Return at most `most` rows, evenly spaced along the path rather than in time."""
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    way = np.concatenate(([0.0], np.cumsum(step)))
    if not np.isfinite(way[-1]) or way[-1] == 0.0:
        return np.array([len(position) - 1], dtype=np.intp)
    return np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], most)))


def keep_extremes(values: FloatArray, most: int) -> NDArray[np.intp]:
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


def keep_cloud(values: FloatArray, most: int) -> NDArray[np.intp]:
    """Return about `most` rows that keep the density of a cloud, and its highest values."""
    n = len(values)
    if n <= most:
        return np.arange(n, dtype=np.intp)
    # Multiples of the golden ratio spread evenly and never fall in step with anchors taking turns.
    even = np.flatnonzero(np.mod(np.arange(n) * 0.6180339887498949, 1.0) < most / n)
    return np.union1d(even, np.argsort(values)[-20:])
