# SPDX-License-Identifier: Apache-2.0
"""For the web pages: functions that stubs only have as overloads, which griffe would leave out."""

from __future__ import annotations

from typing import Any

import griffe


class Overloads(griffe.Extension):  # type: ignore[misc]
    """Adds a function for each group of overloads, with all their signatures and docstrings."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Add those of all modules of a package."""
        _add(pkg)


def _add(scope: griffe.Module | griffe.Class) -> None:
    for name, overloads in scope.overloads.items():
        if not overloads or name in scope.members:
            continue
        function = griffe.Function(
            name, parameters=overloads[0].parameters, returns=overloads[0].returns
        )
        texts = dict.fromkeys(o.docstring.value for o in overloads if o.docstring)
        function.docstring = griffe.Docstring("\n\n".join(texts), parent=function)
        function.overloads = overloads
        scope.set_member(name, function)
    for member in scope.members.values():
        if isinstance(member, griffe.Module | griffe.Class):
            _add(member)
