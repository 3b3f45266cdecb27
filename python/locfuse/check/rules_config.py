# SPDX-License-Identifier: Apache-2.0
"""Checks of what the configuration says by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from locfuse import _core
from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, note, warning

GATES = {
    "range": "ranges",
    "position": "positions",
    "pose": "poses",
    "landmark": "landmark_sightings",
}

_NEVER = 1.0 - 1e-7  # a gate above lets everything pass that anyone will see
_STRICT = 0.95


def ineffective_gates(context: Context) -> Iterator[Finding]:
    """Report each gate as a probability and in metres; name those that never or always reject."""
    if context.by_particles:  # has none
        return
    for key, source in GATES.items():
        if context.fused(source) is not None:
            yield from _gate(context, key, source)


def _gate(context: Context, key: str, source: str) -> Iterator[Finding]:
    probability = getattr(context.config.estimator, key).gate
    where = f"estimator.{key}.gate"
    if probability >= 1.0:
        yield warning(f"{where} is 1: no gate, every outlier of {source} is fused", where,
                      "set a probability such as 0.999, unless that is meant")  # fmt: skip
        return
    sigmas = math.sqrt(_core.chi_squared_quantile(1, probability))
    metres = sigmas * _sigma_of(context, source)
    text = (f"{where} {probability:g}: {source} beyond {sigmas:.1f} sigma are rejected, "
            f"{metres:.3g} m from a pose that is known exactly")  # fmt: skip
    if probability > _NEVER:
        yield warning(f"{text}; it is so close to 1 that it cannot bind", where,
                      "set a probability such as 0.999")  # fmt: skip
    elif context.extent > 0.0 and metres > context.extent:
        yield warning(f"{text}; that is more than the {context.extent:.3g} m that the anchors "
                      "span, so it cannot bind", _sigma_key(context, source),
                      "check the unit of sigma (metres)")  # fmt: skip
    elif probability < _STRICT:
        yield warning(f"{text}; it rejects {100 * (1 - probability):.3g} % of the good ones", where,
                      "set a probability such as 0.999")  # fmt: skip
    else:
        yield note(text, where)


def _sigma_of(context: Context, source: str) -> float:
    if source == "ranges":
        return context.typical_sigma
    table = context.table(source)
    assert table is not None
    if source == "landmark_sightings":
        own = context.config.estimator.landmark.sigma_range_m
        return float(np.median(table.get("sigma_range_m", own)))
    return float(np.median(table["sigma_m" if source == "positions" else "sigma_xy_m"]))


def _sigma_key(context: Context, source: str) -> str:
    table = context.table(source)
    brings = table is not None and "sigma_m" in table
    if source == "ranges" and not brings:
        return "estimator.range"
    return f"{source}.csv"


def implausible_sigmas(context: Context) -> Iterator[Finding]:
    """Name poses and positions whose sigma is a placeholder, and odometry believed without end."""
    for source, column in (("poses", "sigma_xy_m"), ("positions", "sigma_m")):
        table = context.fused(source)
        if table is None:
            continue
        sigma = float(np.median(table[column]))
        if sigma > max(100.0, 10.0 * context.extent):
            yield warning(f"{source}.csv has a {column} of {sigma:g}: they count for nothing",
                          f"{source}.csv, {column}",
                          "give the standard deviation in metres, or leave the source out of use; "
                          "ranges are fused as ranges")  # fmt: skip
        elif sigma < 1e-3:
            yield warning(f"{source}.csv has a {column} of {sigma:g}: they are believed to a "
                          "millimetre", f"{source}.csv, {column}",
                          "give the standard deviation in metres")  # fmt: skip
    noise, where = context.models.odometry, "estimator.odometry"
    if context.used("odometry") is not None and not any(
            value for key, value in noise if key.startswith("sigma_")):  # fmt: skip
        yield error(f"every sigma of {where} is 0: odometry is believed without end and nothing "
                    "corrects it", where,
                    "give what the wheels do, such as sigma_heading_per_sqrt_m: 0.02")  # fmt: skip


def unused_config_sigma(context: Context) -> Iterator[Finding]:
    """Report that sigmas in the log override the configuration's."""
    table = context.used("ranges")
    if table is None or "sigma_m" not in table:
        return
    where = "estimator.range"
    if "range" in context.models.model_fields_set:
        yield note(f"{where} has no effect: every range brings its own sigma_m", where,
                   "remove it, or the column sigma_m of ranges.csv")  # fmt: skip


def unknown_anchors(context: Context) -> Iterator[Finding]:
    """Name anchors of the configuration that the log does not have."""
    for name in context.config.anchors:
        if name != "all" and name not in context.names:
            known = ", ".join(context.names) or "none"
            yield error(f"anchors.{name} says how its ranges read, but the log has no such anchor",
                        f"anchors.{name}", f"anchors of the log: {known}")  # fmt: skip


def zero_lever_arms(context: Context) -> Iterator[Finding]:
    """Report zero lever arms, and whether the log states them."""
    positions = context.used("positions")
    if positions is not None and ("tag" not in positions or "" in positions["tag"]):
        yield from _antenna(context)  # the rest are of tags, which have places of their own
    if context.used("ranges") is None:
        return
    scenario = context.config.simulation
    defaulted = scenario is not None and "tags" not in scenario.model_fields_set
    where = "simulation.tags" if scenario is not None else "log.yaml, tags"
    for name, (x, y, z) in context.log.tags.items():
        if (x, y) == (0.0, 0.0):
            how = "by default" if defaulted else "as written"
            yield note(f"tag {name} is over the middle of the body ({how}), at a height of {z:g} m",
                       where, "measure where it is, if that is not meant")  # fmt: skip


def _antenna(context: Context) -> Iterator[Finding]:
    where, position = "estimator.position", context.models.position
    sensor = context.config.simulation and context.config.simulation.positions
    arm = (position.antenna_forward_m, position.antenna_left_m)
    if sensor:
        placed = (sensor.antenna_forward_m, sensor.antenna_left_m)
        if placed != arm:
            yield error(f"the simulated antenna is at {placed} m in body, the estimator takes it "
                        f"at {arm} m", where, "give both the same lever arm")  # fmt: skip
        return
    written = position.model_fields_set
    for key in ("antenna_forward_m", "antenna_left_m"):
        if getattr(position, key) == 0.0 and key not in written:
            yield warning(f"{where}.{key} is 0 because nobody said otherwise; position fixes are "
                          "of the antenna, not of the body", f"{where}.{key}",
                          "measure the lever arm; if it is zero, write 0")  # fmt: skip
        elif getattr(position, key) == 0.0:
            yield note(f"{where}.{key} is 0, as written", f"{where}.{key}")


def implausible_start(context: Context) -> Iterator[Finding]:
    """Name a start heading in radians, and starts less certain than a filter can bear."""
    start, sigma = context.config.start, context.config.start_sigma
    if not isinstance(start, str):
        heading = float(start[2])
        eighth = heading / (math.pi / 4.0)
        if heading != 0.0 and abs(heading) < 6.5 and abs(eighth - round(eighth)) < 0.01:
            yield warning(f"start has a heading of {heading:g} degrees, which looks like "
                          f"{round(45 * eighth)} degrees in radians", "start",
                          "give [x_m, y_m, heading_deg]")  # fmt: skip
        elif abs(heading) > 360.0:
            yield warning(f"start has a heading of {heading:g} degrees: more than a full turn",
                          "start", "give degrees between -180 and 360")  # fmt: skip
    if context.by_particles:  # does not linearize
        return
    if sigma.heading_deg > 45.0:
        yield warning(f"start_sigma.heading_deg is {sigma.heading_deg:g}: so wide a heading leads "
                      "a filter that linearizes astray", "start_sigma.heading_deg",
                      "find the heading first, or give it to 10 degrees or so")  # fmt: skip
    if context.extent > 0.0 and sigma.xy_m > context.extent:
        yield warning(f"start_sigma.xy_m is {sigma.xy_m:g}, the anchors span {context.extent:.3g} m"
                      ": a filter that linearizes cannot start so wide", "start_sigma.xy_m",
                      "find the position first, from ranges")  # fmt: skip
