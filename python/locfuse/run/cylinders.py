# SPDX-License-Identifier: Apache-2.0
"""Cylinders in the scans of a log as sightings of landmarks, which a run fuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.config.build import build_cylinder_detector
from locfuse.config.schema import RunConfig
from locfuse.run.missing_inputs import how_to_add
from locfuse.run.start import scans_of
from locfuse.types import Log, LogError

ONE_LASER = "name one of them in ros.topics.scans, or keep its rows of scans.csv"


def with_cylinders(log: Log, config: RunConfig) -> Log:
    """Return the log with the cylinders in its scans, if the configuration asks for them.

    They are ``landmark_sightings`` without names, each with the sigmas of its fit, and the laser is
    the sensor of landmarks. Raises LogError where the log has no scans, no landmarks and they
    are not mapped, sightings of its own, or no intensities where ``least_intensity`` asks for them.
    """
    if config.cylinders is None:
        return log
    is_mapped = config.estimator.kind == "landmark_slam"
    for table in ("scans",) if is_mapped else ("scans", "landmarks"):
        if table not in log:
            raise LogError(f"cylinders are detected in scans and identified by landmarks, but "
                           f"the log has no {table}; {how_to_add(log, table)}, or leave "
                           "'cylinders' out")  # fmt: skip
    if log.lasers:
        raise LogError(
            f"cylinders are seen by one laser, but the log has {len(log.lasers)}: "
            f"{', '.join(log.lasers)}; {ONE_LASER}, or leave 'cylinders' out"
        )
    if "landmark_sightings" in log:
        raise LogError("the log has landmark_sightings, which cylinders would replace; leave "
                       "'cylinders' out, or these")  # fmt: skip
    detector = build_cylinder_detector(config.cylinders)
    stamps, rows, seen = [], [], []
    for row, scan in enumerate(scans_of(log)):
        try:
            found = detector.detect(scan)
        except ValueError as problem:
            raise LogError(f"cylinders: {problem}") from problem
        stamps += [scan.stamp] * len(found)
        seen += [row] * len(found)
        rows += [(one.range, one.bearing, *np.sqrt(np.diag(one.covariance)[:2])) for one in found]
    columns = np.array(rows, np.float64).reshape(-1, 4).T
    names = ("range_m", "bearing_rad", "sigma_range_m", "sigma_bearing_rad")
    sightings = {
        "stamp_ns": np.array(stamps, np.int64),
        "landmark": np.full(len(stamps), ""),
        **dict(zip(names, columns, strict=True)),
    }
    if "arrival_ns" in log["scans"]:
        sightings["arrival_ns"] = log["scans"]["arrival_ns"][seen]
    mount = None if log.laser is None else {"pose_in_body": log.laser["pose_in_body"]}
    tables = {**log.tables, "landmark_sightings": sightings}
    return replace(log, tables=tables, landmark_sensor=mount)
