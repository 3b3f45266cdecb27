# SPDX-License-Identifier: Apache-2.0
"""The folder in which everything is kept: the scene, saved scenes, maps, logs, runs."""

from __future__ import annotations

import os
import re
import shutil
import time
import zipfile
import zlib
from pathlib import Path

from locfuse.config.load import load_config, read_yaml
from locfuse.io.maps import YAML, read_map, write_map
from locfuse.io.whole import write_whole
from locfuse.studio.document import Data, Draft, moved_to, text_of
from locfuse.studio.scene import EMPTY, Scene
from locfuse.types import Columns, ConfigError, GridMap, Log, LogError

CURRENT = "scene.yaml"
BAGS = (".bag", ".mcap", ".db3")
MAX_BYTES = 1_000_000_000  # of an upload
MAX_UNPACKED = 4_000_000_000  # of a zipped log
_KEPT = re.compile(r"[^\w.+-]+")


class NameTakenError(ConfigError):
    """Another scene is saved under a name already."""


class Workspace:
    """Folder of a studio; made if it is not there.

    It holds ``scene.yaml``, which is the scene as it is now, further scenes under their names, and
    the folders ``maps``, ``logs``, ``runs`` and ``robots``. Paths in scenes are relative to it.
    Raises ConfigError if it cannot be made or written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.absolute()
        try:
            for name in ("maps", "logs", "runs", "robots", ".nicegui"):
                if (self.folder / name).is_symlink():
                    raise ConfigError(f"--folder {folder}: {name} is a link, which could lead out "
                                      "of it; put a folder there")  # fmt: skip
                (self.folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"--folder {folder}: cannot be made ({error.strerror})") from None
        if not os.access(self.folder, os.W_OK):
            raise ConfigError(f"--folder {folder}: must not be written")

    # Scenes ----------------------------------------------------------------------------------

    def scene(self) -> tuple[Scene, str]:
        """Return the scene as it was left, and what is wrong with its file, if anything is."""
        file = self.folder / CURRENT
        scene = Scene()
        if not os.path.lexists(file):
            return scene, ""
        if not is_own(file):
            return scene, f"{CURRENT} is a link or no file, and was not read"
        try:
            text = file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            return scene, f"{CURRENT} cannot be read ({error})"
        if scene.load_text(text):
            return scene, f"{CURRENT} is no valid scene"
        return scene, ""

    def keep(self, scene: Scene) -> None:
        """Write the scene as it is now, whole or not at all."""
        text = scene.text if not scene.text_problems else scene.good_text
        write_whole(self.folder / CURRENT, text)

    def save(self, scene: Scene, name: str, *, replace: bool = False) -> Path:
        """Write a scene under a name.

        What no file can be named with becomes "-" in `name`. Raises NameTakenError if another scene
        is saved under that name, unless `replace` lets it be lost, and ConfigError if the name
        cannot be that of a file, or is the current scene's.
        """
        file = self.folder / f"{_file_name(name.removesuffix('.yaml'))}.yaml"
        if file.name == CURRENT:
            raise ConfigError(f"{CURRENT} is what the studio keeps by itself; give another name")
        text = scene.good_text.encode()
        taken = os.path.lexists(file) and not (is_own(file) and file.read_bytes() == text)
        if taken and not replace:
            raise NameTakenError(f"{file.name} is another scene, which would be lost")
        write_whole(file, scene.good_text)
        return file

    def set_aside(self) -> str:
        """Keep the scene as it was left under a name of its own, before another replaces it.

        Returns the name of its file, which is one of the saved scenes; "" if nothing would be lost:
        it is empty, or saved already. Raises ConfigError if it cannot be read.
        """
        current = self.folder / CURRENT
        if not is_own(current):
            return ""
        try:
            left = current.read_bytes()
        except OSError as error:
            raise ConfigError(
                f"{current}: cannot be read ({error.strerror}); move it away, or let it be read"
            ) from None
        if left == text_of(EMPTY).encode() or any(left == f.read_bytes() for f in self._saved()):
            return ""
        aside = self._free(self.folder / f"unsaved-{time.strftime('%Y-%m-%d-%H%M%S')}.yaml")
        shutil.copyfile(current, aside)
        return aside.name

    def saved(self) -> list[str]:
        """Return the names of saved scenes, the newest first."""
        return [f.stem for f in sorted(self._saved(), key=lambda f: -f.stat().st_mtime)]

    def _saved(self) -> list[Path]:
        return [f for f in self.folder.glob("*.yaml") if f.name != CURRENT and is_own(f)]

    def load(self, name: str) -> str:
        """Return the text of a saved scene."""
        file = self.folder / f"{_file_name(name)}.yaml"
        if not is_own(file):
            raise ConfigError(f"{name}: there is no such scene, or it is a link")
        try:
            return file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"{name}: cannot be read ({error})") from None

    def taken_from(self, file: Path) -> Data:
        """Return the document of a configuration anywhere, with paths relative to this folder.

        Raises ConfigError as `load_config`.
        """
        load_config(file)
        data: Data = read_yaml(file.read_text(encoding="utf-8"), str(file))
        return moved_to(data, file.parent, self.folder)

    # Maps and logs ---------------------------------------------------------------------------

    def add_map(
        self, name: str, picture: bytes, resolution_m: float, origin: tuple[float, float]
    ) -> tuple[str, GridMap]:
        """Keep a picture as a map: white is free, black a wall, grey unknown.

        `name` is that of the file: PNG or PGM. `resolution_m` is the side of a pixel, `origin` the
        lower left corner in world, metres. Returns the path of the YAML file, relative to the
        folder, and the map. Raises LogError if it is no picture that a map can be made of.
        """
        stem, ending = _file_name(Path(name).stem), Path(name).suffix.lower()
        if ending not in (".png", ".pgm"):
            raise LogError(f"{name}: expected a picture that ends in .png or .pgm")
        image = self._free(self.folder / "maps" / f"{stem}{ending}")
        image.write_bytes(picture)
        file = image.with_suffix(".yaml")
        file.write_text(YAML.format(image=image.name, resolution=float(resolution_m),
                                    origin=(float(origin[0]), float(origin[1]), 0.0)))  # fmt: skip
        try:
            return f"maps/{file.name}", read_map(file)
        except ValueError as error:
            image.unlink()
            file.unlink()
            raise LogError(str(error).replace(str(image), name)) from None

    def take_world(self, scene: Scene, log: Log, name: str) -> None:
        """Give a simulated scene the map, anchors and landmarks of a log.

        Raises LogError if the log has none of them.
        """
        found = {stem: log.tables[stem] for stem in ("anchors", "landmarks") if stem in log}
        if not found and log.grid is None:
            raise LogError(f"{name}: the log has no map, no anchors and no landmarks")

        def change(draft: Draft) -> None:
            if "anchors" in found:
                draft.set(("simulation", "anchors"), places(found["anchors"], "anchor", "xyz"))
                if draft.get(("simulation", "ranges")) is None:
                    draft.set(("simulation", "ranges"), {})
            if "landmarks" in found:
                draft.set(("simulation", "landmarks"), places(found["landmarks"], "landmark", "xy"))
            if log.grid is not None:
                height, width = log.grid.cells.shape
                file = self._free(self.folder / "maps" / f"{_file_name(name)}.pgm")
                write_map(log.grid, file.with_suffix(".yaml"))
                draft.set(("simulation", "map"), {"file": f"maps/{file.stem}.yaml"})
                draft.set(("simulation", "path"), {"shape": "roam"})
                draft.set(
                    ("simulation", "room_m"),
                    [width * log.grid.resolution_m, height * log.grid.resolution_m],
                )

        scene.edit(change)

    def add_log(self, name: str, upload: Path) -> str:
        """Keep an uploaded log: a bag, or a zip of a log folder.

        Returns its path, relative to the folder. Raises LogError if it is neither.
        """
        stem, ending = _file_name(Path(name).stem), Path(name).suffix.lower()
        if ending in BAGS:
            bag = self._free(self.folder / "logs" / f"{stem}{ending}")
            shutil.copyfile(upload, bag)
            return f"logs/{bag.name}"
        if ending != ".zip":
            raise LogError(f"{name}: expected a bag ({', '.join(BAGS)}), or a .zip of a folder "
                           "of a log or of a ROS 2 bag")  # fmt: skip
        out = self._free(self.folder / "logs" / stem)
        try:
            _unpack(upload, out)
        except (zipfile.BadZipFile, OSError, EOFError, zlib.error, RuntimeError) as error:
            shutil.rmtree(out, ignore_errors=True)
            raise LogError(f"{name}: is no zip that can be read ({error})") from None
        return f"logs/{out.name}"

    def remove_log(self, path: str) -> None:
        """Take away a log that `add_log` kept."""
        there = self.folder / path
        if there.is_dir():
            shutil.rmtree(there)
        else:
            there.unlink()

    def _free(self, file: Path) -> Path:
        """Return a name that is not taken: scenes may still use the files of older ones."""
        number, found = 1, file
        while os.path.lexists(found) or os.path.lexists(found.with_suffix(".yaml")):
            number += 1
            found = file.with_stem(f"{file.stem}-{number}")
        return found


def free_name(folder: Path, name: str) -> str:
    """Return a plain name for something new in a folder."""
    plain = _file_name(name)
    number, found = 1, plain
    while os.path.lexists(folder / found):
        number += 1
        found = f"{plain}-{number}"
    return found


def is_own(file: Path) -> bool:
    """Return whether there is a file that is no link, which could lead out of the folder."""
    return file.is_file() and not file.is_symlink()


def places(table: Columns, name: str, axes: str) -> dict[str, list[float]]:
    """Return the points of a table by their names, along these axes."""
    at = zip(*(table[f"{axis}_m"].tolist() for axis in axes), strict=True)
    return {str(key): list(place) for key, place in zip(table[name], at, strict=True)}


def _unpack(file: Path, out: Path) -> None:
    """Unpack the files of a zip into one folder: those of its only folder, if it is that."""
    with zipfile.ZipFile(file) as packed:
        files = [info for info in packed.infolist() if not info.is_dir()]
        if sum(info.file_size for info in files) > MAX_UNPACKED:
            raise zipfile.BadZipFile(f"it holds more than {MAX_UNPACKED / 1e9:g} GB")
        out.mkdir(parents=True)
        for info in files:
            # A name alone: no file of a zip may end up outside of the folder.
            target_file = out / _file_name(Path(info.filename).name)
            with packed.open(info) as source, target_file.open("wb") as target:
                shutil.copyfileobj(source, target)


def _file_name(name: str) -> str:
    kept = _KEPT.sub("-", name.strip()).strip("-.")
    if not kept:
        raise ConfigError(f"{name!r} cannot be the name of a file; expected letters or digits")
    return kept[:80]
