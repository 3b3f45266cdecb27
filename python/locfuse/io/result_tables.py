# SPDX-License-Identifier: Apache-2.0
"""The tables of a result: estimate and outcomes, every bit of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.csv_table import number_texts, stamp_texts, write_table
from locfuse.io.log_folder import QUATERNION
from locfuse.types import FloatArray, Health, MappedLandmarks, Outcomes, Trajectory, Watched


def write_estimate(path: Path, estimate: Trajectory, health: Health | None = None) -> None:
    """Write ``estimate.csv``: poses with covariance, every bit of them, and the state of health."""
    assert estimate.heading is not None
    assert estimate.covariance is not None
    header = ["stamp_s", "x_m", "y_m", "heading_rad"]
    columns: list[FloatArray] = [estimate.position[:, 0], estimate.position[:, 1], estimate.heading]
    names = ("x", "y", "heading")
    for row in range(3):
        for column in range(row, 3):
            header.append(f"cov_{names[row]}_{names[column]}")
            columns.append(estimate.covariance[:, row, column])
    if estimate.height is not None and estimate.height_variance is not None:
        header += ["z_m", "cov_z_z"]
        columns += [estimate.height, estimate.height_variance]
    if estimate.orientation is not None and estimate.orientation_covariance is not None:
        header += [*QUATERNION, "cov_tilt_x_x", "cov_tilt_x_y", "cov_tilt_y_y"]
        covariance = estimate.orientation_covariance
        columns += [*estimate.orientation.T, covariance[:, 0, 0], covariance[:, 0, 1],
                    covariance[:, 1, 1]]  # fmt: skip
    texts = [stamp_texts(estimate.stamp_ns), *map(number_texts, columns)]
    if health is not None and len(health):
        last = np.searchsorted(health.stamp_ns, estimate.stamp_ns, side="right") - 1
        header.append("state")
        texts.append(health.state[np.maximum(last, 0)].tolist())
    write_table(path, header, texts)


def write_outcomes(path: Path, outcomes: Outcomes) -> None:
    """Write ``outcomes.csv``: what became of each message, every bit of it."""
    header = ["stamp_s", "source", "tag", "anchor", "verdict", "nis", "dof", "log_likelihood",
              "residual", "reason"]  # fmt: skip
    words = (outcomes.source, outcomes.tag, outcomes.anchor, outcomes.verdict)
    columns = [stamp_texts(outcomes.stamp_ns), *(word.tolist() for word in words),
               number_texts(outcomes.nis), [str(dof) for dof in outcomes.dof.tolist()],
               number_texts(outcomes.log_likelihood), number_texts(outcomes.residual),
               outcomes.reason.tolist()]  # fmt: skip
    write_table(path, header, columns)


def write_landmarks(path: Path, landmarks: MappedLandmarks) -> None:
    """Write ``landmarks.csv`` of a log folder: the map, which another run may begin with."""
    position, covariance = landmarks.position, landmarks.covariance
    numbers = [*position.T, covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]]
    header = ["landmark", "x_m", "y_m", "cov_x_x", "cov_x_y", "cov_y_y"]
    write_table(path, header, [landmarks.name.tolist(), *map(number_texts, numbers)])


def write_health(path: Path, health: Health) -> None:
    """Write ``health.csv``: state, probabilities and protection levels over time.

    Of watched poses, ``watched.csv``, with their offset from the estimate.
    """
    header = ["stamp_s", "state", "within", "wrong", "protection_x_m", "protection_y_m",
              "protection_heading_rad", "reason"]  # fmt: skip
    columns = [
        stamp_texts(health.stamp_ns),
        health.state.tolist(),
        number_texts(health.within),
        number_texts(health.wrong),
        *(number_texts(np.where(np.isfinite(level), level, np.nan))
          for level in health.protection.T),
        health.reason.tolist(),
    ]  # fmt: skip
    if isinstance(health, Watched):
        header += ["error_x_m", "error_y_m", "error_heading_rad"]
        columns += [number_texts(error) for error in health.error.T]
    write_table(path, header, columns)
