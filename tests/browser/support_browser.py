# SPDX-License-Identifier: Apache-2.0
"""A window of a browser as the tests see it."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.by import By


class Browser:
    """A window of Chromium: `driver` is selenium's, the rest is what tests ask again and again."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, address: str | Path) -> None:
        """Load a file or an address, and forget what was loaded before."""
        self.driver.get("about:blank")
        self.console()
        self.requests()
        self.driver.get(address.as_uri() if isinstance(address, Path) else address)

    def run(self, script: str, *arguments: Any) -> Any:
        """Return what a script returns."""
        return self.driver.execute_script(script, *arguments)

    def wait(self, script: str, seconds: float = 10.0) -> Any:
        """Return what an expression gives, once it is true."""
        until = time.monotonic() + seconds
        while True:
            value = self.run(f"return {script}")
            if value:
                return value
            assert time.monotonic() < until, f"not true within {seconds:g} s: {script}"
            time.sleep(0.05)

    def still(self, selector: str) -> Any:
        """Return an element that is seen in mid-window, where it was a moment ago, or nothing."""
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
        """Click on an element once it can be: sections unfold slowly, fields are made anew."""
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
        """Return what the console told since it was asked last: errors, warnings, all else."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def requests(self) -> list[str]:
        """Return the addresses that were asked for since this was asked last, but for data URLs."""
        told = (json.loads(e["message"])["message"] for e in self.driver.get_log("performance"))
        asked = [one["params"]["request"]["url"] for one in told
                 if one["method"] == "Network.requestWillBeSent"]  # fmt: skip
        return [url for url in asked if not url.startswith("data:")]

    def screen(self, width: int, height: int, *, mobile: bool = False) -> None:
        """Give the window another size; a mobile one has two pixels for one."""
        metrics = {"width": width, "height": height, "mobile": mobile,
                   "deviceScaleFactor": 2 if mobile else 1}  # fmt: skip
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def dark(self, wanted: bool) -> None:
        """Prefer dark pages, or light ones."""
        feature = {"name": "prefers-color-scheme", "value": "dark" if wanted else "light"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})

    def reaches(self, script: str, wanted: float, seconds: float = 60.0) -> float:
        """Return the best value of an expression within a time: others may use the machine.

        It is asked every second, and no more once it is what was wanted.
        """
        until, best = time.monotonic() + seconds, -math.inf
        while best < wanted and time.monotonic() < until:
            time.sleep(1.0)
            best = max(best, float(self.run(f"return {script}")))
        return best
