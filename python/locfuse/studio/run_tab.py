# SPDX-License-Identifier: Apache-2.0
"""The tab in which a scene is run, watched and compared."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from nicegui import ui

from locfuse.studio.compare import FIGURES, compared, value_of
from locfuse.studio.estimators import Choice, choices
from locfuse.studio.runner import Part, Run

if TYPE_CHECKING:
    from locfuse.studio.page import StudioPage

At = tuple[int, str]  # number of a run, and key of one of its parts
_PLAYER = "studio-player"
_MAX_SHOWN = 6  # runs over one another
_DOWNLOADS = {"report.html": "Report", "scene.yaml": "Config", "estimate.tum": "Trajectory (TUM)",
              "drive.mcap": "Bag (.mcap)"}  # fmt: skip
_UNDER_WAY = ("waiting", "running")
_STATES = {"waiting": "waits", "running": "runs", "writing": "writes its report", "done": "done",
           "failed": "failed", "cancelled": "cancelled"}  # fmt: skip


class RunTab:
    """Choose estimators, run them in another process, watch and compare what comes out."""

    def __init__(self, page: StudioPage) -> None:
        self._page = page
        self._chosen: dict[str, bool] = {"as_set": True}
        self._offered: list[Choice] = []
        self._shown: list[At] = []
        self._played: tuple[list[str], bool] | None = None
        self._compared: list[tuple[int, str, str]] = []
        self._listed: list[tuple[At, str, bool, bool]] = []
        self._bars: dict[At, Any] = {}
        self._awaited: set[At] = set()

    def build(self) -> None:
        """Build the tab."""
        with ui.element("div").classes("st-run"):
            with ui.element("div").classes("st-left"):
                ui.html("<h2>Estimators</h2>", sanitize=False)
                self._boxes = ui.element("div")
                with ui.element("div").classes("st-row").style("margin:10px 0 6px"):
                    self._start = ui.button("Run", icon="play_arrow", on_click=self._run)
                    self._start.props('unelevated no-caps data-testid="run"')
                    self._cancel = ui.button(
                        "Cancel", icon="stop", on_click=self._page.studio.runner.cancel
                    )
                    self._cancel.props('outline no-caps data-testid="cancel"')
                self._hint = ui.label().classes("st-quiet").props('data-testid="run-hint"')
                ui.html("<h2>Runs</h2>", sanitize=False)
                self._runs = ui.element("div").props('data-testid="runs"')
            with ui.element("div").classes("st-right"):
                self._empty = ui.label(
                    "Nothing has been run yet. Choose estimators on the left and press Run."
                ).classes("st-empty")
                ui.html(f'<div id="{_PLAYER}"></div>', sanitize=False)
                self._table = ui.element("div").props('data-testid="comparison"')
        self._find_shown()

    def _find_shown(self) -> None:
        """Show the last run that there is, as when the page is opened again."""
        for run in reversed(self._page.studio.runner.runs):
            ats = [(run.number, part.key) for part in run.parts]
            self._shown = [at for at in ats if run.can_be_watched(at[1])]
            if not run.ended:
                self._awaited = set(ats) - set(self._shown)
            if self._shown or not run.ended:
                return

    # What happens ----------------------------------------------------------------------------

    def _run(self) -> None:
        studio = self._page.studio
        chosen = [choice for choice in self._offered if self._chosen.get(choice.key)]
        try:
            run = studio.runner.start(studio.scene, chosen, studio.base)
        except (ValueError, OSError) as error:
            self._page.notify(str(error))
            return
        self._shown = []
        self._awaited = {(run.number, part.key) for part in run.parts}
        self._page.changed()
        self.refresh()

    def refresh(self) -> None:
        """Show the scene's estimators, and the runs as they are by now."""
        studio = self._page.studio
        offered = choices(studio.scene.data, studio.scene.config)
        if [c.key for c in offered] != [c.key for c in self._offered]:
            self._offered = offered
            self._show_choices()
        wrong = len(studio.scene.waiting) + len(studio.scene.text_problems)
        busy = studio.runner.busy
        self._start.set_enabled(not busy and not wrong)
        self._cancel.set_visibility(busy)
        self._hint.text = (
            f"{wrong} value{'s do' if wrong > 1 else ' does'} not fit; mend or undo first."
            if wrong
            else ""
        )
        for at, run, part in self._every():
            if at in self._awaited and run.can_be_watched(part.key):
                self._awaited.discard(at)
                self._shown.append(at)
        self._show_runs()
        self._play()

    def _show_choices(self) -> None:
        self._boxes.clear()
        with self._boxes:
            for choice in self._offered:
                with ui.element("div").classes("st-item"):
                    box = ui.checkbox(
                        choice.name,
                        value=self._chosen.get(choice.key, False),
                        on_change=lambda e, key=choice.key: self._chosen.update({key: e.value}),
                    )
                    box.props(f'dense data-testid="choice-{choice.key}"')
                    with box:
                        ui.tooltip(choice.what).props("delay=400")

    # Runs ------------------------------------------------------------------------------------

    def _show_runs(self) -> None:
        """Show the runs; while nothing but their progress is new, only that."""
        listed = [
            (at, part.state, run.can_be_watched(part.key), at in self._shown)
            for at, run, part in self._every()
        ]
        if listed != self._listed:
            self._listed = listed
            self._bars = {}
            self._runs.clear()
            with self._runs:
                for run in reversed(self._page.studio.runner.runs):
                    self._show_run(run)
        for at, _, part in self._every():
            if at in self._bars:
                self._bars[at].value = part.share

    def _every(self) -> list[tuple[At, Run, Part]]:
        """Return the parts of all runs, oldest first."""
        runs = self._page.studio.runner.runs
        return [((run.number, part.key), run, part) for run in runs for part in run.parts]

    def _show_run(self, run: Run) -> None:
        with ui.element("div").style("margin-bottom:10px"):
            with ui.element("div").classes("st-row"):
                when = time.strftime("%d %b %H:%M", time.localtime(run.began))
                ui.label(f"{run.number} · {run.name}").style("font-weight:600").classes("ellipsis")
                ui.label(when).classes("st-quiet").style("flex:1; white-space:nowrap")
                if run.ended:
                    button = ui.button(icon="close", color=None, on_click=lambda: self._ask(run))
                    button.props(f'flat dense size=xs aria-label="Delete run {run.number}"')
                    button.props(f'data-testid="delete-{run.number}"')
            for part in run.parts:
                self._show_part(run, part)

    def _show_part(self, run: Run, part: Part) -> None:
        at = (run.number, part.key)
        watchable = run.can_be_watched(part.key)
        with ui.element("div").classes("st-item") as item:
            whole = "data-whole" if part.metrics else ""
            item.props(
                f'data-testid="part-{run.number}-{part.key}" data-state={part.state} {whole}'
            )
            if watchable:
                box = ui.checkbox(
                    part.name, value=at in self._shown, on_change=lambda e: self._watch(at, e.value)
                ).props("dense")
                box.classes("st-name").props(f'data-testid="watch-{run.number}-{part.key}"')
            else:
                ui.label(part.name).classes("st-name")
            rmse = value_of(FIGURES[0], part.metrics)
            if part.state in ("done", "writing") and rmse is not None:
                ui.label(f"{rmse:.3f} m").style("white-space:nowrap")
            elif part.state != "done":
                cut = run.ended and watchable and part.share and not whole
                share = f" at {100 * part.share:.0f} %" if cut else ""
                ui.label(_STATES[part.state] + share).classes(
                    "st-bad" if part.state == "failed" else "st-quiet")  # fmt: skip
        if part.state == "running":
            bar = ui.linear_progress(part.share, show_value=False, size="4px")
            self._bars[at] = bar.props("instant-feedback")
        if part.error:
            ui.label(part.error).classes("st-note st-wrong").style("margin:2px 0").props(
                f'data-testid="error-{part.key}"')  # fmt: skip

    def _watch(self, at: At, on: bool) -> None:
        if on and at not in self._shown:
            self._shown = [*self._shown, at][-_MAX_SHOWN:]
        elif not on and at in self._shown:
            self._shown.remove(at)
        self._play()

    def _ask(self, run: Run) -> None:
        """Delete a run if that is what is meant."""
        with ui.dialog(value=True) as dialog, ui.card():
            ui.label(f"Delete run {run.number} · {run.name}?").style("font-weight:600")
            ui.label(f"Its folder {run.folder} is deleted, and cannot be had back.").classes(
                "st-quiet"
            )

            def delete() -> None:
                dialog.close()
                self._shown = [at for at in self._shown if at[0] != run.number]
                self._page.studio.runner.delete(run)
                self.refresh()

            with ui.row().style("justify-content:flex-end; width:100%"):
                ui.button("Keep", on_click=dialog.close).props("flat no-caps autofocus")
                ui.button("Delete", color="negative", on_click=delete).props(
                    'unelevated no-caps data-testid="delete-it"'
                )

    # What is watched -------------------------------------------------------------------------

    def _play(self) -> None:
        """Play what is chosen, and compare it."""
        parts = self._parts()
        urls = [f"studio/runs/{run.number}/{part.key}/play.json?{part.grown}"
                for run, part in parts]  # fmt: skip
        more = any(
            part.state in _UNDER_WAY and at in (*self._shown, *self._awaited)
            for at, _, part in self._every()
        )
        if (urls, more) != self._played:
            self._played = (urls, more)
            self._empty.set_visibility(not parts)
            self._page.call("play", _PLAYER, urls, more)
        compared = [(run.number, part.key, part.state) for run, part in parts]
        if compared != self._compared:
            self._compared = compared
            self._compare(parts)

    def _parts(self) -> list[tuple[Run, Part]]:
        found = {at: (run, part) for at, run, part in self._every()}
        return [found[at] for at in self._shown if at in found]

    def _compare(self, parts: list[tuple[Run, Part]]) -> None:
        self._table.clear()
        if not parts:
            return
        with self._table:
            names = [_named(run, part, parts) for run, part in parts]
            found = zip(names, (part.metrics for _, part in parts), strict=True)
            whole = {name: metrics for name, metrics in found if metrics}
            if whole:
                ui.html("<h2>Compared</h2>", sanitize=False)
                ui.html(compared(list(whole), list(whole.values())), sanitize=False)
            ui.html("<h2>Downloads</h2>", sanitize=False)
            for name, (run, part) in zip(names, parts, strict=True):
                with ui.element("div").classes("st-item"):
                    ui.label(name).classes("st-name").style("max-width:220px")
                    self._links(run, part)

    def _links(self, run: Run, part: Part) -> None:
        for file, text in _DOWNLOADS.items():
            url = f"studio/runs/{run.number}/{part.key}/{file}"
            there = part.state == "done" or file == "scene.yaml"
            button: Any = ui.button(text).props("outline dense no-caps size=md")
            button.style("padding:2px 10px").props(f'data-testid="get-{part.key}-{file}"')
            button.set_enabled(there)
            new = ' target="_blank"' if file == "report.html" else " download"
            button.props(f'tag=a href="{url}"{new}')


def _named(run: Run, part: Part, parts: list[tuple[Run, Part]]) -> str:
    several = len({r.number for r, _ in parts}) > 1
    return f"{run.number} · {part.name}" if several else part.name
