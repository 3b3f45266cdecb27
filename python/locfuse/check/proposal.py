# SPDX-License-Identifier: Apache-2.0
"""A configuration for a recording: the keys that matter, and where each value comes from."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import yaml

from locfuse.check.registry import check
from locfuse.config.load import parse_config
from locfuse.config.ros import Topics, plain, types_of
from locfuse.io.recording import read_recording
from locfuse.io.rosbag.bag_stream import Bag, is_bag
from locfuse.io.rosbag.decode import MessageError, frame_of
from locfuse.io.rosbag.wire import broken, deserializer
from locfuse.types import NANOSECONDS, Columns, Log, LogError

MIN_RANGES = 20  # of a tag and an anchor, to see their scatter
MAX_PERIOD_S = 1.0  # between them
LEAST_SIGMA_M = 0.02
_NAMED = ("anchors", "fields", "range_topics")  # sections whose keys people name
GIVEN = "given"  # where a value comes from
# Sources whose types say what they are: poses may be of anybody, points of anything.
BY_TYPE = ("odometry", "imu", "ranges", "positions", "landmark_sightings", "map")
Line: TypeAlias = tuple[str, Any, str]  # key with its sections, value, where it comes from


class Proposal(NamedTuple):
    """A configuration as YAML with comments, and by name the files of the folder ``ros.world``.

    These are for what a bag does not say, with gaps to be filled in; often there are none.
    """

    text: str
    world: dict[str, str]


def proposal(path: Path, base: Path, world: str = "world") -> Proposal:
    """Return a configuration for a log folder or a bag.

    `base` is the folder in which the configuration will be, `world` that of what has to be filled
    in, if anything. What `check` finds stands at the end. Raises LogError as `read_recording`.
    """
    lines, log = proposed(path, base)
    files = _gaps(log) if is_bag(path) else {}
    if files:
        lines.append(("ros.world", world, "to be filled in: where anchors and tags are"))
    text = "".join(written(lines))
    config = parse_config(yaml.safe_load(text))
    if files:  # of which `check` has nothing else to say
        return Proposal(text, files)
    found = [f for f in check(config, log).findings if f.severity != "note"]
    problems = "".join(f"# {f.severity}: {f.what} ({f.where}): {f.advice}\n" for f in found)
    if problems:
        text += f"\n# What `locfuse check` says of it:\n{problems}"
    return Proposal(text, files)


def proposed(
    path: Path, base: Path, given: Mapping[str, Any] | None = None
) -> tuple[list[Line], Log]:
    """Return the lines of a configuration for a recording, and the recording.

    What is `given` stays as it is. Raises LogError as `read_recording`, ConfigError where that is
    no part of a configuration.
    """
    known = flat(given or {})
    ros = parse_config({"start": "auto", **(given or {})}).ros
    topics = dict(_topics(path)) if is_bag(path) else {}
    topics = {key: found for key, found in topics.items() if key not in ros.topics.model_fields_set}
    named: dict[str, Any] = {key: topic for key, (topic, _) in topics.items()}
    named = ros.topics.model_dump(exclude_unset=True) | named
    log = read_recording(path, ros.model_copy(update={"topics": Topics(**named)}), base)
    keys = [f"{key}." for key, _ in known]
    lines = [line for line in (*_keys(log), *((f"ros.topics.{key}", *found)
             for key, found in topics.items()))
             if not any(key.startswith(f"{line[0]}.") for key in keys)]  # fmt: skip
    first = [("log", _relative(path, base), "recorded drive; --log overrides it"),
             *((key, value, GIVEN) for key, value in known if key != "log")]  # fmt: skip
    return [*first, *lines], log


def flat(values: Mapping[str, Any], parents: tuple[str, ...] = ()) -> list[tuple[str, Any]]:
    """Return the keys of nested sections, joined by dots; what people name stays whole.

    Examples
    --------
    >>> flat({"mcl": {}, "estimator": {"range": {"sigma_m": 0.1}}})
    [('mcl', {}), ('estimator.range.sigma_m', 0.1)]
    """
    found: list[tuple[str, Any]] = []
    for key, value in values.items():
        if isinstance(value, Mapping) and value and key not in _NAMED:
            found += flat(value, (*parents, key))
        else:
            found.append((".".join((*parents, key)), value))
    return found


def _gaps(log: Log) -> dict[str, str]:
    """Return files for anchors and tags of which the recording has ranges, but no positions."""
    ranges = log.tables.get("ranges", {})
    if not len(ranges.get("stamp_ns", ())) or "anchors" in log:
        return {}
    anchors = StringIO()
    table = csv.writer(anchors, lineterminator="\n")
    table.writerow(["anchor", "x_m", "y_m", "z_m"])
    table.writerows([name, "", "", ""] for name in np.unique(ranges["anchor"]).tolist())
    files = {"anchors.csv": anchors.getvalue()}
    missing = [name for name in np.unique(ranges["tag"]).tolist() if name not in log.tags]
    if missing:
        tags = {name: ["forward", "left", "up"] for name in missing}
        text = yaml.safe_dump({"tags": tags}, default_flow_style=None)
        files["log.yaml"] = f"# places of tags on the body [m]\n{text}"
    return files


def _keys(log: Log) -> Iterator[Line]:
    truth = log.tables.get("truth", {})
    is_known = "heading_rad" in truth and len(truth["stamp_ns"]) > 0
    why = "found: the recording has a reference" if is_known else "found without a prior"
    flies = _flies(log)
    if flies and not is_known:
        yield "start", [0.0, 0.0, 0.0], "a guess [m, m, deg]: that of a flight is not searched"
    else:
        yield "start", "truth" if is_known else "auto", why
    if flies:
        yield "estimator.kind", "air", "found: altitudes or elevations, so the body flies"
        if "odometry" in log:
            yield "estimator.air.motion", "odometry", "found"
    elif len(log.tables.get("scans", {}).get("stamp_ns", ())):
        if log.grid is not None:
            yield "mcl", {}, "found: scans and a map, so particles localize on it"
        elif "odometry" not in log:
            yield "scan_odometry", {}, "found: scans and no odometry"
    ranges = log.tables.get("ranges", {})
    if len(ranges.get("stamp_ns", ())) and "sigma_m" not in ranges:
        sigma, links = _scatter(ranges)
        if links:
            yield ("estimator.range.sigma_m", max(LEAST_SIGMA_M, float(f"{sigma:.2g}")),
                   f"found: how {links} pairs of tag and anchor scatter")  # fmt: skip
        else:
            yield "estimator.range.sigma_m", 0.3, "a guess: too few ranges to see their scatter"
    for source, key, guess in (("positions", "sigma_m", 0.5), ("poses", "sigma_xy_m", 0.2)):
        sigmas = log.tables.get(source, {}).get(key, np.ones(1))
        if np.any(sigmas <= 0.0):
            why = f"a guess: {np.mean(sigmas <= 0.0):.0%} of the {source} bring no sigma"
            yield f"estimator.{source[:-1]}.sigma_m", guess, why


def _flies(log: Log) -> bool:
    seen = log.tables.get("landmark_sightings", {})
    return "elevation_rad" in seen or len(log.tables.get("altitudes", {}).get("stamp_ns", ())) > 0


def _scatter(ranges: Columns) -> tuple[float, int]:
    """Return the sigma of ranges by their second differences, and of how many pairs it is.

    Motion adds little to them at some ranges a second, outliers nothing to their median.
    """
    sigmas = []
    links = np.char.add(np.char.add(ranges["tag"], "\n"), ranges["anchor"])
    for link in np.unique(links):
        mine = links == link
        order = np.argsort(ranges["stamp_ns"][mine], kind="stable")
        stamp, value = ranges["stamp_ns"][mine][order], ranges["range_m"][mine][order]
        if len(value) >= MIN_RANGES and np.median(np.diff(stamp)) < MAX_PERIOD_S * NANOSECONDS:
            sigmas.append(1.4826 * np.median(np.abs(np.diff(value, 2))) / np.sqrt(6.0))
    return (float(np.median(sigmas)), len(sigmas)) if sigmas else (0.0, 0)


def _topics(path: Path) -> Iterator[tuple[str, tuple[str | list[str], str]]]:
    """Yield the topics that a bag has in place of the usual ones, by their types."""
    bag = Bag(path)
    for _ in bag.messages(lambda _: False):
        pass
    by_type: dict[str, dict[str, int]] = defaultdict(dict)
    for connection, count in bag.counts.items():
        kind = connection.type.replace("/msg/", "/")
        by_type[kind][connection.topic] = by_type[kind].get(connection.topic, 0) + count
    usual = {key: plain(topic) for key, topic in vars(Topics()).items() if topic}
    there = {topic for topics in by_type.values() for topic in topics}
    if (scans := _scans(path, by_type)) is not None:
        yield "scans", scans
    for key in BY_TYPE:
        found = {
            topic: (count, kind)
            for kind in types_of(key)
            for topic, count in by_type[kind].items()
            if topic not in usual.values()
        }
        if usual[key] in there or not found:
            continue
        most = max(found, key=lambda topic: found[topic][0])
        others = sorted(set(found) - {most})
        also = f", not {', '.join(others)}" if others else ""
        yield key, (most, f"found: {found[most][1]}{also}")


def _scans(
    path: Path, by_type: Mapping[str, Mapping[str, int]]
) -> tuple[str | list[str], str] | None:
    """Return a topic for each frame of scans, else of clouds; None where the usual one is all."""
    kind = next((kind for kind in types_of("scans") if by_type.get(kind)), None)
    if kind is None:
        return None
    usual, topics = str(Topics().scans), sorted(by_type[kind])
    kept = _one_of_each_frame(path, topics) if len(topics) > 1 else topics
    if kept == [usual]:
        return None
    others = sorted(set(topics) - set(kept))
    also = f", not {', '.join(others)} of the same frames" if others else ""
    return kept if len(kept) > 1 else kept[0], f"found: {kind}{also}"


def _one_of_each_frame(path: Path, topics: list[str]) -> list[str]:
    """Return a topic for each frame: of scans and the same filtered the one of the shorter name."""
    frames: dict[str, str] = {}
    for connection, _, data in Bag(path).messages(lambda c: c.topic in topics):
        if connection.topic not in frames:
            with suppress(LogError, MessageError, *broken()):
                frames[connection.topic] = plain(frame_of(deserializer(connection)(data)))
        if len(frames) == len(topics):
            break
    names: dict[str, str] = {}
    for topic in sorted(frames, key=lambda topic: (len(topic), topic)):
        names.setdefault(frames[topic], topic)
    return sorted(names.values()) or topics[:1]


def _relative(path: Path, base: Path) -> str:
    path, base = path.resolve(), base.resolve()
    return str(path.relative_to(base)) if path.is_relative_to(base) else str(path)


def written(lines: Sequence[Line]) -> Iterator[str]:
    """Yield YAML with a comment for each value; keys of a section must follow one another."""
    open_sections: list[str] = []
    for key, value, why in sorted(lines, key=lambda line: line[0].split(".")[:-1]):
        *sections, last = key.split(".")
        for depth, section in enumerate(sections):
            if open_sections[depth : depth + 1] != [section]:
                del open_sections[depth:]
                open_sections.append(section)
                yield f"{'  ' * depth}{section}:\n"
        text = yaml.safe_dump(value, default_flow_style=True, width=1000).replace("\n...", "")
        yield f"{'  ' * len(sections)}{last}: {text.strip()}  # {why}\n"
