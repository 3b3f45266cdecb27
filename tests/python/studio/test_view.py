# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a scene is what will be simulated, or what a log holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.io.log_folder import write_log
from locfuse.run.run import load_log
from locfuse.studio.scene import Scene
from locfuse.studio.view import coverage_of, ground_of
from locfuse.types import LogError

KIDNAP = {"kind": "kidnap", "at_s": 20.0, "to": [3.0, 3.0, 90.0]}


def ground(data: dict[str, Any], base: Path = Path()) -> dict[str, Any]:
    return ground_of(parse_config(data), base)


@pytest.mark.parametrize(
    "simulation",
    [
        {"duration_s": 30},
        {"duration_s": 30, "path": {"shape": "waypoints", "margin_m": 4.5}, "faults": [KIDNAP]},
        {"duration_s": 30, "path": {"shape": "roam"}, "map": {"generate": "rooms", "seed": 2}},
    ],
    ids=["circle", "kidnapped", "roaming"],
)
def test_the_way_that_is_drawn_is_the_truth_of_the_simulation(simulation: dict[str, Any]) -> None:
    data = {"simulation": simulation, "seed": 5}

    drawn = ground(data)

    truth = load_log(parse_config(data), None, 5)["truth"]
    time_s = np.linspace(0.0, 30.0, len(drawn["way"]))
    for column, name in enumerate(("x_m", "y_m")):
        at = np.interp(time_s, truth["stamp_ns"] / 1e9, truth[name])
        off = np.abs(np.array(drawn["way"])[:, column] - at)
        assert np.sort(off)[-3] < 0.01  # but for the instant of a kidnapping
    assert drawn["start"][:2] == pytest.approx([truth["x_m"][0], truth["y_m"][0]], abs=1e-3)
    assert (drawn["map"] is None) == ("map" not in simulation)


def test_a_way_through_a_wall_is_drawn_and_reported() -> None:
    path = {"shape": "points", "points_m": [[5.0, 2.0], [5.0, 8.0]]}
    walls = {"walls": [[4.0, 5.0, 6.0, 5.0]]}

    drawn = ground({"simulation": {"path": path, "map": walls}})

    assert "into a wall of the map at (5.00, 4.9" in drawn["message"]
    assert len(drawn["way"]) > 100


def test_of_a_log_its_world_and_its_truth_are_drawn(tmp_path: Path) -> None:
    log = load_log(parse_config({"simulation": {"duration_s": 5}}), None, 1)
    write_log(log, tmp_path / "drive")

    drawn = ground({"log": "drive"}, tmp_path)

    assert drawn["anchors"]["A3"] == [10.0, 10.0]
    assert drawn["counts"]["ranges"] == len(log["ranges"]["stamp_ns"])
    assert drawn["start"] == pytest.approx([8.0, 5.0, np.pi / 2], abs=1e-3)
    with pytest.raises(LogError, match="nowhere"):
        ground({"log": "nowhere"}, tmp_path)


def test_the_coverage_is_that_of_anchors_where_they_are_dragged_to() -> None:
    scene = Scene({"simulation": {}})

    still = coverage_of(scene, {}, Path())
    moved = coverage_of(scene, {"A5": (5.0, 5.0)}, Path())

    assert still is not None
    assert moved is not None
    assert not np.allclose(still.hdop, moved.hdop)
    scene.set(("simulation", "anchors", "A5"), [5.0, 5.0, 0.0])
    put = coverage_of(scene, {}, Path())
    assert put is not None
    np.testing.assert_array_equal(put.hdop, moved.hdop)
    assert coverage_of(Scene(), {}, Path()) is None
    assert coverage_of(Scene({"log": "drive"}), {}, Path()) is None
