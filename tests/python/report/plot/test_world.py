# SPDX-License-Identifier: Apache-2.0
"""Pictures of the world: the box holds what is shown, the map lies where it lies."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse import _core
from locfuse.report.plot.style import new_figure
from locfuse.report.plot.world import box_around, draw_map
from locfuse.types import FREE, OCCUPIED, UNKNOWN, GridMap
from support_figures import colours_at

COLOURS = {FREE: "#ff0000", UNKNOWN: "#00ff00", OCCUPIED: "#0000ff"}


@pytest.mark.parametrize("yaw", [0.0, 0.6, -2.0, np.pi / 2.0])
def test_every_cell_of_a_turned_map_is_drawn_where_the_core_has_it(yaw: float) -> None:
    random = np.random.default_rng(1)
    cells = random.choice(np.array([FREE, UNKNOWN, OCCUPIED], np.int8), (6, 9))
    grid = GridMap(cells, 0.5, (2.0, -1.0, yaw))
    core = _core.OccupancyGrid(cells, 0.5, _core.Pose2(2.0, -1.0, yaw))
    figure = new_figure(6.0)
    axes = figure.add_subplot()
    axes.set_xlim(-5.0, 9.0)
    axes.set_ylim(-8.0, 6.0)
    axes.set_aspect("equal", adjustable="box")

    draw_map(axes, grid, (COLOURS[FREE], COLOURS[UNKNOWN], COLOURS[OCCUPIED]), zorder=0)

    assert (axes.get_xlim(), axes.get_ylim()) == ((-5.0, 9.0), (-8.0, 6.0))
    centres = np.array([core.center(column, row) for row, column in np.ndindex(6, 9)])
    assert colours_at(figure, centres) == [COLOURS[int(cell)] for cell in cells.ravel()]


def test_the_map_takes_points_to_cells_and_back_as_the_core_does() -> None:
    grid = GridMap(np.zeros((6, 9), np.int8), 0.5, (2.0, -1.0, 0.6))
    core = _core.OccupancyGrid(grid.cells, 0.5, _core.Pose2(2.0, -1.0, 0.6))
    centres = np.array([[column + 0.5, row + 0.5] for row in range(6) for column in range(9)])
    expected = [core.center(int(column), int(row)) for column, row in centres]
    assert grid.to_world(centres) == pytest.approx(np.array(expected), abs=1e-12)
    assert grid.to_grid(grid.to_world(centres)) == pytest.approx(centres, abs=1e-12)


def test_the_box_holds_all_that_is_finite_and_keeps_its_shape() -> None:
    points = np.array([[0.0, 0.0], [10.0, 1.0], [np.nan, 99.0]])
    assert np.concatenate(box_around(points, 0.1)) == pytest.approx([-1.0, -1.0, 11.0, 2.0])
    low, high = box_around(points, 0.1, flattest=0.5)
    assert high - low == pytest.approx([12.0, 6.0])
    assert low + high == pytest.approx([10.0, 1.0])
    low, high = box_around(points[:, ::-1], 0.1, tallest=0.8)
    assert high - low == pytest.approx([15.0, 12.0])
    assert np.concatenate(box_around(points[:1], 0.1)) == pytest.approx([-0.1, -0.1, 0.1, 0.1])
