# SPDX-License-Identifier: Apache-2.0
"""Checks of what is in the log, and when."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, note, warning
from locfuse.check.grid import on_map
from locfuse.config.schema import SOURCES, ignored_by
from locfuse.eval.dead_reckoning import legs
from locfuse.run.mcl import messages_for
from locfuse.run.messages import absent, radios_of, to_messages
from locfuse.run.start import require_headings, start_of
from locfuse.run.tracker import recovering_ekf
from locfuse.types import NANOSECONDS, OCCUPIED, Columns, ConfigError, LogError, StampArray

_FAR_M = 1e5  # coordinates beyond are of a map projection
# A robot that creeps has wheels or a radio that report every second all the same; none drives
# 180 km/h, nor do positions that jump, and that often.
_SLOW_HZ, _SLOW_MPS = 1.0, 0.05
_FAST_HZ, _FAST_MPS = 1000.0, 50.0
_USUAL_HZ = 10.0  # within a factor of 30, so that the unit is the nearest power of 1000


def run_errors(context: Context) -> Iterator[Finding]:
    """Report the error with which `run` would stop."""
    try:
        if context.config.mcl is not None:
            messages_for(context.config, context.log)
        messages = to_messages(context.log, context.config)
        require_headings(context.config, context.log)
        if not context.config.searches_start:
            start_of(context.config, context.truth, messages)
        if context.config.estimator.kind == "tag_triangle":
            recovering_ekf(context.config, context.log, messages.landmark_names,
                           *radios_of(context.log, messages, context.config))  # fmt: skip
    except ConfigError as problem:
        yield error(str(problem), "start", "without a start there is no run")
    except LogError as problem:
        yield error(str(problem), "log", "mend the log, or what the configuration uses of it")


def sources_without_messages(context: Context) -> Iterator[Finding]:
    """Name sources that the configuration asks for and the log does not have."""
    asked = "use" in context.config.model_fields_set
    for source in absent(context.config, context.log):
        if source in context.log:
            yield warning(f"{source}.csv is there, but has no message", f"{source}.csv",
                          "was the sensor switched on?")  # fmt: skip
        elif asked:
            yield warning(f"the configuration uses {source}, but the log has none", "use",
                          f"record {source}, or leave them out of use")  # fmt: skip


def messages_without_use(context: Context) -> Iterator[Finding]:
    """Name sources of the log that no filter will see."""
    if context.config.mcl is None:
        for source, why in ignored_by(context.config.estimator).items():
            if context.used(source) is not None:
                yield warning(f"the log has {source}, which are ignored: {why}", "estimator.kind",
                              f"choose another kind, or leave {source} out of use")  # fmt: skip
    for source in SOURCES:
        table = context.table(source)
        if table is not None and source not in context.config.use:
            yield note(f"the log has {len(table['stamp_ns'])} {source}, which are not in use",
                       "use")  # fmt: skip
    if context.table("scans") is not None and not _scans_are_used(context):
        yield note("scans.csv is read, but no filter uses it", "scans.csv")


def _scans_are_used(context: Context) -> bool:
    """Return whether a filter, a front end, or a start that has a map uses scans."""
    log, config = context.log, context.config
    starts = config.searches_start and log.has_laser and log.grid is not None
    makers = config.mcl, config.cylinders, config.scan_odometry
    return starts or any(part is not None for part in makers)


def rates_and_gaps(context: Context) -> Iterator[Finding]:
    """Report the rate of each source, and gaps longer than the filter bridges."""
    for source in SOURCES:
        table = context.used(source)
        if table is None or len(np.unique(table["stamp_ns"])) < 3:
            continue
        step = np.diff(np.unique(table["stamp_ns"])) / NANOSECONDS
        rate, gap = 1.0 / float(np.median(step)), float(step.max())
        yield note(f"{source}: {len(table['stamp_ns'])} messages, {rate:.3g} per second, longest "
                   f"gap {gap:.3g} s", f"{source}.csv")  # fmt: skip
        hold = context.models.hold_s
        if source == "odometry" and "v_mps" in table and gap > hold:
            yield warning(f"odometry is silent for up to {gap:.3g} s; after hold_s = {hold:g} s "
                          "the robot counts as lost", "estimator.hold_s",
                          "raise hold_s, or find what loses the rows")  # fmt: skip


def messages_too_late(context: Context) -> Iterator[Finding]:
    """Name sources whose messages arrive later than the history reaches back."""
    if context.by_particles:  # is fed in order of stamps
        return
    arrivals: list[StampArray] = []
    stamps: list[StampArray] = []
    kinds: list[str] = []
    for source in SOURCES:
        table = context.used(source)
        if table is not None:
            stamps.append(table["stamp_ns"])
            arrivals.append(table.get("arrival_ns", table["stamp_ns"]))
            kinds += [source] * len(table["stamp_ns"])
    if not kinds:
        return
    stamp, arrival, kind = np.concatenate(stamps), np.concatenate(arrivals), np.array(kinds)
    order = np.argsort(arrival, kind="stable")
    newest = np.maximum.accumulate(stamp[order])
    behind = (newest - stamp[order]) / NANOSECONDS
    for name in dict.fromkeys(kinds):
        late = behind[kind[order] == name]
        share = float(np.mean(late > context.config.history_s))
        if share > 0.001:
            yield warning(f"{100 * share:.3g} % of the {name} arrive more than history_s = "
                          f"{context.config.history_s:g} s late (up to {late.max():.3g} s) and are "
                          "lost", "history_s",
                          f"set history_s to {1.2 * late.max():.2g} or more")  # fmt: skip


def units_of_stamps(context: Context) -> Iterator[Finding]:
    """Name stamps in another unit: of all sources by rate and speed, of one by what it spans."""
    tables: dict[str, Columns | None] = {source: context.used(source) for source in SOURCES}
    tables["truth"] = context.table("truth")
    stamps = {name: np.unique(table["stamp_ns"]) / NANOSECONDS
              for name, table in tables.items() if table is not None}  # fmt: skip
    stamps = {name: at for name, at in stamps.items() if len(at) > 2}
    if not stamps:
        return
    # Ranges come in bursts, and a robot may be off for an hour: neither is the rate.
    rate = max(1.0 / float(np.quantile(np.diff(at), 0.9)) for at in stamps.values())
    speed = _speed(context)
    thousands = round(math.log(_USUAL_HZ / rate, 1000.0))
    if speed is not None and (
        (rate < _SLOW_HZ and speed < _SLOW_MPS) or (rate > _FAST_HZ and speed > _FAST_MPS)
    ):
        off = max(thousands, 1) if rate < _SLOW_HZ else min(thousands, -1)
        yield warning(f"the robot drives {speed:.2g} m/s, and its fastest source has {rate:.2g} "
                      f"messages a second: {_unit(off)}", "stamp_s", _factor(off))  # fmt: skip
        return
    spans = {name: float(at[-1] - at[0]) for name, at in stamps.items()}
    usual = sorted(spans.values())[(len(spans) - 1) // 2]
    for name, span in spans.items():
        off = round(math.log(span / usual, 1000.0))
        if off != 0 and abs(span / usual / 1000.0**off - 1.0) < 0.1:
            yield warning(f"{name}.csv spans {span:.3g} s, other sources {usual:.3g} s: "
                          f"{_unit(off)}", f"{name}.csv, stamp_s", _factor(off))  # fmt: skip


def _speed(context: Context) -> float | None:
    """Return the median speed over legs of the robot's path, m/s; None if it hardly moves."""
    table, paths = context.used("odometry"), [track.path for track in context.references]
    if table is not None and "dx_m" in table and context.odometry is not None:
        paths.insert(0, context.odometry)  # velocities give no distance that the stamps do not
    for path in paths:
        begin, end = legs(path.position).T
        if len(begin) >= 3:
            move = path.position[end] - path.position[begin]
            taken = (path.stamp_ns[end] - path.stamp_ns[begin]) / NANOSECONDS
            return float(np.median(np.hypot(*move.T) / taken))
    return None


def _unit(thousands: int) -> str:
    if thousands < 0:
        return f"are stamps {1000**-thousands} times too small?"
    return f"{('milli', 'micro', 'nano')[min(thousands, 3) - 1]}seconds taken for seconds?"


def _factor(thousands: int) -> str:
    way = "divide" if thousands > 0 else "multiply"
    return f"write seconds: {way} stamp_s by {1000 ** abs(thousands)}"


def duplicate_rows(context: Context) -> Iterator[Finding]:
    """Report duplicate ranges."""
    table = context.used("ranges")
    if table is None:
        return
    keys = [table[name] for name in ("stamp_ns", "tag", "anchor")]
    rows = set(zip(*(key.tolist() for key in keys), strict=True))
    twice = len(keys[0]) - len(rows)
    if twice > 0:
        yield warning(f"{twice} ranges have the stamp, tag and anchor of another row; each is "
                      "fused as a new measurement", "ranges.csv", "remove the copies")  # fmt: skip


def unknown_names(context: Context) -> Iterator[Finding]:
    """Report anchors and tags with ranges but no position, or a position but no ranges."""
    table = context.used("ranges")
    if table is None:
        return
    for column, placed, where in (
        ("anchor", context.names, "anchors.csv"),
        ("tag", list(context.log.tags), "log.yaml, tags"),
    ):
        names, counts = np.unique(table[column], return_counts=True)
        received = dict(zip(names.tolist(), counts.tolist(), strict=True))
        for name in sorted(set(received) - set(placed)):
            share = 100.0 * received[name] / len(table["stamp_ns"])
            yield warning(f"{column} {name!r} is received ({share:.3g} % of the ranges) but has no "
                          "position: those ranges are ignored", where,
                          f"add {name!r}, or correct its name; known are: "
                          f"{', '.join(placed) or 'none'}")  # fmt: skip
        for name in placed:
            if name not in received:
                yield warning(f"{column} {name!r} has a position but sends no ranges", where,
                              "is it switched on, and is its name the one it sends?")  # fmt: skip


def coordinates_of_a_projection(context: Context) -> Iterator[Finding]:
    """Name coordinates so large, or frames so far apart, that they are of another frame."""
    if len(context.anchors) and np.abs(context.anchors).max() > _FAR_M:
        far = float(np.abs(context.anchors).max())
        yield warning(f"anchors have coordinates up to {far:.3g} m, as of a map projection",
                      "anchors.csv", "subtract a nearby origin from anchors, truth, positions and "
                      "start")  # fmt: skip
    if len(context.anchors) < 2:
        return
    centre = context.anchors[:, :2].mean(axis=0)
    for source in ("positions", "poses", "truth"):
        table = context.table(source) if source == "truth" else context.used(source)
        if table is None:
            continue
        middle = np.array([np.median(table["x_m"]), np.median(table["y_m"])])
        away = float(np.linalg.norm(middle - centre))
        if away > 10.0 * max(context.extent, 10.0):
            yield error(f"{source}.csv is {away:.3g} m away from the anchors, which span "
                        f"{context.extent:.3g} m: another frame, or degrees of latitude",
                        f"{source}.csv", "bring anchors and positions into one frame, metres"
                        )  # fmt: skip


def angles_in_degrees(context: Context) -> Iterator[Finding]:
    """Name columns of radians whose values are degrees."""
    for source in ("truth", "poses"):
        table = context.table(source)
        if table is None or "heading_rad" not in table:
            continue
        largest = float(np.abs(table["heading_rad"]).max())
        if 7.0 < largest <= 361.0 and _follows_in_degrees(table):
            yield warning(f"heading_rad of {source}.csv reaches {largest:.4g}: degrees?",
                          f"{source}.csv, heading_rad", "write radians")  # fmt: skip
    table = context.used("odometry")
    if table is not None and "omega_radps" in table:
        fast = float(np.quantile(np.abs(table["omega_radps"]), 0.95))
        if fast > 10.0:
            yield warning(f"odometry turns at {fast:.3g} rad/s: degrees per second?",
                          "odometry.csv, omega_radps", "write radians per second")  # fmt: skip
    table = context.table("landmark_sightings")
    if table is not None and len(table["bearing_rad"]) > 0:
        largest = float(np.abs(table["bearing_rad"]).max())
        if largest > 7.0:
            yield warning(f"bearing_rad of landmark_sightings.csv reaches {largest:.4g}: degrees?",
                          "landmark_sightings.csv, bearing_rad", "write radians")  # fmt: skip
    sensor = context.log.landmark_sensor
    if sensor is not None and abs(sensor["pose_in_body"][2]) > 6.3:
        yield warning("the landmark sensor is turned by more than a full turn: degrees?",
                      "log.yaml, landmark_sensor", "write radians")  # fmt: skip
    lasers = context.log.lasers.values() if context.log.lasers else (context.log.laser,)
    for laser in filter(None, lasers):
        angles = [laser["pose_in_body"][2], laser["angle_min_rad"], laser["angle_increment_rad"]]
        if max(map(abs, angles)) > 6.3 or abs(angles[2]) > 0.35:
            yield warning("the laser's angles are larger than a full turn or its beams further "
                          "apart than 20 degrees: degrees?", "log.yaml, laser",
                          "write radians")  # fmt: skip


def _follows_in_degrees(table: Columns) -> bool:
    """Return whether headings follow the course of their own positions if taken as degrees."""
    at = np.column_stack([table["x_m"], table["y_m"]])
    begin, end = legs(at).T
    if len(begin) < 5:
        return False
    move = at[end] - at[begin]
    course = np.arctan2(move[:, 1], move[:, 0])
    heading = table["heading_rad"][begin]
    agree = [
        max(abs(np.mean(np.exp(1j * (course - sense * h)))) for sense in (1.0, -1.0))  # a compass
        for h in (heading, np.radians(heading))
    ]
    return bool(agree[1] > 0.8 and agree[1] > agree[0] + 0.2)


def unused_maps(context: Context) -> Iterator[Finding]:
    """Name maps without walls, and starts or truths off the map."""
    if context.table("scans") is not None and context.log.map is None:
        yield note("the log has scans but no map to match them against; `locfuse map` draws one",
                   "log.yaml, map")  # fmt: skip
    grid = context.log.grid
    if grid is None:
        return
    occupied = grid.cells == OCCUPIED
    if not occupied.any():
        yield error("the map has no occupied cell: no scan can match it", "log.yaml, map",
                    "check occupied_thresh and negate")  # fmt: skip
        return
    if float(occupied.mean()) > 0.5:
        yield warning(f"{100 * occupied.mean():.0f} % of the map is occupied: negate?",
                      "log.yaml, map", "check negate and occupied_thresh")  # fmt: skip
    if context.truth is not None:
        off = 1.0 - float(on_map(grid, context.truth.position).mean())
        if off > 0.01:
            yield warning(f"{100 * off:.3g} % of the truth lies off the map", "log.yaml, map",
                          "check origin and resolution of the map")  # fmt: skip
