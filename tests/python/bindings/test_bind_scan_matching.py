# SPDX-License-Identifier: Apache-2.0
"""Scan matching from Python: arrays in, results out, what is refused."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
import pytest

import locfuse.core as lf
from locfuse.types import FloatArray

BEAMS = 180


def room() -> lf.OccupancyGrid:
    """Walls of 8 x 6 m in cells of 5 cm, and a box that breaks the symmetry; origin (-1, -2)."""
    cells = np.zeros((122, 162), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[80:100, 120:140] = 100
    return lf.OccupancyGrid(cells, 0.05, lf.Pose2(-1.0, -2.0, 0.0))


def seen_from(grid: lf.OccupancyGrid, pose: lf.Pose2) -> lf.LaserScan:
    """Walk along each beam in steps of a millimetre to the first occupied cell."""
    ranges = np.full(BEAMS, np.nan)
    far = np.arange(0.0, 12.0, 0.001)
    for i in range(BEAMS):
        angle = pose.heading - math.pi + i * 2 * math.pi / BEAMS
        column = np.floor((pose.x + 1.0 + far * math.cos(angle)) / 0.05).astype(int)
        row = np.floor((pose.y + 2.0 + far * math.sin(angle)) / 0.05).astype(int)
        inside = (column >= 0) & (column < grid.width) & (row >= 0) & (row < grid.height)
        hit = np.flatnonzero(inside)[grid.cells[row[inside], column[inside]] == 100]
        ranges[i] = far[hit[0]]
    return lf.LaserScan(0, around(), ranges)


def around() -> lf.LaserGeometry:
    return lf.LaserGeometry(lf.Pose2(), -math.pi, 2 * math.pi / BEAMS, 0.1, 12.0)


def test_cells_come_back_as_given_and_cannot_be_changed() -> None:
    given = np.array([[0, 100, -1], [-1, 0, 0]], dtype=np.int8)
    grid = lf.OccupancyGrid(given, 0.5, lf.Pose2(1.0, 2.0, 0.0))
    np.testing.assert_array_equal(grid.cells, given)
    assert (grid.width, grid.height, grid.resolution) == (3, 2, 0.5)
    np.testing.assert_allclose(grid.center(1, 0), [1.75, 2.25])
    assert grid.contains([1.1, 2.1])
    assert not grid.contains([0.9, 2.1])
    with pytest.raises(ValueError, match="read-only"):
        grid.cells[0, 0] = 100


@pytest.mark.parametrize(
    ("cells", "resolution", "text"),
    [
        (np.zeros(4, dtype=np.int8), 0.1, "1 dimensions, expected 2"),
        (np.zeros((0, 4), dtype=np.int8), 0.1, "height is 0"),
        (np.full((2, 2), 50, dtype=np.int8), 0.1, "is 50, expected 0"),
        (np.zeros((2, 2), dtype=np.int8), -0.1, "resolution"),
    ],
)
def test_what_makes_no_grid_is_refused(cells: FloatArray, resolution: float, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        lf.OccupancyGrid(cells, resolution)


@pytest.mark.parametrize("dtype", [np.int16, np.int64, np.uint8])
def test_cells_of_other_integers_are_those_they_say(dtype: type[np.integer[Any]]) -> None:
    cells = np.array([[0, 100, 0], [0, 0, 0]], dtype)
    np.testing.assert_array_equal(lf.OccupancyGrid(cells, 0.5).cells, cells)
    cells[1, 2] = 255  # unknown it would be, cut off to eight bits
    with pytest.raises(ValueError, match=r"row 1: cells holds 255, expected 0 \(free\), 100"):
        lf.OccupancyGrid(cells, 0.5)


@pytest.mark.parametrize("cells", [[[0.9, 100.7]], [[math.nan, 100.0]], np.zeros((3, 4)), [["0"]]])
def test_cells_that_are_no_integers_are_refused(cells: Any) -> None:
    with pytest.raises(TypeError, match=r"cells holds .*, expected integers"):
        lf.OccupancyGrid(cells, 0.5)


def test_distances_are_those_of_brute_force() -> None:
    grid = room()
    row, column = np.nonzero(grid.cells == 100)
    occupied = np.stack([-1.0 + (column + 0.5) * 0.05, -2.0 + (row + 0.5) * 0.05], axis=1)
    points = np.random.default_rng(1).uniform(-6.0, 10.0, (500, 2))
    nearest = np.linalg.norm(points[:, None] - occupied, axis=2).min(axis=1)
    field = lf.DistanceField(grid)
    np.testing.assert_allclose(field.nearest_distance(points), nearest, atol=1e-9)
    np.testing.assert_allclose(field.distance(points), nearest, atol=0.0354)
    matcher = lf.ScanMatcher(grid)
    by_tree = [matcher.nearest_by_kdtree(point) for point in points]
    np.testing.assert_allclose(by_tree, nearest, atol=1e-5)
    with pytest.raises(ValueError, match=r"points has shape \(3,\)"):
        field.distance(np.zeros(3))


def test_scans_keep_their_fields_and_refuse_what_is_no_range() -> None:
    scan = lf.LaserScan(5, around(), [1.0, math.nan, 2.0])
    assert scan.stamp == 5
    np.testing.assert_array_equal(scan.ranges, [1.0, math.nan, 2.0])
    assert scan.geometry.range_max == 12.0
    assert repr(scan) == "LaserScan(stamp=5, 3 beams)"
    with pytest.raises(ValueError, match=r"ranges \[m\] is inf"):
        lf.LaserScan(0, around(), [math.inf])
    with pytest.raises(ValueError, match="expected"):
        lf.LaserScan(0, around(), np.ones((2, 2)))
    with pytest.raises(ValueError, match="range_max"):
        lf.LaserGeometry(lf.Pose2(), 0.0, 0.1, range_min=1.0, range_max=0.5)


def test_search_refines_to_the_pose_the_scan_was_taken_from() -> None:
    grid = room()
    matcher = lf.ScanMatcher(grid)
    truth = lf.Pose2(1.5, 0.5, 2.0)
    scan = seen_from(grid, truth)
    found = matcher.search(scan, position=[1.55, 0.42], covariance=0.01 * np.eye(2))
    assert found.status is lf.ScanSearchStatus.READY
    assert found.reason is lf.ScanSearchReason.UNIQUE
    best = found.hypotheses[0]
    assert best.probability > 0.999
    error = lf.local(best.match.pose, truth)
    assert np.hypot(*error[:2]) < 0.02
    assert abs(error[2]) < 0.005
    assert best.match.covariance is not None
    assert best.match.covariance.shape == (3, 3)
    again = matcher.refine(scan, best.match.pose)
    assert again.converged
    assert again.reason is lf.ScanMatchReason.CONVERGED
    assert again.explained > 0.9
    assert again.weak_direction is None
    ten_degrees = matcher.heading_search(scan, position=[1.5, 0.5])
    assert ten_degrees.heading == pytest.approx(2.0, abs=math.radians(5.01))
    assert ten_degrees.sums.shape == (36,)


def test_bad_input_has_one_error_or_status_each() -> None:
    grid = room()
    matcher = lf.ScanMatcher(grid)
    empty = lf.LaserScan(0, around(), [])
    silent = lf.LaserScan(0, around(), np.full(BEAMS, np.nan))
    good = seen_from(grid, lf.Pose2(1.5, 0.5, 2.0))
    eye = 0.01 * np.eye(2)
    for scan in (empty, silent):
        assert matcher.search(scan, [1.0, 0.0], eye).reason is lf.ScanSearchReason.NO_RETURNS
        assert matcher.refine(scan, lf.Pose2(1, 0, 0)).reason is lf.ScanMatchReason.NO_RETURNS
        found = matcher.heading_search(scan, [1.0, 0.0])
        assert found.heading is None
        assert found.reason is lf.HeadingSearchReason.NO_RETURNS
    outside = matcher.search(good, [50.0, 0.0], eye)
    assert (outside.status, outside.reason) == (
        lf.ScanSearchStatus.NONE,
        lf.ScanSearchReason.OUTSIDE_MAP,
    )
    assert matcher.heading_search(good, [50.0, 0.0]).reason is lf.HeadingSearchReason.OUTSIDE_MAP
    assert matcher.refine(good, lf.Pose2(50, 0, 0)).reason is lf.ScanMatchReason.OUTSIDE_MAP
    with pytest.raises(ValueError, match="position is"):
        matcher.search(good, [math.nan, 0.0], eye)
    with pytest.raises(ValueError, match="positive definite"):
        matcher.search(good, [1.0, 0.0], -eye)
    free = lf.OccupancyGrid(np.zeros((3, 3), dtype=np.int8), 0.1)
    with pytest.raises(ValueError, match="0 occupied cells"):
        lf.ScanMatcher(free)


@pytest.mark.parametrize("user", [lf.DistanceField, lf.RayCaster, lf.ScanMatcher])
def test_none_is_no_map(user: Any) -> None:  # it ended the interpreter once
    with pytest.raises(ValueError, match=f"{user.__name__} has no map, expected an OccupancyGrid"):
        user(None)


def test_settings_are_keywords_and_checked() -> None:
    assert lf.ScanMatcherConfig(sigma_range_m=0.02).sigma_range_m == 0.02
    with pytest.raises(TypeError):
        lf.ScanMatcherConfig(0.02)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match=r"min_explained is 1\.5"):
        lf.ScanMatcher(room(), lf.ScanMatcherConfig(min_explained=1.5))


def test_threads_get_the_same_answers() -> None:
    grid = room()
    matcher = lf.ScanMatcher(grid)
    scan = seen_from(grid, lf.Pose2(1.5, 0.5, 2.0))
    costs: list[float] = []

    def ask() -> None:
        for _ in range(5):
            costs.append(matcher.search(scan, [1.5, 0.5], 0.01 * np.eye(2)).hypotheses[0].cost)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(costs) == 20
    assert len(set(costs)) == 1


def test_beams_one_by_one_are_those_of_a_scan() -> None:
    caster = lf.RayCaster(room())
    ranges = caster.scan(lf.Pose2(0.5, 0.25, 0.1), -1.0, 0.1, 30, max_range=20.0)
    assert ranges.shape == (30,)
    assert np.isfinite(ranges).any()
    headings = 0.1 + (-1.0 + 0.1 * np.arange(30))
    one_by_one = caster.cast(np.tile([0.5, 0.25], (30, 1)), headings, max_range=20.0)
    np.testing.assert_allclose(one_by_one, ranges, atol=1e-12)


def test_unknown_cells_stop_beams_where_that_is_asked_for() -> None:
    grid = lf.OccupancyGrid(np.array([[0, -1, 0, 100]], dtype=np.int8), 1.0)
    start, heading = np.array([[0.5, 0.5]]), np.zeros(1)
    assert lf.RayCaster(grid).cast(start, heading) == 2.5
    assert lf.RayCaster(grid, unknown_stops=True).cast(start, heading) == 0.5


def test_beams_of_other_shapes_and_of_no_number_are_refused() -> None:
    caster = lf.RayCaster(room())
    with pytest.raises(ValueError, match=r"headings has shape \(3,\), expected \(2,\)"):
        caster.cast(np.zeros((2, 2)), np.zeros(3))
    with pytest.raises(ValueError, match=r"points has shape \(2, 3\)"):
        caster.cast(np.zeros((2, 3)), np.zeros(2))
    with pytest.raises(ValueError, match="heading is nan"):
        caster.cast(np.zeros((1, 2)), np.array([math.nan]))
    with pytest.raises(ValueError, match="max_range is -1"):
        caster.scan(lf.Pose2(), 0.0, 0.1, 3, max_range=-1.0)
    with pytest.raises(ValueError, match="count is -2"):
        caster.scan(lf.Pose2(), 0.0, 0.1, -2)
