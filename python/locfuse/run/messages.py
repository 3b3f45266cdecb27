# SPDX-License-Identifier: Apache-2.0
"""From the tables of a log to messages in order of arrival."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.build import build_anchors
from locfuse.config.schema import SOURCES, Odometry, RunConfig, Source
from locfuse.io.log_folder import FORCES, RATES
from locfuse.run.missing_inputs import how_to_add, where_named
from locfuse.types import NANOSECONDS, QUATERNION, Columns, Log, LogError, StampArray, Trajectory

MOTION = ("dx_m", "dy_m", "dheading_rad")  # of odometry
VELOCITY = ("v_mps", "v_left_mps", "omega_radps")
NOT_IN_PLANE = ("landmark_sightings have elevation_rad, so their ranges are not in the plane; set "
                "estimator.kind: air, or leave 'landmark_sightings' out of use")  # fmt: skip


@dataclass(frozen=True)
class Messages:
    """The messages of a log, ready for replay, and the source, names and row of each.

    All is sorted by arrival; arrays have shape (n,). `row` is the row in the log's table of that
    source. A landmark's name stands in `anchor`; lists of names are in order of id. An increment
    takes effect when its motion begins, all else at its stamp; `begin_ns` is the first effective
    stamp, `end_ns` the last stamp.
    """

    log: _core.MessageLog
    stamp_ns: StampArray
    effective_ns: StampArray
    source: NDArray[np.str_]
    tag: NDArray[np.str_]
    anchor: NDArray[np.str_]
    row: NDArray[np.intp]
    anchor_names: list[str]
    tag_names: list[str]
    landmark_names: list[str]
    begin_ns: int
    end_ns: int


def to_messages(log: Log, config: RunConfig) -> Messages:
    """Turn the tables that a configuration uses into messages, in order of arrival.

    The first row of odometry increments is a motion from before the log: only its stamp is used.
    Raises LogError where nothing is left to fuse, or ranges come without anchors or tags.
    """
    sources: tuple[Source, ...] = ("imu", *SOURCES) if config.is_inertial else SOURCES
    tables: dict[str, Mapping[str, NDArray[Any]]] = {
        source: as_measured(source, log[source], config, config.latency_of_tables_s[source])
        for source in sources
        if source in log and source in config.use and len(log[source]["stamp_ns"]) > 0
    }
    if not tables:
        present = [s for s in SOURCES if s in log and len(log[s]["stamp_ns"]) > 0]
        raise LogError(f"nothing to fuse: the log has {present or 'no messages'}, "
                       f"the config uses {list(config.use)}")  # fmt: skip
    if config.is_inertial and FORCES[0] not in tables.get("imu", {}):
        what = "imu" if "imu" not in tables else f"{FORCES[0]} in imu"
        raise LogError(f"estimator.air.motion is inertial, but the log has no {what}; "
                       f"{how_to_add(log, 'imu')}, or set motion: constant_velocity")  # fmt: skip
    if config.estimator.kind != "air" and "elevation_rad" in tables.get("landmark_sightings", {}):
        raise LogError(NOT_IN_PLANE)
    _check_clocks(tables)
    anchor_names, tag_names = _names(log, tables)
    is_mapped = config.estimator.kind == "landmark_slam"
    landmark_names = _landmark_names(log, tables.get("landmark_sightings"), is_mapped)
    messages = _core.MessageLog()
    parts: list[dict[str, Any]] = []
    for source, table in tables.items():
        part = _add(messages, source, table, anchor_names, tag_names, landmark_names)
        part["source"] = np.full(len(part["stamp"]), source)
        empty = np.full(len(part["stamp"]), "")
        part["tag"] = table.get("tag", empty)
        part["row"] = np.arange(len(part["stamp"]))
        part["anchor"] = table.get("anchor", table.get("landmark", empty))
        parts.append(part)
    messages.sort()
    column = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    order = np.argsort(column["arrival"], kind="stable")
    used = np.full(len(order), True)
    if config.watch_poses and not np.all(column["source"] == "poses"):
        used = column["source"] != "poses"  # which says nothing of when the others begin
    return Messages(
        log=messages,
        stamp_ns=column["stamp"][order],
        effective_ns=column["effective"][order],
        source=column["source"][order],
        tag=column["tag"][order],
        anchor=column["anchor"][order],
        row=column["row"][order],
        anchor_names=anchor_names,
        tag_names=tag_names,
        landmark_names=landmark_names,
        begin_ns=int(column["effective"][used].min()),
        end_ns=int(column["stamp"].max()),
    )


def absent(config: RunConfig, log: Log) -> list[str]:
    """Return the sources that ``use`` names, that nothing makes and the log has no message of."""
    made = {"poses"} if config.mcl is not None and config.mcl.poses_hz is not None else set()
    made |= {"landmark_sightings"} if config.cylinders is not None else set()
    made |= {"odometry"} if config.scan_odometry is not None else set()
    return [source for source in config.use
            if source not in made and (source not in log or not len(log[source]["stamp_ns"]))
            ]  # fmt: skip


def cut_off(
    log: Log,
    messages: Messages,
    until_ns: int,
    received: NDArray[np.bool_],
    scans: NDArray[np.bool_] | None = None,
) -> tuple[Log, Messages]:
    """Return a log and its messages as if it had ended at a stamp.

    `received` and `scans` are bool arrays, shape (n,), of which messages and which scans stay. Of
    truth, and of all else that they do not name, what has a later stamp is left out.
    """
    rows: dict[str, NDArray[Any]] = {
        source: np.sort(messages.row[received & (messages.source == source)])
        for source in np.unique(messages.source).tolist()
    }
    if scans is not None:
        rows["scans"] = scans
    tables = {}
    for name, table in log.tables.items():
        if "stamp_ns" in table:
            kept = rows[name] if name in rows else table["stamp_ns"] <= until_ns
            table = {column: values[kept] for column, values in table.items()}
        tables[name] = table
    columns = {
        name: getattr(messages, name)[received]
        for name in ("stamp_ns", "effective_ns", "source", "tag", "anchor", "row")
    }
    return replace(log, tables=tables), replace(messages, **columns, end_ns=until_ns)


def as_measured(source: Source, table: Columns, config: RunConfig, latency_s: float) -> Columns:
    """Return a table at the stamps at which it was taken, and motions at their scale.

    It arrives when it did. Odometry that was made is so already.
    """
    if "origin" in table:
        return table
    if source == "odometry":
        table = {**table, **corrected(table, config.estimator.odometry)}
    delay = round(latency_s * NANOSECONDS)
    if delay == 0:
        return table
    effective = _effective(source, table)
    begins = {"begin_ns": effective - delay} if "begin_ns" in table else {}
    return {**table, "stamp_ns": table["stamp_ns"] - delay, **begins,
            "arrival_ns": table.get("arrival_ns", effective)}  # fmt: skip


def corrected(motion: Mapping[str, Any], wheels: Odometry) -> dict[str, Any]:
    """Return columns of odometry, or numbers of a row, with the wheels' errors taken out.

    By docs/models/motion.md eq. (1.7): a chord turns by half of what the turn does.
    """
    names = forward, left, turn = MOTION if "dx_m" in motion else VELOCITY
    found = {name: motion[name] for name in names if name in motion}
    bends = names == MOTION and wheels.turn_scale != 1.0
    if bends or wheels.direction_rad != 0.0:
        bend = 0.5 * (wheels.turn_scale - 1.0) * motion[turn] if bends else 0.0
        angle = wheels.direction_rad + bend
        c, s = np.cos(angle), np.sin(angle)
        x, y = motion[forward], motion.get(left, 0.0)
        found |= {forward: c * x - s * y, left: s * x + c * y}
    return {name: value * (wheels.turn_scale if name == turn else wheels.distance_scale)
            for name, value in found.items()}  # fmt: skip


def _effective(source: str, table: Columns) -> StampArray:
    """Return when the messages of a table take effect."""
    stamp: StampArray = table["stamp_ns"]
    if source != "odometry" or "dx_m" not in table:
        return stamp
    return table.get("begin_ns", np.concatenate([stamp[:1], stamp[:-1]]))


def _check_clocks(tables: Mapping[str, Mapping[str, NDArray[Any]]]) -> None:
    """Refuse sources that are an hour or more apart: they count time from different origins."""
    spans = sorted(
        (int(table["stamp_ns"].min()), int(table["stamp_ns"].max()), source)
        for source, table in tables.items()
        if len(table["stamp_ns"]) > 0
    )
    for (_, end, first), (later, _, second) in pairwise(spans):
        if later - end > 3600 * NANOSECONDS:
            raise LogError(f"{second} begin {(later - end) / NANOSECONDS:.6g} s after {first} end; "
                           "do all files count time from the same origin?")  # fmt: skip


def _names(
    log: Log, tables: Mapping[str, Mapping[str, NDArray[Any]]]
) -> tuple[list[str], list[str]]:
    """Return anchor and tag names in order of id: those with a place first."""
    anchors = [str(name) for name in log["anchors"]["anchor"]] if "anchors" in log else []
    tags = list(log.tags)
    if "ranges" in tables:
        ranges = tables["ranges"]
        if not anchors:
            raise LogError(f"the log has ranges but no anchors; {how_to_add(log, 'anchors')}, or "
                           "leave 'ranges' out of use")  # fmt: skip
        if not tags:
            raise LogError("the log has ranges but nothing says where tags sit; "
                           f"{how_to_add(log, 'tags')}")  # fmt: skip
        for column, known in (("anchor", anchors), ("tag", tags)):
            named = sorted(set(ranges[column].tolist()))
            if named and not set(named) & set(known):
                raise LogError(f"no range can be used: ranges name {column}s {named}, "
                               f"{where_named(log, column + 's')} names {known}")  # fmt: skip
        anchors += sorted(set(ranges["anchor"].tolist()) - set(anchors))
        tags += sorted(set(ranges["tag"].tolist()) - set(tags))
    if "tag" in tables.get("positions", {}):
        named = sorted(set(tables["positions"]["tag"].tolist()) - {""})
        if named and not set(named) & set(tags):
            raise LogError(f"no position of a tag can be used: positions name tags {named}, "
                           f"{where_named(log, 'tags')} names {list(log.tags)}")  # fmt: skip
        tags += sorted(set(named) - set(tags))
    return anchors, tags


def _landmark_names(
    log: Log, sightings: Mapping[str, NDArray[Any]] | None, is_mapped: bool
) -> list[str]:
    """Return landmark names in order of id: those with a place first, unless they are mapped."""
    names = [str(name) for name in log["landmarks"]["landmark"]] if "landmarks" in log else []
    if sightings is None:
        return names
    if is_mapped:
        return names + sorted(set(sightings["landmark"].tolist()) - {""} - set(names))
    if not names:
        raise LogError("the log has landmark_sightings but no landmarks; "
                       f"{how_to_add(log, 'landmarks')}, or leave 'landmark_sightings' out of use"
                       )  # fmt: skip
    named = sorted(set(sightings["landmark"].tolist()) - {""})
    if named and not set(named) & set(names) and "" not in sightings["landmark"]:
        raise LogError(f"no sighting can be used: sightings name landmarks {named}, "
                       f"{where_named(log, 'landmarks')} names {names}")  # fmt: skip
    return names + sorted(set(named) - set(names))


def _ids(names: list[str], column: NDArray[Any]) -> NDArray[np.int32]:
    unique, inverse = np.unique(column, return_inverse=True)
    lookup = np.array(
        [names.index(str(name)) if str(name) else -1 for name in unique], dtype=np.int32
    )
    ids: NDArray[np.int32] = lookup[inverse]
    return ids


def _add(
    messages: _core.MessageLog,
    source: str,
    table: Mapping[str, NDArray[Any]],
    anchor_names: list[str],
    tag_names: list[str],
    landmark_names: list[str],
) -> dict[str, Any]:
    """Add one table; return its stamps, effective stamps and arrivals."""
    stamp, arrival = table["stamp_ns"], table.get("arrival_ns")
    effective = _effective(source, table)
    if source == "odometry":
        add_odometry(messages, table)
    elif source == "ranges":
        tag, anchor = _ids(tag_names, table["tag"]), _ids(anchor_names, table["anchor"])
        messages.add_ranges(stamp, tag, anchor, table["range_m"], table.get("sigma_m"), arrival)
    elif source == "positions":
        position = np.column_stack([table["x_m"], table["y_m"]])
        of_tag = _ids(tag_names, table["tag"]) if "tag" in table else None
        messages.add_positions(stamp, position, table["sigma_m"], arrival, of_tag)
    elif source == "landmark_sightings":
        messages.add_sightings(stamp, _ids(landmark_names, table["landmark"]), table["range_m"],
                               table["bearing_rad"], table.get("sigma_range_m"),
                               table.get("sigma_bearing_rad"), arrival, table.get("elevation_rad"),
                               table.get("sigma_elevation_rad"))  # fmt: skip
    elif source == "altitudes":
        messages.add_altitudes(stamp, table["height_m"], table.get("sigma_m"), arrival)
    elif source == "headings":
        course = table.get("is_course")
        messages.add_headings(stamp, table["heading_rad"], table.get("sigma_rad"),
                              None if course is None else course != 0, arrival)  # fmt: skip
    elif source == "imu":
        add_samples(messages, table)
    else:
        pose = np.column_stack([table["x_m"], table["y_m"], table["heading_rad"]])
        sigma_xy, sigma_heading = table["sigma_xy_m"], table["sigma_heading_rad"]
        messages.add_poses(stamp, pose, sigma_xy, sigma_heading, arrival)
    arrived = effective if arrival is None else arrival
    return {"stamp": stamp, "effective": effective, "arrival": arrived}


def add_samples(messages: _core.MessageLog, table: Mapping[str, NDArray[Any]]) -> None:
    """Add samples of an IMU, which may have no forces."""
    rates = np.column_stack([table[name] for name in RATES])
    forces = np.column_stack([table[name] for name in FORCES]) if FORCES[0] in table else None
    messages.add_samples(table["stamp_ns"], rates, forces, table.get("arrival_ns"))


def add_odometry(messages: _core.MessageLog, table: Mapping[str, NDArray[Any]]) -> None:
    """Add a table of odometry; the first increment of a file counts as no motion."""
    stamp, arrival = table["stamp_ns"], table.get("arrival_ns")
    if "dx_m" not in table:
        messages.add_velocities(stamp, table["v_mps"], table["omega_radps"], arrival,
                                table.get("v_left_mps"))  # fmt: skip
        return
    motion = np.column_stack([table["dx_m"], table["dy_m"], table["dheading_rad"]])
    if "begin_ns" not in table:
        motion[:1] = 0.0
    messages.add_increments(_effective("odometry", table), stamp, motion, arrival,
                            table.get("variance"), table.get("origin"), table.get("again")
                            )  # fmt: skip


def radios_of(
    log: Log, messages: Messages, config: RunConfig
) -> tuple[_core.AnchorMap, list[_core.Tag]]:
    """Return the anchors and the tags that have a place, with the ids of the messages.

    Raises ConfigError where the configuration names an anchor that the log does not have.
    """
    anchors = build_anchors(log.tables.get("anchors"), messages.anchor_names, config.anchors)
    tags = [_core.Tag(i, list(log.tags[name])) for i, name in enumerate(messages.tag_names)
            if name in log.tags]  # fmt: skip
    return anchors, tags


def landmarks_of(log: Log, messages: Messages) -> _core.LandmarkSensor:
    """Return the landmarks that have a place, with the ids of the messages, and their sensor."""
    return landmark_sight(log, messages.landmark_names)


def known_landmarks(log: Log, names: list[str]) -> list[_core.KnownLandmark]:
    """Return the landmarks of a log as a `LandmarkEkf` begins with them; ids as in `names`.

    Those without a covariance, or with one of 0, are exact. A table does not have correlations, and
    a map is mostly turned and shifted as a whole: n covariances are taken n times, which bounds
    them together whatever their correlations are (P <= n diag(P_11, ..., P_nn)).
    """
    if "landmarks" not in log:
        return []
    table = log["landmarks"]
    ids = _ids(names, table["landmark"]).tolist()
    exact = np.zeros(len(ids))
    xx, xy, yy = (table.get(name, exact) for name in ("cov_x_x", "cov_x_y", "cov_y_y"))
    uncertain = int(np.count_nonzero(xx > 0.0))
    covariance = uncertain * np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
    places = zip(ids, table["x_m"].tolist(), table["y_m"].tolist(), covariance, strict=True)
    return [_core.KnownLandmark(i, [x, y], P if P[0, 0] > 0.0 else None) for i, x, y, P in places]


def landmark_sight(log: Log, names: list[str]) -> _core.LandmarkSensor:
    """Return the landmarks of a log, whose ids are their places in `names`, and their sensor."""
    if "landmarks" not in log:
        return _core.LandmarkSensor(_core.LandmarkMap([]), landmark_sensor_of(log))
    table = log["landmarks"]
    radius = table.get("radius_m", np.zeros(len(table["landmark"])))
    ids = _ids(names, table["landmark"]).tolist()
    height = table.get("z_m", np.zeros(len(ids)))
    columns = (values.tolist() for values in (table["x_m"], table["y_m"], radius, height))
    known = _core.LandmarkMap([_core.Landmark(i, [x, y], r, z)
                               for i, x, y, r, z in zip(ids, *columns, strict=True)])  # fmt: skip
    return _core.LandmarkSensor(known, landmark_sensor_of(log))


def landmark_sensor_of(log: Log) -> _core.Pose2:
    """Return the pose of the landmark sensor in body."""
    mount = log.landmark_sensor
    return _core.Pose2() if mount is None else _core.Pose2(*map(float, mount["pose_in_body"]))


def trajectory_of(estimates: list[_core.PoseEstimate]) -> Trajectory:
    """Return estimates as one trajectory, with covariances."""
    return Trajectory(
        np.array([e.stamp for e in estimates], np.int64),
        np.array([[e.pose.x, e.pose.y] for e in estimates]).reshape(-1, 2),
        np.array([e.pose.heading for e in estimates]),
        np.array([e.covariance for e in estimates]).reshape(-1, 3, 3),
    )


def truth_of(log: Log) -> Trajectory | None:
    """Return the reference trajectory of a log, if it has one."""
    if "truth" not in log:
        return None
    table = log["truth"]
    heading = table.get("heading_rad")
    return Trajectory(
        table["stamp_ns"],
        np.column_stack([table["x_m"], table["y_m"]]).astype(float),
        heading,
        height=table.get("z_m"),
        orientation=np.column_stack([table[name] for name in QUATERNION])
        if QUATERNION[0] in table
        else None,
    )
