# SPDX-License-Identifier: Apache-2.0
"""Pictures of a run: what is drawn is what was estimated."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from locfuse import plot
from locfuse.types import NANOSECONDS, FloatArray, RunResult, Trajectory
from support_results import EPOCH_NS, make_result


def _texts(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def _legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def _with_covariance(result: RunResult, covariance: FloatArray) -> RunResult:
    tiled = np.tile(covariance, (len(result.estimate), 1, 1))
    return replace(result, estimate=replace(result.estimate, covariance=tiled))


def _corners(collection: PolyCollection) -> list[FloatArray]:
    return [np.asarray(path.vertices, dtype=np.float64) for path in collection.get_paths()]


def _band(figure: Figure, panel: int) -> FloatArray:
    (band,) = figure.axes[panel].collections
    assert isinstance(band, PolyCollection)
    return _corners(band)[0]


def _bars(figure: Figure, colour: str) -> list[tuple[float, float, float, float]]:
    """Boxes (left, right, lowest, highest) of one colour in the picture of verdicts."""
    boxes: list[tuple[float, float, float, float]] = []
    for collection in figure.axes[0].collections:
        assert isinstance(collection, PolyCollection)
        if np.allclose(np.asarray(collection.get_facecolor()), to_rgba(colour)):
            for corners in _corners(collection):
                (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
                boxes.append((float(x0), float(x1), float(y0), float(y1)))
    return boxes


# --- ellipses -------------------------------------------------------------------------------------


def test_ellipse_axes_are_the_eigenvalues_along_their_eigenvectors() -> None:
    turn = np.radians(30.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    covariance = rotation @ np.diag([0.5**2, 0.1**2]) @ rotation.T

    major, minor, angle = plot.ellipse_axes(covariance, 3.0)

    assert major == pytest.approx(2 * 3 * 0.5)
    assert minor == pytest.approx(2 * 3 * 0.1)
    assert np.tan(angle) == pytest.approx(np.tan(turn))


def test_ellipses_in_the_picture_are_three_sigma_and_centred_on_the_estimate() -> None:
    correlated = np.array([[0.04, 0.03, 0.0], [0.03, 0.09, 0.0], [0.0, 0.0, 0.01]])
    result = _with_covariance(make_result(), correlated)

    ellipses = [p for p in plot.plot_path(result).axes[0].patches if isinstance(p, Ellipse)]

    assert 20 <= len(ellipses) <= 30
    low, high = np.sqrt(np.linalg.eigvalsh(correlated[:2, :2]))
    for ellipse in ellipses:
        assert sorted([ellipse.get_width(), ellipse.get_height()]) == pytest.approx(
            [6 * low, 6 * high]
        )
        off = np.linalg.norm(result.estimate.position - np.array(ellipse.get_center()), axis=1)
        assert off.min() < 1e-9


def test_ellipses_are_spread_over_the_way_and_not_piled_up_where_the_robot_waits() -> None:
    result = make_result(n=400)
    position = result.estimate.position.copy()
    position[:] = [8.0, 0.0]
    position[300:, 0] += np.linspace(0.0, 10.0, 100)  # waits 30 s, then drives 10 s
    result = replace(result, estimate=replace(result.estimate, position=position))

    patches = plot.plot_path(result).axes[0].patches

    x = np.array([p.get_center() for p in patches if isinstance(p, Ellipse)])[:, 0]
    assert np.count_nonzero(x < 8.2) <= 2
    assert np.diff(np.sort(x)).max() < 0.6


@pytest.mark.parametrize(
    ("covariance", "said"),
    [
        (np.eye(3), r"\(3, 3\), expected \(2, 2\)"),
        (np.diag([1.0, -0.5]), "eigenvalue -0.5"),
    ],
)
def test_ellipse_of_what_is_no_planar_covariance_is_refused(
    covariance: FloatArray, said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        plot.ellipse_axes(covariance, 3.0)


# --- truth and errors -----------------------------------------------------------------------------


def test_truth_is_interpolated_along_the_shorter_arc_across_the_cut() -> None:
    stamps = np.array([0, 10], dtype=np.int64) + EPOCH_NS
    truth = Trajectory(stamps, np.array([[0.0, 0.0], [1.0, -2.0]]), np.radians([170.0, -170.0]))

    position, heading = plot.interpolate(truth, np.array([EPOCH_NS + 4, EPOCH_NS + 5]))

    assert position == pytest.approx(np.array([[0.4, -0.8], [0.5, -1.0]]))
    assert heading is not None
    assert np.degrees(heading) == pytest.approx([178.0, -180.0])


def test_interpolation_outside_the_track_is_refused() -> None:
    truth = Trajectory(np.array([5, 9], dtype=np.int64), np.zeros((2, 2)))
    with pytest.raises(ValueError, match=r"5\.\.9 ns"):
        plot.interpolate(truth, np.array([4], dtype=np.int64))


def test_error_is_estimate_minus_truth_at_its_stamp() -> None:
    errors = plot.errors_against_truth(make_result(error=(0.05, -0.08, 0.02)))

    assert errors is not None
    assert errors.error == pytest.approx(np.tile([0.05, -0.08, 0.02], (200, 1)))
    assert errors.sigma == pytest.approx(np.tile([0.1, 0.2, 0.05], (200, 1)))


def test_estimates_outside_truth_are_left_out_and_not_extrapolated() -> None:
    result = make_result(n=100)
    assert result.truth is not None
    truth = Trajectory(result.truth.stamp_ns[20:60], result.truth.position[20:60])

    errors = plot.errors_against_truth(replace(result, truth=truth))

    assert errors is not None
    assert np.array_equal(errors.stamp_ns, result.estimate.stamp_ns[20:60])
    assert np.abs(errors.error).max() < 0.081


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
        (line,) = [x for x in figure.axes[panel].lines if x.get_color() == plot.ESTIMATE]
        assert np.asarray(line.get_ydata()) == pytest.approx(np.full(200, error))
        assert np.asarray(line.get_xdata())[[0, -1]] == pytest.approx([0.0, 19.9])
        corners = _band(figure, panel)
        assert corners[:, 1].min() == pytest.approx(-bound)
        assert corners[:, 1].max() == pytest.approx(bound)
        assert figure.axes[panel].get_ylim()[1] > bound


def test_no_heading_in_truth_means_no_heading_panel() -> None:
    figure = plot.plot_errors(make_result(truth_heading=False))
    assert figure is not None
    assert [a.get_ylabel() for a in figure.axes] == ["x error [m]", "y error [m]"]


def test_there_is_no_error_picture_without_truth_or_overlap() -> None:
    result = make_result()
    assert result.truth is not None
    later = replace(result.truth, stamp_ns=result.truth.stamp_ns + 3600 * NANOSECONDS)

    assert plot.plot_errors(make_result(with_truth=False)) is None
    assert plot.plot_errors(replace(result, truth=later)) is None


def test_a_single_wild_error_survives_the_thinning_of_a_long_run() -> None:
    result = make_result(n=30_000, anchors=())
    position = result.estimate.position.copy()
    position[12_345, 0] += 50.0
    figure = plot.plot_errors(replace(result, estimate=replace(result.estimate, position=position)))

    assert figure is not None
    (line,) = [x for x in figure.axes[0].lines if x.get_color() == plot.ESTIMATE]
    drawn = np.asarray(line.get_ydata())
    assert len(drawn) < 6000
    assert drawn.max() == pytest.approx(50.05)
    assert figure.axes[0].get_ylim()[1] > 50.05


# --- path -----------------------------------------------------------------------------------------


def test_path_has_equal_scales_and_every_part_named() -> None:
    figure = plot.plot_path(make_result())

    assert figure.axes[0].get_aspect() == 1.0
    assert figure.axes[0].get_xlabel() == "x in world [m]"
    assert _legend(figure) == ["truth", "estimate", "3-sigma ellipse", "start", "end", "anchor"]
    assert sorted(_texts(figure)) == ["A1", "A10", "A2", "A3"]


def test_path_without_truth_and_anchors_does_not_name_them() -> None:
    figure = plot.plot_path(make_result(with_truth=False, anchors=()))
    assert _legend(figure) == ["estimate", "3-sigma ellipse", "start", "end"]


def test_path_points_at_the_anchor_that_was_rejected() -> None:
    figure = plot.plot_path(make_result(rejected={"A2": (3.0, 12.0)}))

    (text,) = [t for t in figure.axes[0].texts if "rejected" in t.get_text()]
    assert text.get_text() == "A2: 45.0 % rejected"
    assert text.get_color() == plot.REJECTED
    (mark,) = [x for x in figure.axes[0].lines if x.get_markerfacecolor() == plot.REJECTED]
    assert [np.asarray(mark.get_xdata())[0], np.asarray(mark.get_ydata())[0]] == pytest.approx(
        [0.0, 8.0]
    )


def test_names_of_thirty_anchors_do_not_cover_one_another() -> None:
    figure = plot.plot_path(make_result(anchors=[f"anchor-{k:02d}" for k in range(30)]))
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]

    assert len(boxes) == 30
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])


def test_anchors_above_one_another_share_a_name() -> None:
    result = make_result(anchors=("low", "high", "far"))
    anchors = {k: v.copy() for k, v in result.log["anchors"].items()}
    for axis in ("x_m", "y_m"):
        anchors[axis][1] = anchors[axis][0]
    figure = plot.plot_path(replace(result, log=replace(result.log, tables={"anchors": anchors})))

    assert sorted(_texts(figure)) == ["far", "low, high"]


def test_path_of_an_empty_estimate_is_refused() -> None:
    nothing = Trajectory(np.empty(0, dtype=np.int64), np.empty((0, 2)))
    with pytest.raises(ValueError, match="no rows"):
        plot.plot_path(replace(make_result(), estimate=nothing))


# --- NIS ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("dof", "low", "high"), [(1, 0.000982, 5.024), (2, 0.0506, 7.378)])
def test_nis_band_is_that_of_the_chi_square_tables(dof: int, low: float, high: float) -> None:
    assert plot.nis_band(dof) == pytest.approx((low, high), rel=1e-3)


def test_nis_band_without_freedom_is_refused() -> None:
    with pytest.raises(ValueError, match="dof is 0"):
        plot.nis_band(0)


def test_nis_has_a_panel_per_compared_source_with_the_band_of_its_freedom() -> None:
    figure = plot.plot_nis(make_result(every_source=True))

    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert [t.split(":")[0] for t in titles] == [
        "ranges, 1 row",
        "positions, 2 rows",
        "poses, 3 rows",
    ]
    for dof, axes in zip((1, 2, 3), figure.axes, strict=True):
        extent = axes.patches[0].get_path().get_extents(axes.patches[0].get_patch_transform())
        assert (extent.y0, extent.y1) == pytest.approx(plot.nis_band(dof))
        assert axes.get_yscale() == "log"


def test_nis_draws_every_rejected_message_in_the_warning_colour() -> None:
    result = make_result(rejected={"A2": (3.0, 12.0)})
    (axes,) = plot.plot_nis(result).axes

    (red,) = [x for x in axes.lines if x.get_color() == plot.REJECTED]
    gated = result.outcomes.verdict == "gated"
    assert np.asarray(red.get_ydata()) == pytest.approx(result.outcomes.nis[gated])
    assert axes.get_ylim()[1] > result.outcomes.nis.max()
    assert "11.2 % rejected" in axes.get_title(loc="left")


def test_mean_of_nis_is_that_of_the_fused_messages_only() -> None:
    result = make_result(n=600, rejected={"A2": (0.0, 60.0)})
    (axes,) = plot.plot_nis(result).axes

    (line,) = [x for x in axes.lines if x.get_color() == plot.MEAN]
    mean = np.asarray(line.get_ydata(), dtype=np.float64)
    fused = result.outcomes.nis[result.outcomes.verdict == "fused"]
    assert mean.mean() == pytest.approx(fused.mean(), rel=0.01)
    assert len(mean) == 60


def test_nis_that_was_never_computed_is_said_in_a_sentence() -> None:
    result = make_result(anchors=())
    (text,) = plot.plot_nis(result).texts
    assert "no NIS" in text.get_text()


def test_thinning_a_cloud_keeps_each_of_three_anchors_that_take_turns() -> None:
    turns = np.tile([1.0, 2.0, 3.0], 20_000)
    kept = turns[plot._keep_cloud(turns, 4000)]
    assert len(kept) == pytest.approx(4000, abs=50)
    assert np.array([np.mean(kept == v) for v in (1.0, 2.0, 3.0)]) == pytest.approx(1 / 3, abs=0.02)


# --- verdicts -------------------------------------------------------------------------------------


def test_rows_come_by_source_and_anchors_in_natural_order() -> None:
    rows = plot.message_rows(make_result(every_source=True).outcomes)
    assert [row.label for row in rows] == [
        "odometry",
        "anchor A1",
        "anchor A2",
        "anchor A3",
        "anchor A10",
        "positions",
        "poses",
    ]
    assert [len(row.stamp_ns) for row in rows] == [200] * 7


def test_rows_are_in_order_of_time_when_messages_came_late() -> None:
    outcomes = make_result(n=5, anchors=("A",), rejected={"A": (0.1, 0.3)}).outcomes
    turned = np.array([0, 2, 1, 4, 3])
    late = replace(outcomes, **{k: v[turned] for k, v in vars(outcomes).items()})

    (row,) = plot.message_rows(late)

    assert np.array_equal(row.stamp_ns, outcomes.stamp_ns)
    assert list(row.verdict) == ["fused", "gated", "gated", "fused", "fused"]


def test_longest_stretch_is_the_longest_unbroken_one() -> None:
    verdict = ["gated", "gated", "fused", "gated", "gated", "gated", "stale", "gated"]
    row = plot.MessageRow("ranges", "A", np.arange(8) * 10, np.array(verdict))

    assert plot.longest_rejected_stretch(row) == plot.Stretch(3, 30, 50)
    assert row.rejected == 6
    assert row.rejected_share == 0.75


def test_a_row_without_rejections_has_no_stretch() -> None:
    row = plot.MessageRow("poses", "", np.arange(3), np.array(["fused", "fused", "stale"]))
    assert plot.longest_rejected_stretch(row) is None


def test_rejections_are_drawn_in_the_row_of_the_anchor_when_they_happened() -> None:
    figure = plot.plot_outcomes(make_result(rejected={"A2": (3.0, 12.0)}))

    names = [t.get_text() for t in figure.axes[0].get_yticklabels()]
    assert names == ["anchor A1", "anchor A2", "anchor A3", "anchor A10"]
    boxes = np.array(_bars(figure, plot.REJECTED))
    assert boxes[:, 0].min() == pytest.approx(3.0, abs=0.1)
    assert boxes[:, 1].max() == pytest.approx(12.0, abs=0.1)
    assert (boxes[:, 2] > 0.5).all()  # row 1 lies between 0.5 and 1.5
    assert (boxes[:, 3] < 1.5).all()
    assert (boxes[:, 1] - boxes[:, 0]).sum() == pytest.approx(9.0, abs=0.2)
    assert _texts(figure).count("45.0 %") == 1
    assert _texts(figure).count("0.0 %") == 3


def test_height_of_a_mark_is_the_rejected_share_and_never_vanishes() -> None:
    result = make_result(n=60_000, anchors=("half", "one"))
    verdict = np.full(len(result.outcomes), "fused", dtype="<U16")
    half = np.flatnonzero(result.outcomes.anchor == "half")
    verdict[half[::2]] = "gated"
    verdict[np.flatnonzero(result.outcomes.anchor == "one")[777]] = "gated"
    figure = plot.plot_outcomes(replace(result, outcomes=replace(result.outcomes, verdict=verdict)))

    boxes = np.array(_bars(figure, plot.REJECTED))
    height = boxes[:, 3] - boxes[:, 2]
    first, second = boxes[:, 3] < 0.5, boxes[:, 3] > 0.5
    assert height[first] == pytest.approx(np.full(plot._TIME_BINS, 0.4))
    assert height[second] == pytest.approx([0.24])
    assert _texts(figure).count("<0.1 %") == 1


def test_a_silent_anchor_leaves_a_gap_and_a_steady_one_none() -> None:
    result = make_result(n=300, anchors=("A",))
    heard = (np.arange(300) < 100) | (np.arange(300) >= 200)
    outcomes = replace(result.outcomes, **{k: v[heard] for k, v in vars(result.outcomes).items()})
    boxes = sorted(
        _bars(plot.plot_outcomes(replace(result, outcomes=outcomes)), plot.ESTIMATE_PALE)
    )

    gaps = [b[0] - a[1] for a, b in pairwise(boxes)]
    assert sum(gap > 1e-9 for gap in gaps) == 1
    assert max(gaps) == pytest.approx(10.0, abs=0.2)


def test_every_other_verdict_has_its_own_colour_and_name() -> None:
    result = make_result(n=10, anchors=("A",))
    verdict = np.array(["fused"] * 6 + ["gated", "stale", "ignored", "not_modelled"])
    figure = plot.plot_outcomes(replace(result, outcomes=replace(result.outcomes, verdict=verdict)))

    assert set(_legend(figure)) == {"message arrived", *plot.VERDICT_LABELS.values()}
    for colour in plot.VERDICT_COLOURS.values():
        assert len(_bars(figure, colour)) == 1


def test_names_with_signs_of_formula_and_markup_are_drawn_as_they_are(tmp_path: Path) -> None:
    result = make_result(anchors=("$\\frac$", "<b>"), rejected={"$\\frac$": (0.0, 20.0)})
    for figure in (plot.plot_path(result), plot.plot_outcomes(result)):
        plot.save(figure, tmp_path / "x.png")
    assert "$\\frac$: 100.0 % rejected" in _texts(plot.plot_path(result))


# --- all of them ----------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_shortest_runs_are_drawn(n: int, tmp_path: Path) -> None:
    result = make_result(n=n, every_source=True)
    for draw in (plot.plot_path, plot.plot_errors, plot.plot_nis, plot.plot_outcomes):
        figure = draw(result)
        assert figure is not None
        plot.save(figure, tmp_path / "x.png")


def test_a_hundred_thousand_messages_are_drawn_in_seconds(tmp_path: Path) -> None:
    result = make_result(n=25_000, rejected={"A3": (100.0, 1500.0)})
    assert len(result.outcomes) == 100_000
    begin = time.perf_counter()
    for draw in (plot.plot_path, plot.plot_errors, plot.plot_nis, plot.plot_outcomes):
        figure = draw(result)
        assert figure is not None
        plot.save(figure, tmp_path / f"{draw.__name__}.png")
        assert (tmp_path / f"{draw.__name__}.png").stat().st_size < 500_000
    # About one second on a slow core; ten leaves room for a loaded machine, not for 100 000 marks.
    assert time.perf_counter() - begin < 10.0


def test_equal_runs_give_equal_files(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        plot.save(plot.plot_nis(make_result()), tmp_path / name)
    first = (tmp_path / "a.png").read_bytes()
    assert first == (tmp_path / "b.png").read_bytes()
    assert b"atplotlib" not in first  # nor does the file change with the version of the plotter


def test_a_run_of_nothing_has_no_beginning() -> None:
    result = make_result(n=0)
    with pytest.raises(ValueError, match="no estimate and no message"):
        plot.start_ns(result)
