# SPDX-License-Identifier: Apache-2.0
"""Self-contained HTML pages: one file with the pictures inside, for light and dark themes."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from html import escape
from pathlib import Path

# The Content-Security-Policy lets the browser load nothing and execute only the script of the page,
# which it identifies by its hash.
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; img-src data:; style-src 'unsafe-inline'{script}">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
{body}
</main>
</body>
</html>
"""
_STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8").partition("\n")[2]


def page(title: str, body: str, script: str = "") -> str:
    """Return a whole page; `body` is HTML, `title` text, `script` all it may execute."""
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    allowed = f"; script-src 'sha256-{digest}'" if script else ""
    return _PAGE.format(title=escape(title), style=_STYLE, body=body, script=allowed)


def png_address(png: bytes) -> str:
    """Return the address of a picture that is in the address itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def picture(name: str, heading: str, caption: str, file: Path) -> str:
    """Return a PNG with a heading and a caption, held in the page itself."""
    return (
        f'<h2 id="{name}">{escape(heading)}</h2>\n<figure><figcaption><p class="quiet">'
        f'{escape(caption)}</p></figcaption><div class="wide"><img alt="{escape(heading)}" '
        f'src="{png_address(file.read_bytes())}"></div></figure>'
    )


def table(name: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; its cells are escaped here and nowhere else."""
    lines = ["<tr>" + "".join(f"<th>{escape(c)}</th>" for c in head) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows]
    body = "\n".join(lines)
    return f'<div class="wide"><table id="{name}-table">\n{body}\n</table></div>'
