# SPDX-License-Identifier: Apache-2.0
"""Calls from the server into the page."""

from __future__ import annotations

import json
from typing import Any

from nicegui import ui


def call(function: str, *arguments: Any) -> None:
    """Call a function of the page's ``studio``, once there is one."""
    texts = ", ".join(json.dumps(argument) for argument in arguments)
    ui.run_javascript(f"studio.{function}({texts})")
