# SPDX-License-Identifier: Apache-2.0
"""Trajectories as TUM files: ``stamp_s x y z qx qy qz qw``, one pose per line."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from locfuse.io.csv_table import line_of_row, number_texts, parse, read_bytes, stamp_texts
from locfuse.io.whole import write_whole
from locfuse.types import LogError, Trajectory

logger = logging.getLogger(__name__)

NORM_TOLERANCE = 0.01  # files with three decimals pass


def read_tum(path: str | Path) -> Trajectory:
    """Read a TUM file; its poses are projected to the plane.

    Position is (x, y); heading is the yaw of the quaternion, so z, roll and pitch are dropped.
    Stamps are exact to the nanosecond. Of poses with the same stamp the first counts, and a warning
    on the logger ``locfuse`` says how many there were. Blank lines and lines that start with ``#``
    are skipped.

    The trajectory has headings and no covariance; a file whose name ends in ``.gz`` is unpacked.
    Raises LogError if the file is missing or empty, a line is not 8 finite numbers, a stamp lies
    before the last one, or a quaternion is not of norm 1.
    """
    path = Path(path)
    data = read_bytes(path)
    stamp_ns, x, y, _z, qx, qy, qz, qw = parse(data, "sfffffff", " ", 1, path)
    if len(stamp_ns) == 0:
        raise LogError(f"{path}: no pose, expected lines of stamp_s x y z qx qy qz qw")
    for row in np.flatnonzero(np.diff(stamp_ns) < 0)[:1] + 1:
        line = line_of_row(data, 1, row)
        before, stamp = stamp_texts(stamp_ns[row - 1 : row + 1])
        raise LogError(f"{path}, line {line}: stamp {stamp} does not come after {before}")
    norm = np.sqrt(qx**2 + qy**2 + qz**2 + qw**2)
    for row in np.flatnonzero(np.abs(norm - 1.0) > NORM_TOLERANCE)[:1]:
        line = line_of_row(data, 1, row)
        raise LogError(f"{path}, line {line}: quaternion of norm {norm[row]:g}, expected 1")
    heading = np.arctan2(2.0 * (qw * qz + qx * qy), qw**2 + qx**2 - qy**2 - qz**2)
    heading[heading >= np.pi] = -np.pi
    first = np.concatenate([[True], np.diff(stamp_ns) > 0])
    if not first.all():
        logger.warning("%s: %d poses have the stamp of the one before and are left out", path,
                       np.count_nonzero(~first))  # fmt: skip
    return Trajectory(stamp_ns[first], np.column_stack([x, y])[first], heading[first])


def write_tum(path: str | Path, trajectory: Trajectory, comment: str = "") -> None:
    """Write a trajectory as a TUM file, for this library's evaluation and for others'.

    Stamps have 9 decimals and are exact; positions and quaternions read back as the same float64.
    z is the height, 0 in the plane; the quaternion that of the heading, or of the attitude where
    that is known. Without a heading the quaternion is the identity: such a file
    reads back with heading 0. Covariance is not part of the format. A `comment` of one line comes
    first, after ``#``.

    Raises ValueError if a position or heading is not finite.
    """
    x, y = trajectory.position.T
    z = np.zeros(len(trajectory)) if trajectory.height is None else trajectory.height
    half = np.zeros(len(trajectory)) if trajectory.heading is None else trajectory.heading / 2.0
    for name, values in (("x", x), ("y", y), ("z", z), ("heading", half)):
        for row in np.flatnonzero(~np.isfinite(values))[:1]:
            raise ValueError(f"{name} of pose {row} is {values[row]}, expected a finite number")
    stamps, is_flat = stamp_texts(trajectory.stamp_ns), trajectory.height is None
    if trajectory.orientation is None:
        columns = map(number_texts, (x, y, z, np.sin(half), np.cos(half)))
        lines = [f"{stamp} {px} {py} {0 if is_flat else pz} 0 0 {qz} {qw}\n"
                 for stamp, px, py, pz, qz, qw in zip(stamps, *columns, strict=True)]  # fmt: skip
    else:
        columns = map(number_texts, (x, y, z, *trajectory.orientation.T[[1, 2, 3, 0]]))
        lines = [" ".join(row) + "\n" for row in zip(stamps, *columns, strict=True)]
    write_whole(path, "".join([*[f"# {comment}\n"] * bool(comment), *lines]))
