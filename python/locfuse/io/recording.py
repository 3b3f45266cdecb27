# SPDX-License-Identifier: Apache-2.0
"""Recordings of any kind: log folders, bags, and published data sets."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from locfuse.config.ros import Ros
from locfuse.io.log_folder import read_log, read_world, with_world, write_log
from locfuse.io.rosbag.bags import is_bag, read_bag, write_bag
from locfuse.types import ConfigError, Log, LogError, nearest

Progress = Callable[[int, int], None]

BAGS = (".bag", ".mcap")  # how files end that are written as bags
FILES = (".db3", ".csv", ".tum", ".yaml", ".yml", ".zip", ".gz", ".rawlog", ".rrd")  # and others
OWN = ("log", "bag")  # kinds of recordings other than published data sets


def read_recording(
    path: str | Path,
    ros: Ros | None = None,
    base: Path | None = None,
    progress: Progress | None = None,
    *,
    antennas: bool = True,
) -> Log:
    """Read a log folder or a bag.

    `ros` is what a bag says where, by default the usual topics; ``ros.world`` is relative to
    `base`, and goes before what the recording says of the world. `progress` is called with (bytes
    read, total bytes) of a bag; `antennas` is as of `read_bag`. Raises LogError as `read_log`,
    `read_world` or `read_bag`.
    """
    path = Path(path)
    world, ros = world_of(Ros() if ros is None else ros, base)
    if not is_bag(path):
        log = read_log(path, ros.gps_origin)
        return log if world is None else with_world(log, world)
    return read_bag(path, ros, world, progress, antennas=antennas)


def world_of(ros: Ros, base: Path | None = None) -> tuple[Log | None, Ros]:
    """Return what ``ros.world``, relative to `base`, says, and `ros` with where its map begins.

    Raises LogError as `read_world`.
    """
    if ros.world is None:
        return None, ros
    world = read_world((Path() if base is None else base) / ros.world, ros.gps_origin)
    return world, ros.model_copy(update={"gps_origin": world.gps_origin})


def convert_recording(
    kind: str,
    source: str | Path,
    out: str | Path,
    ros: Ros | None = None,
    base: Path | None = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Convert a recording: a published one to log folders, a log or a bag to either.

    Parameters
    ----------
    kind : str
        ``log`` for a log folder, ``bag``, or a data set of results/recordings.md, whose converters
        are part of a checkout.
    source : str or Path
    out : str or Path
        A folder; of a log or a bag also a file that ends in ``.bag`` (ROS 1) or ``.mcap`` (ROS 2).
    ros : Ros, optional
        What is said where in a bag.
    base : Path, optional
        Folder that ``ros.world`` is relative to.
    progress : callable, optional
        Called with (done, total) while a bag is read or written.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    ConfigError
        If there is no such kind, or no checkout that has it.
    LogError
        If the source cannot be read, or `out` cannot be what was asked for.
    """
    out = Path(out)
    _check_out(out)
    if kind not in OWN:
        if out.suffix in BAGS:
            raise LogError(f"{out}: a data set becomes log folders; 'locfuse convert log' makes "
                           "bags of them")  # fmt: skip
        return convert_dataset(kind, source, out)
    if (kind == "bag") != is_bag(Path(source)):
        if Path(source).exists():
            other = "bag" if kind == "log" else "log"
            raise LogError(f"{source}: is no {_called(kind)}; did you mean 'convert {other}'?")
        raise LogError(f"{source}: no such {_called(kind)}")
    check_other(source, out)
    log = read_recording(source, ros, base, progress)
    if out.suffix in BAGS:
        write_bag(log, out, ros, progress)
    else:
        write_log(log, out)
    return [out]


def convert_dataset(kind: str, source: str | Path, out: str | Path) -> list[Path]:
    """Convert a published data set to log folders by its converter in a checkout.

    Raises ConfigError where there is no such data set or no checkout, LogError as the converter.
    """
    datasets = import_papers("datasets", f"'convert {kind}', which is neither log nor bag,")
    kinds, key = [*datasets.CONVERTERS, *OWN], kind.replace("-", "_")
    if key not in datasets.CONVERTERS:
        raise ConfigError(f"unknown data set {kind!r}; {nearest(key, kinds)}")
    folders: list[Path] = datasets.convert(key, source, out)
    return folders


def checkout() -> Path | None:
    """Return the checkout around the working folder or this file; None if there is none."""
    for folder in (Path.cwd(), *Path.cwd().parents, *Path(__file__).resolve().parents):
        if (folder / "papers" / "reproduce.py").is_file():
            return folder
    return None


def import_papers(module: str, needed_for: str) -> Any:
    """Import a module of `papers`. Raises ConfigError where there is no checkout."""
    root = checkout()
    if root is None:
        raise ConfigError(
            f"{needed_for} needs a checkout of locfuse, as papers/ is not installed; "
            "call it inside one"
        )
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    return importlib.import_module(f"papers.{module}")


def _check_out(out: Path) -> None:
    """Refuse what neither a folder nor a bag can be called, before the work and not after it."""
    written = "what is written is a log folder, or a bag that ends in .bag (ROS 1) or .mcap (ROS 2)"
    if out.suffix in FILES:
        raise LogError(f"{out}: ends in {out.suffix!r}; {written}")
    if out.suffix in BAGS:
        if out.is_dir():
            raise LogError(f"{out}: is a folder; a bag is a file")
    elif out.is_file():
        raise LogError(f"{out}: is a file; {written}")
    for folder in out.absolute().parents:
        if folder.is_file():
            raise LogError(f"{out}: {folder} is a file; expected a folder")


def check_other(source: str | Path, out: Path) -> None:
    """Refuse to write over what is read.

    Raises LogError if both are the same file or folder.
    """
    if out.exists() and out.samefile(source):
        raise LogError(f"{out}: is the recording itself; give what is written another name")


def _called(kind: str) -> str:
    return "log folder" if kind == "log" else "bag"
