# SPDX-License-Identifier: Apache-2.0
"""Files and folders that are written whole or not at all, whatever ends the program."""

from __future__ import annotations

import fcntl
import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from locfuse.types import ConfigError

INCOMPLETE = "incomplete.txt"
PART, _STAGE = ".part-", ".writing-"
_WHY = "Writing was ended on its way: these files are of several runs. Write them again.\n"


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a file to write, of the same ending, which then takes the place of `path`.

    On an error it is removed, and `path` stays as it was. An OSError names `path`.
    """
    path = Path(path)
    part = path.with_name(f"{PART}{secrets.token_hex(4)}{path.suffix}")
    with naming(path):
        try:
            yield part
            sync(part)
            os.replace(part, path)
            sync(path.parent)
        finally:
            part.unlink(missing_ok=True)


def write_whole(path: str | Path, text: str) -> None:
    """Write a text as `whole_file` does, in UTF-8."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")


@contextmanager
def whole_folder(folder: str | Path, owned: Collection[str] = ()) -> Iterator[Path]:
    """Yield an empty folder to write, whose files then take their places in `folder` together.

    Files of the names `owned` that were not written are removed there. While files take their
    places `INCOMPLETE` is among them, so that it stays if the program is ended. Programs that write
    the same folder take turns. On an error `folder` stays as it was; an OSError names it.
    """
    folder = Path(folder)
    is_new = not folder.exists()
    with naming(folder):
        folder.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(folder)
        stage = folder / f"{_STAGE}{secrets.token_hex(4)}"
        stage.mkdir()
        try:
            with _locked(stage):
                yield stage
                files = sorted(stage.iterdir())
                for file in files:
                    sync(file)
                with _locked(folder):
                    _put_in_place(files, folder, owned)
        except BaseException:
            shutil.rmtree(stage, ignore_errors=True)
            if is_new and not any(folder.iterdir()):
                folder.rmdir()
            raise
        shutil.rmtree(stage, ignore_errors=True)


def _put_in_place(files: list[Path], folder: Path, owned: Collection[str]) -> None:
    marker = folder / INCOMPLETE
    marker.write_text(_WHY, encoding="utf-8")
    sync(folder)
    written = {file.name for file in files}
    for name in owned:
        if name not in written:
            (folder / name).unlink(missing_ok=True)
    for file in files:
        os.replace(file, folder / file.name)
    sync(folder)
    marker.unlink()


def _remove_abandoned(folder: Path) -> None:
    """Remove what programs left that were killed: nobody holds it any more."""
    for stage in folder.glob(f"{_STAGE}*"):
        try:
            with _locked(stage, fcntl.LOCK_NB):
                shutil.rmtree(stage, ignore_errors=True)
        except OSError:
            continue


@contextmanager
def _locked(folder: Path, how: int = 0) -> Iterator[None]:
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | how)
        yield
    finally:
        os.close(opened)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder, made if missing, so that nobody else holds it.

    Raises ConfigError if another program does.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as held:
        try:
            held.enter_context(_locked(folder, fcntl.LOCK_NB))
        except BlockingIOError:
            raise ConfigError(
                f"{folder}: another program is writing it; wait for it, or choose another folder"
            ) from None
        yield


def sync(path: Path) -> None:
    """Wait until a file or the names in a folder would survive a crash of the machine."""
    opened = os.open(path, os.O_RDONLY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Name the file or folder that was to be written in what goes wrong, not the one beside it."""
    try:
        yield
    except OSError as error:
        name = str(error.filename or "")
        if error.errno is None or (name and PART not in name and _STAGE not in name):
            raise
        inside = Path(name).name if _STAGE in name else ""
        raise OSError(error.errno, error.strerror, str(path / inside)) from error
