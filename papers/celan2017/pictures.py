# SPDX-License-Identifier: Apache-2.0
"""The paper's figures with our runs: laps (9 to 12), doubt (13 and 14), eights (15)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from locfuse.report.plot.style import save
from locfuse.sim.sensors import seconds
from locfuse.types import NANOSECONDS, FloatArray
from papers.celan2017.comparison import runs_of
from papers.celan2017.eight import METHODS, NAMES, ride
from papers.celan2017.plots import (
    Track,
    plot_doubt,
    plot_eight,
    plot_laps,
    plot_radios,
    plot_sigmas,
)
from papers.celan2017.runs import BLIND_S, SEEN_S, SETUPS, Run, tag_poses
from papers.celan2017.world import LEAST_RANGES, Lap, lap

SEED = 11  # whose wheels drift as theirs did
LAPS = ("odometry", "lidar", "covered", "covered_switch", "hall", "hall_switch")
DOUBTS = ("hall", "hall_switch")
SIGMAS = ("hall", "hall_switch", "covered")
STRETCH_S = (12.0, 34.0)  # of Fig. 15


def draw_pictures(folder: Path, seeds: int) -> list[Path]:
    """Draw one lap and one ride into a folder; return the paths."""
    del seeds  # one tells
    folder.mkdir(parents=True, exist_ok=True)
    of, runs = lap(SEED), runs_of(SEED)
    drawn = [
        ("celan_laps", _laps(of, runs)),
        ("celan_radios", _radios(of, runs)),
        ("celan_doubt", _doubt(of, runs)),
        ("celan_sigmas", _sigmas(runs)),
        ("celan_eight", _eight()),
    ]
    paths = []
    for name, figure in drawn:
        paths.append(folder / f"{name}.png")
        save(figure, paths[-1])
    return paths


def _laps(of: Lap, runs: dict[str, Run]) -> Figure:
    tracks = [Track(_told(name, runs[name]), runs[name].truth, runs[name].estimate)
              for name in LAPS]  # fmt: skip
    return plot_laps(of.floor.map, _anchors(of), tracks)


def _told(name: str, run: Run) -> str:
    metres, degrees = np.hypot(*run.end[:2]), abs(np.rad2deg(run.end[2]))
    acted = "" if "switch" not in name else f", {len(run.injections)} injections"
    return f"{SETUPS[name].text}: {metres:.2f} m, {degrees:.1f} deg{acted}"


def _radios(of: Lap, runs: dict[str, Run]) -> Figure:
    fixes = np.array([[z.pose.x, z.pose.y] for z in tag_poses(of.fixes)])
    track = Track(f"{SETUPS['lidar'].text}, and UWB where {LEAST_RANGES} anchors are heard",
                  runs["lidar"].truth, runs["lidar"].estimate)  # fmt: skip
    return plot_radios(of.floor.map, _anchors(of), track, fixes)


def _doubt(of: Lap, runs: dict[str, Run]) -> Figure:
    tracks = []
    for name in DOUBTS:
        run = runs[name]
        last = seconds(run.stamp_ns) > of.duration_s - BLIND_S - SEEN_S
        tracks.append(Track(f"{SETUPS[name].text}: the end", run.truth[last], run.estimate[last],
                            run.covariance[last], run.injections))  # fmt: skip
    return plot_doubt(of.floor.map, _anchors(of), tracks)


def _sigmas(runs: dict[str, Run]) -> Figure:
    run = runs[SIGMAS[0]]
    edges = np.flatnonzero(np.diff(run.in_room.astype(int), prepend=0, append=0))
    time_s = seconds(run.stamp_ns)
    grey = time_s[np.minimum(edges, len(time_s) - 1)].reshape(-1, 2)
    return plot_sigmas({SETUPS[name].text: seconds(runs[name].stamp_ns) for name in SIGMAS},
                       {SETUPS[name].text: runs[name].sigma_in_body for name in SIGMAS},
                       grey)  # fmt: skip


def _eight() -> Figure:
    of = ride(SEED)
    begin, end = STRETCH_S
    tracks = {}
    for name, method in METHODS.items():
        found = method(of)
        time_s = found.stamp_ns / NANOSECONDS
        tracks[NAMES[name]] = found.position[(time_s >= begin) & (time_s <= end)]
    truth = of.drive.pose_at(np.linspace(begin, end, 400))[:, :2]
    return plot_eight(truth, tracks, f"from {begin:g} s to {end:g} s of an eight")


def _anchors(of: Lap) -> FloatArray:
    return np.array(list(of.floor.anchors.values()))[:, :2]
