# SPDX-License-Identifier: Apache-2.0
"""What tests of recordings work out from their log folders."""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.errors import interpolate
from locfuse.io.csv_table import read_bytes
from locfuse.io.log_folder import read_log
from locfuse.run.messages import truth_of
from locfuse.types import NANOSECONDS, FloatArray, Log, StampArray, Trajectory, wrap_angle
from papers.datasets import convert
from papers.datasets.source import arc
from support_runs import recording


def converted(name: str, out: Path) -> dict[str, Log]:
    """Return the logs of a recording by folder name, or skip the test if it is absent."""
    folders = convert(name, recording(name.replace("_", "-")), out / name)
    return {path.name: read_log(path) for path in folders}


def damaged(
    recording: Path, copy: Path, file: str, line: int | None = None, text: str = ""
) -> Path:
    """Return a folder of links to a recording with a line of one file replaced, or without it."""
    copy.mkdir()
    for path in recording.iterdir():
        if path.name != file:
            (copy / path.name).symlink_to(path)
    if line is not None:
        lines = read_bytes(recording / file).decode().splitlines()
        lines[line - 1] = text
        data = "\n".join(lines).encode()
        (copy / file).write_bytes(gzip.compress(data, 1) if file.endswith(".gz") else data)
    return copy


def rows_in(log: Log) -> dict[str, int]:
    return {stem: len(next(iter(table.values()))) for stem, table in log.tables.items()}


def robust_sigma(values: FloatArray) -> float:
    """Return the standard deviation that a Gaussian of this median absolute deviation has."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def truth_in(log: Log) -> Trajectory:
    truth = truth_of(log)
    assert truth is not None
    return truth


def motions_of(log: Log) -> tuple[StampArray, FloatArray]:
    """Return the stamps of the odometry and the motions between them, shape (n - 1, 3)."""
    table = log["odometry"]
    if "v_mps" in table:
        seconds = np.diff(table["stamp_ns"]) / NANOSECONDS
        moved = arc(table["v_mps"][:-1] * seconds, table["omega_radps"][:-1] * seconds)
        return table["stamp_ns"], np.column_stack(list(moved.values()))
    columns = [table[key][1:] for key in ("dx_m", "dy_m", "dheading_rad")]
    return table["stamp_ns"], np.column_stack(columns)


def driven_m(log: Log) -> float:
    """Return how far the odometry says that the body went."""
    return float(np.hypot(*motions_of(log)[1].T[:2]).sum())


def reckoned(log: Log, start: tuple[float, float, float]) -> Trajectory:
    """Return where the odometry alone leads from a pose at its first stamp."""
    stamps, motions = motions_of(log)
    heading = start[2] + np.concatenate([[0.0], np.cumsum(motions[:, 2])])
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    steps = np.column_stack(
        [c * motions[:, 0] - s * motions[:, 1], s * motions[:, 0] + c * motions[:, 1]]
    )
    position = start[:2] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return Trajectory(stamps, position, wrap_angle(heading))


def carried(track: Trajectory, forward_m: float, left_m: float) -> FloatArray:
    """Return where a point of the body is along a track, shape (n, 2)."""
    assert track.heading is not None
    c, s = np.cos(track.heading), np.sin(track.heading)
    return track.position + np.column_stack(
        [c * forward_m - s * left_m, s * forward_m + c * left_m]
    )


@dataclass(frozen=True)
class SightingErrors:
    """Measured minus true: ``range_m``, ``bearing_rad``, shape (n,); ``row`` of the sighting."""

    row: NDArray[np.intp]
    range_m: FloatArray
    bearing_rad: FloatArray


def sighting_errors(log: Log) -> SightingErrors:
    """Return the errors of the sightings of known landmarks where truth and its heading are."""
    table, places = log["landmark_sightings"], log["landmarks"]
    row_of = {name: row for row, name in enumerate(places["landmark"].tolist())}
    at = np.column_stack([places["x_m"], places["y_m"]])
    target = at[[row_of[name] for name in table["landmark"].tolist()]]
    stamps, which = np.unique(table["stamp_ns"], return_inverse=True)
    poses, inside = interpolate(truth_in(log), stamps)
    assert poses.heading is not None
    forward, left, turned = (log.landmark_sensor or {"pose_in_body": [0.0, 0.0, 0.0]})[
        "pose_in_body"
    ]
    position = np.full((len(stamps), 2), np.nan)
    heading = np.full(len(stamps), np.nan)
    position[inside], heading[inside] = carried(poses, forward, left), poses.heading + turned
    row = np.flatnonzero(inside[which])
    away = target[row] - position[which[row]]
    bearing = np.arctan2(away[:, 1], away[:, 0]) - heading[which[row]]
    return SightingErrors(
        row,
        table["range_m"][row] - np.hypot(*away.T),
        wrap_angle(table["bearing_rad"][row] - bearing),
    )
