# SPDX-License-Identifier: Apache-2.0
"""Decimation: which rows of a long run are drawn, without losing ends or extremes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from locfuse.types import FloatArray


def stride(n: int, maximum: int) -> NDArray[np.intp]:
    """Return evenly spaced rows including first and last, at most `maximum`."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, maximum)).astype(np.intp))


def evenly_along(position: FloatArray, maximum: int) -> NDArray[np.intp]:
    """Return at most `maximum` rows, evenly spaced along the path rather than in time."""
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    way = np.concatenate(([0.0], np.cumsum(step)))
    if not np.isfinite(way[-1]) or way[-1] == 0.0:
        return np.array([len(position) - 1], dtype=np.intp)
    return np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], maximum)))


def keep_extremes(values: FloatArray, maximum: int) -> NDArray[np.intp]:
    """Return at most about `maximum` rows: first, last, and the extremes of each block between."""
    n = len(values)
    if n <= maximum:
        return np.arange(n, dtype=np.intp)
    edges = np.linspace(0, n, maximum // 2 + 1).astype(np.intp)
    chosen = [0, n - 1]
    for a, b in pairwise(edges.tolist()):
        block = values[a:b]
        chosen += [int(a + np.argmin(block)), int(a + np.argmax(block))]
    return np.unique(np.array(chosen, dtype=np.intp))


def keep_cloud(values: FloatArray, maximum: int) -> NDArray[np.intp]:
    """Return about `maximum` rows that keep the density of a cloud, and its highest values."""
    n = len(values)
    if n <= maximum:
        return np.arange(n, dtype=np.intp)
    # Multiples of the golden ratio spread evenly and never fall in step with anchors taking turns.
    even = np.flatnonzero(np.mod(np.arange(n) * 0.6180339887498949, 1.0) < maximum / n)
    return np.union1d(even, np.argsort(values)[-20:])
