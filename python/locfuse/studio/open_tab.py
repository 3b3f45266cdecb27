# SPDX-License-Identifier: Apache-2.0
"""The tab in which scenes, recorded logs and maps are opened."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import run, ui

from locfuse.config.schema import RunConfig
from locfuse.studio.document import RefusedError
from locfuse.studio.drawing import use_map
from locfuse.studio.view import log_of, replaying
from locfuse.studio.workspace import BAGS, MAX_BYTES
from locfuse.types import ConfigError, LogError

if TYPE_CHECKING:
    from locfuse.studio.page import StudioPage

_WRONG = (ConfigError, LogError, RefusedError, OSError, ValueError, MemoryError)


class OpenTab:
    """Open what is there already: saved scenes, configurations, logs, bags, maps."""

    def __init__(self, page: StudioPage) -> None:
        self._page = page
        self._uploads: dict[str, Any] = {}  # what is said of them, by their kind

    def build(self) -> None:
        """Build the tab."""
        with ui.element("div").classes("st-open"):
            with ui.element("div").classes("st-card"):
                self._scenes()
            with ui.element("div").classes("st-card"):
                self._logs()
            with ui.element("div").classes("st-card"):
                self._maps()

    def _scenes(self) -> None:
        ui.html("<h2>A scene</h2>", sanitize=False)
        text = "Scenes are configurations of locfuse run. What is opened replaces the scene."
        ui.label(text).classes("st-quiet")
        with ui.element("div").classes("st-row").style("margin-top:8px"):
            self._saved = ui.select([], label="saved here").props(
                'outlined dense options-dense data-testid="saved"').style("flex:1")  # fmt: skip
            self._saved.on("popup-show", self.refresh)
            ui.button("Open", on_click=self._open_saved).props(
                'unelevated no-caps data-testid="open-saved"'
            )
        self._path_row("scene-path", "or a YAML file on this machine", self._open_file)
        self._upload("scene", ".yaml,.yml", "or upload a YAML file")
        self.refresh()

    def _logs(self) -> None:
        ui.html("<h2>A recorded log</h2>", sanitize=False)
        ui.label("A log folder or a bag (.bag, .mcap, .db3). The Run tab runs it as a simulation."
                 ).classes("st-quiet")  # fmt: skip
        self._path_row("log-path", "log folder or bag on this machine", self._open_log)
        self._upload(
            "log",
            ",".join((*BAGS, ".zip")),
            f"or upload a bag, or a .zip of a folder, of up to {MAX_BYTES / 1e9:g} GB",
        )

    def _maps(self) -> None:
        ui.html("<h2>A map for the scene</h2>", sanitize=False)
        ui.label("A picture: white is free, black a wall, grey unknown. Or the map, anchors and "
                 "landmarks of a log.").classes("st-quiet")  # fmt: skip
        with ui.element("div").classes("st-row").style("margin-top:8px"):
            self._numbers = {
                "resolution": ui.input("metres per pixel", value="0.05"),
                "x": ui.input("x of the lower left corner", value="0", ),
                "y": ui.input("y of it", value="0"),
            }  # fmt: skip
            for name, field in self._numbers.items():
                field.props(f'outlined dense data-testid="map-{name}"').style("flex:1")
        self._upload("map", ".png,.pgm", "upload a PNG or PGM picture")
        self._path_row("world-path", "or take the world of a log folder or bag on this machine",
                       self._take_world)  # fmt: skip

    def _path_row(self, name: str, text: str, action: Any) -> None:
        with ui.element("div").classes("st-row").style("margin-top:8px"):
            field = ui.input(text).props(f'outlined dense data-testid="{name}"').style("flex:1")

            async def go() -> None:
                field.error = None
                try:
                    await action(Path((field.value or "").strip()).expanduser())
                except _WRONG as error:
                    field.error = _sentence(error)

            field.on("keydown.enter", go)
            ui.button("Open", on_click=go).props(f'unelevated no-caps data-testid="{name}-go"')

    def _upload(self, kind: str, accept: str, text: str) -> None:
        numbers = "{}"
        if kind == "map":
            parts = (f"{name}: document.querySelector('[data-testid=map-{name}]').value"
                     for name in self._numbers)  # fmt: skip
            numbers = "{" + ", ".join(parts) + "}"
        with ui.element("label").classes("st-row").style("margin-top:10px; cursor:pointer"):
            ui.label(text)
            picker = ui.element("input").props(
                f'type=file accept="{accept}" data-testid="upload-{kind}"'
            )
            picker.on(
                "change",
                js_handler=f"(e) => studio.upload(e.target, {json.dumps(kind)}, {numbers})",
            )
        said = ui.label().classes("st-note").style("margin:6px 0 0")
        said.props(f'data-testid="upload-{kind}-said"').set_visibility(False)
        self._uploads[kind] = said

    def refresh(self) -> None:
        """Show which scenes are saved."""
        self._saved.set_options(self._page.studio.workspace.saved())

    # What happens ----------------------------------------------------------------------------

    def _open_saved(self) -> None:
        self._saved.error = None
        if not self._saved.value:
            self._saved.error = "choose one of the saved scenes first"
            return
        name = str(self._saved.value)
        try:
            text = self._page.studio.workspace.load(name)
        except ConfigError as error:
            self._saved.error = str(error)
            return
        self._saved.error = self._page.load_text(text, name) or None
        if not self._saved.error:
            self._page.tabs.value = "World"

    def _opened(self) -> None:
        self._page.changed()
        self._page.tabs.value = "World"

    async def _open_file(self, file: Path) -> None:
        if not file.name:
            raise ValueError("expected the path of a file")
        self._page.studio.scene.replace(self._page.studio.workspace.taken_from(file))
        self._opened()
        self._page.notify(f"{file.name} is the scene now", good=True)

    async def _open_log(self, path: Path) -> None:
        """Make a scene that replays a log."""
        if not path.name:
            raise ValueError("expected the path of a log folder or a bag")
        await self._use_log(str(path.absolute()), path.stem)

    async def _use_log(self, path: str, name: str) -> None:
        studio = self._page.studio
        data = await run.io_bound(replaying, studio.scene, path, name, studio.base)
        assert data is not None
        studio.scene.replace(data)
        self._opened()

    async def _take_world(self, path: Path) -> None:
        """Give the scene the map, anchors and landmarks of a log."""
        studio = self._page.studio
        if not path.name:
            raise ValueError("expected the path of a log folder or a bag")
        if studio.scene.config.simulation is None:
            raise ValueError("this scene replays a log; make a new one first")
        log = await run.io_bound(log_of, RunConfig(log=str(path.absolute())), studio.base)
        assert log is not None
        studio.workspace.take_world(studio.scene, log, path.stem)
        self._opened()

    def on_event(self, said: dict[str, Any]) -> None:
        """Go on with a file that was uploaded."""
        kind, name = str(said["kind"]), str(said["name"])
        if said["do"] == "uploading":
            self._say(kind, f"uploading and reading {name} ...", wrong=False)
        elif said.get("error"):
            self._say(kind, str(said["error"]))
        elif kind == "log":
            ui.timer(0.0, lambda: self._uploaded_log(str(said["path"]), name), once=True)
        else:
            self._say(kind, self._uploaded(kind, name, said))

    def _uploaded(self, kind: str, name: str, said: dict[str, Any]) -> str:
        """Make a scene or a map that was uploaded the scene's; return what is wrong with it."""
        if kind == "scene":
            wrong = self._page.load_text(str(said["text"]), name)
            if wrong:
                return wrong
        else:
            width, depth = said["size"]
            try:
                use_map(self._page.studio.scene, str(said["path"]), (float(width), float(depth)))
            except RefusedError as error:
                return f"{name}: {_sentence(error)}"
        self._page.tabs.value = "World"
        return ""

    async def _uploaded_log(self, path: str, name: str) -> None:
        try:
            await self._use_log(path, Path(name).stem)
            self._say("log", "")
        except _WRONG as error:
            self._say("log", _sentence(error))

    def _say(self, kind: str, text: str, *, wrong: bool = True) -> None:
        """Say below an upload what becomes of it; nothing once it is there."""
        label = self._uploads[kind]
        label.text = text
        label.set_visibility(bool(text))
        label.classes(add="st-wrong" if wrong else "", remove="" if wrong else "st-wrong")


def _sentence(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
