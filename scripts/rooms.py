# SPDX-License-Identifier: Apache-2.0
"""Write the Python rooms of CONTRIBUTING.md from the import contract; --check compares."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

ROOT = Path(__file__).resolve().parent.parent
PACKAGE, PAGE = ROOT / "python" / "locfuse", ROOT / "CONTRIBUTING.md"
BEGIN, END = "<!-- rooms, by scripts/rooms.py -->\n", "<!-- end of the rooms -->\n"


def rooms() -> str:
    """Return the order of the rooms, lowest first, and what each contains."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    order = [layer.replace(" | ", ", ") for layer in reversed(layers)]
    lines = [
        "```text",
        "_core < " + " < ".join(order),
        "```",
        "",
        "| room | contents |",
        "|---|---|",
    ]
    for layer in order:
        for name in layer.split(", "):
            lines.append(f"| `{name}` | {contents(name)} |")
    return "\n".join(lines) + "\n"


def contents(room: str) -> str:
    """Return the first line of the docstring of a room."""
    file = PACKAGE / f"{room}.py"
    source = file if file.is_file() else PACKAGE / room / "__init__.py"
    text = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8")))
    assert text is not None, source
    return text.partition("\n")[0].rstrip(".").replace("``", "`")


def main() -> int:
    """Write the page; with --check return 1 where it is out of date."""
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(BEGIN)
    text = before + BEGIN + rooms() + END + rest.partition(END)[2]
    if "--check" in sys.argv:
        return int(text != page)
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
