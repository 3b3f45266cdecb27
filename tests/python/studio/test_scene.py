# SPDX-License-Identifier: Apache-2.0
"""A scene is a valid configuration at any time, remembers its steps, and loses nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from locfuse.config.load import load_config, parse_config
from locfuse.studio import drawing
from locfuse.studio.document import Key, RefusedError, dotted, moved_to, text_of
from locfuse.studio.scene import EMPTY, Scene

ROOT = Path(__file__).resolve().parents[3]
RATE: Key = ("simulation", "ranges", "rate_hz")
ROOM: Key = ("simulation", "room_m")


def paper() -> Scene:
    """Return the room of ekim2020, drawn."""
    scene = Scene()
    for x, y in ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0), (5.0, 0.0)):
        drawing.add_anchor(scene, x, y)
    return scene


def read_again(scene: Scene) -> Any:
    return parse_config(yaml.safe_load(scene.text))


@pytest.mark.parametrize(
    "file", sorted((ROOT / "examples/configs").glob("*.yaml")), ids=lambda p: p.stem
)
def test_every_ready_configuration_is_a_scene_and_comes_back_the_same(file: Path) -> None:
    scene = Scene()

    assert scene.load_text(file.read_text()) == ()

    assert scene.text == file.read_text()
    scene.set(("description",), "changed")
    expected = load_config(file).model_copy(update={"description": "changed"})
    assert read_again(scene) == expected == scene.config


def test_a_value_is_set_undone_and_redone() -> None:
    scene = paper()
    before = scene.text

    assert scene.set(RATE, 8.0) is None
    after = scene.text
    assert scene.config.simulation is not None
    assert scene.config.simulation.ranges is not None
    assert scene.config.simulation.ranges.rate_hz == 8.0
    assert scene.undo()
    assert scene.text == before
    assert scene.redo()
    assert scene.text == after
    assert not scene.redo()


def test_a_new_step_forgets_what_was_undone() -> None:
    scene = paper()
    scene.set(RATE, 8.0)
    scene.undo()

    scene.set(RATE, 9.0)

    assert not scene.can_redo


def test_undo_goes_back_to_the_first_step_and_no_further() -> None:
    scene = paper()

    steps = 0
    while scene.undo():
        steps += 1

    assert steps == 5
    assert scene.data == EMPTY


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (RATE, -1.0, "greater than 0"),
        (RATE, "fast", "expected a number"),
        (RATE, float("nan"), "finite number"),
        (RATE, True, "does not take yes or no"),
        (ROOM, [10.0, "wide"], "value 2: expected a number"),
        (ROOM, [10.0], "value 2: is missing"),
        (ROOM, [10.0, 9.0, 8.0], "expected 2 values, there are 3"),
        (ROOM, [2.0, 2.0], "leaves the room"),
        (("simulation", "path", "radius_m"), 9.0, "leaves the room"),
        (("simulation", "anchors", "A1"), [0.0, 0.0], "value 3: is missing"),
        (("simulation", "anchors"), {}, "ranges need anchors and tags"),
        (("simulation", "rnges"), {}, "did you mean 'ranges'"),
        (("estimator", "range", "gate"), 1.5, "expected at most 1"),
        (("use",), [], "at least 1"),
        (("start",), "somewhere", "expected 'truth', 'auto'"),
        (("seed",), 0.5, "expected a whole number"),
        (("simulation", "faults", 0), {"kind": "gremlin"}, "unknown kind 'gremlin'"),
        (("mcl",), {"min_particles": 9, "max_particles": 3}, "min_particles <= max_particles"),
    ],
    ids=lambda v: dotted(v) if isinstance(v, tuple) else "",
)
def test_a_wrong_value_is_reported_at_its_key_and_changes_nothing(
    key: Key, value: Any, message: str
) -> None:
    scene = paper()
    before = scene.text

    problem = scene.set(key, value)

    assert problem is not None
    assert message in problem
    assert scene.waiting[key].message == problem
    assert scene.text == before
    assert read_again(scene) == scene.config


def test_a_wrong_value_is_gone_once_a_right_one_is_set_or_it_is_undone() -> None:
    scene = paper()
    scene.set(RATE, -1.0)
    scene.set(RATE, 6.0)
    assert not scene.waiting

    scene.set(RATE, -1.0)
    scene.undo()
    assert not scene.waiting
    assert scene.config.simulation is not None
    assert scene.config.simulation.ranges is not None
    assert scene.config.simulation.ranges.rate_hz == 6.0


def test_a_value_that_does_not_fit_yet_waits_for_the_one_that_makes_it_fit() -> None:
    scene = paper()
    least, most = ("mcl", "min_particles"), ("mcl", "max_particles")
    scene.set(("mcl",), {"min_particles": 500, "max_particles": 1000})

    assert scene.set(least, 2000) is not None
    assert scene.set(most, 3000) is None

    assert not scene.waiting
    assert scene.config.mcl is not None
    assert (scene.config.mcl.min_particles, scene.config.mcl.max_particles) == (2000, 3000)


def test_a_right_value_is_taken_beside_one_that_waits() -> None:
    scene = paper()
    scene.set(RATE, -1.0)

    assert scene.set(("seed",), 4) is None

    assert scene.config.seed == 4
    assert list(scene.waiting) == [RATE]


def test_a_key_returns_to_its_default() -> None:
    scene = paper()
    scene.set(RATE, 8.0)

    assert scene.reset(RATE) is None

    assert scene.config.simulation is not None
    assert scene.config.simulation.ranges is not None
    assert scene.config.simulation.ranges.rate_hz == 5.0


def test_what_defaults_say_is_written_out_where_a_part_of_it_is_set() -> None:
    scene = Scene({"simulation": {}})

    drawing.add_anchor(scene, 5.0, 5.0)
    scene.set(("simulation", "path", "radius_m"), 2.0)

    assert scene.config.simulation is not None
    assert len(scene.config.simulation.anchors) == 6
    assert scene.config.simulation.path.shape == "circle"
    assert read_again(scene) == scene.config


# Text ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("name: a\nsimulation:\n  duration_s: -1\n", 3, "greater than 0"),
        ("name: a\nsimulation:\n  duratio_s: 1\n", 3, "did you mean 'duration_s'"),
        ("simulation:\n  faults:\n  - {kind: nlos, walls: [[0, 0, 1]], extra_m: 1}\n", 3,
         "is missing"),
        ("simulation:\n  room_m: [9, 9]\n  path: {shape: eight, radius_m: 4}\n", 1, "eight around"),
        ("simulation:\n  faults:\n  - {kind: latency, source: positions, delay_s: 1}\n", 3,
         "switched off"),
        ("name: [a\nseed: 1\n", 2, "not valid YAML"),
        ("seed: 1\na: 1\na: 2\n", 3, "given twice"),
        ("", None, "is empty"),
        ("- 1\n- 2\n", None, "expected keys and values"),
        ("name: !!bool 3\n", None, "not valid YAML"),
    ],
)  # fmt: skip
def test_a_wrong_text_is_kept_and_reported_in_its_line_and_the_scene_stays(
    text: str, line: int | None, message: str
) -> None:
    scene = paper()
    config = scene.config

    problems = scene.load_text(text)

    assert problems == scene.text_problems
    assert problems[0].line == line
    assert message in str(problems[0])
    assert scene.text == text
    assert scene.config == config
    scene.undo()
    assert read_again(scene) == config


def test_a_text_keeps_its_comments_until_a_form_writes_it_anew() -> None:
    scene = Scene()
    text = "name: mine # a comment\nsimulation: {duration_s: 5}\n"

    scene.load_text(text)
    assert scene.text == text
    scene.set(("seed",), 3)
    scene.undo()

    assert scene.text == text


def test_another_document_replaces_the_scene_in_one_step() -> None:
    scene = paper()
    before = scene.data

    scene.replace({"simulation": {"duration_s": 3.0}})
    with pytest.raises(RefusedError, match="greater than 0"):
        scene.replace({"simulation": {"duration_s": 0.0}})

    assert scene.config.simulation is not None
    assert scene.config.simulation.duration_s == 3.0
    scene.undo()
    assert scene.data == before


def test_paths_of_files_move_with_a_document(tmp_path: Path) -> None:
    data: dict[str, Any] = {
        "log": {"dataset": "lias", "path": "data"},
        "ros": {"world": "/absolute"},
    }

    moved = moved_to(data, tmp_path / "here", tmp_path / "a/b")

    assert moved["log"]["path"] == "../../here/data"
    assert moved["ros"]["world"] == "/absolute"
    assert data["log"]["path"] == "data"
    map_of = {"simulation": {"map": {"file": "m.yaml"}}}
    assert moved_to(map_of, tmp_path, tmp_path / "a")["simulation"]["map"]["file"] == "../m.yaml"
    assert moved_to({"log": "drive"}, tmp_path, tmp_path) == {"log": "drive"}


def test_texts_are_short_and_read_back() -> None:
    data = {"simulation": {"anchors": {"A1": [0.0, 1.5, 2.0]}, "path": {"shape": "circle"}}}

    assert "A1: [0.0, 1.5, 2.0]" in text_of(data)
    assert yaml.safe_load(text_of(data)) == data
