# SPDX-License-Identifier: Apache-2.0
"""What a mouse does to a scene: each thing goes where it was put, and what needs it follows."""

from __future__ import annotations

from typing import Any

import pytest

from locfuse.config.scenario import Nlos, Points, Scenario
from locfuse.studio import drawing
from locfuse.studio.document import RefusedError
from locfuse.studio.scene import Scene
from locfuse.studio.view import world_of


def scenario_of(scene: Scene) -> Scenario:
    assert scene.config.simulation is not None
    return scene.config.simulation


def drawn(**simulation: Any) -> Scene:
    return Scene({"simulation": simulation})


def test_the_first_anchor_switches_ranges_on_and_the_last_one_off() -> None:
    scene = Scene()
    assert scenario_of(scene).ranges is None

    assert drawing.add_anchor(scene, 1.0, 2.0) == "A1"
    assert scenario_of(scene).ranges is not None
    assert scenario_of(scene).anchors == {"A1": (1.0, 2.0, 0.0)}

    drawing.remove(scene, ("anchor", "A1"))
    assert scenario_of(scene).ranges is None


def test_ranges_that_were_switched_off_by_hand_stay_off() -> None:
    scene = drawn(ranges=None)

    drawing.add_anchor(scene, 1.0, 2.0)

    assert scenario_of(scene).ranges is None


def test_anchors_are_as_high_as_the_last_one_and_keep_their_height_when_moved() -> None:
    scene = drawn(anchors={"A1": [0.0, 0.0, 2.5]})

    drawing.add_anchor(scene, 4.0, 4.0)
    drawing.move(scene, ("anchor", "A1"), 1.0, 1.0)

    assert scenario_of(scene).anchors == {"A1": (1.0, 1.0, 2.5), "A2": (4.0, 4.0, 2.5)}


def test_faults_of_an_anchor_that_is_taken_away_go_with_it() -> None:
    faults = [{"kind": "bias", "anchor": "A1", "offset_m": 1.0}, {"kind": "bias", "offset_m": 0.1}]
    scene = drawn(anchors={"A1": [0, 0, 0], "A2": [5, 5, 0]}, faults=faults)

    drawing.remove(scene, ("anchor", "A1"))
    assert len(scenario_of(scene).faults) == 1
    drawing.remove(scene, ("anchor", "A2"))
    assert scenario_of(scene).faults == []


def test_the_last_landmark_takes_sightings_with_it() -> None:
    scene = drawn(landmarks={"L1": [1, 1]}, landmark_sightings={})

    drawing.remove(scene, ("landmark", "L1"))

    assert scenario_of(scene).landmark_sightings is None


def test_a_cylinder_gives_landmarks_a_radius_that_stays_if_there_is_one() -> None:
    scene = Scene()

    drawing.add_landmark(scene, 1.0, 1.0)
    assert scenario_of(scene).landmark_radius_m == 0.0
    drawing.add_landmark(scene, 2.0, 2.0, cylinder=True)
    assert scenario_of(scene).landmark_radius_m == drawing.CYLINDER_M
    scene.set(("simulation", "landmark_radius_m"), 0.3)
    drawing.add_landmark(scene, 3.0, 3.0, cylinder=True)

    assert scenario_of(scene).landmark_radius_m == 0.3
    assert list(scenario_of(scene).landmarks) == ["L1", "L2", "L3"]


def test_walls_of_the_laser_stand_in_the_map_and_those_of_ranges_in_a_fault() -> None:
    scene = drawn()

    drawing.add_wall(scene, [1.0, 1.0, 2.0, 1.0])
    drawing.add_wall(scene, [3.0, 3.0, 4.0, 3.0], nlos=True)
    drawing.add_wall(scene, [5.0, 5.0, 5.0, 6.0], nlos=True)

    scenario = scenario_of(scene)
    assert scenario.map is not None
    assert scenario.map.walls == [(1.0, 1.0, 2.0, 1.0)]
    (fault,) = scenario.faults
    assert isinstance(fault, Nlos)
    assert fault.walls == [(3.0, 3.0, 4.0, 3.0), (5.0, 5.0, 5.0, 6.0)]
    assert world_of(scene)["nlos"] == [[0, 0, 3.0, 3.0, 4.0, 3.0], [0, 1, 5.0, 5.0, 5.0, 6.0]]


def test_walls_are_moved_by_their_ends_and_taken_away() -> None:
    scene = drawn(map={"walls": [[1, 1, 2, 1]]},
                  faults=[{"kind": "nlos", "walls": [[3, 3, 4, 3]], "extra_m": 1}])  # fmt: skip

    drawing.move(scene, ("wall", 0, 1), 2.0, 4.0)
    drawing.move(scene, ("nlos", 0, 0, 0), 0.0, 3.0)
    assert world_of(scene)["walls"] == [[1.0, 1.0, 2.0, 4.0]]
    assert world_of(scene)["nlos"] == [[0, 0, 0.0, 3.0, 4.0, 3.0]]

    drawing.remove(scene, ("wall", 0))
    drawing.remove(scene, ("nlos", 0, 0))
    assert world_of(scene)["walls"] == []
    assert scenario_of(scene).faults == []


def test_a_wall_of_no_length_is_refused() -> None:
    scene = drawn()

    with pytest.raises(RefusedError, match="two different ends"):
        drawing.add_wall(scene, [1.0, 1.0, 1.0, 1.0])


def test_a_path_is_driven_at_the_speed_of_the_one_before() -> None:
    scene = drawn(path={"shape": "square", "speed_mps": 0.7, "turn_rate_radps": 2.0})

    drawing.draw_path(scene, [[1, 1], [5, 1], [5, 1], [5, 5], [1, 1]], closed=True)

    path = scenario_of(scene).path
    assert isinstance(path, Points)
    assert path.points_m == [(1.0, 1.0), (5.0, 1.0), (5.0, 5.0)]
    assert path.closed
    assert (path.speed_mps, path.turn_rate_radps) == (0.7, 2.0)


def test_points_and_middles_of_paths_are_moved() -> None:
    scene = drawn()
    drawing.move(scene, ("center",), 4.0, 6.0)
    assert world_of(scene)["path"]["center"] == [4.0, 6.0]

    drawing.draw_path(scene, [[1, 1], [5, 1], [5, 5]])
    drawing.move(scene, ("point", 1), 6.0, 2.0)
    drawing.remove(scene, ("point", 0))

    assert world_of(scene)["path"]["points"] == [[6.0, 2.0], [5.0, 5.0]]
    with pytest.raises(RefusedError, match="at least 2"):
        drawing.remove(scene, ("point", 0))


def test_what_does_not_fit_is_refused_and_the_scene_stays() -> None:
    scene = drawn()
    before = scene.text

    with pytest.raises(RefusedError, match="outside of the room"):
        drawing.draw_path(scene, [[1, 1], [50, 1]])
    with pytest.raises(RefusedError, match="leaves the room"):
        drawing.move(scene, ("center",), 1.0, 1.0)

    assert scene.text == before


def test_a_new_name_holds_wherever_the_old_one_stood() -> None:
    scene = Scene({
        "simulation": {"anchors": {"A1": [0, 0, 0], "A2": [5, 0, 0]},
                       "faults": [{"kind": "bias", "anchor": "A1", "offset_m": 1.0}]},
        "anchors": {"A1": {"offset_m": 0.5}},
    })  # fmt: skip

    drawing.rename(scene, ("anchor", "A1"), "door")

    assert list(scenario_of(scene).anchors) == ["door", "A2"]
    assert getattr(scenario_of(scene).faults[0], "anchor", None) == "door"
    assert list(scene.config.anchors) == ["door"]
    with pytest.raises(RefusedError, match="another anchor named 'A2'"):
        drawing.rename(scene, ("anchor", "door"), "A2")
    with pytest.raises(RefusedError, match="expected a text"):
        drawing.rename(scene, ("anchor", "door"), "")


def test_on_the_map_of_a_file_the_robot_roams() -> None:
    scene = drawn()

    drawing.use_map(scene, "maps/a.yaml", (20.0, 15.0))

    scenario = scenario_of(scene)
    assert scenario.map is not None
    assert scenario.map.file == "maps/a.yaml"
    assert scenario.room_m == (20.0, 15.0)
    assert scenario.path.shape == "roam"


def test_there_is_nothing_to_draw_in_a_log() -> None:
    scene = Scene({"log": "drive"})

    assert world_of(scene) == {"simulated": False, "log": "drive"}
    with pytest.raises(RefusedError, match="replays a log"):
        drawing.add_anchor(scene, 1.0, 1.0)
