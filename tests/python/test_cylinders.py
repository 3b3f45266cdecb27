# SPDX-License-Identifier: Apache-2.0
"""Poles in the raw scans of a recording: all that show tape are found, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import locfuse as lf
from support_runs import DATA

CAR_PARK = DATA / "acfr-carpark"
STEP = np.deg2rad(0.5)
ANGLE = -np.pi / 2 + STEP * np.arange(361)
LASER = lf.LaserGeometry(lf.Pose2(), ANGLE[0], STEP, range_min=0.5, range_max=80.0)
HEADINGS = np.deg2rad(np.arange(0.0, 360.0, 0.25))
# A tube of 6 to 7 cm; beams of a SICK are wider than their gap and good to a few centimetres.
POLES = lf.CylinderDetectorConfig(
    sigma_range_m=0.03, sigma_bearing_rad=0.004, radius_m=0.035, least_beams=1, least_intensity=1.0
)


def read(name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    files = sorted(CAR_PARK.glob(f"{name}.csv*"))
    if not files:
        pytest.skip(f"{CAR_PARK / name}.csv.gz is not there")
    return np.genfromtxt(files[0], delimiter=",", skip_header=1)


def ends(ranges: Any, bearings: Any) -> np.ndarray:
    return np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings)], axis=-1)


def beacons_by_heading(beacons: np.ndarray, laser: np.ndarray, taped: np.ndarray) -> Any:
    """Beacons in the frame of the laser, turned so that taped beams end at them; None if unsure."""
    c, s = np.cos(HEADINGS), np.sin(HEADINGS)
    turned = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], 1) @ (beacons - laser).T
    off = np.linalg.norm(turned.transpose(0, 2, 1)[:, :, None] - taped, axis=-1)
    best = np.argmin(np.minimum(off.min(1), 1.0).mean(1))
    sure = len(set(off[best].argmin(0))) >= 2 and off[best].min(0).max() < 0.3
    return turned[best].T if sure else None


def test_poles_with_tape_are_found_in_the_car_park() -> None:
    scans, tape, gps = (read(n) for n in ("laser_ranges", "laser_intensity", "gps"))
    beacons = read("beacons")[:, 1:3]
    where = np.stack([np.interp(scans[:, 0], gps[:, 0], gps[:, i]) for i in (1, 2)], axis=-1)
    detector = lf.CylinderDetector(POLES)
    shown = found = told = false = 0
    for ranges, bright, laser in zip(scans[:, 1:], tape[:, 1:], where, strict=True):
        taped = ends(ranges + POLES.radius_m, ANGLE)[(bright >= 1) & (ranges < 20.0)]
        poles = beacons_by_heading(beacons, laser, taped) if len(taped) >= 2 else None
        if poles is None:
            continue
        cylinders = detector.detect(lf.LaserScan(0, LASER, ranges, bright))
        centres = np.array([ends(c.range, c.bearing) for c in cylinders])
        near = np.array([c.range < 20.0 for c in cylinders])
        off = np.linalg.norm(centres[:, None] - poles, axis=-1)
        in_view = np.linalg.norm(taped[:, None] - poles, axis=-1).min(0) < 0.3
        shown += int(np.sum(in_view))
        found += int(np.sum(off.min(0)[in_view] < 0.3))
        told += int(np.sum(near))
        false += int(np.sum(off.min(1)[near] > 0.3))
    print(f"{found} of {shown} poles found, {false} of {told} cylinders false")
    assert shown > 400
    assert found >= 0.97 * shown
    assert false < 0.02 * told
