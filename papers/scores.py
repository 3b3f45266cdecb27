# SPDX-License-Identifier: Apache-2.0
"""Scores that several experiments share."""

from __future__ import annotations

import numpy as np

from locfuse.types import FloatArray


def rms(errors: FloatArray) -> float:
    """Return the root mean square of errors, shape (n,), or of their lengths, shape (n, d)."""
    squares = errors**2
    return float(np.sqrt(np.mean(squares if squares.ndim == 1 else np.sum(squares, axis=1))))
