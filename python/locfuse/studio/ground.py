# SPDX-License-Identifier: Apache-2.0
"""Map and way of the newest scene, computed by a process of its own."""

from __future__ import annotations

import signal
import threading
import time
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from locfuse import NumericalError
from locfuse.config.schema import RunConfig
from locfuse.studio.view import ground_of
from locfuse.studio.work import spawned

TROUBLE = (ValueError, OSError, NumericalError, MemoryError)
_MIN_S = 1.0  # that what nobody waits for any more may take: a new process takes longer
_LOOK_S = 0.05  # between looks whether anybody still waits


@dataclass
class _Question:
    text: str
    answer: dict[str, Any] | None = None
    done: threading.Event = field(default_factory=threading.Event)


class Grounds:
    """Answers what `ground_of` does, without keeping the server busy.

    A large map takes minutes, and each edit of its scene asks anew. So only the newest question is
    computed: one that is under way is ended for it, one that waits for its turn is dropped.
    """

    def __init__(self) -> None:
        self._newest: _Question | None = None
        self._lock = threading.Lock()  # of the newest question
        self._turn = threading.Lock()  # of the process
        self._process: SpawnProcess | None = None
        self._pipe: Connection | None = None

    def of(self, config: RunConfig, base: Path) -> dict[str, Any] | None:
        """Return map and way of a scene, with a ``message`` if there are none.

        None if another scene was asked for before this one was done.
        """
        if config.simulation is None:  # a log that was read is known to this process
            return answer(config, base)
        text = config.model_dump_json(include={"simulation", "seed"})
        with self._lock:
            question = self._newest
            mine = question is None or question.text != text or question.done.is_set()
            if mine:
                question = self._newest = _Question(text)
        assert question is not None
        if mine:
            with self._turn:
                question.answer = self._computed(question, base)
            question.done.set()
        question.done.wait()
        return question.answer

    def begin(self) -> None:
        """Start the process, which takes a second, before anybody asks."""
        with self._turn:
            self._ready()

    def close(self) -> None:
        """End the process."""
        process = self._process
        if process is not None:
            process.kill()
            process.join()

    def _computed(self, question: _Question, base: Path) -> dict[str, Any] | None:
        if question is not self._newest:
            return None
        pipe, began = self._ready(), time.monotonic()
        try:
            pipe.send((question.text, base))
            while not pipe.poll(_LOOK_S):
                if question is not self._newest and time.monotonic() - began > _MIN_S:
                    self.close()
                    return None
            found: dict[str, Any] = pipe.recv()
        except (EOFError, OSError):
            return {"message": "the process that makes the map ended; is there memory enough?"}
        return found if question is self._newest else None

    def _ready(self) -> Connection:
        if self._process is None or self._pipe is None or not self._process.is_alive():
            self._pipe, self._process = spawned(_answer_all, duplex=True)
        return self._pipe


def answer(config: RunConfig, base: Path) -> dict[str, Any]:
    """Return what `ground_of` does, or what is wrong as its ``message``."""
    try:
        return ground_of(config, base)
    except TROUBLE as error:
        return {"message": " ".join(str(error).split())}


def _answer_all(pipe: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends it
    try:
        while True:
            text, base = pipe.recv()
            pipe.send(answer(RunConfig.model_validate_json(text), base))
    except (EOFError, OSError):
        pass  # the server is gone
