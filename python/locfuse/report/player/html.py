# SPDX-License-Identifier: Apache-2.0
"""The player with its data as an HTML fragment that loads nothing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

# Starts every player of the page; `element.player` is for tests and the console.
_BEGIN = """
for (const data of document.querySelectorAll("script.locfuse-runs")) {
  const element = data.previousElementSibling;
  element.player = new LocfusePlayer(element, JSON.parse(data.textContent), {controls: true});
}
"""


@cache
def player_js() -> str:
    """Return the JavaScript of the class ``LocfusePlayer``."""
    return Path(__file__).with_name("player.js").read_text(encoding="utf-8")


@cache
def player_css() -> str:
    """Return the style of a player."""
    return Path(__file__).with_name("player.css").read_text(encoding="utf-8")


def player_script() -> str:
    """Return the script of a page: the class, and the start of the players of the page."""
    return player_js() + _BEGIN


def player_html(packed: Sequence[dict[str, Any]]) -> str:
    """Return an HTML fragment that plays runs on top of one another.

    They are from `pack`; the world of the first one is drawn. Style, data and script are inside;
    the script is `player_script`, which a page's Content-Security-Policy can allow by its hash.
    """
    # Escaped, so that no text of a user can close the element.
    data = json.dumps(list(packed), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return (
        f"<style>\n{player_css()}</style>\n"
        '<div class="locfuse-player"><noscript>The player needs JavaScript.</noscript></div>'
        f'<script type="application/json" class="locfuse-runs">{data}</script>\n'
        f"<script>{player_script()}</script>"
    )
