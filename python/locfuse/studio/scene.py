# SPDX-License-Identifier: Apache-2.0
"""The scene that is worked on: a configuration that is always valid, with a memory."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from locfuse.config.load import YamlError, read_yaml
from locfuse.config.schema import RunConfig
from locfuse.studio.document import (
    Data,
    Draft,
    Key,
    Problem,
    RefusedError,
    checked,
    closest,
    line_of,
    text_of,
    value_at,
)

_MAX_STEPS = 500  # that can be undone

EMPTY: Data = {
    "name": "scene",
    "simulation": {
        "room_m": [10.0, 10.0],
        "anchors": {},
        "ranges": None,
        "poses": None,
        "path": {"shape": "circle"},
        "duration_s": 60.0,
    },
}


@dataclass(frozen=True)
class Waiting:
    """A value that does not fit, and why; it waits for others that make it fit."""

    value: Any
    message: str


class Scene:
    """A document that is a valid configuration at any time, and what was tried in vain.

    A value that does not fit is kept beside the document, with its message, until it is changed, or
    other changes make it fit; then both become part of the document. A text that does not fit is
    kept the same way. Whoever shows the scene asks `version` whether anything is new.

    `data` is the document, never changed in place, and `config` the same, read. `text` is the YAML
    as typed, or made from the document; `good_text` is that of the document, `text_problems` what
    is wrong with `text` if it differs. `version` counts the changes, refused ones included.
    """

    def __init__(self, data: Data | None = None) -> None:
        self.data: Data = copy.deepcopy(EMPTY if data is None else data)
        self.config: RunConfig = checked(self.data)
        self.waiting: dict[Key, Waiting] = {}
        self.text = self.good_text = text_of(self.data)
        self.text_problems: tuple[Problem, ...] = ()
        self.version = 0
        self._past: list[tuple[Data, str]] = []
        self._future: list[tuple[Data, str]] = []

    # Changes ---------------------------------------------------------------------------------

    def set(self, key: Key, value: Any) -> str | None:
        """Set a key; return what is wrong with the value, None if it was taken."""
        return self._try(key, lambda draft: draft.set(key, value), value)

    def reset(self, key: Key) -> str | None:
        """Return a key to its default, or remove an item; return what is wrong with that."""
        return self._try(key, lambda draft: draft.remove(key), None)

    def edit(self, change: Callable[[Draft], None]) -> None:
        """Change several keys in one step.

        Raises RefusedError if the result is no configuration; the scene stays as it was.
        """
        draft = Draft(self.data, self.config)
        change(draft)
        config = checked(draft.data)
        self.waiting = {k: w for k, w in self.waiting.items() if value_at(draft.data, k[:-1])}
        self._take(draft.data, config)

    def load_text(self, text: str) -> tuple[Problem, ...]:
        """Take a YAML text as the scene; return what is wrong with it, nothing if it was taken."""
        self.version += 1
        try:
            data = read_yaml(text, "the text")
            config = checked(data)
        except YamlError as error:
            what = str(error).split(": ", 1)[1]  # the line names the place
            self.text, self.text_problems = text, (Problem((), what, error.line),)
        except RefusedError as error:
            self.text = text
            self.text_problems = tuple(
                Problem(p.key, p.message, line_of(text, closest(data, p))) for p in error.problems
            )
        else:
            self.waiting = {}
            self._take(data, config, text)
        return self.text_problems

    def replace(self, data: Data) -> None:
        """Take another document, in one step that can be undone.

        Raises RefusedError if it is no configuration.
        """
        config = checked(data)
        self.waiting = {}
        self._take(copy.deepcopy(data), config)

    # Memory ----------------------------------------------------------------------------------

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to go back."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to go forward again."""
        return bool(self._future)

    def undo(self) -> bool:
        """Go back a step, or drop values that do not fit; return whether there was anything."""
        if self.waiting or self.text_problems:
            self._show(self.data, self.good_text)
            return True
        return self._step(self._past, self._future)

    def redo(self) -> bool:
        """Go forward a step; return whether there was one."""
        return self._step(self._future, self._past)

    def _step(self, source: list[tuple[Data, str]], target: list[tuple[Data, str]]) -> bool:
        if not source:
            return False
        target.append((self.data, self.good_text))
        self._show(*source.pop())
        return True

    def _show(self, data: Data, text: str) -> None:
        self.data, self.config, self.text = data, checked(data), text
        self.good_text = text
        self.waiting, self.text_problems = {}, ()
        self.version += 1

    # Inside ----------------------------------------------------------------------------------

    def _try(self, key: Key, change: Callable[[Draft], None], value: Any) -> str | None:
        others = {k: w for k, w in self.waiting.items() if k != key}
        together, alone = Draft(self.data, self.config), Draft(self.data, self.config)
        problems: tuple[Problem, ...] = ()
        for draft, with_others in ((together, True), (alone, False)):
            if with_others and not others:
                continue
            try:
                for k, waiting in others.items() if with_others else ():
                    draft.set(k, waiting.value)
                change(draft)
                config = checked(draft.data)
            except RefusedError as error:
                problems = error.problems
            except (KeyError, IndexError, TypeError):  # a section is gone that others were in
                problems = (Problem(key, "does not exist any more"),)
            else:
                self.waiting = {} if with_others else others
                self._take(draft.data, config)
                return None
        message = "; ".join(dict.fromkeys(_at(key, problem) for problem in problems))
        self.waiting = {**others, key: Waiting(value, message)}
        self.version += 1
        return message

    def _take(self, data: Data, config: RunConfig, text: str | None = None) -> None:
        self.version += 1
        self.text_problems = ()
        if data == self.data and text in (None, self.good_text):
            self.text = self.good_text
            return
        self._past = [*self._past[1 - _MAX_STEPS :], (self.data, self.good_text)]
        self._future = []
        self.data, self.config = data, config
        self.text = self.good_text = text_of(data) if text is None else text


def _at(key: Key, problem: Problem) -> str:
    """Return a problem as it is shown at a key: the place is named only if it is another one."""
    if key[: len(problem.key)] == problem.key:
        return problem.message
    inside = problem.key[len(key) :]
    if problem.key[: len(key)] != key:
        return str(problem)
    parts = (f"value {part + 1}" if isinstance(part, int) else part for part in inside)
    return f"{', '.join(parts)}: {problem.message}"  # as people count
