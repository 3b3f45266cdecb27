# SPDX-License-Identifier: Apache-2.0
"""The paper's questions as pictures: wrong starts, GPS or laser, its mistakes, kidnapping, rays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from locfuse.report.plot.style import save
from locfuse.types import NANOSECONDS, FloatArray
from papers.gadau2022.kidnapping import kidnap, marks_of
from papers.gadau2022.plots import plot_errors, plot_kidnapping, plot_sensors
from papers.gadau2022.runs import microsimulation, ray_simulation
from papers.gadau2022.world import DURATION_S, LAYOUTS, SENSORS, SPEEDS, STEP_NS

SHOWN = 600  # steps of a kidnapping: the last minute


def draw_pictures(folder: Path, seeds: int) -> list[Path]:
    """Draw the first run of each kind."""
    del seeds  # one tells
    folder.mkdir(parents=True, exist_ok=True)
    time_s = np.arange(1, round(DURATION_S * 10) + 1) / 10.0
    starts = {name: microsimulation(name, "circle", 0).off_m for name in LAYOUTS}
    right = {
        "ours": microsimulation("square, near", "circle", 0, wrong=False).off_m,
        "derivatives of Fig. 2": microsimulation(
            "square, near", "circle", 0, wrong=False, mistake="derivatives"
        ).off_m,
        "ranges to the surface": microsimulation(
            "square, near", "circle", 0, wrong=False, mistake="surface"
        ).off_m,
    }
    rays = {
        f"theirs at {speed:g} m/s": ray_simulation(
            "5", speed, 0, by_rule=("derivatives", "surface")
        ).off_m
        for speed in SPEEDS
    }
    rays |= {f"ours at {speed:g} m/s": ray_simulation("5", speed, 0).off_m for speed in SPEEDS}
    drawn = [
        ("gadau_start", plot_errors(time_s, starts, "start 2 m and 60 degrees wrong")),
        ("gadau_sensors", _sensors(time_s)),
        ("gadau_mistakes", plot_errors(time_s, right, "right start, four landmarks")),
        ("gadau_kidnapped", _kidnapped()),
        ("gadau_rays", plot_errors(time_s, rays, "five discs, 151 rays")),
    ]
    paths = []
    for name, figure in drawn:
        paths.append(folder / f"{name}.png")
        save(figure, paths[-1])
    return paths


def _sensors(time_s: FloatArray) -> Figure:
    runs = {name: microsimulation("triangle", "circle", 0, sensors=SENSORS[name][1])
            for name in ("GPS", "laser")}  # fmt: skip
    found = {name: run.found for name, run in runs.items()}
    gps = runs["GPS"]
    return plot_sensors(marks_of("triangle"), gps.fixes, time_s, gps.truth, found)


def _kidnapped() -> Figure:
    ours = kidnap("triangle", 0, beside=True)
    assert ours.alone is not None
    first = len(ours.truth) - SHOWN
    time_s = np.arange(first + 1, len(ours.truth) + 1) * STEP_NS / NANOSECONDS
    found = {"RecoveringEkf": ours.found[first:], "PoseEkf alone": ours.alone[first:]}
    return plot_kidnapping(marks_of("triangle"), time_s, ours.truth[first:], found,
                           ours.put_down - first)  # fmt: skip
