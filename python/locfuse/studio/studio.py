# SPDX-License-Identifier: Apache-2.0
"""What all pages of a studio share: the scene, its folder, its runs, its robots."""

from __future__ import annotations

from pathlib import Path

from locfuse.studio.ground import Grounds
from locfuse.studio.runner import Runner
from locfuse.studio.scene import EMPTY
from locfuse.studio.setups import Setups
from locfuse.studio.workspace import Workspace


class Studio:
    """A scene that is kept as it changes, and the runs of its folder.

    `config` is taken as the scene; its file stays as it is. A scene that it replaces, and that is
    saved under no name, is set aside under one of its own; `notice` says which. Raises ConfigError
    if the folder cannot be used, or the configuration is none.
    """

    def __init__(self, folder: Path, config: Path | None = None) -> None:
        self.workspace = Workspace(folder)
        self.scene, wrong = self.workspace.scene()
        self.notice = wrong
        taken = None if config is None else self.workspace.taken_from(config)
        would_be_lost = bool(wrong) or taken not in (None, self.scene.data)
        if would_be_lost and (aside := self.workspace.set_aside()):
            self.notice = f"{wrong or 'the scene of before had no name'}; it is kept as {aside}"
        if taken is not None:
            self.scene.replace(taken)
        self.grounds = Grounds()
        self.runner = Runner(self.workspace.folder / "runs")
        self.setups = Setups(self.workspace.folder / "robots")
        if unread := self.runner.unread:
            ignored = f"runs/{unread[0]}" + (f"; {len(unread) - 1} more" if unread[1:] else "")
            self.notice = "; ".join(filter(None, (self.notice, f"not read: {ignored}")))
        self._kept = -1
        self.keep()

    @property
    def base(self) -> Path:
        """Folder that paths of the scene are relative to."""
        return self.workspace.folder

    def keep(self) -> str:
        """Write the scene, if it is another one than what was written last.

        Returns what kept it from being written; it is tried again then.
        """
        if self._kept == self.scene.version:
            return ""
        try:
            self.workspace.keep(self.scene)
        except OSError as error:
            return f"the scene cannot be kept in {self.base} ({error.strerror})"
        self._kept = self.scene.version
        return ""

    def new(self) -> None:
        """Begin an empty scene; the old one can be had back by undo."""
        self.scene.replace(EMPTY)
        self.keep()

    def close(self) -> None:
        """Keep the scene and end what runs."""
        self.keep()
        self.grounds.close()
        self.runner.close()
        self.setups.close()
