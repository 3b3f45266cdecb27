# SPDX-License-Identifier: Apache-2.0
"""The page of the papers: readable on a narrow screen, valid links, no requests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from papers.page import PAGE, read_rows, write_page
from support_browser import Browser

ROWS = Path(__file__).resolve().parents[2] / "results" / "papers.json"


def test_claims_are_read_on_a_narrow_screen_and_links_lead_there(
    browser: Browser, tmp_path: Path
) -> None:
    write_page([replace(one, pictures=[]) for one in read_rows(ROWS)], tmp_path, quick=False)
    browser.open(tmp_path / PAGE)
    assert browser.requests() == [(tmp_path / PAGE).as_uri()]
    assert browser.console() == []
    links = browser.run("return [...document.links].map((a) => a.getAttribute('href'))")
    assert len(links) == 5  # to each paper
    assert all(browser.run("return !!document.querySelector(arguments[0])", to) for to in links)
    browser.screen(420, 900, mobile=True)
    assert browser.run("return document.documentElement.scrollWidth") <= 420
    ends = browser.run("""
        const claims = [...document.querySelectorAll(".claim div")];
        return claims.map((claim) => claim.getBoundingClientRect().right);""")
    assert len(ends) > 60
    assert max(ends) <= 420
