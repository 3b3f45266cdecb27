# SPDX-License-Identifier: Apache-2.0
"""A run to watch in a browser: packed small by Python, played by plain JavaScript.

`pack` makes of a run what JSON holds, `player_html` a fragment of a page that plays it without a
network. ``player.js`` and ``player.css`` beside this file are all there is to serve elsewhere.
"""

from __future__ import annotations

from locfuse.report.player.html import player_css, player_html, player_js, player_script
from locfuse.report.player.packing import MOST_BYTES, pack

__all__ = ["MOST_BYTES", "pack", "player_css", "player_html", "player_js", "player_script"]
