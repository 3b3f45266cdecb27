# SPDX-License-Identifier: Apache-2.0
"""The tab in which a robot is set up by one recording, and what was found is shown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from nicegui import ui

from locfuse.commission.result import CONFIGURATION
from locfuse.studio.setups import PICTURES, REPORT
from locfuse.types import ConfigError

if TYPE_CHECKING:
    from locfuse.studio.page import StudioPage


class SetupTab:
    """Choose a recording, watch the work, look at map, anchors and noise, use the result."""

    def __init__(self, page: StudioPage) -> None:
        self._page = page
        self._setups = page.studio.setups
        self._awaited: str | None = None
        self._shown: str | None = None
        self._drawn: tuple[list[str], str | None] | None = None

    def build(self) -> None:
        """Build the tab."""
        with ui.element("div").classes("st-run"):
            with ui.element("div").classes("st-left"):
                ui.html("<h2>A robot by one drive</h2>", sanitize=False)
                ui.label("A log folder or a bag becomes a map, places of anchors, noise and a "
                         "configuration.").classes("st-quiet")  # fmt: skip
                self._path = ui.input("log folder or bag on this machine").props(
                    'outlined dense data-testid="setup-path"'
                )
                self._path.on("keydown.enter", self._start)
                with ui.element("div").classes("st-row").style("margin:10px 0 6px"):
                    self._go = ui.button("Set up", icon="play_arrow", on_click=self._start)
                    self._go.props('unelevated no-caps data-testid="setup-go"')
                    self._cancel = ui.button("Cancel", icon="stop", on_click=self._setups.cancel)
                    self._cancel.props('outline no-caps data-testid="setup-cancel"')
                self._part = ui.label().classes("st-quiet").props('data-testid="setup-part"')
                self._bar = ui.linear_progress(0.0, show_value=False, size="4px")
                ui.html("<h2>Robots</h2>", sanitize=False)
                self._robots = ui.element("div").props('data-testid="robots"')
            with ui.element("div").classes("st-right"):
                self._found = ui.element("div").props('data-testid="robot"')
        self.refresh()

    def _start(self) -> None:
        self._path.error = None
        path = Path((self._path.value or "").strip()).expanduser()
        try:
            if not path.name or not path.exists():
                raise ValueError("expected the path of a log folder or a bag")
            self._awaited = self._setups.start(path)
        except (ValueError, OSError) as error:
            self._path.error = " ".join(str(error).split())
        self._page.refresh()

    def refresh(self) -> None:
        """Show how far the work is, and what there is."""
        busy = self._setups.busy
        self._go.set_enabled(not busy)
        self._cancel.set_visibility(busy)
        self._bar.set_visibility(busy)
        self._bar.value = self._setups.share
        self._part.text = self._setups.part
        names = self._setups.names()
        if not busy and self._awaited is not None:
            self._path.error = self._setups.error or None
            self._shown = self._awaited if self._awaited in names else self._shown
            self._awaited = None
        if self._shown not in names:
            self._shown = names[0] if names else None
        if self._drawn != (names, self._shown):
            self._list(names)
            self._show()

    def _list(self, names: list[str]) -> None:
        self._robots.clear()
        with self._robots:
            for name in names:
                with ui.element("div").classes("st-item"):
                    ui.button(name, on_click=lambda name=name: self._choose(name)).props(
                        f'flat dense no-caps align=left data-testid="robot-{name}"'
                    )

    def _choose(self, name: str) -> None:
        self._shown = name
        self._show()

    def _show(self) -> None:
        self._drawn = (self._setups.names(), self._shown)
        self._found.clear()
        with self._found:
            name = self._shown
            if name is None:
                ui.label("No robot has been set up yet. Give a recording on the left.").classes(
                    "st-empty")  # fmt: skip
                return
            base = f"studio/robots/{quote(name, safe='')}"
            with ui.element("div").classes("st-row"):
                ui.label(name).style("font-weight:600; flex:1")
                for text, target, new in (("Report", REPORT, ' target="_blank"'),
                                        ("Config", CONFIGURATION, " download")):  # fmt: skip
                    button = ui.button(text).props("outline dense no-caps")
                    button.props(f'tag=a href="{base}/{target}"{new} data-testid="setup-{target}"')
                ui.button("Use as the scene", on_click=lambda: self._use(name)).props(
                    'outline dense no-caps data-testid="setup-use"'
                )
            for picture in PICTURES:
                file = self._setups.file_of(name, picture)
                if file is not None:
                    source = f"{base}/{picture}?{file.stat().st_mtime_ns}"
                    ui.element("img").props(f'src="{source}" alt="{picture}"').style("width:100%")

    def _use(self, name: str) -> None:
        """Make a scene that replays the recording with what was found."""
        file = self._setups.file_of(name, CONFIGURATION)
        try:
            if file is None:
                raise ConfigError(f"{name}: {CONFIGURATION} is not there any more")
            self._page.studio.scene.replace(self._page.studio.workspace.taken_from(file))
        except (ConfigError, OSError) as error:
            self._page.notify(str(error))
            return
        self._page.changed()
        self._page.tabs.value = "World"
