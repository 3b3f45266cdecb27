# SPDX-License-Identifier: Apache-2.0
"""The folder keeps the scene whole, and takes maps and logs that are what they should be."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from locfuse.config.load import load_config, parse_config
from locfuse.io.log_folder import read_log, write_log
from locfuse.run.run import load_log
from locfuse.studio.scene import Scene
from locfuse.studio.studio import Studio
from locfuse.studio.workspace import NameTakenError, Workspace
from locfuse.types import FREE, OCCUPIED, ConfigError, LogError


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "studio")


def png(width: int = 40, height: int = 30) -> bytes:
    grey = np.full((height, width), 255, np.uint8)
    grey[0], grey[-1], grey[:, 0], grey[:, -1] = 0, 0, 0, 0
    file = io.BytesIO()
    Image.fromarray(grey).save(file, format="png")
    return file.getvalue()


def test_the_scene_is_there_again_as_it_was_left(tmp_path: Path) -> None:
    studio = Studio(tmp_path / "studio")
    studio.scene.load_text("name: mine # a comment\nsimulation: {duration_s: 7}\n")
    studio.keep()

    again = Studio(tmp_path / "studio")

    assert again.scene.text == studio.scene.text
    assert again.notice == ""


def test_a_wrong_text_does_not_replace_the_kept_scene(tmp_path: Path) -> None:
    studio = Studio(tmp_path / "studio")
    studio.scene.set(("seed",), 5)
    studio.scene.load_text("name: [")
    studio.keep()

    assert Studio(tmp_path / "studio").scene.config.seed == 5


def test_a_scene_file_that_somebody_broke_is_reported_and_not_lost(tmp_path: Path) -> None:
    folder = tmp_path / "studio"
    folder.mkdir()
    (folder / "scene.yaml").write_text("simulation: {duration_s: -1}\n")

    studio = Studio(folder)

    assert studio.notice.startswith("scene.yaml is no valid scene; it is kept as unsaved-")
    (aside,) = folder.glob("unsaved-*.yaml")
    assert aside.read_text() == "simulation: {duration_s: -1}\n"
    assert studio.scene.text == "simulation: {duration_s: -1}\n"
    assert "greater than 0" in studio.scene.text_problems[0].message


def test_a_configuration_to_begin_with_stays_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("log: drive\nros: {world: w}\n")

    studio = Studio(tmp_path / "a/studio", file)
    studio.scene.set(("seed",), 1)
    studio.keep()

    assert file.read_text() == "log: drive\nros: {world: w}\n"
    assert studio.scene.data["log"] == "../../drive"
    assert studio.scene.data["ros"]["world"] == "../../w"


def drawn(folder: Path, text: str = "simulation: {duration_s: 9} # by hand\n") -> str:
    studio = Studio(folder)
    studio.scene.load_text(text)
    studio.keep()
    return text


def test_a_configuration_does_not_replace_a_scene_that_has_no_name(tmp_path: Path) -> None:
    text = drawn(tmp_path / "studio")
    file = tmp_path / "mine.yaml"
    file.write_text("simulation: {duration_s: 3}\n")

    studio = Studio(tmp_path / "studio", file)

    assert studio.scene.data == {"simulation": {"duration_s": 3}}
    (name,) = studio.workspace.saved()
    assert studio.workspace.load(name) == text
    assert f"it is kept as {name}.yaml" in studio.notice


def test_nothing_is_set_aside_where_nothing_would_be_lost(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("simulation: {duration_s: 3}\n")
    folder = tmp_path / "studio"
    Studio(folder)  # leaves an empty scene
    for _ in range(2):
        assert Studio(folder, file).notice == ""
    drawn(folder)
    Studio(folder).workspace.save(Studio(folder).scene, "mine")

    assert Studio(folder, file).notice == ""
    assert Studio(folder).workspace.saved() == ["mine"]


def test_another_scene_is_not_lost_to_one_that_is_saved_under_its_name(
    workspace: Workspace,
) -> None:
    one, two = (Scene({"name": name, "simulation": {}}) for name in ("one", "two"))
    file = workspace.save(one, "my room")

    with pytest.raises(NameTakenError, match=r"my-room\.yaml is another scene"):
        workspace.save(two, "my/room")

    assert file.read_text() == one.text
    assert workspace.save(one, "my room") == file
    assert workspace.save(two, "my room", replace=True).read_text() == two.text


def test_scenes_are_saved_under_names_that_locfuse_run_takes(workspace: Workspace) -> None:
    scene = Scene({"name": "room", "simulation": {}})

    file = workspace.save(scene, " my room/../x ")

    assert file.parent == workspace.folder
    assert load_config(file) == scene.config
    assert workspace.saved() == [file.stem]
    assert workspace.load(file.stem) == scene.text
    for name in ("", "///", "scene", "scene.yaml"):
        with pytest.raises(ConfigError):
            workspace.save(scene, name)


def test_a_folder_that_cannot_be_made_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    with pytest.raises(ConfigError, match=r"--folder .* cannot be made"):
        Workspace(tmp_path / "file")


@pytest.mark.parametrize("name", ["maps", "logs", "runs"])
def test_a_folder_that_is_a_link_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "studio").mkdir()
    (tmp_path / "studio" / name).symlink_to(tmp_path)

    with pytest.raises(ConfigError, match=f"{name} is a link"):
        Workspace(tmp_path / "studio")


def test_links_are_neither_read_nor_written_through(tmp_path: Path) -> None:
    secret = tmp_path / "secret.yaml"
    secret.write_text("name: secret\n")
    Workspace(tmp_path / "studio")
    for name in ("scene.yaml", "saved.yaml"):
        (tmp_path / "studio" / name).symlink_to(secret)
    (tmp_path / "studio/maps/floor.png").symlink_to(tmp_path / "planted")

    studio = Studio(tmp_path / "studio")

    assert studio.notice == "scene.yaml is a link or no file, and was not read"
    assert studio.workspace.saved() == []
    with pytest.raises(ConfigError, match="is a link"):
        studio.workspace.load("saved")
    with pytest.raises(NameTakenError):
        studio.workspace.save(studio.scene, "saved")
    studio.workspace.save(studio.scene, "saved", replace=True)
    assert studio.workspace.add_map("floor.png", png(), 0.1, (0.0, 0.0))[0] == "maps/floor-2.yaml"
    assert not (tmp_path / "planted").exists()
    assert secret.read_text() == "name: secret\n"
    assert "secret" not in studio.scene.text


def test_runs_that_are_not_read_are_reported(tmp_path: Path) -> None:
    for number in ("001", "002"):
        (tmp_path / "studio/runs" / number).mkdir(parents=True)
        (tmp_path / "studio/runs" / number / "run.json").write_text("{")

    notice = Studio(tmp_path / "studio").notice

    assert notice.startswith("not read: runs/001: ")
    assert notice.endswith("; 1 more")


def test_a_picture_becomes_a_map(workspace: Workspace) -> None:
    path, grid = workspace.add_map("Floor 1.png", png(), 0.1, (-1.0, 2.0))

    assert path == "maps/Floor-1.yaml"
    assert grid.cells.shape == (30, 40)
    assert grid.cells[0, 0] == OCCUPIED
    assert grid.cells[15, 15] == FREE
    assert grid.origin == (-1.0, 2.0, 0.0)
    config = parse_config({"simulation": {"map": {"file": path}, "path": {"shape": "roam"},
                                          "laser": {}, "duration_s": 1}})  # fmt: skip
    assert load_log(config, workspace.folder, 0).grid is not None
    assert workspace.add_map("Floor 1.png", png(), 0.1, (0.0, 0.0))[0] == "maps/Floor-1-2.yaml"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.png", b"", "neither PGM"),
        ("a.png", b"\x89PNG\r\n\x1a\n broken", "cannot be read"),
        ("a.pgm", b"P5 3 3 255\nab", "its header says 3 x 3"),
        ("a.jpg", b"", "ends in .png or .pgm"),
    ],
)
def test_what_is_no_picture_is_refused_and_leaves_nothing(
    workspace: Workspace, name: str, content: bytes, message: str
) -> None:
    with pytest.raises(LogError, match=message):
        workspace.add_map(name, content, 0.1, (0.0, 0.0))

    assert list((workspace.folder / "maps").iterdir()) == []


def zipped(folder: Path, below: str) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as out:
        for one in folder.iterdir():
            out.write(one, f"{below}{one.name}")
    return file.getvalue()


def upload(tmp_path: Path, content: bytes) -> Path:
    file = tmp_path / "upload"
    file.write_bytes(content)
    return file


@pytest.mark.parametrize("below", ["", "drive/", "../../"])
def test_a_zip_of_a_log_folder_becomes_one(
    workspace: Workspace, tmp_path: Path, below: str
) -> None:
    log = load_log(parse_config({"simulation": {"duration_s": 3}}), None, 1)
    write_log(log, tmp_path / "drive")

    path = workspace.add_log("drive.zip", upload(tmp_path, zipped(tmp_path / "drive", below)))

    again = read_log(workspace.folder / path)
    np.testing.assert_array_equal(again["ranges"]["range_m"], log["ranges"]["range_m"])
    assert {p.name for p in tmp_path.iterdir()} == {"studio", "drive", "upload"}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [("a.zip", b"no zip", "is no zip"), ("a.txt", b"", "expected a bag"), ("a.zip", b"", "no zip")],
)
def test_what_is_no_log_is_refused(
    workspace: Workspace, tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    with pytest.raises(LogError, match=message):
        workspace.add_log(name, upload(tmp_path, content))

    assert list((workspace.folder / "logs").iterdir()) == []


def test_a_zip_that_breaks_off_leaves_nothing(workspace: Workspace, tmp_path: Path) -> None:
    log = load_log(parse_config({"simulation": {"duration_s": 3}}), None, 1)
    write_log(log, tmp_path / "drive")
    whole = bytearray(zipped(tmp_path / "drive", ""))
    whole[60:90] = bytes(30)  # inside of its first file

    with pytest.raises(LogError, match="is no zip that can be read"):
        workspace.add_log("a.zip", upload(tmp_path, bytes(whole)))

    assert list((workspace.folder / "logs").iterdir()) == []


def test_the_world_of_a_log_is_taken_into_a_scene(workspace: Workspace) -> None:
    simulation = {"duration_s": 2, "laser": {}, "map": {}, "landmarks": {"L1": [1, 2]},
                  "anchors": {"N": [1, 1, 2], "S": [9, 1, 2], "E": [5, 9, 2]}}  # fmt: skip
    log = load_log(parse_config({"simulation": simulation}), None, 1)
    scene = Scene()

    workspace.take_world(scene, log, "drive")

    taken = scene.config.simulation
    assert taken is not None
    assert taken.anchors == {"N": (1, 1, 2), "S": (9, 1, 2), "E": (5, 9, 2)}
    assert taken.landmarks == {"L1": (1, 2)}
    assert taken.map is not None
    assert taken.ranges is not None
    assert load_log(scene.config, workspace.folder, 0).grid is not None
