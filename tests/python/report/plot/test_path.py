# SPDX-License-Identifier: Apache-2.0
"""The picture of the path: ellipses as large as claimed, every part named, wrong anchors marked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Ellipse

from locfuse.report import plot
from locfuse.report.plot.path import ellipse_axes
from locfuse.report.plot.style import REJECTED
from locfuse.types import FloatArray, Log, RunResult, Trajectory
from support_figures import legend_of, texts
from support_results import make_result


def _with_covariance(result: RunResult, covariance: FloatArray) -> RunResult:
    tiled = np.tile(covariance, (len(result.estimate), 1, 1))
    return replace(result, estimate=replace(result.estimate, covariance=tiled))


def _with_landmarks(result: RunResult, names: list[str]) -> RunResult:
    n = len(names)
    table = {"landmark": np.array(names), "x_m": np.arange(n) * 0.7, "y_m": np.full(n, 1.0)}
    return replace(result, log=Log(tables={**result.log.tables, "landmarks": table}))


def test_ellipse_axes_are_the_eigenvalues_along_their_eigenvectors() -> None:
    turn = np.radians(30.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    covariance = rotation @ np.diag([0.5**2, 0.1**2]) @ rotation.T

    major, minor, angle = ellipse_axes(covariance, 3.0)

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
    [(np.eye(3), r"\(3, 3\), expected \(2, 2\)"), (np.diag([1.0, -0.5]), "eigenvalue -0.5")],
)
def test_ellipse_of_what_is_no_planar_covariance_is_refused(
    covariance: FloatArray, said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        ellipse_axes(covariance, 3.0)


def test_path_has_equal_scales_and_every_part_named() -> None:
    figure = plot.plot_path(make_result())

    assert figure.axes[0].get_aspect() == 1.0
    assert figure.axes[0].get_xlabel() == "x in world [m]"
    assert legend_of(figure) == ["truth", "estimate", "3-sigma ellipse", "start", "end", "anchor"]
    assert sorted(texts(figure)) == ["A1", "A10", "A2", "A3"]


def test_path_without_truth_and_anchors_does_not_name_them() -> None:
    figure = plot.plot_path(make_result(with_truth=False, anchors=()))
    assert legend_of(figure) == ["estimate", "3-sigma ellipse", "start", "end"]


def test_path_points_at_the_anchor_that_was_rejected() -> None:
    figure = plot.plot_path(make_result(rejected={"A2": (3.0, 12.0)}))

    (text,) = [t for t in figure.axes[0].texts if "rejected" in t.get_text()]
    assert text.get_text() == "A2: 45.0 % rejected"
    assert text.get_color() == REJECTED
    assert legend_of(figure)[-1] == "anchor, at least 10 % rejected"
    (mark,) = [x for x in figure.axes[0].lines if x.get_markerfacecolor() == REJECTED]
    assert [np.asarray(mark.get_xdata())[0], np.asarray(mark.get_ydata())[0]] == pytest.approx(
        [0.0, 8.0]
    )


def test_landmarks_are_drawn_and_named_even_if_an_anchor_has_the_same_name() -> None:
    figure = plot.plot_path(_with_landmarks(make_result(anchors=("1",)), ["1", "2"]))

    assert sorted(texts(figure)) == ["1", "1", "2"]
    assert legend_of(figure)[-2:] == ["anchor", "landmark"]
    (mark,) = [x for x in figure.axes[0].lines if x.get_label() == "landmark"]
    assert np.asarray(mark.get_xdata()) == pytest.approx([0.0, 0.7])


def test_landmarks_too_many_to_read_stay_without_names() -> None:
    figure = plot.plot_path(_with_landmarks(make_result(), [f"L{k}" for k in range(61)]))
    assert not [text for text in texts(figure) if text.startswith("L")]
    assert "landmark" in legend_of(figure)


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

    assert sorted(texts(figure)) == ["far", "low, high"]


def test_path_of_an_empty_estimate_is_refused() -> None:
    nothing = Trajectory(np.empty(0, dtype=np.int64), np.empty((0, 2)))
    with pytest.raises(ValueError, match="no rows"):
        plot.plot_path(replace(make_result(), estimate=nothing))


def test_names_with_signs_of_formula_and_markup_are_drawn_as_they_are(tmp_path: Path) -> None:
    figure = plot.plot_path(make_result(anchors=("$\\frac$", "<b>"), rejected={"<b>": (0.0, 20.0)}))
    plot.save(figure, tmp_path / "x.png")
    assert sorted(texts(figure)) == ["$\\frac$", "<b>: 100.0 % rejected"]
