# SPDX-License-Identifier: Apache-2.0
"""The page: a head with what holds for all, and tabs: world, runs, robots, what to open."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from nicegui import ui

from locfuse.studio.document import RefusedError
from locfuse.studio.open_tab import OpenTab
from locfuse.studio.run_tab import RunTab
from locfuse.studio.setup_tab import SetupTab
from locfuse.studio.studio import Studio
from locfuse.studio.workspace import NameTakenError
from locfuse.studio.world_tab import WorldTab
from locfuse.types import ConfigError

_HEAD = "".join(
    f'<link rel="stylesheet" href="studio/static/{name}.css">' for name in ("studio", "player")
) + "".join(
    f'<script src="studio/static/{name}.js"></script>'
    for name in ("coverage", "editor", "player", "studio")
)  # fmt: skip
_LOOK_S = 0.25  # between looks at what another page, or a run, has changed


class StudioPage:
    """One browser's view of the studio."""

    def __init__(self, studio: Studio) -> None:
        self.studio = studio
        self._seen = (-1, -1)
        self._setups_seen = -1
        self._world_seen = -1

    def build(self) -> None:
        """Build the page."""
        ui.add_head_html(_HEAD)
        ui.colors(primary="#0072B2", negative="#b04a00", positive="#00694c")
        self.world = WorldTab(self)
        self.run = RunTab(self)
        self.setup = SetupTab(self)
        self.open = OpenTab(self)
        with ui.element("div").classes("st-head"):
            self._head()
        with (
            ui.tab_panels(self.tabs, value="World", keep_alive=True, animated=False)
            .classes("st-main")
            .props("keep-alive")
        ):
            for name, tab in (("World", self.world), ("Run", self.run), ("Set up", self.setup),
                              ("Open", self.open)):  # fmt: skip
                with ui.tab_panel(name).style("padding:0; height:100%; overflow:hidden"):
                    tab.build()
        ui.on("studio", lambda event: self.on_event(event.args))
        ui.timer(_LOOK_S, self.refresh)
        if self.studio.notice:
            ui.notify(
                self.studio.notice, type="warning", position="top", timeout=0, close_button="close"
            )
            self.studio.notice = ""

    def _head(self) -> None:
        ui.html("locfuse <span>studio</span>", sanitize=False).classes("st-brand")
        with ui.tabs(value="World").props("dense no-caps indicator-color=primary") as self.tabs:
            for name in ("World", "Run", "Set up", "Open"):
                ui.tab(name).props(f'data-testid="tab-{name.lower().replace(" ", "-")}"')
        ui.element("div").classes("st-gap")
        self.name = ui.label().classes("st-quiet ellipsis").style("max-width:260px")
        self.undo = self._button("undo", "Undo (Ctrl+Z)", lambda: self.studio.scene.undo())
        self.redo = self._button("redo", "Redo (Ctrl+Y)", lambda: self.studio.scene.redo())
        self._button("note_add", "New scene", self.studio.new)
        self._button("save", "Save under a name", self._save)
        self._button("download", "Download the scene as YAML",
                     lambda: ui.download.from_url("studio/scene.yaml", "scene.yaml"))  # fmt: skip

    def _button(self, icon: str, text: str, action: Callable[[], Any]) -> Any:
        button = ui.button(icon=icon, color=None, on_click=lambda: self._do(action))
        button.props(f'flat dense round=false aria-label="{text}" data-testid="{icon}"')
        with button:
            ui.tooltip(text).props("delay=400")
        return button

    def _do(self, action: Callable[[], Any]) -> None:
        action()
        self.changed()

    def _save(self) -> None:
        with ui.dialog(value=True) as dialog, ui.card().style("min-width:360px"):
            ui.label("Save the scene").style("font-weight:600")
            name = ui.input("Name", value=self.studio.scene.config.name).props(
                "outlined dense autofocus"
            )
            name.classes("w-full").props('data-testid="save-name"').style("width:100%")
            ui.label(f"Becomes a file in {self.studio.base}, which locfuse run takes.").classes(
                "st-quiet"
            )

            def save(*, replace: bool = False) -> None:
                lose.set_visibility(False)
                try:
                    file = self.studio.workspace.save(self.studio.scene, name.value or "",
                                                      replace=replace)  # fmt: skip
                except NameTakenError as error:
                    name.error = f"{error}; replace it, or give another name"
                    lose.set_visibility(True)
                except (ConfigError, OSError) as error:
                    name.error = str(error)
                else:
                    dialog.close()
                    self.notify(f"saved as {file.name}", good=True)

            name.on("keydown.enter", lambda: save())
            name.on_value_change(lambda: lose.set_visibility(False))
            with ui.row().style("justify-content:flex-end; width:100%"):
                ui.button("Cancel", on_click=dialog.close).props("flat no-caps")
                lose: Any = ui.button("Replace", color="negative")
                lose.on_click(lambda: save(replace=True))
                lose.props('outline no-caps data-testid="save-over"').set_visibility(False)
                ui.button("Save", on_click=lambda: save()).props(
                    'unelevated no-caps data-testid="save-it"'
                )

    # What happens ----------------------------------------------------------------------------

    def on_event(self, said: dict[str, Any]) -> None:
        """Handle an event of the drawing board, a key or an upload."""
        try:
            if said["do"] == "undo":
                self.studio.scene.undo()
            elif said["do"] == "redo":
                self.studio.scene.redo()
            elif said["do"] in ("uploading", "uploaded"):
                self.open.on_event(said)
            else:
                self.world.on_event(said)
        except RefusedError as error:
            self.notify("; ".join(problem.message for problem in error.problems))
            self._world_seen = -1  # the page shows what it tried; show what is
        except (KeyError, IndexError, TypeError, ValueError):
            self.notify("that is not there any more")
            self._world_seen = -1
        self.changed()

    def changed(self) -> None:
        """Keep the scene and show what is new."""
        wrong = self.studio.keep()
        if wrong:
            self.notify(wrong)
        self.refresh()

    def refresh(self) -> None:
        """Show what is new, if anything is."""
        scene, runner = self.studio.scene, self.studio.runner
        if self._world_seen != scene.version:
            self._world_seen = scene.version
            self.name.text = scene.config.name
            self.undo.set_enabled(scene.can_undo or bool(scene.waiting or scene.text_problems))
            self.redo.set_enabled(scene.can_redo)
            self.world.refresh()
        if self._seen != (scene.version, runner.version):
            self._seen = (scene.version, runner.version)
            self.run.refresh()
        if self._setups_seen != self.studio.setups.version:
            self._setups_seen = self.studio.setups.version
            self.setup.refresh()

    def call(self, function: str, *arguments: Any) -> None:
        """Call a function of the page's ``studio``, once there is one."""
        texts = ", ".join(json.dumps(argument) for argument in arguments)
        ui.run_javascript(f"studio.{function}({texts})")

    def notify(self, text: str, *, good: bool = False) -> None:
        """Show a sentence for a while."""
        ui.notify(
            text,
            type="positive" if good else "negative",
            position="top",
            timeout=3000 if good else 8000,
            close_button=False if good else "close",
        )

    def load_text(self, text: str, name: str) -> str:
        """Take a YAML text as the scene; return what is wrong with it, if anything is."""
        before = self.studio.scene.text
        problems = self.studio.scene.load_text(text)
        if problems:
            self.studio.scene.load_text(before)
        else:
            self.notify(f"{name} is the scene now", good=True)
        self.changed()
        return f"{name}: {'; '.join(map(str, problems))}" if problems else ""
