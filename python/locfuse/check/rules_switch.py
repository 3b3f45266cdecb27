# SPDX-License-Identifier: Apache-2.0
"""Checks of the thresholds by which UWB takes over from scans."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, warning
from locfuse.config.schema import Mcl, Switch
from locfuse.types import NANOSECONDS

_NIS_NOMINAL = 1.0  # per row, where noise is as the configuration says
_NIS_NEVER = 0.1  # sigmas three times too wide
_NIS_MOST = 10.0  # as which a larger one counts
_ANY_HEADING = math.pi / math.sqrt(3.0)  # standard deviation of headings all around
_RADIOS = ("ranges", "positions")


def ineffective_switch(context: Context) -> Iterator[Finding]:
    """Name thresholds of a switch that no particles ever pass, or all of them do."""
    mcl = context.config.mcl
    if mcl is None or mcl.switch is None:
        return
    if all(context.used(source) is None for source in _RADIOS):
        yield error("mcl.switch has nothing to switch to: the log has neither ranges nor positions "
                    "that are used", "mcl.switch", "record them, or remove the switch")  # fmt: skip
    else:
        yield from _uwb_never_of_use(context, mcl.switch)
    yield from _always_in_doubt(mcl, mcl.switch)
    yield from _never_in_doubt(context, mcl.switch)


def _always_in_doubt(mcl: Mcl, switch: Switch) -> Iterator[Finding]:
    for unit, floor in (("m", mcl.sigma_map_m), ("rad", mcl.sigma_map_rad)):
        for key, why in (
            (f"sigma_sure_{unit}", "no estimate is surer than the map"),
            (f"elsewhere_{unit}", "no two estimates agree better than the map is right"),
        ):
            if getattr(switch, key) <= floor:
                yield _fault(key, f"is {getattr(switch, key):g}, but {why}, {floor:g}: UWB would "
                             "take over all the time", "set it well above the map's sigma"
                             )  # fmt: skip


def _never_in_doubt(context: Context, switch: Switch) -> Iterator[Finding]:
    if context.floor is not None:
        low, high = context.floor
        across = float(np.hypot(*(high - low)))
        if switch.sigma_unsure_m >= 0.5 * across:
            yield _fault("sigma_unsure_m", f"is {switch.sigma_unsure_m:g}, but particles all over "
                         f"the floor have {0.5 * across:.3g}: it would never take over",
                         "set it to what you still call sure")  # fmt: skip
        if switch.elsewhere_m >= across:
            yield _fault("elsewhere_m", f"is {switch.elsewhere_m:g}, but the floor is {across:.3g} "
                         "across: they will never be in doubt by it", "set it to 1 or so"
                         )  # fmt: skip
    for key, most, sane in (("sigma_unsure_rad", _ANY_HEADING, 0.35),
                            ("elsewhere_rad", math.pi, 0.5)):  # fmt: skip
        if getattr(switch, key) >= most:
            yield _fault(key, f"is {getattr(switch, key):g}, but headings all around have "
                         f"{most:.3g}: they will never be in doubt", f"set it to {sane:g} or so"
                         )  # fmt: skip
    if switch.doubt_s >= context.duration_s:
        yield _fault("doubt_s", f"is {switch.doubt_s:g}, but the log has {context.duration_s:.3g} "
                     "s: it would never take over", "set it to a few seconds")  # fmt: skip


def _uwb_never_of_use(context: Context, switch: Switch) -> Iterator[Finding]:
    period_s = _period_s(context)
    if switch.uwb_age_s < period_s:
        yield _fault("uwb_age_s", f"is {switch.uwb_age_s:g}, but UWB is received every "
                     f"{period_s:.3g} s: it would be too old almost always",
                     f"set it to {2.5 * period_s:.2g}"
                     )  # fmt: skip
    best, driving = _least_sigmas(context, period_s)
    if switch.uwb_sigma_m < best:
        yield _fault("uwb_sigma_m", f"is {switch.uwb_sigma_m:g}, but all of UWB together leaves "
                     f"{best:.2g}: it would never be of use", "set it to twice what UWB's "
                     "filter states, below sigma_sure_m")  # fmt: skip
    elif switch.uwb_sigma_m < driving:
        yield warning(f"mcl.switch.uwb_sigma_m is {switch.uwb_sigma_m:g}, but driving UWB's filter "
                      f"states {driving:.2g} at best: it would be of use at rest alone",
                      "mcl.switch.uwb_sigma_m", "set it to twice that, below sigma_sure_m"
                      )  # fmt: skip
    if switch.uwb_nis < _NIS_NEVER or switch.uwb_nis >= _NIS_MOST:
        yield _fault("uwb_nis", f"is {switch.uwb_nis:g}, but the NIS per row is 1 where UWB is "
                     f"right, and {_NIS_MOST:g} at most: it would "
                     f"{'never' if switch.uwb_nis < 1.0 else 'always'} be of use",
                     "set it to 1.4, to 3 behind walls")  # fmt: skip
    elif switch.uwb_nis < _NIS_NOMINAL:
        yield warning(f"mcl.switch.uwb_nis is {switch.uwb_nis:g}, but the NIS per row is 1 where "
                      "noise is nominal: correct UWB is rejected", "mcl.switch.uwb_nis",
                      "set it to 1.4, or sigmas to what ranges scatter by")  # fmt: skip


def _fault(key: str, what: str, advice: str) -> Finding:
    return error(f"mcl.switch.{key} {what}", f"mcl.switch.{key}", advice)


def _period_s(context: Context) -> float:
    """Return the typical time between messages of UWB."""
    tables = [context.used(source) for source in _RADIOS]
    stamps = np.unique(np.concatenate([t["stamp_ns"] for t in tables if t is not None]))
    return float(np.median(np.diff(stamps))) / NANOSECONDS if len(stamps) > 1 else math.inf


def _least_sigmas(context: Context, period_s: float) -> tuple[float, float]:
    """Return the minimum sigmas of the UWB filter while driving, with every measurement.

    n ranges leave at least sigma sqrt(2 / n) along the worse axis, n fixes sigma / sqrt(n).
    Driving, half of the wheels' noise along the way, q per epoch, comes to each axis:
    P = (sqrt(q^2 + 4 q R) - q) / 2 with R of one epoch.
    """
    ranges, positions = (context.used(source) for source in _RADIOS)
    news = 0.0
    if ranges is not None:
        news += 0.5 * len(ranges["stamp_ns"]) / context.typical_sigma**2
    if positions is not None:
        sigma = float(np.median(positions["sigma_m"]))
        news += len(positions["stamp_ns"]) / sigma**2 if sigma > 0.0 else 0.0
    if news == 0.0:
        return 0.0, 0.0
    best = 1.0 / math.sqrt(news)
    if context.odometry is None:
        return best, best
    way = float(np.linalg.norm(np.diff(context.odometry.position, axis=0), axis=1).sum())
    step = min(period_s / context.duration_s, 1.0)  # of the whole, an epoch
    R = 1.0 / (news * step)
    q = 0.5 * context.models.odometry.sigma_longitudinal_per_sqrt_m**2 * way * step
    return best, max(best, math.sqrt(0.5 * (math.sqrt(q * q + 4.0 * q * R) - q)))
