# SPDX-License-Identifier: Apache-2.0
"""Runs in a process of their own: the same as `locfuse run`, cancelled, crashed, found again."""

from __future__ import annotations

import gzip
import json
import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from locfuse.config.load import load_config
from locfuse.io.maps import write_map
from locfuse.report.results import write_results
from locfuse.run.run import run
from locfuse.sim.room import room_grid
from locfuse.studio.document import text_of
from locfuse.studio.estimators import CHOICES, choices, variant
from locfuse.studio.runner import Run, Runner
from locfuse.studio.scene import Scene
from locfuse.studio.work import PLAY, write_bag_of

CHOICE = {choice.key: choice for choice in CHOICES}
SHORT: dict[str, Any] = {"name": "short", "simulation": {"duration_s": 10.0}}
# Far longer than any test waits.
LONG: dict[str, Any] = {"name": "long", "simulation": {"duration_s": 20_000.0}}
# Computes for minutes, and can be watched meanwhile.
SLOW: dict[str, Any] = {
    "name": "slow",
    "simulation": {"map": {}, "laser": {"beams": 180}, "duration_s": 2000.0},
    "mcl": {"min_particles": 50_000, "max_particles": 50_000, "beams": 180},
}
FILES = ("estimate.csv", "outcomes.csv", "estimate.tum", "truth.tum", "config.yaml")
WAIT_S = 120.0


@pytest.fixture
def runner(tmp_path: Path) -> Iterator[Runner]:
    folder = tmp_path / "runs"
    folder.mkdir()
    made = Runner(folder)
    yield made
    made.close()


def begin(runner: Runner, data: dict[str, Any], *keys: str) -> Run:
    return runner.start(Scene(data), [CHOICE[key] for key in keys], runner.folder.parent)


def ended(runner: Runner) -> Run:
    made = begin(runner, SHORT, "odometry")
    runner.wait(WAIT_S)
    return made


def until(wanted: Any) -> None:
    end = time.monotonic() + WAIT_S
    while not wanted():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_each_estimator_gives_what_locfuse_run_gives_bit_for_bit(
    runner: Runner, tmp_path: Path
) -> None:
    made = begin(runner, SHORT, "as_set", "odometry", "odometry_uwb")
    runner.wait(WAIT_S)

    assert [(part.state, part.error) for part in made.parts] == [("done", "")] * 3
    for part in made.parts:
        folder = made.folder_of(part.key)
        again = run(load_config(folder / "scene.yaml"), base=folder)
        write_results(again, tmp_path / part.key)
        for name in FILES:
            assert (folder / name).read_bytes() == (tmp_path / part.key / name).read_bytes(), name
        assert part.metrics["position_rmse_m"] == again.metrics["position_rmse_m"]
        assert (folder / "report.html").exists()
    rmse = [part.metrics["position_rmse_m"] for part in made.parts]
    assert len(set(rmse)) == 3


def test_what_is_played_has_the_name_of_the_estimator(runner: Runner) -> None:
    made = begin(runner, SHORT, "odometry")
    runner.wait(WAIT_S)

    shown = play_of(made, "odometry")

    assert shown["name"] == "odometry alone"
    assert shown["whole"] is True
    assert made.can_be_watched("odometry")
    assert load_config(made.folder_of("odometry") / "config.yaml").name == "short"


def test_a_map_beside_the_scene_is_found_from_the_folder_of_the_run(
    runner: Runner, tmp_path: Path
) -> None:
    (tmp_path / "maps").mkdir()
    write_map(room_grid((8.0, 6.0), [], 0.05), tmp_path / "maps/room.yaml")
    scene = Scene({"simulation": {
        "map": {"file": "maps/room.yaml"}, "path": {"shape": "roam"}, "laser": {}, "duration_s": 5,
        "room_m": [8, 6]}, "mcl": {"max_particles": 600}})  # fmt: skip

    made = runner.start(scene, [CHOICE["as_set"]], tmp_path)
    runner.wait(WAIT_S)

    assert made.parts[0].error == ""
    shown = play_of(made, "as_set")
    assert shown["map"] is not None
    assert shown["particles"]["of"] > 5


def test_a_run_is_cancelled_at_once_and_another_one_can_follow(runner: Runner) -> None:
    made = begin(runner, LONG, "as_set", "odometry")
    until(lambda: made.parts[0].state == "running")
    began = time.monotonic()

    runner.cancel()
    runner.wait(WAIT_S)

    assert time.monotonic() - began < 5.0
    assert [part.state for part in made.parts] == ["cancelled", "cancelled"]
    assert [part.error for part in made.parts] == ["", ""]
    assert not runner.busy
    again = begin(runner, SHORT, "as_set")
    runner.wait(WAIT_S)
    assert (again.number, again.parts[0].state) == (2, "done")


def play_of(run: Run, key: str) -> dict[str, Any]:
    packed: dict[str, Any] = json.loads(gzip.decompress((run.folder_of(key) / PLAY).read_bytes()))
    return packed


def test_a_run_can_be_watched_while_it_computes_and_what_there_was_when_it_is_cancelled_stays(
    runner: Runner,
) -> None:
    made = begin(runner, SLOW, "as_set", "odometry")
    part = made.parts[0]
    until(lambda: part.grown >= 1)
    first = play_of(made, "as_set")
    until(lambda: part.grown >= 3)
    later = play_of(made, "as_set")
    assert (part.state, part.metrics) == ("running", {})
    for shown in (first, later):
        assert shown["whole"] is False
        assert shown["name"] == "as set"
    assert 0.0 < first["end"] < later["end"] < 2000.0

    runner.cancel()
    runner.wait(WAIT_S)

    assert [p.state for p in made.parts] == ["cancelled", "cancelled"]
    assert made.can_be_watched("as_set")
    assert not made.can_be_watched("odometry")
    left = play_of(made, "as_set")
    assert left["whole"] is False
    assert left["end"] >= later["end"]
    assert {file.name for file in made.folder_of("as_set").iterdir()} == {"scene.yaml", PLAY}
    (found,) = Runner(runner.folder).runs
    assert (found.parts[0].state, found.parts[0].metrics) == ("cancelled", {})
    assert 0.0 < found.parts[0].share < 1.0


def test_a_run_whose_process_dies_is_one_sentence(runner: Runner) -> None:
    made = begin(runner, LONG, "as_set", "odometry")
    until(lambda: made.parts[0].state == "running")
    assert runner._process is not None
    assert runner._process.pid is not None

    os.kill(runner._process.pid, signal.SIGKILL)
    runner.wait(WAIT_S)

    assert [part.state for part in made.parts] == ["failed", "cancelled"]
    assert "ended by signal 9" in made.parts[0].error
    assert not runner.busy


def test_what_goes_wrong_in_one_estimator_is_reported_and_the_others_run(runner: Runner) -> None:
    wall = {"walls": [[4.0, 5.0, 6.0, 5.0]]}
    path = {"shape": "points", "points_m": [[5.0, 2.0], [5.0, 8.0]]}
    through_a_wall = {"simulation": {"map": wall, "path": path, "duration_s": 30}}

    made = begin(runner, through_a_wall, "as_set", "odometry")
    runner.wait(WAIT_S)

    assert [part.state for part in made.parts] == ["failed", "failed"]
    assert "into a wall of the map at (5.00, 4.9" in made.parts[0].error
    assert "Traceback" in (made.folder_of("as_set") / "error.txt").read_text()


def test_a_log_that_is_not_there_is_one_sentence(runner: Runner) -> None:
    made = begin(runner, {"log": "nowhere"}, "as_set")
    runner.wait(WAIT_S)

    assert made.parts[0].state == "failed"
    assert "nowhere" in made.parts[0].error
    assert "\n" not in made.parts[0].error


@pytest.mark.parametrize("wrong", ["nothing", "busy", "waiting", "text"])
def test_what_cannot_be_run_is_refused_in_words(runner: Runner, wrong: str) -> None:
    scene = Scene(SHORT)
    if wrong == "busy":
        begin(runner, LONG, "as_set")
    if wrong == "waiting":
        scene.set(("seed",), -1)
    if wrong == "text":
        scene.load_text("a: [")

    expected = {"nothing": "no estimator is chosen", "busy": "under way"}.get(wrong, "do not fit")
    with pytest.raises(ValueError, match=expected):
        runner.start(scene, [] if wrong == "nothing" else [CHOICE["as_set"]], runner.folder)


def test_runs_are_found_again_and_those_that_were_under_way_are_cancelled(runner: Runner) -> None:
    made = begin(runner, SHORT, "as_set", "odometry")
    runner.wait(WAIT_S)
    made.parts[1].state = "running"
    made.write()
    (runner.folder / "strange").mkdir()
    (runner.folder / "strange/run.json").write_text("{")

    (found,) = Runner(runner.folder).runs

    assert (found.number, found.name) == (1, "short")
    assert [part.state for part in found.parts] == ["done", "cancelled"]
    assert found.parts[0].metrics == made.parts[0].metrics
    assert found.can_be_watched("as_set")


def test_a_run_that_is_done_is_found_again_however_soon_the_server_ends(runner: Runner) -> None:
    made = begin(runner, SHORT, "as_set")
    until(lambda: not runner.busy)  # its process still runs: it has said its last word but one
    runner.close()

    (found,) = Runner(runner.folder).runs

    assert (found.parts[0].state, found.parts[0].metrics) == ("done", made.parts[0].metrics)
    assert found.parts[0].metrics["position_rmse_m"] > 0.0


def test_figures_of_a_run_are_kept_before_its_report_is_written(runner: Runner) -> None:
    made = begin(runner, SHORT, "as_set")

    def written() -> dict[str, Any]:
        part: dict[str, Any] = json.loads((made.folder / "run.json").read_text())["parts"][0]
        return part

    until(lambda: written()["metrics"])
    assert written()["state"] == "writing"
    assert written()["metrics"]["position_rmse_m"] > 0.0
    runner.close()

    (found,) = Runner(runner.folder).runs
    assert found.parts[0].metrics == made.parts[0].metrics
    assert found.can_be_watched("as_set")


@pytest.mark.parametrize(
    "key",
    ["VICTIM", "../../../victim", "..", "", ".", "a/b", "a\n", "A", 'y" innerHTML="<img src=q>', 7],
)
def test_a_key_that_is_no_plain_name_is_not_read_and_nothing_is_deleted(
    tmp_path: Path, key: Any
) -> None:
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "precious.txt").write_text("precious")
    (tmp_path / "runs/001").mkdir(parents=True)
    part = {"key": str(victim) if key == "VICTIM" else key, "name": "x", "state": "running"}
    about = {"name": "x", "began": 0.0, "parts": [part]}
    (tmp_path / "runs/001/run.json").write_text(json.dumps(about))

    runner = Runner(tmp_path / "runs")

    assert runner.runs == []
    assert [said.partition(": ")[0] for said in runner.unread] == ["001"]
    assert "parts.0.key" in runner.unread[0]
    assert (victim / "precious.txt").read_text() == "precious"


@pytest.mark.parametrize("link", ["001", "001/as_set"])
def test_a_run_that_is_a_link_to_elsewhere_is_not_read(tmp_path: Path, link: str) -> None:
    victim = tmp_path / "victim"
    (victim / "as_set").mkdir(parents=True)
    about = {"name": "x", "began": 0.0, "parts": [{"key": "as_set", "name": "x"}]}
    for folder in (victim, victim / "as_set"):
        (folder / "precious.txt").write_text("precious")
    place = tmp_path / "runs" / link
    place.parent.mkdir(parents=True)
    place.symlink_to(victim)
    (tmp_path / "runs/001/run.json").write_text(json.dumps(about))
    before = sorted(victim.rglob("*"))

    runner = Runner(tmp_path / "runs")
    assert runner.runs == []
    assert len(runner.unread) == 1

    made = begin(runner, SHORT, "odometry")
    runner.wait(WAIT_S)

    assert made.folder == tmp_path / "runs/002"
    assert sorted(victim.rglob("*")) == before


@pytest.mark.parametrize("name", ["run.json", "odometry/play.json.gz", "odometry/report.html"])
def test_a_file_of_a_run_that_is_a_link_is_not_followed(runner: Runner, name: str) -> None:
    made = ended(runner)
    (made.folder / name).rename(runner.folder.parent / "elsewhere")
    (made.folder / name).symlink_to(runner.folder.parent / "elsewhere")

    again = Runner(runner.folder)

    if name == "run.json":
        assert again.unread == ["001: it, or its run.json, is a link"]
    else:
        assert again.runs[0].file_of("odometry", Path(name).name) is None
        assert again.runs[0].can_be_watched("odometry") == (name != "odometry/play.json.gz")


def test_a_bag_is_not_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "run").mkdir()
    (tmp_path / "run/scene.yaml").write_text(text_of(SHORT))
    for name in (".part-drive.mcap", "drive.mcap"):
        (tmp_path / "run" / name).symlink_to(tmp_path / "precious")
    receiver, said = multiprocessing.Pipe(duplex=False)

    write_bag_of(str(tmp_path / "run"), "drive.mcap", said)

    assert receiver.recv() == ""
    assert (tmp_path / "precious").read_text() == "precious"
    assert not (tmp_path / "run/drive.mcap").is_symlink()


@pytest.mark.parametrize(
    "wrong",
    [
        {"state": "x onclick=alert(1)"},
        {"share": 2.0},
        {"share": "1"},
        {"metrics": []},
        {"metrics": {"position_rmse_m": "<b>"}},
        {"metrics": {"counts": [1]}},
        {"name": "\ud800"},
    ],
)
def test_what_no_studio_writes_is_no_run(tmp_path: Path, wrong: dict[str, Any]) -> None:
    (tmp_path / "001/as_set").mkdir(parents=True)
    about = {"name": "x", "began": 0.0, "parts": [{"key": "as_set", "name": "x"} | wrong]}
    (tmp_path / "001/run.json").write_text(json.dumps(about))

    runner = Runner(tmp_path)

    assert runner.runs == []
    assert len(runner.unread) == 1


@pytest.mark.parametrize(
    ("name", "text"),
    [("001", "[" * 100_000), ("001", '{"name": "x", "began": NaN, "parts": []}'),
     ("-1", '{"name": "x", "began": 0, "parts": []}'),
     ("0001", '{"name": "x", "began": 0, "parts": []}')],
)  # fmt: skip
def test_a_file_of_anything_is_no_run(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "run.json").write_text(text)

    runner = Runner(tmp_path)

    assert runner.runs == []
    assert len(runner.unread) == 1


def test_a_run_is_deleted_with_its_folder_and_its_number_is_not_used_again(runner: Runner) -> None:
    first = ended(runner)
    second = ended(runner)

    runner.delete(first)

    assert not first.folder.exists()
    assert (second.number, ended(runner).number) == (2, 3)


# Estimators ----------------------------------------------------------------------------------


def keys_of(data: dict[str, Any]) -> list[str]:
    scene = Scene(data)
    return [choice.key for choice in choices(scene.data, scene.config)]


def test_estimators_are_offered_for_which_there_are_sensors() -> None:
    room: dict[str, Any] = {"simulation": {}}
    laser: dict[str, Any] = {"simulation": {"laser": {}, "map": {}, "ranges": None, "poses": None}}
    marks: dict[str, Any] = {"landmarks": {"L1": [1, 1]}, "landmark_sightings": {}, "positions": {}}

    assert keys_of(room) == ["as_set", "odometry", "odometry_uwb", "odometry_poses", "all"]
    assert keys_of(laser) == ["as_set", "odometry", "mcl", "mcl_ekf"]
    assert set(keys_of({"simulation": marks})) > {"odometry_landmarks", "odometry_positions"}
    assert keys_of({"log": "drive"}) == [choice.key for choice in CHOICES]


def test_a_choice_changes_what_is_used_and_nothing_else() -> None:
    scene = Scene({"simulation": {"laser": {}, "map": {}}, "mcl": {"max_particles": 700}})

    ekf = variant(CHOICE["odometry_uwb"], scene.data, scene.config)
    both = variant(CHOICE["mcl_ekf"], scene.data, scene.config)

    assert (ekf["use"], ekf["mcl"]) == (["odometry", "ranges"], None)
    assert both["mcl"] == {"max_particles": 700, "poses_hz": 2.0, "switch": None}
    assert ekf["simulation"] == both["simulation"] == scene.data["simulation"]
    assert list(scene.data) == ["simulation", "mcl"]
