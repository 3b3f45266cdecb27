# SPDX-License-Identifier: Apache-2.0
"""Robots that are set up by recordings: one at a time, each in a folder, in another process."""

from __future__ import annotations

import threading
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path

from locfuse.commission.result import CONFIGURATION
from locfuse.studio.work import set_up, spawned
from locfuse.studio.workspace import free_name, is_own

REPORT = "report.html"
PICTURES = ("survey.png", "map.png", "tune.png")
FILES = (REPORT, f"drive/{REPORT}", CONFIGURATION, *PICTURES)
_END_S = 5.0  # that a process is given to end by itself


class Setups:
    """The robots of a workspace. `part` of the work is done to the `share`; `error` of the last."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.version = 0
        self.part = ""
        self.share = 0.0
        self.error = ""
        self._process: SpawnProcess | None = None
        self._listener: threading.Thread | None = None
        self._cancelled = False

    @property
    def busy(self) -> bool:
        """Whether a robot is being set up."""
        return self._listener is not None and self._listener.is_alive()

    def names(self) -> list[str]:
        """Return the robots that are set up, the newest first."""
        found = [file for file in self.folder.glob(f"*/{REPORT}")
                 if is_own(file) and not file.parent.is_symlink()]  # fmt: skip
        return [file.parent.name for file in sorted(found, key=lambda f: -f.stat().st_mtime)]

    def file_of(self, name: str, file: str) -> Path | None:
        """Return a file of a robot; None if there is none, or it is a link."""
        path = self.folder / name / file
        known = file in FILES and name in self.names() and not path.parent.is_symlink()
        return path if known and is_own(path) else None

    def start(self, recording: Path) -> str:
        """Begin to set up a robot by a recording; return its name.

        Raises ValueError while another one is under way.
        """
        if self.busy:
            raise ValueError("a robot is being set up; wait for it, or cancel it")
        name = free_name(self.folder, recording.stem)
        self.part, self.share, self.error, self._cancelled = "read", 0.0, "", False
        receiver, self._process = spawned(
            set_up, str(recording.absolute()), str(self.folder / name)
        )
        self._listener = threading.Thread(
            target=self._listen, args=(receiver, self._process), daemon=True
        )
        self._listener.start()
        self.version += 1
        return name

    def cancel(self) -> None:
        """End what is under way."""
        self._cancelled = True
        if self._process is not None and self._process.is_alive():
            self._process.terminate()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until what is under way has ended."""
        if self._listener is not None:
            self._listener.join(timeout_s)

    def close(self) -> None:
        """End what is under way, as the server ends."""
        if self.busy:
            self.cancel()
        self.wait(2.0 * _END_S)

    def _listen(self, receiver: Connection, process: SpawnProcess) -> None:
        error = "the process that sets the robot up ended without a word; is there memory enough?"
        try:
            while True:
                what, *more = receiver.recv()
                if what == "progress":
                    self.part, self.share = more
                    self.version += 1
                else:
                    error = more[0]
                    break
        except (EOFError, OSError):
            pass  # it ended before its last word
        process.join(_END_S)
        receiver.close()
        self.error = "" if self._cancelled else error
        self.part, self.share = "", 0.0
        self.version += 1
