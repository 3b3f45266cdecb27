# SPDX-License-Identifier: Apache-2.0
"""Figures of recordings: drives among cylinders, maps of landmarks, errors of outliers."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from locfuse.report.palette import ELLIPSE_SIGMAS
from locfuse.report.plot.style import (
    ANCHOR,
    ESTIMATE,
    ESTIMATE_PALE,
    MUTED,
    REJECTED,
    TRUTH,
    Handle,
    dress,
    legend,
    new_figure,
    time_axis,
    title,
)
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, StampArray, Trajectory
from papers.figures import save_figures
from papers.recordings.cylinder_localization import arena_drive, load_drive, park_drive
from papers.recordings.uwb_3d import load_flight, true_at
from papers.recordings.uwb_outliers import CASES, OUTLIER_M, Case, distances, fly, robust_config
from papers.recordings.victoria_park import CHAINS, antenna_of, mapped_by


def draw_drives(folder: Path, configs: Path | None) -> list[Path]:
    """Draw the drives among cylinders whose recordings are there; return the paths."""
    figures = {}
    for name, drive_of in (("acfr_carpark", park_drive), ("lego_arena", arena_drive)):
        with suppress(LogError):
            log = load_drive(configs, name)
            drive, wheels = drive_of(log), drive_of(log, blind=True)
            poles = np.column_stack([log["landmarks"]["x_m"], log["landmarks"]["y_m"]])
            found = {"wheels alone": wheels.position, "wheels and cylinders": drive.position}
            figures[name] = plot_drive(poles, drive.reference, drive.stamp_ns, found)
    return save_figures(figures.items(), folder)


def draw_trees(folder: Path, configs: Path | None) -> list[Path]:
    """Draw the map of trees of each chain, if the recording is there; return the paths."""
    figures = {}
    for chain in CHAINS:
        with suppress(LogError):
            mapped = mapped_by(configs, chain)
            fixes, mapping = mapped.log["positions"], mapped.mapping
            gps = np.column_stack([fixes["x_m"], fixes["y_m"]])
            figures[f"victoria_park_{chain}"] = plot_landmarks(
                antenna_of(mapping.estimate), mapping.position, mapping.covariance, gps,
                "GPS, not used")  # fmt: skip
    return save_figures(figures.items(), folder)


def draw_outliers(folder: Path, configs: Path | None) -> list[Path]:
    """Draw the cases whose recordings are there into a folder; return the paths."""
    figures = {}
    for name, case in CASES.items():
        with suppress(LogError):
            log = load_flight(configs, case.recording)
            figures[name.replace(" ", "_")] = _outliers(name, case, log)
    return save_figures(figures.items(), folder)


def _outliers(name: str, case: Case, log: Log) -> Figure:
    flown = fly(case, log, 0, robust_config())
    begin = flown.whole.stamp_ns[0]
    known = true_at(log, flown.whole.stamp_ns)[2]
    stamps = log["ranges"]["stamp_ns"]
    used = stamps >= begin
    return plot_outliers(
        name,
        (flown.whole.stamp_ns[known] - begin) / NANOSECONDS,
        {
            "Gaussian, gated": distances(flown.gated, log),
            "robust": distances(flown.whole, log),
            "robust, without outliers": distances(flown.clean, log),
        },
        (stamps[used] - begin) / NANOSECONDS,
        flown.off[used],
        flown.gated.gated[used],
        OUTLIER_M,
    )


_COLOURS = (REJECTED, ESTIMATE)


def plot_drive(
    cylinders: FloatArray,
    reference: FloatArray,
    stamp_ns: StampArray,
    found: Mapping[str, FloatArray],
) -> Figure:
    """Draw the drive, and beside it distances from the reference over time.

    Parameters
    ----------
    cylinders : float64 array, shape (m, 2)
    reference : float64 array, shape (n, 2)
    stamp_ns : int64 array, shape (n,)
    found : mapping of method to positions, float64 array, shape (n, 2)
        At most two, the better one last.
    """
    figure = new_figure(4.8)
    way, off = figure.subplots(1, 2)
    dress(way)
    dress(off)
    time_s = (stamp_ns - stamp_ns[0]) / NANOSECONDS
    handles = way.plot(*cylinders.T, "o", color=ANCHOR, ms=5, label="cylinders")
    handles += way.plot(*reference.T, color=TRUTH, lw=3.0, alpha=0.3, label="reference")
    for (name, position), colour in zip(found.items(), _COLOURS, strict=False):
        handles += way.plot(*position.T, color=colour, lw=1.2, label=name)
        off.plot(time_s, 100.0 * np.hypot(*(position - reference).T), color=colour, lw=1.2)
    way.set_aspect("equal", adjustable="datalim")
    way.set(xlabel="x [m]", ylabel="y [m]")
    time_axis(off, time_s)
    off.set_ylabel("off the reference [cm]")
    off.set_ylim(bottom=0.0)
    title(way, "the drive")
    title(off, "how far off")
    legend(figure, handles)
    return figure


def plot_landmarks(
    estimate: Trajectory,
    landmarks: FloatArray,
    covariance: FloatArray,
    beside: FloatArray,
    label: str,
) -> Figure:
    """Return the map in world.

    Parameters
    ----------
    estimate : Trajectory
    landmarks : float64 array, shape (m, 2)
    covariance : float64 array, shape (m, 2, 2)
        Of the landmarks.
    beside : float64 array, shape (n, 2)
        Positions to compare the path with.
    label : str
        What they are.
    """
    figure = new_figure(9.0)
    axes = figure.subplots()
    dress(axes)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    (other,) = axes.plot(*beside.T, ".", color=MUTED, ms=2, label=label)
    (path,) = axes.plot(*estimate.position.T, "-", color=ESTIMATE, lw=1.2, label="estimate")
    for centre, spread in zip(landmarks, covariance, strict=True):
        variance, axis = np.linalg.eigh(spread)
        width, height = 2.0 * ELLIPSE_SIGMAS * np.sqrt(np.maximum(variance, 0.0))
        angle = float(np.rad2deg(np.arctan2(axis[1, 0], axis[0, 0])))
        axes.add_patch(
            Ellipse(centre, width, height, angle=angle, fill=False, color=ANCHOR, lw=0.6)
        )
    axes.plot(*landmarks.T, "o", color=ANCHOR, ms=3)
    mark = Line2D([], [], color=ANCHOR, marker="o", ms=3, ls="none",
                  label=f"landmarks, ellipses of {ELLIPSE_SIGMAS:g} sigma")  # fmt: skip
    legend(figure, [path, other, mark])
    return figure


_TICKS = (-100.0, -10.0, -1.0, 0.0, 1.0, 10.0, 100.0)


def plot_outliers(
    name: str,
    error_s: FloatArray,
    errors_m: Mapping[str, FloatArray],
    range_s: FloatArray,
    off_m: FloatArray,
    gated: NDArray[np.bool_],
    outlier_m: float,
) -> Figure:
    """Draw how far three estimates are from truth, and below how far each range is off.

    Parameters
    ----------
    name : str
        Of the recording.
    error_s : float64 array, shape (n,)
        When, in seconds from the beginning.
    errors_m : mapping of estimate to float64 array, shape (n,)
        Distance from truth [m]: behind a gate, robust, robust without the outliers.
    range_s, off_m : float64 array, shape (ranges,)
        When, and how wrong a range is; NaN where that is not known.
    gated : bool array, shape (ranges,)
        Which did not pass the gate.
    outlier_m : float
        What is further off is an outlier.
    """
    figure = new_figure(5.6)
    above, below = figure.subplots(2, 1, sharex=True)
    for axes in (above, below):
        dress(axes)
    handles: list[Handle] = []
    looks = ((REJECTED, 1.0, 2), (ESTIMATE, 1.0, 3), (ESTIMATE_PALE, 4.0, 1))
    for (label, error), (color, width, order) in zip(errors_m.items(), looks, strict=True):
        handles += above.plot(error_s, error, color=color, lw=width, zorder=order, label=label)
    above.set_ylabel("distance from truth [m]")
    rmse = (f"{label} {np.sqrt(np.mean(error**2)):.3g} m" for label, error in errors_m.items())
    title(above, f"{name}: RMSE {'; '.join(rmse)}")
    wrong = np.abs(off_m) > outlier_m
    for shown, marker, color, label in (
        (~gated, ".", MUTED, "range, fused"),
        (gated, ".", REJECTED, "range, gated"),
        (wrong & ~gated, "x", TRUTH, "outlier, fused"),
    ):
        size = 3 if marker == "." else 6
        handles += below.plot(
            range_s[shown], off_m[shown], marker, ms=size, color=color, label=label
        )
    for side in (-outlier_m, outlier_m):
        below.axhline(side, color=TRUTH, lw=0.8, ls="--")
    furthest = max(2.0 * outlier_m, 1.3 * float(np.nanmax(np.abs(off_m))))
    below.set_yscale("symlog", linthresh=2.0 * outlier_m)
    below.set_ylim(-furthest, furthest)
    below.set_yticks([tick for tick in _TICKS if abs(tick) <= furthest])
    below.yaxis.set_major_formatter("{x:g}")
    below.set_ylabel("range off its median [m]")
    through, rejected = int((wrong & ~gated).sum()), int((gated & ~wrong).sum())
    title(below, f"{int(wrong.sum())} outliers, the gate lets {through} through; it rejects "
                 f"{rejected} others")  # fmt: skip
    time_axis(below, error_s)
    legend(figure, handles)
    return figure
