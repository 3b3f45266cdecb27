# SPDX-License-Identifier: Apache-2.0
"""Runs of a scene: started in another process, watched, cancelled, found again."""

from __future__ import annotations

import json
import os
import re
import shutil
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError

from locfuse.config.load import expected
from locfuse.io.whole import write_whole
from locfuse.studio.compare import FIGURES, value_of
from locfuse.studio.document import dotted, moved_to, text_of
from locfuse.studio.estimators import Choice, variant
from locfuse.studio.scene import Scene
from locfuse.studio.work import CONFIG, FAILED, PLAY, Job, spawned, work
from locfuse.studio.workspace import is_own
from locfuse.types import shown

ABOUT = "run.json"
STATE = "^(waiting|running|writing|done|failed|cancelled)$"
ENDED = ("done", "failed", "cancelled")
_END_S = 5.0  # that a process is given to end by itself


def plain_name(text: str) -> str:
    """Return a text that can only name a folder below another; raise ValueError else."""
    if not re.fullmatch("[a-z][a-z0-9_]{0,39}", text):
        raise ValueError(f"{shown(text)} is no plain name; expected letters a-z, digits and _")
    return text


@dataclass
class Part:
    """One estimator of a run.

    `key`, also its folder, and `name` are as of the `Choice`. `state` is ``waiting``, ``running``,
    ``writing`` the report, ``done``, ``failed`` (`error` says why) or ``cancelled``. `share` of the
    work is done, 0 to 1; `grown` counts how often there was more of it to watch. `metrics` is that
    of ``metrics.json``, from ``writing`` on: never of a part of a run.
    """

    key: Annotated[str, AfterValidator(plain_name)]
    name: str
    state: Annotated[str, Field(pattern=STATE)] = "waiting"
    share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    error: str = ""
    grown: int = 0
    metrics: dict[str, Any] = field(default_factory=dict)


@dataclass
class Run:
    """A scene run with some estimators.

    `name` is that of the scene; it began `began` seconds after 1970.
    """

    number: int
    name: str
    folder: Path
    began: float
    parts: list[Part]

    @property
    def ended(self) -> bool:
        """Whether nothing of it runs any more."""
        return all(part.state in ENDED for part in self.parts)

    def folder_of(self, key: str) -> Path:
        """Return where the results of one estimator are."""
        return self.folder / key

    def file_of(self, key: str, name: str) -> Path | None:
        """Return a file of one estimator; None if there is none, or it is a link."""
        file = self.folder_of(key) / name
        return file if is_own(file) else None

    def can_be_watched(self, key: str) -> bool:
        """Whether there is something to play of an estimator."""
        return self.file_of(key, PLAY) is not None

    def write(self) -> None:
        """Write what is known of it beside its results, whole or not at all."""
        about = {"name": self.name, "began": self.began, "parts": [asdict(p) for p in self.parts]}
        write_whole(self.folder / ABOUT, json.dumps(about, indent=1, allow_nan=False) + "\n")


class Runner:
    """The runs of a workspace, of which one at a time is under way.

    Each run has a folder of its number in `folder`; runs of before are found there. `unread` says
    what there is no run of ours.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runs, self.unread = _found_in(folder)
        self.version = 0
        self._process: SpawnProcess | None = None
        self._cancelled = False
        self._watch: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether a run is under way."""
        return bool(self.runs) and not self.runs[-1].ended

    def start(self, scene: Scene, chosen: Sequence[Choice], base: Path) -> Run:
        """Begin to run a scene.

        Each estimator has a folder with ``scene.yaml``, of which ``locfuse run`` makes the same.

        The scene's paths are relative to `base`. Raises ValueError if nothing is chosen, a run is
        under way, or the scene has values that do not fit.
        """
        if self.busy:
            raise ValueError("a run is under way; wait for it, or cancel it")
        if not chosen:
            raise ValueError("no estimator is chosen; choose at least one")
        if scene.waiting or scene.text_problems:
            raise ValueError("the scene has values that do not fit; mend or undo them first")
        number = 1 + max((run.number for run in self.runs), default=0)
        while os.path.lexists(self.folder / f"{number:03}"):
            number += 1  # what is no run of ours is not touched
        parts = [Part(choice.key, choice.name) for choice in chosen]
        run = Run(number, scene.config.name, self.folder / f"{number:03}", time.time(), parts)
        for choice in chosen:
            folder = run.folder_of(choice.key)
            folder.mkdir(parents=True)
            data = moved_to(variant(choice, scene.data, scene.config), base, folder)
            (folder / CONFIG).write_text(text_of(data), encoding="utf-8")
        run.write()
        self.runs.append(run)
        self._begin(run)
        return run

    def cancel(self) -> None:
        """End the run that is under way; what is done of it stays."""
        self._cancelled = True
        process = self._process
        if process is not None and process.is_alive():
            process.terminate()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until the run that is under way has ended."""
        if self._watch is not None:
            self._watch.join(timeout_s)

    def delete(self, run: Run) -> None:
        """Delete a run that has ended, with its folder."""
        if run.ended and run in self.runs:
            shutil.rmtree(run.folder, ignore_errors=True)
            self.runs.remove(run)
            self.version += 1

    def close(self) -> None:
        """End what is under way, as the server ends."""
        if self.busy:
            self.cancel()
        self.wait(2.0 * _END_S)  # what is done, too, is written once its process has ended

    def _begin(self, run: Run) -> None:
        folders = tuple(str(run.folder_of(part.key)) for part in run.parts)
        job = Job(folders, tuple(part.name for part in run.parts))
        self._cancelled = False
        receiver, self._process = spawned(work, job)
        self._watch = threading.Thread(
            target=self._listen, args=(run, receiver, self._process), daemon=True
        )
        self._watch.start()

    def _listen(self, run: Run, receiver: Connection, process: SpawnProcess) -> None:
        try:
            while (message := receiver.recv()) is not None:
                self._hear(run, run.parts[message[0]], *message[1:])
        except (EOFError, OSError):
            pass  # it ended before its last word
        process.join(_END_S)
        for part in run.parts:
            if part.state not in ENDED:
                _clear(run.folder_of(part.key))
                part.state = "cancelled" if self._cancelled else "failed"
                part.error = "" if self._cancelled else _how(process.exitcode)
                self._cancelled = self._cancelled or part.state == "failed"
        receiver.close()
        run.write()
        self.version += 1

    def _hear(self, run: Run, part: Part, what: str, *more: Any) -> None:
        if what == "progress":
            part.state, part.share = "running", more[0] / more[1]
        elif what == "grown":
            part.grown += 1
        elif what == "shown":
            part.metrics, part.state, part.share = more[0], "writing", 1.0
            part.grown += 1
            run.write()  # the server may be killed while the report is written
        elif what == "done":
            part.state = "done"
        else:
            part.error, part.state = more[0], "failed"
        self.version += 1


def _clear(folder: Path) -> None:
    """Leave of an estimator that was ended on its way what can be watched, and its scene."""
    for file in folder.iterdir():
        if file.name not in (CONFIG, PLAY, FAILED) and not file.is_dir():
            file.unlink()


def _how(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"the process of the run was ended by signal {-exitcode}; is there memory enough?"
    return f"the process of the run ended without a result (exit status {exitcode})"


def _found_in(folder: Path) -> tuple[list[Run], list[str]]:
    """Return the runs of before, and why others are none; the folder may come from elsewhere.

    Those that were under way when the server ended are cancelled.
    """
    found, unread = [], []
    for place in sorted(folder.iterdir()):
        if not os.path.lexists(place / ABOUT):
            continue
        try:
            run = _read(place)
        except ValidationError as error:
            wrong = error.errors(include_url=False)[0]
            unread.append(f"{place.name}: {dotted(wrong['loc'])}: {expected(wrong)}")
        except (OSError, ValueError) as error:
            unread.append(f"{place.name}: {error}")
        else:
            for part in run.parts:
                if part.state not in ENDED:
                    _clear(run.folder_of(part.key))
                    part.state = "cancelled"
            found.append(run)
    return found, unread


def _read(folder: Path) -> Run:
    """Return the run that a folder holds. Raises ValueError if it is none of ours."""
    if not re.fullmatch("[0-9]{3,9}", folder.name) or folder.name != f"{int(folder.name):03}":
        raise ValueError("is no number of a run")
    if folder.is_symlink() or not is_own(folder / ABOUT):
        raise ValueError(f"it, or its {ABOUT}, is a link")
    about = _ABOUT.validate_json((folder / ABOUT).read_bytes(), strict=True)
    for part in about.parts:
        if (folder / part.key).is_symlink() or not (folder / part.key).is_dir():
            raise ValueError(f"{part.key} is no folder")
        try:
            for figure in FIGURES:
                value_of(figure, part.metrics)
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError):
            raise ValueError(f"{part.key}: metrics are no figures") from None
    return Run(int(folder.name), about.name, folder, about.began, about.parts)


@dataclass
class _About:
    """What stands in `ABOUT`."""

    name: str
    began: Annotated[float, Field(ge=0.0, le=1e11)]
    parts: list[Part]


_ABOUT = TypeAdapter(_About)
