# SPDX-License-Identifier: Apache-2.0
"""What processes of their own do for the studio: run each estimator, keep what comes out."""

from __future__ import annotations

import gzip
import json
import multiprocessing
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from locfuse.commission.commission import commission
from locfuse.config.load import load_config
from locfuse.io.rosbag.bags import write_bag
from locfuse.io.whole import whole_file
from locfuse.report.commission import write_setup
from locfuse.report.player import pack
from locfuse.report.results import write_results
from locfuse.run.run import run
from locfuse.types import RunResult

PLAY = "play.json.gz"
CONFIG = "scene.yaml"
FAILED = "error.txt"
_MIN_STEP = 0.005  # of the whole, between two words on progress
_MIN_S = 1.0  # between two looks at a run that computes
_SHARE = 0.1  # of the time of a run that looks may take


@dataclass(frozen=True)
class Job:
    """What to run: the folder of each estimator, which holds its configuration; and their names."""

    folders: tuple[str, ...]
    names: tuple[str, ...]


def spawned(
    target: Callable[..., None], *arguments: Any, duplex: bool = False
) -> tuple[Connection, SpawnProcess]:
    """Start a process whose last argument is one end of a pipe; return the other end and it.

    Spawned, not forked: the server has threads, and a process must not inherit their locks.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex)
    process = context.Process(target=target, args=(*arguments, theirs), daemon=True)
    process.start()
    theirs.close()
    return ours, process


def work(job: Job, said: Connection) -> None:
    """Run the estimators of a job one after another, then write their reports.

    Sends (index, "progress", done, total), (index, "grown") when more of it can be watched,
    (index, "shown", metrics) once all of it can be, (index, "done") or (index, "failed", sentence);
    in the end None.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends it
    results: dict[int, RunResult] = {}
    for index, folder in enumerate(job.folders):
        with _reporting(index, Path(folder), said):
            results[index] = _shown(index, Path(folder), job.names[index], said)
    for index, result in results.items():
        with _reporting(index, Path(job.folders[index]), said):
            write_results(result, job.folders[index])
            said.send((index, "done"))
    said.send(None)


@contextmanager
def _reporting(index: int, folder: Path, said: Connection) -> Iterator[None]:
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
    """Run an estimator and write what the player shows of it, on the way as well."""
    reported = -1.0
    due = time.perf_counter() + _MIN_S

    def progress(done: int, total: int) -> None:
        nonlocal reported
        if total and done / total - reported >= _MIN_STEP:
            reported = done / total
            said.send((index, "progress", done, total))

    def watch(so_far: Callable[[], RunResult]) -> None:
        nonlocal due
        began = time.perf_counter()
        if began < due:
            return
        _write_play(so_far(), folder, name, whole=False)
        said.send((index, "grown"))
        ended = time.perf_counter()
        due = ended + max(_MIN_S, (ended - began) * (1.0 / _SHARE - 1.0))

    said.send((index, "progress", 0, 1))
    config = load_config(folder / CONFIG)
    result = run(config, base=folder, progress=progress, watch=watch)
    _write_play(result, folder, name, whole=True)
    said.send((index, "shown", dict(result.metrics)))
    return result


def _write_play(result: RunResult, folder: Path, name: str, *, whole: bool) -> None:
    """Write what the player shows, in the place of what was there."""
    named = replace(result, config={**result.config, "name": name})
    text = json.dumps(pack(named, whole=whole), separators=(",", ":"))
    with whole_file(folder / PLAY) as part:
        part.write_bytes(gzip.compress(text.encode(), 6, mtime=0))


def set_up(recording: str, folder: str, said: Connection) -> None:
    """Set up a robot by a recording in a folder of its own.

    Sends ("progress", part, share) on the way, and in the end ("done", what went wrong or "").
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends it
    reported = ("", -1.0)

    def progress(part: str, share: float) -> None:
        nonlocal reported
        if part != reported[0] or share - reported[1] >= _MIN_STEP:
            reported = (part, share)
            said.send(("progress", part, share))

    try:
        found = commission(Path(recording), base=Path(folder), progress=progress)
        write_setup(found, Path(folder))
        said.send(("done", ""))
    except Exception as error:  # reported to the page
        said.send(("done", " ".join(str(error).split()) or type(error).__name__))


def write_bag_of(folder: str, name: str, said: Connection) -> None:
    """Run the configuration of a folder and write a bag there; send what went wrong, or ''."""
    try:
        config = load_config(Path(folder, CONFIG))
        with whole_file(Path(folder, name)) as part:
            write_bag(run(config, base=Path(folder)), part, config.ros)
        said.send("")
    except Exception as error:  # reported to the caller
        said.send(" ".join(str(error).split()) or type(error).__name__)
