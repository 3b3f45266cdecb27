# SPDX-License-Identifier: Apache-2.0
"""Checks of an IMU: units, axes, gravity, gaps."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, note, warning
from locfuse.io.log_folder import FORCES, GRAVITY_MPS2, RATES
from locfuse.types import NANOSECONDS, Columns, FloatArray

TOLERANCE = 1.5  # of its length [m/s^2]
MAX_GAP_S = 0.1  # of samples; beyond it turns are the wheels' alone
MAX_BIAS = 0.2  # [rad/s]
MIN_TURN = 1.0  # in all, below which axes and units cannot be compared [rad]
AGREES = 0.8  # correlation of turns


def imu_gravity(context: Context) -> Iterator[Finding]:
    """Report an accelerometer in other units, or without gravity."""
    table = context.log.tables.get("imu", {})
    if FORCES[0] not in table or not len(table["stamp_ns"]):
        return
    length = float(np.median(np.linalg.norm(_columns(table, FORCES), axis=1)))
    if length < 0.5:
        what = f"accelerations are {length:.2g} m/s^2 at the median: without gravity"
        yield note(what, "imu.csv", "record them as they are measured, or point the sensor's z "
                   "axis upwards: the vertical is not known")  # fmt: skip
    elif abs(length - GRAVITY_MPS2) > TOLERANCE:
        unit = " (that is 1 g)" if abs(length - 1.0) < 0.2 else ""
        yield error(f"accelerations are {length:.3g} m/s^2 at the median{unit}, gravity is 9.81",
                    "imu.csv", "convert them to m/s^2")  # fmt: skip


def imu_against_wheels(context: Context) -> Iterator[Finding]:
    """Report a gyro in degrees, of another axis, of the other sign or with a large bias."""
    imu, wheels = context.log.tables.get("imu", {}), context.used("odometry")
    if wheels is None or len(imu.get("stamp_ns", ())) < 2:
        return
    turned, at_rest, by_axis, seconds = _turns(imu, wheels)
    if len(turned) < 10:
        return
    if at_rest.any():
        rates = by_axis[at_rest] / seconds[at_rest, None]
        bias = float(np.linalg.norm(np.median(rates, axis=0)))
        if bias > MAX_BIAS:
            yield warning(f"the gyro reads {bias:.2g} rad/s while the wheels stand", "imu.csv",
                          "is it in rad/s, and calibrated?")  # fmt: skip
            return
    if np.abs(turned).sum() < MIN_TURN or turned.std() == 0.0:
        return
    fits = [_correlation(axis, turned) for axis in by_axis.T]
    best = int(np.argmax(np.abs(fits)))
    if abs(fits[best]) < AGREES:
        return
    slope = float(by_axis[:, best] @ turned / (turned @ turned))
    if best != 2:
        yield error(f"turns of the wheels show in the gyro's {'xyz'[best]} axis, not about the "
                    "vertical", "imu.csv", "exchange the axes, in forces too")  # fmt: skip
    elif abs(slope) > 10.0:
        yield error(f"the gyro turns {slope:.3g} times as much as the wheels", "imu.csv",
                    "convert degrees per second to rad/s")  # fmt: skip
    elif abs(slope) < 0.1:
        yield error(f"the gyro turns {slope:.3g} times as much as the wheels", "imu.csv",
                    "do wheels turn in degrees, or is the gyro's unit another?")  # fmt: skip
    elif slope < 0.0:
        yield error("the gyro turns the other way than the wheels", "imu.csv",
                    "change the sign of the rates, or of the turns of odometry")  # fmt: skip


def imu_gaps(context: Context) -> Iterator[Finding]:
    """Report samples with gaps, in which turns are the wheels' alone."""
    stamp = np.sort(context.log.tables.get("imu", {}).get("stamp_ns", np.zeros(0, np.int64)))
    gaps = np.diff(stamp) / NANOSECONDS
    far = gaps > MAX_GAP_S
    if far.any():
        yield warning(f"{int(far.sum())} gaps between samples, up to {gaps.max():.3g} s; from "
                      f"{MAX_GAP_S:g} s on the gyro is not used", "imu.csv",
                      "is the driver's rate at least 10 Hz, and does it lose samples?")  # fmt: skip


def _columns(table: Columns, names: tuple[str, ...]) -> FloatArray:
    return np.column_stack([table[name] for name in names])


def _levelled(imu: Columns) -> FloatArray:
    """Return rates (n, 3) about axes of which the third is the vertical, if gravity shows it."""
    rates = _columns(imu, RATES)
    up = np.median(_columns(imu, FORCES), axis=0) if FORCES[0] in imu else np.zeros(3)
    length = float(np.linalg.norm(up))
    if abs(length - GRAVITY_MPS2) > TOLERANCE:
        return rates
    up = up / length
    axis = np.cross([0.0, 0.0, 1.0], up)
    sine, cosine = float(np.linalg.norm(axis)), float(up[2])
    if sine < 1e-9:
        return rates * [1.0, math.copysign(1.0, cosine), math.copysign(1.0, cosine)]
    k = axis / sine
    # Rodrigues: turns the vertical of the sensor onto z.
    cross = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    turn = np.eye(3) - sine * cross + (1.0 - cosine) * cross @ cross
    return np.asarray(rates @ turn.T)


def _turns(imu: Columns, wheels: Columns) -> tuple[FloatArray, ...]:
    """Return turns by wheels (m,), whether they stand, turns by the gyro (m, 3), and seconds."""
    t, at = imu["stamp_ns"] / NANOSECONDS, wheels["stamp_ns"] / NANOSECONDS
    order = np.argsort(t, kind="stable")
    t, rates = t[order], _levelled(imu)[order]
    steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(t)[:, None]
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    by_axis = np.column_stack([np.diff(np.interp(at, t, column)) for column in total.T])
    seconds = np.diff(at)
    if "dx_m" in wheels:
        turned = wheels["dheading_rad"][1:]
        moved = np.hypot(wheels["dx_m"], wheels["dy_m"])[1:]
    else:
        turned, moved = wheels["omega_radps"][:-1] * seconds, np.abs(wheels["v_mps"][:-1])
    inside = (at[:-1] >= t[0]) & (at[1:] <= t[-1])
    stand = (turned == 0.0) & (moved == 0.0)
    return turned[inside], stand[inside], by_axis[inside], seconds[inside]


def _correlation(a: FloatArray, b: FloatArray) -> float:
    spread = float(a.std() * b.std())
    return 0.0 if spread == 0.0 else float(np.mean((a - a.mean()) * (b - b.mean())) / spread)
