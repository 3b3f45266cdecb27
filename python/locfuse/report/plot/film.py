# SPDX-License-Identifier: Apache-2.0
"""Animation of a localization on a map: particles, estimate and truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.lines import Line2D
from matplotlib.text import Text

from locfuse import _core
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import interpolate
from locfuse.io.whole import whole_file
from locfuse.report.plot import style
from locfuse.report.plot.world import box_around, draw_map, drawable, world_figure
from locfuse.run.mcl import frame_of, live_mcl, mcl_of, messages_for, scan_arrivals_of
from locfuse.run.odometry import with_odometry
from locfuse.run.start import scans_of
from locfuse.types import (
    NANOSECONDS,
    UNKNOWN,
    ConfigError,
    FloatArray,
    Frame,
    RunResult,
    Trajectory,
)

_AFTER_S = 6.0  # shown after the pose is found
_NEVER_S = 60.0  # shown if it never is
_FRAMES_PER_S = 8
_MAX_FRAMES = 120
_LAST_FRAMES = 12  # repetitions of the last frame
_DPI = 64


def write_film(result: RunResult, path: Path) -> Path:
    """Localize again and write the particles after each scan as an animated GIF.

    The configuration of the run has ``mcl``, and the path ends in ``.gif``; it is returned. Raises
    ConfigError as `check_film`.
    """
    config = RunConfig.model_validate(dict(result.config))
    check_film(config, path)
    frames = record(config, result)
    shown = frames[:: -(-len(frames) // _MAX_FRAMES)]
    shown += [frames[-1]] * _LAST_FRAMES
    stage = _Stage(result, frames[0].stamp_ns)
    writer = PillowWriter(fps=_FRAMES_PER_S)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part, writer.saving(stage.figure, str(part), _DPI):
        for frame in shown:
            stage.show(frame)
            writer.grab_frame()
    return path


def check_film(config: RunConfig, path: Path) -> None:
    """Raise ConfigError before the work if no film can be made.

    The configuration must have an ``mcl``, and the path must end in ``.gif``.
    """
    if config.mcl is None:
        raise ConfigError("a film shows the particles of mcl; add 'mcl: {}' to the configuration")
    if path.suffix.lower() != ".gif":
        raise ConfigError(f"{path}: a film is a GIF; give it a name that ends in .gif")


def record(config: RunConfig, result: RunResult) -> list[Frame]:
    """Return a frame per scan, from the start until a while after the pose was found."""
    made = config.scan_odometry is not None  # and is what the result has
    log = result.log if made else with_odometry(result.log, config)
    messages = messages_for(config, log)
    mcl = live_mcl(config, mcl_of(config, log, messages))
    ready_s = result.metrics["mcl"]["ready_s"]
    shown_s = _NEVER_S if ready_s is None else ready_s + _AFTER_S
    end = mcl.estimate().stamp + round(shown_s * NANOSECONDS)
    scans = scans_of(result.log)
    arrivals = scan_arrivals_of(result.log) or [scan.stamp for scan in scans]
    shown = [i for i, scan in enumerate(scans) if scan.stamp <= end]
    frames: list[Frame] = []
    _core.localize(mcl, messages.log, [scans[i] for i in shown], [arrivals[i] for i in shown],
                   lambda *_: frames.append(frame_of(mcl)))  # fmt: skip
    return frames


class _Stage:
    """A figure whose marks move from frame to frame."""

    def __init__(self, result: RunResult, origin_ns: int) -> None:
        assert result.log.grid is not None
        self._truth = result.truth
        self._origin_ns = origin_ns
        grid = result.log.grid
        known = grid.to_world(np.argwhere(grid.cells != UNKNOWN)[:, ::-1].astype(float))
        low, high = box_around(known, 0.02, 0.4, 0.9)
        self.figure, axes = world_figure(low, high, 1.5)
        axes.grid(visible=False)
        draw_map(axes, drawable(grid, float((high - low)[0])))
        self._cloud: PathCollection = axes.scatter(
            [], [], s=7.0, color=style.ESTIMATE, alpha=0.6, linewidths=0, zorder=3
        )
        self._true = _Arrow(axes, style.TRUTH, "truth", ring=True)
        self._estimate = _Arrow(axes, style.REJECTED, "estimate", ring=False)
        look: dict[str, Any] = {"fontsize": 16, "pad": 10}
        self._clock: Text = axes.set_title("0.0 s", loc="right", color=style.INK, **look)
        self._status: Text = axes.set_title("ambiguous", loc="left", fontweight="bold", **look)
        particle = Line2D(
            [], [], ls="none", marker="o", ms=4, color=style.ESTIMATE, label="particle"
        )
        style.legend(self.figure, [particle, self._estimate.handle, self._true.handle])
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # a layout per frame would make the picture jitter

    def show(self, frame: Frame) -> None:
        self._cloud.set_offsets(frame.particles[:, :2])
        self._estimate.point(frame.pose)
        self._true.point(_pose_at(self._truth, frame.stamp_ns))
        seconds = (frame.stamp_ns - self._origin_ns) / NANOSECONDS
        self._clock.set_text(f"{seconds:.1f} s")
        self._status.set_text("ready" if frame.ready else "ambiguous")
        self._status.set_color(style.ANCHOR if frame.ready else style.REJECTED)


class _Arrow:
    """A pose as a dot or ring with a line ahead."""

    def __init__(self, axes: Axes, colour: str, label: str, *, ring: bool) -> None:
        self._reach = 0.04 * float(np.ptp(axes.get_xlim()))
        (self._line,) = axes.plot([], [], color=colour, lw=2.5, zorder=5)
        size, fill, edge, width = (14, "none", colour, 2.0) if ring else (9, colour, "white", 1.0)
        nowhere = np.empty((0, 2))
        (self.handle,) = style.marks(
            axes, nowhere, "o", size, fill, label, mec=edge, mew=width, zorder=6
        )

    def point(self, pose: FloatArray | None) -> None:
        if pose is None:
            self._line.set_data([], [])
            self.handle.set_data([], [])
            return
        x, y, heading = pose.tolist()
        ahead = x + self._reach * np.cos(heading), y + self._reach * np.sin(heading)
        self._line.set_data([x, ahead[0]], [y, ahead[1]])
        self.handle.set_data([x], [y])


def _pose_at(truth: Trajectory | None, stamp_ns: int) -> FloatArray | None:
    """Return the true pose at a stamp; None where it is unknown."""
    if truth is None or truth.heading is None or len(truth) == 0:
        return None
    at, inside = interpolate(truth, np.array([stamp_ns], dtype=np.int64))
    if not inside[0] or at.heading is None:
        return None
    return np.array([*at.position[0], at.heading[0]])
