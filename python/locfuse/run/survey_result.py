# SPDX-License-Identifier: Apache-2.0
"""What a survey found, and its files."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from locfuse.io.csv_table import number_texts, read_bytes, write_table
from locfuse.io.result_tables import write_columns
from locfuse.types import Columns, FloatArray, LogError, MappedLandmarks, Trajectory, shown

AXES = ("x_m", "y_m", "z_m")
_FARTHEST_M = 1e7


@dataclass(frozen=True)
class SurveyedAnchor:
    """An anchor that ranges name.

    Attributes
    ----------
    name : str
    position : float64 array, shape (3,)
        In the frame of the survey, metres; NaN where it is not placed.
    covariance : float64 array, shape (3, 3)
        Of the position, square metres; 0 along what was given.
    offset_m, sigma_offset_m : float
        What its ranges read more than the distance.
    scale, sigma_scale : float
        What its ranges are times the distance; exact but with ``sigma_anchor_scale``.
    ranges, rejected : int
        From the start on, and of those how many were judged wrong.
    word : str
        ``good``, ``weak`` (its place adds more than an eighth to the variance of a range),
        ``doubtful`` (parts of the drive may not fit together), ``two places`` or ``not placed``.
    other : float64 array, shape (3,), or None
        Of ``two places`` the other one.
    """

    name: str
    position: FloatArray
    covariance: FloatArray
    offset_m: float
    sigma_offset_m: float
    ranges: int
    rejected: int
    word: str
    other: FloatArray | None = None
    scale: float = 1.0
    sigma_scale: float = 0.0

    @property
    def sigma_m(self) -> float:
        """Sigma along the axis in the plane that is known least, metres; NaN if not placed."""
        if self.word == "not placed":
            return float("nan")
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance[:2, :2])[-1], 0.0)))


@dataclass(frozen=True)
class SurveyedTag:
    """A tag whose place on the robot was found.

    `position` has shape (2,): forward and left, metres; `sigma_m` is along the axis that is known
    least.
    """

    name: str
    position: FloatArray
    sigma_m: float


@dataclass(frozen=True)
class SurveyResult:
    """Where anchors and landmarks are.

    Attributes
    ----------
    anchors : tuple of SurveyedAnchor
    landmarks : MappedLandmarks
        Those that sightings name.
    estimate : Trajectory
        The drive, with the covariance in the frame of the start.
    frame : str
        What the axes are, a sentence.
    findings : tuple of str
        What is wrong: ids that are swapped, anchors that moved.
    advice : str
        Which further drive would help; empty where all is good.
    stop : float64 array, shape (2,), or None
        The place of that drive.
    tags : tuple of SurveyedTag
        With `sigma_tag_m`.
    """

    anchors: tuple[SurveyedAnchor, ...]
    landmarks: MappedLandmarks
    estimate: Trajectory
    frame: str
    findings: tuple[str, ...] = ()
    advice: str = ""
    stop: FloatArray | None = None
    tags: tuple[SurveyedTag, ...] = ()


def read_measured(path: Path) -> Columns:
    """Read what was measured by hand: as ``anchors.csv``, with empty cells where it is not known.

    Raises LogError where the file is no such table.
    """
    header = ("anchor", *AXES)
    rows = list(csv.reader(read_bytes(path).decode("utf-8-sig", "replace").splitlines()))
    if not rows or tuple(cell.strip() for cell in rows[0]) != header:
        raise LogError(f"{path}, line 1: expected the header {','.join(header)}")
    names: list[str] = []
    at: list[list[float]] = []
    for line, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        if len(row) != len(header) or not row[0].strip():
            raise LogError(f"{path}, line {line}: expected an anchor and three numbers, which may "
                           "be empty")  # fmt: skip
        if row[0].strip() in names:
            raise LogError(f"{path}, line {line}: anchor {row[0].strip()} is listed twice")
        names.append(row[0].strip())
        at.append([])
        for cell in row[1:]:
            try:
                at[-1].append(float(cell) if cell.strip() else np.nan)
            except ValueError:
                raise LogError(f"{path}, line {line}: {shown(cell)} is not a number") from None
            if cell.strip() and not abs(at[-1][-1]) <= _FARTHEST_M:
                raise LogError(f"{path}, line {line}: {shown(cell)} is no place in metres")
    table = np.array(at).reshape(-1, 3)
    return {"anchor": np.array(names, dtype=str),
            **{axis: table[:, k].copy() for k, axis in enumerate(AXES)}}  # fmt: skip


def write_survey(result: SurveyResult, folder: Path) -> list[Path]:
    """Write ``anchors.csv``, and ``landmarks.csv`` if there are any, as of a log folder.

    What is not placed is left out. Columns of covariances are beyond those of the format.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    placed = [a for a in result.anchors if a.word != "not placed"]
    if placed:
        at = np.array([a.position for a in placed])
        columns = [[a.name for a in placed], *(number_texts(at[:, k]) for k in range(3))]
        written.append(folder / "anchors.csv")
        write_table(written[-1], ("anchor", *AXES), columns)
    if len(result.landmarks):
        written.append(folder / "landmarks.csv")
        write_columns(written[-1], result.landmarks)
    return written


def yaml_of(result: SurveyResult) -> Mapping[str, Mapping[str, float]]:
    """Return the section ``anchors`` of a configuration: errors that stand out of their sigma."""
    found: dict[str, dict[str, float]] = {}
    for a in result.anchors:
        if a.word != "not placed" and abs(a.offset_m) > 2.0 * a.sigma_offset_m:
            found.setdefault(a.name, {})["offset_m"] = round(a.offset_m, 3)
        if a.word != "not placed" and abs(a.scale - 1.0) > 2.0 * a.sigma_scale > 0.0:
            found.setdefault(a.name, {})["scale"] = round(a.scale, 4)
    return found
