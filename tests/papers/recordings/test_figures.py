# SPDX-License-Identifier: Apache-2.0
"""The picture of a drive among cylinders: both methods, and their distances from the reference."""

from __future__ import annotations

import numpy as np

from locfuse.types import NANOSECONDS
from papers.recordings.figures import plot_drive


def test_distances_are_drawn_in_centimetres_over_seconds() -> None:
    reference = np.column_stack([np.linspace(0.0, 5.0, 11), np.zeros(11)])
    stamps = 7 * NANOSECONDS + np.arange(11) * NANOSECONDS // 2
    found = {"wheels": reference + [0.0, 0.3], "both": reference - [0.04, 0.0]}
    figure = plot_drive(np.array([[1.0, 2.0]]), reference, stamps, found)
    way, off = figure.axes
    assert [line.get_label() for line in way.lines] == ["cylinders", "reference", "wheels", "both"]
    worse, better = (np.asarray(line.get_ydata()) for line in off.lines)
    np.testing.assert_allclose(worse, 30.0)
    np.testing.assert_allclose(better, 4.0)
    np.testing.assert_allclose(np.asarray(off.lines[0].get_xdata()), np.linspace(0.0, 5.0, 11))
