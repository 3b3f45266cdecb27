# SPDX-License-Identifier: Apache-2.0
"""The paper's questions as pictures: wrong starts, its mistakes, kidnapping."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from locfuse import _core
from locfuse.gadau.kidnapping import kidnap, marks_of
from locfuse.gadau.runs import microsimulation
from locfuse.gadau.world import DURATION_S, LAYOUTS, STEP_NS, filter_config, known, seen_by, told
from locfuse.plot.gadau import plot_errors, plot_kidnapping
from locfuse.plot.style import save
from locfuse.types import NANOSECONDS, FloatArray

SHOWN = slice(-600, None)  # steps of a kidnapping: the last minute


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
    drawn = [
        ("gadau_start", plot_errors(time_s, starts, "start 2 m and 60 degrees wrong")),
        ("gadau_mistakes", plot_errors(time_s, right, "right start, four landmarks")),
        ("gadau_kidnapped", _kidnapped()),
    ]
    paths = []
    for name, figure in drawn:
        paths.append(folder / f"{name}.png")
        save(figure, paths[-1])
    return paths


def _kidnapped() -> Figure:
    ours = kidnap("triangle", 0)
    alone = _alone(ours.truth, 0)
    time_s = np.arange(1, len(ours.truth) + 1) * STEP_NS / NANOSECONDS
    first = len(time_s) + (SHOWN.start or 0)
    return plot_kidnapping(
        marks_of("triangle"), time_s[SHOWN], ours.truth[SHOWN],
        {"RecoveringEkf": ours.found[SHOWN], "PoseEkf alone": alone[SHOWN]}, ours.put_down - first,
    )  # fmt: skip


def _alone(truth: FloatArray, seed: int) -> FloatArray:
    """Return the poses of a PoseEkf on the same way, which knows no alarm."""
    rng = np.random.default_rng(seed)
    marks = marks_of("triangle")
    ekf = _core.PoseEkf(filter_config(), _core.AnchorMap([]), [],
                        _core.PoseEstimate(0, _core.Pose2(*truth[0]), np.diag([0.05] * 3) ** 2),
                        known(marks))  # fmt: skip
    poses = [truth[0]]
    for k, (here, there) in enumerate(pairwise(truth)):
        begin, end = k * STEP_NS, (k + 1) * STEP_NS
        # What carries a robot off turns no wheel.
        carried = np.hypot(*(there - here)[:2]) > 1.0
        ekf.on(_core.Increment(begin, end, told(there if carried else here, there, rng)))
        ekf.on_joint([_core.RangeBearing(end, None, distance, bearing)
                      for distance, bearing in seen_by(there, marks, rng).tolist()])  # fmt: skip
        pose = ekf.estimate().pose
        poses.append(np.array([pose.x, pose.y, pose.heading]))
    return np.array(poses)
