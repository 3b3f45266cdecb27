# SPDX-License-Identifier: Apache-2.0
"""The report of a run in a browser: it plays, shows the numbers of the run, and prints."""

from __future__ import annotations

import base64
import csv
import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import load_config, parse_config
from locfuse.report.html_page import page
from locfuse.report.player import pack, player_html, player_script
from locfuse.report.results import write_results
from locfuse.run.run import run
from locfuse.types import RunResult
from support_browser import Browser

CONFIGS = Path(__file__).resolve().parents[2] / "examples" / "configs"
PLAYER = "document.querySelector('.locfuse-player').player"


@pytest.fixture(scope="module")
def room() -> RunResult:
    """Return a run of the paper's room with a wall, so that some ranges are rejected."""
    config = load_config(CONFIGS / "ekim_room.yaml").model_dump(mode="json")
    config["simulation"]["duration_s"] = 30
    config["simulation"]["faults"] = [{"kind": "nlos", "walls": [[2, 0.5, 2, 4]], "extra_m": 2.0}]
    return run(parse_config(config), seed=1)


@pytest.fixture(scope="module")
def report(room: RunResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_results(room, tmp_path_factory.mktemp("room"))


@pytest.fixture(scope="module")
def particles() -> RunResult:
    """Return 60 s of 2,000 particles on a map."""
    config = load_config(CONFIGS / "hallways_mcl_uwb.yaml").model_dump(mode="json")
    config["simulation"]["duration_s"] = 60
    config["mcl"] |= {"min_particles": 2000, "max_particles": 2000}
    return run(parse_config(config), seed=1)


def test_it_opens_from_disk_without_a_console_message_and_without_a_request(
    browser: Browser, report: Path
) -> None:
    browser.open(report)
    browser.wait(f"{PLAYER}.duration > 0")
    time.sleep(0.3)
    assert browser.console() == []
    assert browser.requests() == [report.as_uri()]


def test_the_policy_forbids_to_load_and_to_execute_anything_else(
    browser: Browser, report: Path
) -> None:
    browser.open(report)
    browser.run(
        "const one = document.createElement('script'); one.textContent = 'window.evil = 1';"
        "document.body.append(one);"
        "const two = new Image(); two.src = 'http://127.0.0.1:9/x.png'; document.body.append(two);"
    )
    time.sleep(0.3)
    assert browser.run("return window.evil") is None
    console = " ".join(browser.console())
    assert "script-src" in console
    assert "img-src" in console


def test_play_moves_time_and_pause_stops_it(browser: Browser, report: Path) -> None:
    browser.open(report)
    browser.run(f"window.events = []; for (const name of ['play', 'pause', 'end', 'time']) "
                f"{PLAYER}.on(name, () => events.push(name)); {PLAYER}.play(2)")  # fmt: skip
    began = time.monotonic()
    browser.wait(f"{PLAYER}.time > 1.5")
    took = time.monotonic() - began
    browser.run(f"{PLAYER}.pause()")
    at = browser.run(f"return {PLAYER}.time")
    time.sleep(0.3)
    assert browser.run(f"return {PLAYER}.time") == at
    assert 0.6 < took < 5.0
    events = browser.run("return events")
    assert (events[0], events[-1]) == ("play", "pause")
    assert "time" in events


def test_it_stops_at_the_end_and_restarts(browser: Browser, report: Path) -> None:
    browser.open(report)
    browser.run(f"{PLAYER}.on('end', () => window.ended = true); {PLAYER}.seek(29.5); "
                f"{PLAYER}.play(5)")  # fmt: skip
    browser.wait("window.ended")
    assert browser.run(f"return !{PLAYER}.playing && {PLAYER}.time === {PLAYER}.end")
    browser.run(f"{PLAYER}.play(1)")
    assert browser.run(f"return {PLAYER}.time") < 29.0


def test_seek_shows_the_pose_of_estimate_csv(browser: Browser, report: Path) -> None:
    with (report.parent / "estimate.csv").open() as file:
        rows = list(csv.DictReader(file))
    browser.open(report)
    for row in (rows[0], rows[len(rows) // 3], rows[-1]):
        time_s = float(row["stamp_s"]) - float(rows[0]["stamp_s"])
        pose = browser.run(f"{PLAYER}.seek(arguments[0]); return {PLAYER}.pose()", time_s)
        assert pose["x"] == pytest.approx(float(row["x_m"]), abs=1e-9)
        assert pose["y"] == pytest.approx(float(row["y_m"]), abs=1e-9)
        assert pose["heading"] == pytest.approx(float(row["heading_rad"]), abs=1e-6)


def test_between_two_estimates_the_pose_is_between_them(browser: Browser, report: Path) -> None:
    browser.open(report)
    before, after = (
        browser.run(f"{PLAYER}.seek(10); {PLAYER}.step({way}); return "
                    f"{{...{PLAYER}.pose(), t: {PLAYER}.time}}") for way in (1, 2)
    )  # fmt: skip
    assert after == before  # a step is one row, whatever its size
    later = browser.run(f"{PLAYER}.step(1); return {{...{PLAYER}.pose(), t: {PLAYER}.time}}")
    middle = browser.run(f"{PLAYER}.seek(arguments[0]); return {PLAYER}.pose()",
                         (before["t"] + later["t"]) / 2)  # fmt: skip
    assert middle["x"] == pytest.approx((before["x"] + later["x"]) / 2, abs=1e-9)


def test_keys_play_step_seek_and_change_the_speed(browser: Browser, report: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    browser.open(report)
    world = browser.driver.find_element("css selector", ".lp-world")
    world.send_keys(Keys.SPACE)
    assert browser.run(f"return {PLAYER}.playing") is True
    world.send_keys(Keys.SPACE)
    assert browser.run(f"return {PLAYER}.playing") is False
    browser.run(f"{PLAYER}.seek(10)")
    world.send_keys(Keys.ARROW_RIGHT)
    assert browser.run(f"return {PLAYER}.time") == 11.0
    world.send_keys(Keys.SHIFT, Keys.ARROW_LEFT)
    assert browser.run(f"return {PLAYER}.time") == 1.0
    world.send_keys(Keys.ARROW_UP)
    assert browser.run(f"return {PLAYER}.speed") == 2
    world.send_keys(".")
    assert browser.run(f"return {PLAYER}.time") == pytest.approx(1.0333, abs=1e-3)
    world.send_keys(Keys.END)
    assert browser.run(f"return {PLAYER}.time === {PLAYER}.end")


def test_the_slider_scrubs_and_everything_that_is_pressed_has_a_name(
    browser: Browser, report: Path
) -> None:
    browser.open(report)
    browser.run("const slider = document.querySelector('.lp-slider'); slider.value = 12.5; "
                "slider.dispatchEvent(new Event('input'))")  # fmt: skip
    assert browser.run(f"return {PLAYER}.time") == 12.5
    browser.wait("document.querySelector('.lp-clock').textContent.startsWith('12.50 s')")
    assert browser.run(
        "return document.querySelector('.lp-slider').getAttribute('aria-valuetext')"
    ).startswith("12.50 s of ")
    assert browser.run("return document.querySelector('.lp-decimated').textContent") == ""
    names = browser.driver.find_elements(
        "css selector", ".locfuse-player :is(button, input, select, canvas)"
    )
    assert len(names) > 10
    assert all(element.accessible_name for element in names)


def test_a_rejected_range_is_shown_with_its_reason(
    browser: Browser, report: Path, room: RunResult
) -> None:
    row = int(np.flatnonzero(room.outcomes.verdict == "gated")[0])
    origin = min(int(room.outcomes.stamp_ns.min()), int(room.estimate.stamp_ns.min()))
    time_s = (int(room.outcomes.stamp_ns[row]) - origin) / 1e9
    browser.open(report)
    browser.run(f"{PLAYER}.seek(arguments[0])", time_s)
    shown = browser.wait("document.querySelector('.lp-latest li b') && "
                         "document.querySelector('.lp-latest').innerText")  # fmt: skip
    limit = str(room.outcomes.reason[row]).rpartition("> ")[2]
    nis = f"{room.outcomes.nis[row]:.3g}"
    assert f"anchor {room.outcomes.anchor[row]}: NIS {nis} above the gate of {limit}" in shown


def test_layers_change_what_is_drawn(browser: Browser, report: Path) -> None:
    browser.open(report)
    picture = ("return new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => "
               "done(document.querySelector('.lp-world').toDataURL()))))")  # fmt: skip
    browser.run(
        f"{PLAYER}.seek(10); {PLAYER}.redraw(true)"
    )  # smoothing depends on how a line was drawn
    browser.press("[aria-label='Follow the robot']")
    browser.run(f"{PLAYER}._zoom(4)")  # or the ellipse would be smaller than the robot's mark
    time.sleep(0.5)  # until the layout has settled
    seen = {"all": browser.run(picture)}
    for layer in ("truth", "trail", "ellipse", "ranges", "fixes"):
        button = browser.driver.find_element("css selector", f"[data-layer={layer}]")
        button.click()
        assert button.get_attribute("aria-pressed") == "false"
        seen[layer] = browser.run(picture)
        button.click()
    assert len(set(seen.values())) == len(seen)
    assert browser.run(picture) == seen["all"]


def test_zoom_pan_follow_and_back(browser: Browser, report: Path) -> None:
    browser.open(report)
    view = f"return (({{cx, cy, scale}}) => [cx, cy, scale])({PLAYER}._world)"
    whole = browser.run(view)
    browser.press("[aria-label='Zoom in']")
    assert browser.run(view)[2] == pytest.approx(1.5 * whole[2])
    browser.press("[aria-label='Follow the robot']")
    middle = browser.run(f"const {{x, y}} = {PLAYER}.pose(); return [x, y]")
    assert browser.run(view)[:2] == middle
    browser.run(f"{PLAYER}.seek(20)")
    pose = browser.run(f"return {PLAYER}.pose()")
    browser.wait(f"Math.abs({PLAYER}._world.cx - {pose['x']}) < 1e-9")
    browser.press("[aria-label='Show all']")
    assert browser.run(view) == pytest.approx(whole)


def test_strips_show_less_time_by_the_wheel_and_keep_up(browser: Browser, report: Path) -> None:
    browser.open(report)
    window = f"return [{PLAYER}._strips.start, {PLAYER}._strips.end]"
    whole = browser.run(window)
    browser.run("const strips = document.querySelector('.lp-strips'), box = "
                "strips.getBoundingClientRect(); strips.dispatchEvent(new WheelEvent('wheel', "
                "{deltaY: -1000, ctrlKey: true, clientX: box.left + box.width / 2}))")  # fmt: skip
    begin, end = browser.run(window)
    assert end - begin == pytest.approx((whole[1] - whole[0]) * np.exp(-1.5))
    time.sleep(0.3)
    assert browser.run(window) == [begin, end]  # although the player is elsewhere
    assert begin < (whole[0] + whole[1]) / 2 < end
    browser.run(f"{PLAYER}.seek({end} + 3)")
    browser.wait(f"{PLAYER}._strips.start > {begin}")
    begin, end = browser.run(window)
    assert begin < browser.run(f"return {PLAYER}.time") < end
    browser.run("document.querySelector('.lp-strips').dispatchEvent(new MouseEvent('dblclick'))")
    assert browser.run(window) == pytest.approx(whole)


def test_60_seconds_of_2000_particles_play_smoothly(
    browser: Browser, particles: RunResult, tmp_path: Path
) -> None:
    assert {len(frame.particles) for frame in particles.frames} == {2000}
    report = write_results(particles, tmp_path)
    browser.open(report)
    packed = browser.run(f"return {PLAYER}.runs[0].particles.first.length")
    assert packed == len(particles.frames) + 1  # no frame of a minute is dropped

    browser.run(f"{PLAYER}.on('end', () => {PLAYER}.play()); {PLAYER}.seek(5); {PLAYER}.play(1)")
    assert browser.reaches(f"{PLAYER}.frames_per_s", 30.0) >= 30.0
    browser.press("[aria-label='Follow the robot']")
    assert browser.run(f"return {PLAYER}._world.follow")
    time.sleep(1.0)
    assert browser.reaches(f"{PLAYER}.frames_per_s", 30.0) >= 30.0
    assert browser.console() == []


def test_a_thinned_run_says_so(browser: Browser, room: RunResult, tmp_path: Path) -> None:
    file = tmp_path / "thin.html"
    file.write_text(page("t", player_html([pack(room, max_bytes=60_000)]), player_script()))
    browser.open(file)
    shown = browser.run("return document.querySelector('.lp-decimated').textContent")
    share = browser.run(f"const {{t, of}} = {PLAYER}.runs[0].estimate; return t.length / of")
    assert f"estimate {int(np.ceil(100 * share))} %" in shown
    assert share < 0.5


def test_runs_are_overlaid_in_colours_and_hidden(
    browser: Browser, room: RunResult, tmp_path: Path
) -> None:
    half = replace(room, config={**room.config, "name": "every second"})
    file = tmp_path / "two.html"
    file.write_text(page("two", player_html([pack(room), pack(half)]), player_script()))
    browser.open(file)
    swatches = browser.run("return [...document.querySelectorAll('.lp-swatch')].map(one => "
                           "getComputedStyle(one).backgroundColor)")  # fmt: skip
    assert len(set(swatches)) == 2
    assert "every second" in browser.run("return document.querySelector('.lp-runs').innerText")
    browser.driver.find_elements("css selector", ".lp-runs input")[0].click()
    assert browser.run(f"return {PLAYER}.shown().name") == "every second"
    browser.run(f"{PLAYER}.show([{PLAYER}.runs[1].packed])")
    assert browser.run(f"return {PLAYER}.runs.map(run => run.name)") == ["every second"]
    browser.run(f"{PLAYER}.destroy()")
    assert browser.run("return document.querySelector('canvas')") is None
    assert browser.console() == []


def test_runs_that_begin_at_different_messages_keep_their_clocks(
    browser: Browser, room: RunResult, tmp_path: Path
) -> None:
    late = pack(room)
    late["start_ns"] = str(int(late["start_ns"]) + 2_000_000_000)
    other = pack(room)
    other["start_ns"] = str(int(other["start_ns"]) + 10**18)
    file = tmp_path / "late.html"
    file.write_text(page("late", player_html([pack(room), late, other]), player_script()))
    browser.open(file)
    assert browser.run(f"return {PLAYER}.runs.map(run => run.start)") == [0, 2, 0]
    shifted, first = browser.run(f"{PLAYER}.seek(7); const a = {PLAYER}.pose(1); {PLAYER}.seek(5); "
                                 f"return [a.x, {PLAYER}.pose(0).x]")  # fmt: skip
    assert shifted == pytest.approx(first, abs=1e-9)


def test_light_dark_and_phone(browser: Browser, report: Path) -> None:
    browser.open(report)
    corner = ("return new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => "
              "done([...document.querySelector('.lp-world').getContext('2d')"
              ".getImageData(2, 2, 1, 1).data].slice(0, 3)))))")  # fmt: skip
    assert browser.run(corner) == [255, 255, 255]
    browser.dark(True)
    browser.wait("document.querySelector('.locfuse-player').dataset.theme === 'dark'")
    assert max(browser.run(corner)) < 60
    browser.screen(390, 844, mobile=True)
    browser.wait("innerWidth === 390")
    wide = browser.run("return document.documentElement.scrollWidth")
    assert wide <= 390, "the page scrolls sideways"
    box = "document.querySelector('{}').getBoundingClientRect()"
    side, world = box.format(".lp-side"), box.format(".lp-world")
    assert browser.run(f"return {side}.top > {world}.bottom")


@pytest.mark.parametrize("dark", [False, True])
def test_paper_shows_one_still_picture_in_light_colours(
    dark: bool, browser: Browser, report: Path
) -> None:
    browser.dark(dark)
    browser.open(report)
    browser.run("window.addEventListener('beforeprint', () => window.printed = "
                "document.querySelector('.lp-world').toDataURL('image/png'))")  # fmt: skip
    printed = browser.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    pdf = base64.b64decode(printed["data"])
    assert pdf.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 8
    assert _darkness(browser.run("return window.printed")) < 0.2
    theme = browser.run("return document.querySelector('.locfuse-player').dataset.theme")
    assert theme == ("dark" if dark else "light")
    assert browser.run(f"return {PLAYER}.time") == 0.0


def _darkness(url: str) -> float:
    """Return the fraction of dark pixels of an image."""
    import io

    from PIL import Image

    data = base64.b64decode(url.partition(",")[2])
    grey: Any = np.asarray(Image.open(io.BytesIO(data)).convert("L"))
    return float(np.mean(grey < 100))
