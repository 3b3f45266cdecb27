# SPDX-License-Identifier: Apache-2.0
"""The rooms of the Python package are those of the contract and of the page."""

from __future__ import annotations

import subprocess
import sys

from support_runs import ROOT


def test_the_page_of_concepts_shows_the_rooms_of_the_contract() -> None:
    check = [sys.executable, str(ROOT / "scripts" / "rooms.py"), "--check"]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"run scripts/rooms.py {done.stderr}"
