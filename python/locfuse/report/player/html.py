# SPDX-License-Identifier: Apache-2.0
"""A player with its data as a fragment of a page that loads nothing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

# Shows every player of the page; `player` on its element is what a test or a console talks to.
_BEGIN = """
for (const data of document.querySelectorAll("script.locfuse-runs")) {
  const element = data.previousElementSibling;
  element.player = new LocfusePlayer(element, JSON.parse(data.textContent), {controls: true});
}
"""


@cache
def player_js() -> str:
    """Return the JavaScript of the class ``LocfusePlayer``."""
    return _file("player.js")


@cache
def player_css() -> str:
    """Return the style of a player."""
    return _file("player.css")


def _file(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def player_script() -> str:
    """Return what a page executes: the class, and the players of the page."""
    return player_js() + _BEGIN


def player_html(packed: Sequence[dict[str, Any]]) -> str:
    """Return a fragment of HTML that plays runs, one over the other.

    Parameters
    ----------
    packed : sequence of dict
        As `pack` returns them; the first one's world is drawn.

    Returns
    -------
    str
        With style, data and script inside; the script is `player_script`, which a page's
        Content-Security-Policy can allow by its hash.
    """
    # No text of a user can end the element: JSON may write "<" as a number.
    data = json.dumps(list(packed), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return (
        f"<style>\n{player_css()}</style>\n"
        '<div class="locfuse-player"><noscript>The player needs JavaScript.</noscript></div>'
        f'<script type="application/json" class="locfuse-runs">{data}</script>\n'
        f"<script>{player_script()}</script>"
    )
