# SPDX-License-Identifier: Apache-2.0
"""Makes the picture of results/papers.md: ``python -m pytest tests/browser/pictures_of_papers.py``.

It shows the page written by ``locfuse reproduce all --out out/papers``, with the seeds of
results/papers.json.
"""

from __future__ import annotations

from pathlib import Path

from papers.page import PAGE, ROWS, read_rows
from support_browser import Browser

ROOT = Path(__file__).resolve().parents[2]
LEFT = ROOT / "out" / "papers"


def test_top_and_first_paper(browser: Browser) -> None:
    found, committed = (read_rows(file) for file in (LEFT / ROWS, ROOT / "results" / "papers.json"))
    assert [one.seeds for one in found] == [one.seeds for one in committed]
    browser.open(LEFT / PAGE)
    browser.screen(1200, 1500)
    browser.driver.save_screenshot(str(ROOT / "results" / "images" / "papers_page.png"))
    assert browser.requests() == [(LEFT / PAGE).as_uri()]
