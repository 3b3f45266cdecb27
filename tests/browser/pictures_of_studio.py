# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures of docs/studio.md: ``python -m pytest tests/browser/pictures_of_studio.py``.

Each is taken of a page whose form and drawing board say the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from support_browser import Browser
from test_studio_in_browser import Page, Served, serve

__all__ = ["serve"]

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
ROOM = {
    "name": "my room",
    "simulation": {
        "room_m": [10.0, 10.0],
        "duration_s": 60.0,
        "anchors": {"A1": [0.0, 0.0, 0.0], "A2": [10.0, 0.0, 0.0], "A3": [10.0, 10.0, 0.0],
                    "A4": [0.0, 10.0, 0.0], "A5": [5.0, 0.0, 0.0]},
        "landmarks": {"L1": [2.5, 5.5], "L2": [7.0, 3.2]},
        "landmark_radius_m": 0.15,
        "ranges": {}, "poses": None, "laser": {},
        "map": {"walls": [[4.0, 7.0, 4.0, 10.0], [6.0, 0.0, 6.0, 1.0]]},
        "path": {"shape": "points", "closed": True, "speed_mps": 0.6,
                 "points_m": [[1.5, 1.5], [8.5, 1.8], [8.8, 8.8], [5.2, 8.4], [3.6, 5.2],
                              [1.5, 8.5]]},
        "faults": [{"kind": "nlos", "walls": [[5.5, 5.8, 7.6, 7.2]], "extra_m": 0.8,
                    "sigma_m": 0.2}],
    },
    "mcl": {"poses_hz": 2.0},
    "use": ["odometry", "ranges", "poses"],
}  # fmt: skip


# Computes for half a minute.
SLOW = {
    **ROOM,
    "mcl": {"min_particles": 60_000, "max_particles": 60_000, "beams": 180},
    "use": ["odometry", "ranges"],
}


@pytest.fixture
def scene(request: pytest.FixtureRequest) -> Any:
    return getattr(request, "param", ROOM)


@pytest.fixture
def page(
    browser: Browser, serve: Callable[..., Served], tmp_path: Path, scene: dict[str, Any]
) -> Page:
    (tmp_path / "room.yaml").write_text(yaml.safe_dump(scene, sort_keys=False))
    page = Page(browser, serve(str(tmp_path / "room.yaml"))).open()
    browser.wait("studio.editor.found && studio.editor.found.way.length > 10", 60)
    browser.wait("!!studio.editor.picture")
    return page


def taken(page: Page, name: str) -> None:
    time.sleep(0.6)  # until animations have ended
    page.browser.driver.save_screenshot(str(IMAGES / f"studio_{name}.png"))


def test_world(page: Page) -> None:
    page.drag((5.0, 0.0), (4.0, 1.0), (3.2, 2.0))
    page.until_scene(lambda scene: scene["simulation"]["anchors"]["A5"] == [3.2, 2.0, 0.0])
    for index, value in enumerate(("3.2", "2", "0")):
        page.shows(f"simulation.anchors.A5.{index}", value)
    page.browser.wait("!studio.editor.asking && studio.editor.busy.hidden")
    taken(page, "world")


def test_error(page: Page) -> None:
    page.section("room")
    page.section("sensors")
    page.unfold("simulation.ranges")
    page.type("simulation.ranges.rate_hz", "-5")
    page.type("simulation.ranges.sigma_m", "a lot")
    assert page.message("simulation.ranges.sigma_m") == "expected a number"
    taken(page, "error")


@pytest.mark.parametrize("scene", [SLOW], indirect=True)
def test_live(page: Page) -> None:
    page.click("tab-run")
    page.click("choice-odometry_uwb")
    page.click("run")
    page.browser.wait("studio.player && studio.player.live && studio.player.newest() > 20", 120)
    page.browser.wait("studio.player.time > 16", 60)
    assert page.browser.run("return studio.player.more")
    taken(page, "live")


def test_run_and_compare(page: Page) -> None:
    page.click("tab-run")
    for key in ("odometry", "odometry_uwb"):
        page.click(f"choice-{key}")
    page.click("run")
    for key in ("as_set", "odometry", "odometry_uwb"):
        page.ran(1, key, 180)
    page._until((page.served.folder / "runs/001/odometry_uwb/report.html").exists, 120)
    page.browser.wait("studio.player.runs.length === 3 && studio.player.runs[0].particles")
    # A moment with a scan, a particle cloud and more than one rejected range.
    page.browser.run("""
        const {player} = studio, run = player.runs[0], {messages} = run;
        const many = (t) => run.turned_down.filter((row) => run.source(row) === "ranges"
          && messages.t[row] <= t && messages.t[row] > t - 0.3).length;
        let best = 20;
        for (let t = 12; t < 55; t += 0.1) if (many(t) > many(best)) best = t;
        player.seek(best);
        studio.best = many(best);""")
    assert page.browser.run("return studio.best") >= 1
    taken(page, "run")
    # Zoom on the robot: its ellipse, its particles and the end points of its beams.
    page.browser.run("""
        const {player} = studio;
        player.runs[1].visible = player.runs[2].visible = false;
        player.redraw(true);
        document.querySelector('[aria-label="Follow the robot"]').click();
        player._world.zoom(5);
        player._world.centre(player.pose(0));
        player.redraw(true);""")
    time.sleep(0.6)
    stage = page.browser.driver.find_element("css selector", ".lp-stage")
    stage.screenshot(str(IMAGES / "studio_robot.png"))
    page.browser.run("document.querySelector('.st-right').scrollTo(0, 1e6)")
    taken(page, "compare")
