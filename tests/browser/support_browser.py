# SPDX-License-Identifier: Apache-2.0
"""A browser window for the tests."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.by import By


class Browser:
    """A window of Chromium: `driver` is selenium's, the rest are common helpers."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, address: str | Path) -> None:
        """Load a file or an address; clear earlier console messages and requests."""
        self.driver.get("about:blank")
        self.console()
        self.requests()
        self.driver.get(address.as_uri() if isinstance(address, Path) else address)

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a script and return its result."""
        return self.driver.execute_script(script, *arguments)

    def wait(self, script: str, seconds: float = 10.0) -> Any:
        """Return the value of an expression once it is true."""
        until = time.monotonic() + seconds
        while True:
            value = self.run(f"return {script}")
            if value:
                return value
            assert time.monotonic() < until, f"not true within {seconds:g} s: {script}"
            time.sleep(0.05)

    def still(self, selector: str) -> Any:
        """Return an element scrolled into view if it is visible and does not move, or None."""
        element = self.driver.find_element(By.CSS_SELECTOR, selector)
        where = (
            "const r = arguments[0].getBoundingClientRect(); return [r.x, r.y, r.width, r.height]"
        )
        self.run("arguments[0].scrollIntoView({block: 'center'})", element)
        before = self.run(where, element)
        time.sleep(0.1)
        now = self.run(where, element)
        return element if now == before and now[2] > 0 and now[3] > 0 else None

    def press(self, selector: str, seconds: float = 15.0) -> None:
        """Click on an element once possible: sections unfold slowly, fields are recreated."""
        until = time.monotonic() + seconds
        while True:
            try:
                if element := self.still(selector):
                    element.click()
                    return
                assert time.monotonic() < until, (
                    f"not to be clicked within {seconds:g} s: {selector}"
                )
            except WebDriverException:
                if time.monotonic() >= until:
                    raise

    def console(self) -> list[str]:
        """Return all console messages since the last call."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def requests(self) -> list[str]:
        """Return the requested addresses since the last call, except data URLs."""
        events = (json.loads(e["message"])["message"] for e in self.driver.get_log("performance"))
        urls = [one["params"]["request"]["url"] for one in events
                if one["method"] == "Network.requestWillBeSent"]  # fmt: skip
        return [url for url in urls if not url.startswith("data:")]

    def screen(self, width: int, height: int, *, mobile: bool = False) -> None:
        """Resize the window; a mobile one has a device pixel ratio of 2."""
        metrics = {"width": width, "height": height, "mobile": mobile,
                   "deviceScaleFactor": 2 if mobile else 1}  # fmt: skip
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def dark(self, wanted: bool) -> None:
        """Prefer dark pages, or light ones."""
        feature = {"name": "prefers-color-scheme", "value": "dark" if wanted else "light"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})

    def reaches(self, script: str, wanted: float, seconds: float = 60.0) -> float:
        """Return the maximum of an expression within a time, as the machine may be shared.

        It is evaluated every second until it reaches `wanted`.
        """
        until, best = time.monotonic() + seconds, -math.inf
        while best < wanted and time.monotonic() < until:
            time.sleep(1.0)
            best = max(best, float(self.run(f"return {script}")))
        return best
