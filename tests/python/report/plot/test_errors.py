# SPDX-License-Identifier: Apache-2.0
"""The picture of the errors: what is drawn is estimate minus truth, and nothing extreme is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from locfuse.report import plot
from locfuse.report.plot.style import ESTIMATE
from locfuse.types import NANOSECONDS, Trajectory
from support_figures import corners, line_of
from support_results import make_result


def test_error_picture_shows_the_error_inside_three_sigma() -> None:
    figure = plot.plot_errors(make_result(error=(0.05, -0.08, 0.02), sigma=(0.1, 0.2, 0.05)))

    assert figure is not None
    assert [a.get_ylabel() for a in figure.axes] == [
        "x error [m]",
        "y error [m]",
        "heading error [deg]",
    ]
    expected = [(0.05, 0.3), (-0.08, 0.6), (np.degrees(0.02), np.degrees(0.15))]
    for panel, (error, bound) in enumerate(expected):
        time_s, drawn = line_of(figure, panel, ESTIMATE)
        assert drawn == pytest.approx(np.full(200, error))
        assert time_s[[0, -1]] == pytest.approx([0.0, 19.9])
        (band,) = figure.axes[panel].collections
        assert isinstance(band, PolyCollection)
        (polygon,) = corners(band)
        assert polygon[:, 1].min() == pytest.approx(-bound)
        assert polygon[:, 1].max() == pytest.approx(bound)
        assert figure.axes[panel].get_ylim()[1] > bound


def test_no_heading_in_truth_means_no_heading_panel() -> None:
    figure = plot.plot_errors(make_result(truth_heading=False))
    assert figure is not None
    assert [a.get_ylabel() for a in figure.axes] == ["x error [m]", "y error [m]"]


def test_no_covariance_means_no_band() -> None:
    result = make_result()
    bare = replace(result.estimate, covariance=None)
    figure = plot.plot_errors(replace(result, estimate=bare))

    assert figure is not None
    assert not any(list(axes.collections) for axes in figure.axes)
    assert "band" not in figure.axes[0].get_title(loc="left")
    assert line_of(figure, 0, ESTIMATE)[1] == pytest.approx(np.full(200, 0.05))


def test_there_is_no_error_picture_without_truth_or_overlap() -> None:
    result = make_result()
    assert result.truth is not None
    later = replace(result.truth, stamp_ns=result.truth.stamp_ns + 3600 * NANOSECONDS)
    nothing = Trajectory(np.empty(0, dtype=np.int64), np.empty((0, 2)))

    assert plot.plot_errors(make_result(with_truth=False)) is None
    assert plot.plot_errors(replace(result, truth=later)) is None
    assert plot.plot_errors(replace(result, truth=nothing)) is None


def test_line_and_band_are_broken_where_truth_is_silent() -> None:
    result = make_result(n=200)
    assert result.truth is not None
    kept = (np.arange(200) < 60) | (np.arange(200) >= 120)
    truth = Trajectory(result.truth.stamp_ns[kept], result.truth.position[kept])
    figure = plot.plot_errors(replace(result, truth=truth))

    assert figure is not None
    time_s, error = line_of(figure, 0, ESTIMATE)
    assert np.flatnonzero(np.isnan(error)).tolist() == [60]
    assert time_s[[59, 61]] == pytest.approx([5.9, 12.0])
    (band,) = figure.axes[0].collections
    assert isinstance(band, PolyCollection)
    spans = [(p[:, 0].min(), p[:, 0].max()) for p in corners(band)]
    assert spans == [pytest.approx((0.0, 5.9)), pytest.approx((12.0, 19.9))]


def test_a_single_wild_error_survives_the_decimation_of_a_long_run() -> None:
    result = make_result(n=30_000, anchors=())
    position = result.estimate.position.copy()
    position[12_345, 0] += 50.0
    figure = plot.plot_errors(replace(result, estimate=replace(result.estimate, position=position)))

    assert figure is not None
    _, drawn = line_of(figure, 0, ESTIMATE)
    assert len(drawn) < 6000
    assert drawn.max() == pytest.approx(50.05)
    assert figure.axes[0].get_ylim()[1] > 50.05
    assert "largest 50" in figure.axes[0].get_title(loc="left")


def test_a_band_of_kilometres_at_the_start_does_not_flatten_the_error() -> None:
    result = make_result(n=200)
    assert result.estimate.covariance is not None
    covariance = result.estimate.covariance.copy()
    covariance[:5] *= 1e8
    figure = plot.plot_errors(
        replace(result, estimate=replace(result.estimate, covariance=covariance))
    )
    assert figure is not None
    assert figure.axes[0].get_ylim()[1] < 1.0
