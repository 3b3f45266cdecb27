# SPDX-License-Identifier: Apache-2.0
"""The tab with the drawing board, its tools, and the forms and the text beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from locfuse.config import scenario, schema
from locfuse.studio import drawing
from locfuse.studio.document import Key
from locfuse.studio.fields import Field, field_of
from locfuse.studio.forms import Forms
from locfuse.studio.view import world_of

if TYPE_CHECKING:
    from locfuse.studio.page import StudioPage

TOOLS = (
    ("select", "near_me", "Select and move (Del takes away, arrows move)"),
    ("anchor", "change_history", "Anchor"),
    ("landmark", "diamond", "Landmark"),
    ("cylinder", "radio_button_unchecked", "Cylinder: a landmark that the laser sees"),
    ("wall", "horizontal_rule", "Wall that the laser sees"),
    (
        "nlos",
        "signal_cellular_connected_no_internet_0_bar",
        "Wall that ranges are too long through",
    ),
    ("path", "timeline", "Path of the robot"),
    ("erase", "backspace", "Take away"),
)
MODES = {"dop": "HDOP", "seen": "anchors in view", "off": "no coverage"}
_SIM: Key = ("simulation",)
_BOARD = "studio-board"


class WorldTab:
    """Draw and set what is to be simulated."""

    def __init__(self, page: StudioPage) -> None:
        self._page = page
        self._chosen: Key | None = None
        self._mounted = False
        self._kind = ""
        self._forms = Forms(lambda: page.studio.scene, page.changed)
        self._chosen_forms = Forms(lambda: page.studio.scene, page.changed)

    def build(self) -> None:
        """Build the tab."""
        with ui.element("div").classes("st-world"):
            with ui.element("div").classes("st-tools"):
                self._tools()
            with ui.element("div").classes("st-board"):
                ui.html(f'<div id="{_BOARD}" style="height:100%"></div>', sanitize=False).style(
                    "height:100%"
                )
            with ui.element("div").classes("st-side"):
                self._side()

    def _tools(self) -> None:
        self._buttons: dict[str, Any] = {}
        for name, icon, text in TOOLS:
            button = ui.button(icon=icon, color=None, on_click=lambda name=name: self.use(name))
            button.props(f'flat dense aria-label="{text}" data-testid="tool-{name}"')
            with button:
                ui.tooltip(text).props('delay=300 anchor="center right" self="center left"')
            self._buttons[name] = button
        ui.element("hr")
        with ui.button(icon="gradient", color=None).props(
            'flat dense aria-label="What the floor shows"'
        ) as button:
            ui.tooltip("What the floor shows").props('anchor="center right" self="center left"')
            with ui.menu():
                for mode, text in MODES.items():
                    ui.menu_item(text, lambda mode=mode: self._javascript(f'mode("{mode}")'))
        button.props('data-testid="coverage"')
        fit = ui.button(icon="fit_screen", color=None, on_click=lambda: self._javascript("fit()"))
        fit.props('flat dense aria-label="Show all"')
        with fit:
            ui.tooltip("Show all (F)").props('anchor="center right" self="center left"')
        self.use("select")

    def use(self, tool: str) -> None:
        """Choose a tool."""
        for name, button in self._buttons.items():
            button.classes(
                add="st-on" if name == tool else "", remove="" if name == tool else "st-on"
            )
        self._javascript(f'use("{tool}")')

    def _javascript(self, expression: str) -> None:
        ui.run_javascript(f"studio.editor && studio.editor.{expression}")

    # Side ------------------------------------------------------------------------------------

    def _side(self) -> None:
        with ui.tabs(value="Settings").classes("st-tabs").props("dense no-caps align=left") as tabs:
            ui.tab("Settings")
            ui.tab("YAML").props('data-testid="tab-yaml"')
        with ui.tab_panels(tabs, value="Settings", animated=False, keep_alive=True):
            with ui.tab_panel("Settings"):
                self._trouble = ui.element("div")
                self._selection = ui.element("div")
                self._settings = ui.element("div")
            with ui.tab_panel("YAML"):
                self._yaml()

    def _build_settings(self) -> None:
        """Make the forms: those of a simulation, or those of a log."""
        forms = self._forms
        self._settings.clear()
        with self._settings:
            if self._page.studio.scene.config.simulation is not None:
                with self._section("Room and time", open_=True):
                    forms.fields(schema.RunConfig, (), ["name", "seed"])
                    forms.fields(scenario.Scenario, _SIM, ["room_m", "duration_s",
                                                           "landmark_radius_m"])  # fmt: skip
                with self._section("Path"):
                    forms.path((*_SIM, "path"))
                with self._section("Sensors"), ui.element("div").classes("st-fields"):
                    for name in ("odometry", "ranges", "poses", "positions", "landmark_sightings",
                                 "altitudes", "headings", "laser"):  # fmt: skip
                        forms.section(field_of(scenario.Scenario, name), (*_SIM, name))
                    forms.field(field_of(scenario.Scenario, "tags"), (*_SIM, "tags"))
                with self._section("Map"), ui.element("div").classes("st-fields"):
                    forms.section(field_of(scenario.Scenario, "map"), (*_SIM, "map"))
                with self._section("Faults"):
                    forms.faults((*_SIM, "faults"))
            else:
                with self._section("Log", open_=True):
                    forms.fields(schema.RunConfig, (), ["name", "description", "log", "ros"])
            with self._section("Estimator"):
                forms.fields(schema.RunConfig, (), [
                    "start", "when_lost", "use", "anchors", "start_sigma", "estimator", "mcl",
                    "cylinders", "scan_odometry", "tag_conditioner", "initializer",
                    "health", "watch_poses"])  # fmt: skip
            with self._section("Delivery"):
                forms.fields(schema.RunConfig, (), ["history_s", "history_messages", "clock_jump",
                                                    "switched_off"])  # fmt: skip

    def _section(self, name: str, *, open_: bool = False) -> Any:
        box = ui.expansion(name, value=open_).classes("st-section")
        return box.props(f'data-testid="section-{name.split(" ")[0].lower()}"')

    def _yaml(self) -> None:
        self._text = ui.codemirror(language="YAML", line_wrapping=True).classes("st-yaml")
        self._text.props('data-testid="yaml"')
        with ui.element("div").classes("st-row").style("padding:6px 12px"):
            apply = ui.button("Apply", on_click=self._apply).props("unelevated dense no-caps")
            apply.props('data-testid="apply"').style("padding:2px 14px")
            self._verdict = ui.label().classes("st-quiet").props('data-testid="yaml-verdict"')
            self._verdict.style("flex:1; max-height:72px; overflow:auto; white-space:pre-wrap")

    def _apply(self) -> None:
        self._page.studio.scene.load_text(self._text.value or "")
        self._page.changed()

    # What happens ----------------------------------------------------------------------------

    def on_event(self, said: dict[str, Any]) -> None:
        """Handle an event of the drawing board."""
        scene, do = self._page.studio.scene, said["do"]
        what: Key = tuple(said["what"]) if isinstance(said.get("what"), list) else ()
        if do == "add":
            x, y, kind = float(said["x"]), float(said["y"]), said["what"]
            if kind == "anchor":
                drawing.add_anchor(scene, x, y)
            else:
                drawing.add_landmark(scene, x, y, cylinder=kind == "cylinder")
        elif do == "move":
            drawing.move(scene, what, float(said["x"]), float(said["y"]))
        elif do == "remove":
            drawing.remove(scene, what)
        elif do == "wall":
            drawing.add_wall(scene, [float(v) for v in said["wall"]], nlos=bool(said["nlos"]))
        elif do == "path":
            drawing.draw_path(scene, said["points"], closed=bool(said["closed"]))
            self.use("select")
        elif do == "select":
            self._choose(what or None)
        elif do == "ground":
            self._tell_ground(said)

    def refresh(self) -> None:
        """Show the scene as it is now."""
        scene = self._page.studio.scene
        world = world_of(scene)
        kind = "simulation" if world["simulated"] else "log"
        if self._kind != kind:
            self._kind = kind
            self._build_settings()
        self._forms.refresh()
        self._chosen_forms.refresh()
        if self._text.value != scene.text:
            self._text.value = scene.text
        problems = scene.text_problems
        self._verdict.text = "\n".join(map(str, problems)) or "This is the scene."
        self._verdict.classes(add="st-bad" if problems else "", remove="" if problems else "st-bad")
        if self._mounted:
            self._page.call("show", world)
        else:
            self._mounted = True
            self._page.call("mount", _BOARD, world)

    def _tell_ground(self, said: dict[str, Any]) -> None:
        """Show what keeps a simulation from being driven, or what a log holds."""
        self._trouble.clear()
        with self._trouble:
            if said.get("message"):
                ui.label(said["message"]).classes("st-note st-wrong").props('data-testid="trouble"')
            elif said.get("counts"):
                text = ", ".join(f"{count} {name}" for name, count in said["counts"].items())
                ui.label(f"The log holds {text}.").classes("st-note")

    # The thing that is chosen ------------------------------------------------------------------

    def _choose(self, what: Key | None) -> None:
        if what == self._chosen:
            return
        self._chosen = what
        self._selection.clear()
        if what is None or what[0] == "center":
            return
        key = drawing.key_of(what)
        with self._selection, ui.element("div").classes("st-section"):
            with ui.element("div").classes("st-row").style("padding:8px 12px 4px"):
                ui.label(_called(what)).style("flex:1; font-weight:600").props(
                    'data-testid="chosen"'
                )
                button = ui.button(icon="delete", color=None, on_click=self._take_away)
                button.props('flat dense size=sm aria-label="Take it away"')
            with ui.element("div").classes("st-fields"):
                if what[0] in ("anchor", "landmark"):
                    self._name(what)
                self._numbers(what, key)
        self._chosen_forms.refresh()

    def _name(self, what: Key) -> None:
        field = ui.input("name", value=str(what[1])).props(
            'dense outlined data-testid="chosen-name"'
        )

        def commit() -> None:
            name = (field.value or "").strip()
            if name == what[1]:
                return
            try:
                drawing.rename(self._page.studio.scene, what, name)
            except ValueError as error:
                field.error = str(error)
                return
            self._page.changed()
            self._choose(None)

        field.on("blur", commit).on("keydown.enter", commit)

    def _numbers(self, what: Key, key: Key) -> None:
        names: tuple[str, ...] = {
            "anchor": ("x_m", "y_m", "z_m"),
            "wall": ("x1_m", "y1_m", "x2_m", "y2_m"),
            "nlos": ("x1_m", "y1_m", "x2_m", "y2_m"),
        }.get(str(what[0]), ("x_m", "y_m"))
        for index, name in enumerate(names):
            place = Field(name, "number", name.removesuffix("_m"), "m", "")
            self._chosen_forms.field(place, (*key, index))

    def _take_away(self) -> None:
        if self._chosen is not None:
            short = self._chosen[: 3 if self._chosen[0] == "nlos" else 2]
            self._page.on_event({"do": "remove", "what": list(short)})


def _called(what: Key) -> str:
    kind = {"nlos": "wall for ranges", "point": "point of the path"}.get(str(what[0]), str(what[0]))
    if what[0] in ("anchor", "landmark"):
        return f"{kind} {what[1]}"
    return kind if what[0] != "point" else f"{kind}, {int(what[1]) + 1}"
