# SPDX-License-Identifier: Apache-2.0
"""Forms made from the schema: a field for each key, with its unit, its meaning and its error."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_args

from nicegui import ui
from pydantic import BaseModel

from locfuse.config import scenario
from locfuse.studio.document import Key, dotted, plain, value_at
from locfuse.studio.fields import Field, field_of, fields_of, label_of, read, shown
from locfuse.studio.scene import Scene


def _members(union: Any, tag: str) -> dict[str, type[BaseModel]]:
    """Return the members of a union by what their tag says."""
    members = get_args(get_args(union)[0])
    return {member.model_fields[tag].default: member for member in members}


SHAPES = _members(scenario.Path, "shape")
FAULTS = _members(scenario.Fault, "kind")
# What is required and has no default begins with something that does what its name says.
BEGINNINGS: dict[str, dict[str, Any]] = {
    "nlos": {"walls": [[4.0, 5.0, 6.0, 5.0]], "extra_m": 0.5, "sigma_m": 0.2},
    "bias": {"offset_m": 0.3},
    "wander": {"sigma_m": 0.1, "correlation_s": 5.0},
    "outliers": {"source": "ranges", "probability": 0.05, "magnitude_m": 3.0},
    "dropouts": {"source": "ranges", "from_s": 20.0, "to_s": 30.0},
    "latency": {"source": "poses", "delay_s": 0.3},
    "wheel_slip": {"from_s": 20.0, "to_s": 22.0, "translation_factor": 1.5},
    "slip_episodes": {"every_s": 15.0, "lasting_s": 1.0, "translation_factor": 1.5},
    "kidnap": {"at_s": 30.0, "to": [2.0, 2.0, 0.0]},
    "glass": {"share": 0.2, "probability": 0.8},
    "people": {"count": 3},
    "max_range": {},
    "covered": {"from_deg": -180.0, "to_deg": 0.0},
}


_MAX_ROWS = 10  # of a text that is seen at once


class Forms:
    """The forms of a page: they write into a scene, and show what it says.

    `scene` returns the scene, which may be another one by now. `changed` is called after anything
    was set, fitting or not.
    """

    def __init__(self, scene: Callable[[], Scene], changed: Callable[[], None]) -> None:
        self._scene = scene
        self._changed = changed
        self._inputs: list[tuple[Key, Field, Any]] = []
        self._parts: list[Callable[[], None]] = []

    # What is shown ---------------------------------------------------------------------------

    def refresh(self) -> None:
        """Show what the scene says by now."""
        for part in [*self._parts]:
            part()
        alive = [entry for entry in self._inputs if not entry[2].is_deleted]
        self._inputs = alive
        for key, field, element in alive:
            self._show(key, field, element)

    def _value(self, key: Key) -> Any:
        return plain(value_at(self._scene().config, key))

    def _show(self, key: Key, field: Field, element: Any) -> None:
        waiting = self._scene().waiting.get(key)
        value = self._value(key) if waiting is None else waiting.value
        wanted = value if field.kind in ("choice", "choices", "switch") else shown(field, value)
        if waiting is not None and field.kind == "choice" and value not in field.choices:
            wanted = None
        if element.value != wanted:
            element.value = wanted
        if field.kind == "yaml":
            element.props["rows"] = min(_MAX_ROWS, 1 + str(wanted).count("\n"))
        if hasattr(element, "error"):
            element.error = None if waiting is None else waiting.message

    def _set(self, key: Key, value: Any) -> None:
        scene = self._scene()
        if value is None:
            scene.reset(key)
        else:
            scene.set(key, value)
        self._changed()

    # Fields ----------------------------------------------------------------------------------

    def fields(self, model: type[BaseModel], prefix: Key, names: list[str] | None = None) -> None:
        """Make a field for each key of a section, and sections for those inside of it."""
        every = fields_of(model) if names is None else [field_of(model, name) for name in names]
        with ui.element("div").classes("st-fields"):
            for field in every:
                if field.kind != "section":
                    self.field(field, (*prefix, field.name))
            for field in every:
                if field.kind == "section":
                    self.section(field, (*prefix, field.name))

    def field(self, field: Field, key: Key) -> None:
        """Make one field, which is found by the test id of its dotted key."""
        element: Any
        if field.kind == "switch":
            element = ui.switch(field.label, on_change=lambda e: self._chosen(key, e.value))
            element.props("dense")
        elif field.kind in ("choice", "choices"):
            element = ui.select(list(field.choices), label=field.label,
                                multiple=field.kind == "choices", clearable=field.optional,
                                on_change=lambda e: self._chosen(key, e.value))  # fmt: skip
            element.props("dense outlined options-dense")
            element.props("use-chips" if field.kind == "choices" else "")
        else:
            element = self._input(field, key)
            element.props("dense outlined")
        element.classes("st-wide" if field.kind in ("yaml", "choices") else "")
        element.props["data-testid"] = dotted(key)
        if field.help:
            with element:
                ui.tooltip(f"{field.help} ({field.name})").props("delay=500 max-width=320px")
        self._inputs.append((key, field, element))
        self._show(key, field, element)

    def _input(self, field: Field, key: Key) -> Any:
        is_long = field.kind == "yaml"
        element: Any = ui.textarea(field.label) if is_long else ui.input(field.label)
        element.props("input-style='font-size:12.5px; resize:vertical'" if is_long else "")
        if field.unit:
            element.props(f'suffix="{field.unit}"')
        if field.optional:
            element.props('placeholder="none" stack-label')

        def commit() -> None:
            text = element.value or ""
            waiting = self._scene().waiting.get(key)
            now = self._value(key) if waiting is None else waiting.value
            if text.strip() != shown(field, now):
                self._set(key, read(field, text))

        element.on("blur", commit)
        if not is_long:
            element.on("keydown.enter", commit)
        return element

    def _chosen(self, key: Key, value: Any) -> None:
        waiting = self._scene().waiting.get(key)
        now = self._value(key) if waiting is None else waiting.value
        if value != now:
            self._set(key, value)

    # Sections --------------------------------------------------------------------------------

    def section(self, field: Field, key: Key) -> None:
        """Make a section that opens; one that may be absent has a switch."""
        assert field.model is not None
        model = field.model
        refusals: list[Callable[[Key, Any], None]] = []  # it is below the header it belongs to
        box = ui.expansion(field.label).classes("st-sub st-wide").props("dense")
        box.props["data-testid"] = dotted(key)
        with box.add_slot("header"), ui.element("div").classes("st-row st-full"):
            if field.optional:
                self._switch(field, key, lambda key, value: refusals[0](key, value))
            ui.label(field.label).style("flex:1 0 auto; white-space:nowrap")
            if field.help:
                ui.label(field.help).classes("st-quiet ellipsis").style(
                    "flex:0 1 auto; min-width:0"
                )
        self._lazily(box, key, lambda: self.fields(model, key))
        refusals.append(self._refusal(f"{dotted(key)}-on"))

    def _refusal(self, name: str) -> Callable[[Key, Any], None]:
        """Make a place that says why what was chosen above it is refused; return what sets it.

        Such a choice does not wait until it fits: it is undone, and the place says why until the
        scene is another one.
        """
        label = ui.label().classes("st-note st-wrong st-wide").style("margin:0 8px")
        label.props["data-testid"] = f"{name}-refused"
        label.set_visibility(False)
        of: list[Any] = [None]

        def say(message: str | None) -> None:
            label.text = message or ""
            label.set_visibility(message is not None)

        def attempt(key: Key, value: Any) -> None:
            scene = self._scene()
            say(scene.set(key, value))
            scene.waiting.pop(key, None)
            of[0] = scene.data
            self._changed()

        def forget() -> None:
            if not label.is_deleted and self._scene().data is not of[0]:
                say(None)

        self._parts.append(forget)
        return attempt

    def _switch(self, field: Field, key: Key, attempt: Callable[[Key, Any], None]) -> None:
        """Make a switch for a section that may be absent."""

        def flip(on: bool) -> None:
            if on != (self._value(key) is not None):
                attempt(key, {} if on else None)

        element = ui.switch(on_change=lambda e: flip(e.value)).props("dense")
        element.props["data-testid"] = f"{dotted(key)}-on"
        element.props["aria-label"] = field.label
        element.on("click.stop", lambda: None)

        def show() -> None:
            if not element.is_deleted:
                element.value = self._value(key) is not None

        self._parts.append(show)
        show()

    def _lazily(self, box: ui.expansion, key: Key, make: Callable[[], None]) -> None:
        """Fill a section when it is opened first, and anew when it comes or goes."""
        made: list[bool] = []
        with box:
            inside = ui.element("div")

        def fill() -> None:
            if box.is_deleted:
                return
            there = self._value(key) is not None
            if not box.value or made == [there]:
                return
            made[:] = [there]
            inside.clear()
            with inside:
                if there:
                    make()
                else:
                    ui.label("Switched off.").classes("st-quiet").style("padding:4px 8px 10px")

        box.on_value_change(lambda: fill())
        self._parts.append(fill)

    def path(self, key: Key) -> None:
        """Make the form of the path: its shape, and the keys of that."""
        attempt = self._refusal(f"{dotted(key)}.shape")
        box = ui.element("div")
        made: list[str] = []

        def fill() -> None:
            path = value_at(self._scene().config, key)
            if path is None or box.is_deleted or made == [path.shape]:
                return
            made[:] = [path.shape]
            box.clear()
            with box:
                with ui.element("div").classes("st-fields"):
                    select = ui.select(list(SHAPES), label="shape", value=path.shape,
                                       on_change=lambda e: choose(e.value))  # fmt: skip
                    select.props("dense outlined options-dense")
                    select.props["data-testid"] = f"{dotted(key)}.shape"
                    select.classes("st-wide")
                self.fields(SHAPES[path.shape], key)

        def choose(shape: str) -> None:
            before = self._value(key)
            if shape == before.get("shape", made[0]):
                return
            kept = {k: v for k, v in before.items() if k in ("speed_mps", "turn_rate_radps")
                    and k in SHAPES[shape].model_fields}  # fmt: skip
            if shape == "points":
                kept["points_m"] = self._corners()
            made.clear()
            attempt(key, {"shape": shape, **kept})

        self._parts.append(fill)
        fill()

    def _corners(self) -> list[list[float]]:
        """Return a path to begin with: a stroke through the middle of the room."""
        room = value_at(self._scene().config, ("simulation", "room_m")) or (10.0, 10.0)
        width, depth = room
        return [[0.25 * width, 0.5 * depth], [0.75 * width, 0.5 * depth]]

    def faults(self, key: Key) -> None:
        """Make a form for each fault, a button that takes it away, and one that adds another."""
        box = ui.element("div")
        attempt = self._refusal(f"{dotted(key)}-add")
        made: list[tuple[str, ...]] = []

        def fill() -> None:
            faults = value_at(self._scene().config, key) or []
            kinds = tuple(fault.kind for fault in faults)
            if box.is_deleted or made == [kinds]:
                return
            made[:] = [kinds]
            box.clear()
            with box, ui.element("div").classes("st-fields"):
                for index, kind in enumerate(kinds):
                    self._fault(kind, (*key, index))
                self._add_fault(key, len(kinds), attempt)

        self._parts.append(fill)
        fill()

    def _fault(self, kind: str, key: Key) -> None:
        box = ui.expansion(value=True).classes("st-sub st-wide").props("dense")
        with box.add_slot("header"), ui.element("div").classes("st-row st-full"):
            ui.label(label_of(kind)).style("flex:1; font-weight:600")
            button = (
                ui.button(icon="close", color=None)
                .props("flat dense size=sm")
                .on("click.stop", lambda: None)
            )
            button.props(f'aria-label="remove {kind}"')
            button.on_click(lambda: self._set(key, None))
        with box:
            self.fields(FAULTS[kind], key)

    def _add_fault(self, key: Key, count: int, attempt: Callable[[Key, Any], None]) -> None:
        def add(kind: str) -> None:
            attempt((*key, count), {"kind": kind, **BEGINNINGS[kind]})

        button = ui.button("add a fault", icon="add").props("flat dense no-caps").classes("st-wide")
        with button.props('data-testid="add-fault"'), ui.menu():
            for kind, model in FAULTS.items():
                with ui.menu_item(label_of(kind), lambda kind=kind: add(kind)) as item:
                    item.props(f'data-testid="add-fault-{kind}"')
                    summary = (model.__doc__ or "").strip().split("\n")[0]
                    ui.tooltip(summary).props("delay=300")
