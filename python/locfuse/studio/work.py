# SPDX-License-Identifier: Apache-2.0
"""What a process of its own does for the studio: run each estimator, keep what comes out."""

from __future__ import annotations

import gzip
import json
import os
import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path

from locfuse.config.load import load_config
from locfuse.player import pack
from locfuse.results import write_results
from locfuse.run import run
from locfuse.types import RunResult

PLAY = "play.json.gz"
CONFIG = "scene.yaml"
FAILED = "error.txt"
_LEAST_STEP = 0.005  # of the whole, between two words on progress


@dataclass(frozen=True)
class Job:
    """What to run: the folder of each estimator, which holds its configuration; and their names."""

    folders: tuple[str, ...]
    names: tuple[str, ...]


def work(job: Job, said: Connection) -> None:
    """Run the estimators of a job one after another, then write their reports.

    Sends (index, "progress", done, total), (index, "shown", metrics) once it can be watched,
    (index, "done") or (index, "failed", sentence); in the end None.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends it
    results: dict[int, RunResult] = {}
    for index, folder in enumerate(job.folders):
        with _told(index, Path(folder), said):
            results[index] = _shown(index, Path(folder), job.names[index], said)
    for index, result in results.items():
        with _told(index, Path(job.folders[index]), said):
            write_results(result, job.folders[index])
            said.send((index, "done"))
    said.send(None)


@contextmanager
def _told(index: int, folder: Path, said: Connection) -> Iterator[None]:
    """Say what went wrong: whatever it is, the others can still run."""
    try:
        yield
    except Exception as error:
        sentence = " ".join(str(error).split()) or type(error).__name__
        if not isinstance(error, ValueError | OSError):
            sentence = f"{type(error).__name__}: {sentence}"
        Path(folder, FAILED).write_text(traceback.format_exc(), encoding="utf-8")
        said.send((index, "failed", sentence))


def _shown(index: int, folder: Path, name: str, said: Connection) -> RunResult:
    """Run an estimator and write what the player shows of it."""
    told = -1.0

    def progress(done: int, total: int) -> None:
        nonlocal told
        if total and done / total - told >= _LEAST_STEP:
            told = done / total
            said.send((index, "progress", done, total))

    said.send((index, "progress", 0, 1))
    config = load_config(folder / CONFIG)
    result = run(config, base=folder, progress=progress)
    named = replace(result, config={**result.config, "name": name})
    text = json.dumps(pack(named), separators=(",", ":"))
    part = folder / f".{PLAY}"
    part.write_bytes(gzip.compress(text.encode(), 6, mtime=0))
    os.replace(part, folder / PLAY)
    said.send((index, "shown", dict(result.metrics)))
    return result
