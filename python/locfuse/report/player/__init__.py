# SPDX-License-Identifier: Apache-2.0
"""Replays runs in a browser: packed as JSON by Python, played by plain JavaScript.

`pack` returns a run as JSON, `player_html` a fragment of a page that plays it without a network.
``player.js`` and ``player.css`` beside this file have no dependencies.
"""

from __future__ import annotations

from locfuse.report.player.html import player_css, player_html, player_js, player_script
from locfuse.report.player.packing import MAX_BYTES, pack

__all__ = ["MAX_BYTES", "pack", "player_css", "player_html", "player_js", "player_script"]
