# SPDX-License-Identifier: Apache-2.0
"""One run: messages in, poses, outcomes and metrics out."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.build import build_anchors, build_estimator_config
from locfuse.config.schema import SOURCES, Dataset, RunConfig
from locfuse.eval.errors import LONGEST_GAP_S, interpolate
from locfuse.eval.metrics import metrics
from locfuse.io.datasets import convert
from locfuse.io.log_folder import read_log
from locfuse.sim.scenario import simulate
from locfuse.start import start_from_nothing
from locfuse.types import (
    NANOSECONDS,
    ConfigError,
    Log,
    LogError,
    Outcomes,
    RunResult,
    StampArray,
    Trajectory,
    nearest,
)

VERDICTS = np.array([verdict.name.lower() for verdict in _core.Verdict])

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Messages:
    """A log made ready for replay, and what each message was.

    Attributes
    ----------
    log : MessageLog
        Sorted by arrival.
    stamp_ns, source, tag, anchor : arrays, shape (n,)
        In the same order; names for people.
    anchor_names, tag_names : list of str
        Name of each id.
    begin_ns, end_ns : int
        First effective stamp and last stamp.
    """

    log: _core.MessageLog
    stamp_ns: StampArray
    source: NDArray[np.str_]
    tag: NDArray[np.str_]
    anchor: NDArray[np.str_]
    anchor_names: list[str]
    tag_names: list[str]
    begin_ns: int
    end_ns: int


def run(
    config: RunConfig,
    log: Log | None = None,
    *,
    base: Path | None = None,
    seed: int | None = None,
    start: _core.PoseEstimate | None = None,
    progress: Progress | None = None,
) -> RunResult:
    """Localize along a log.

    Parameters
    ----------
    config : RunConfig
    log : Log, optional
        Instead of what the configuration names.
    base : Path, optional
        Folder that the configuration's paths are relative to.
    seed : int, optional
        Of the simulation, instead of what the configuration says.
    start : PoseEstimate, optional
        Instead of what the configuration says.
    progress : callable, optional
        Told (messages done, messages in all).

    Returns
    -------
    RunResult

    Raises
    ------
    ConfigError, LogError
        If the configuration or the log cannot be used as they are.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> result = run(parse_config({"simulation": {"duration_s": 10}}), seed=1)
    >>> result.metrics["position_rmse_m"] < 0.1
    True
    """
    if seed is not None:
        config = config.model_copy(update={"seed": seed})
    if log is None:
        log = load_log(config, base, config.seed)
    messages = to_messages(log, config)
    truth = truth_of(log)
    anchors = build_anchors(log.tables.get("anchors"), messages.anchor_names, config.anchors)
    tags = [_core.Tag(i, list(log.tags[name])) for i, name in enumerate(messages.tag_names)
            if name in log.tags]  # fmt: skip
    first, found = 0, None
    if start is None and config.start == "auto":
        ekf, first, found = start_from_nothing(config, log, messages.log, messages.begin_ns,
                                               anchors, tags)  # fmt: skip
    else:
        start = start_of(config, truth, messages) if start is None else start
        ekf = _core.PoseEkf(build_estimator_config(config.estimator), anchors, tags, start)
    start_ns = ekf.belief.stamp
    total = len(messages.log)
    began = time.perf_counter()
    record = _core.replay(
        ekf,
        messages.log,
        history=round(config.history_s * NANOSECONDS),
        progress=None if progress is None else (lambda done: progress(done, total)),
        first=first,
    )
    wall_s = time.perf_counter() - began
    if progress is not None:
        progress(total, total)
    poses = record.poses
    estimate = Trajectory(record.stamp_ns, poses[:, :2].copy(), poses[:, 2].copy(),
                          record.covariances)  # fmt: skip
    outcomes = _outcomes(messages, record, log, config, start_ns)
    duration_s = (messages.end_ns - messages.begin_ns) / NANOSECONDS
    return RunResult(
        config=config.model_dump(mode="json"),
        log=log,
        estimate=estimate,
        truth=truth,
        outcomes=outcomes,
        metrics={
            **metrics(estimate, truth, outcomes, duration_s, wall_s),
            "start_s": None if found is None else found.seconds,
        },
        start=found,
    )


def load_log(config: RunConfig, base: Path | None, seed: int) -> Log:
    """Return the log that a configuration names: simulated, read or converted."""
    base = Path() if base is None else base
    if config.simulation is not None:
        return simulate(config.simulation, np.random.default_rng(seed), base)
    if isinstance(config.log, Dataset):
        source = (base / config.log.path).resolve()
        with tempfile.TemporaryDirectory() as out:
            folders = {folder.name: folder for folder in convert(config.log.dataset, source,
                                                                 Path(out) / "log")}  # fmt: skip
            name = config.log.run or next(iter(folders))
            if name not in folders:
                raise ConfigError(f"log.run: no run {name!r}; {nearest(name, folders)}")
            return read_log(folders[name])
    if config.log is not None:
        return read_log(base / config.log)
    raise ConfigError("the config names no 'log' and no 'simulation'; give one, or --log DIR")


def truth_of(log: Log) -> Trajectory | None:
    """Return the reference trajectory of a log, if it has one."""
    if "truth" not in log:
        return None
    table = log["truth"]
    heading = table.get("heading_rad")
    return Trajectory(
        table["stamp_ns"], np.column_stack([table["x_m"], table["y_m"]]).astype(float), heading
    )


def start_of(config: RunConfig, truth: Trajectory | None, messages: Messages) -> _core.PoseEstimate:
    """Return where the estimator starts, and when.

    Raises
    ------
    ConfigError
        If the start is ``truth`` and the log has none, or none with a heading.
    """
    xy, turn = config.start_sigma.xy_m, np.deg2rad(config.start_sigma.heading_deg)
    covariance = np.diag([xy, xy, turn]) ** 2
    if config.start == "auto":
        raise ConfigError("start is 'auto'; expected 'truth' or [x, y, heading_deg] here")
    if config.start != "truth":
        x, y, heading_deg = config.start
        pose = _core.Pose2(x, y, _core.wrap_angle(float(np.deg2rad(heading_deg))))
        return _core.PoseEstimate(messages.begin_ns, pose, covariance)
    if truth is None or truth.heading is None:
        lacks = "no truth.csv" if truth is None else "a truth.csv without headings"
        raise ConfigError(f"start is 'truth', but the log has {lacks}; "
                          "set start: [x, y, heading_deg]")  # fmt: skip
    if int(truth.stamp_ns[0]) > messages.end_ns:
        raise ConfigError("start is 'truth', but truth.csv begins after the last message; do all "
                          "files count time from the same origin?")  # fmt: skip
    stamp = max(int(truth.stamp_ns[0]), messages.begin_ns)
    at, inside = interpolate(truth, np.array([stamp], dtype=np.int64))
    if stamp > int(truth.stamp_ns[-1]):
        raise ConfigError("start is 'truth', but truth.csv ends before the first message")
    if not inside[0] or at.heading is None:
        raise ConfigError(
            f"start is 'truth', but truth.csv has a gap of more than {LONGEST_GAP_S:g} s at the "
            "first message; set start: [x, y, heading_deg]"
        )
    pose = _core.Pose2(float(at.position[0, 0]), float(at.position[0, 1]), float(at.heading[0]))
    return _core.PoseEstimate(stamp, pose, covariance)


def to_messages(log: Log, config: RunConfig) -> Messages:
    """Turn the tables that a configuration uses into messages, in order of arrival.

    The first row of odometry increments tells a motion from before the log: only its stamp is used.

    Raises
    ------
    LogError
        If nothing is left to fuse, or ranges come without anchors or tags.
    """
    tables: dict[str, Mapping[str, NDArray[Any]]] = {
        source: log[source]
        for source in SOURCES
        if source in log and source in config.use and len(log[source]["stamp_ns"]) > 0
    }
    if not tables:
        present = [s for s in SOURCES if s in log and len(log[s]["stamp_ns"]) > 0]
        raise LogError(f"nothing to fuse: the log has {present or 'no messages'}, "
                       f"the config uses {list(config.use)}")  # fmt: skip
    _check_clocks(tables)
    anchor_names, tag_names = _names(log, tables.get("ranges"))
    messages = _core.MessageLog()
    parts: list[dict[str, Any]] = []
    for source, table in tables.items():
        part = _add(messages, source, table, anchor_names, tag_names)
        part["source"] = np.full(len(part["stamp"]), source)
        empty = np.full(len(part["stamp"]), "")
        part["tag"], part["anchor"] = table.get("tag", empty), table.get("anchor", empty)
        parts.append(part)
    messages.sort()
    column = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    order = np.argsort(column["arrival"], kind="stable")
    return Messages(
        log=messages,
        stamp_ns=column["stamp"][order],
        source=column["source"][order],
        tag=column["tag"][order],
        anchor=column["anchor"][order],
        anchor_names=anchor_names,
        tag_names=tag_names,
        begin_ns=int(column["effective"].min()),
        end_ns=int(column["stamp"].max()),
    )


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


def _names(log: Log, ranges: Mapping[str, NDArray[Any]] | None) -> tuple[list[str], list[str]]:
    """Return anchor and tag names in order of id: those with a place first."""
    anchors = [str(name) for name in log["anchors"]["anchor"]] if "anchors" in log else []
    tags = list(log.tags)
    if ranges is not None:
        if not anchors:
            raise LogError("the log has ranges but no anchors.csv; add it, or leave 'ranges' out "
                           "of use")  # fmt: skip
        if not tags:
            raise LogError("the log has ranges but its log.yaml names no tags; add "
                           "'tags: {NAME: [x, y, z]}'")  # fmt: skip
        for column, known, where in (("anchor", anchors, "anchors.csv"), ("tag", tags, "log.yaml")):
            named = sorted(set(ranges[column].tolist()))
            if named and not set(named) & set(known):
                raise LogError(f"no range can be used: ranges.csv names {column}s {named}, {where} "
                               f"names {known}")  # fmt: skip
        anchors += sorted(set(ranges["anchor"].tolist()) - set(anchors))
        tags += sorted(set(ranges["tag"].tolist()) - set(tags))
    return anchors, tags


def _ids(names: list[str], column: NDArray[Any]) -> NDArray[np.int32]:
    unique, inverse = np.unique(column, return_inverse=True)
    lookup = np.array([names.index(str(name)) for name in unique], dtype=np.int32)
    ids: NDArray[np.int32] = lookup[inverse]
    return ids


def _add(
    messages: _core.MessageLog,
    source: str,
    table: Mapping[str, NDArray[Any]],
    anchor_names: list[str],
    tag_names: list[str],
) -> dict[str, Any]:
    """Add one table; return its stamps, effective stamps and arrivals."""
    stamp, arrival = table["stamp_ns"], table.get("arrival_ns")
    effective = stamp
    if source == "odometry" and "dx_m" in table:
        begin = np.concatenate([stamp[:1], stamp[:-1]])
        motion = np.column_stack([table["dx_m"], table["dy_m"], table["dheading_rad"]])
        motion[:1] = 0.0
        effective = begin
        messages.add_increments(begin, stamp, motion, arrival)
    elif source == "odometry":
        messages.add_velocities(stamp, table["v_mps"], table["omega_radps"], arrival)
    elif source == "ranges":
        tag, anchor = _ids(tag_names, table["tag"]), _ids(anchor_names, table["anchor"])
        messages.add_ranges(stamp, tag, anchor, table["range_m"], table.get("sigma_m"), arrival)
    elif source == "positions":
        position = np.column_stack([table["x_m"], table["y_m"]])
        messages.add_positions(stamp, position, table["sigma_m"], arrival)
    else:
        pose = np.column_stack([table["x_m"], table["y_m"], table["heading_rad"]])
        sigma_xy, sigma_heading = table["sigma_xy_m"], table["sigma_heading_rad"]
        messages.add_poses(stamp, pose, sigma_xy, sigma_heading, arrival)
    heard = effective if arrival is None else arrival
    return {"stamp": stamp, "effective": effective, "arrival": heard}


def _outcomes(
    messages: Messages, record: _core.RunLog, log: Log, config: RunConfig, start_ns: int
) -> Outcomes:
    verdict = VERDICTS[record.verdict]
    nis, dof = record.nis, record.dof
    reason = np.full(len(verdict), "", dtype=object)
    gates = {
        "ranges": _core.Gate(config.estimator.gate_range),
        "positions": _core.Gate(config.estimator.gate_position),
        "poses": _core.Gate(config.estimator.gate_pose),
    }
    for row in np.flatnonzero(verdict == "gated"):
        limit = gates[str(messages.source[row])].limit(int(dof[row]))
        reason[row] = f"nis {nis[row]:.4g} > {limit:.4g}"
    placed = set(log["anchors"]["anchor"].tolist()) if "anchors" in log else set()
    for row in np.flatnonzero(verdict == "not_modelled"):
        if messages.anchor[row] not in placed:
            reason[row] = f"unknown anchor {messages.anchor[row]}"
        elif messages.tag[row] not in log.tags:
            reason[row] = f"unknown tag {messages.tag[row]}"
        else:
            reason[row] = "tag on the anchor: no direction"
    reason[verdict == "ignored"] = "used for the start"
    early = messages.stamp_ns < start_ns
    reason[(verdict == "stale") & early] = "before the start"
    reason[(verdict == "stale") & ~early] = f"older than the history of {config.history_s:g} s"
    return Outcomes(
        stamp_ns=messages.stamp_ns,
        source=messages.source,
        tag=messages.tag,
        anchor=messages.anchor,
        verdict=verdict,
        nis=nis,
        dof=dof,
        log_likelihood=record.log_likelihood,
        residual=record.residual,
        reason=reason.astype(str),
    )
