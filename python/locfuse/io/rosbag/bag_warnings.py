# SPDX-License-Identifier: Apache-2.0
"""Warnings about a bag: messages that were left out, and topics that are missing."""

from __future__ import annotations

from collections.abc import Iterator

from locfuse.config import ros
from locfuse.config.ros import plain
from locfuse.io.rosbag.bag_contents import BagContents
from locfuse.io.rosbag.bag_stream import Bag

# The usual messages of a topic, for advice.
TYPES = {key: ros.TYPES[key][0] for key in ("odometry", "imu", "scans", "ranges", "poses",
                                            "positions", "landmark_sightings", "map")}  # fmt: skip

ONE_VOICE = ("odometry", "scans")  # of which two publishers at once are a mistake


def say(contents: BagContents, bag: Bag) -> None:
    """Say what was left out, and which topics were asked for by name but are not there."""
    for topic, skipped in contents.skipped.items():
        total = skipped.count + contents.counts.get(topic, 0)
        contents.warn(f"{skipped.count} of {total} messages on {topic} are left "
                       f"out: {skipped.first}")  # fmt: skip
    _say_of_two_voices(contents, bag)
    for key, topic in _silent(contents, bag):
        if key in contents.ros.topics.model_fields_set:
            advice = _advice(contents, key, bag) or f"; {_named(bag)}"
            contents.warn(f"nothing on {topic}, where ros.topics.{key} is expected{advice}")
        elif advice := _advice(contents, key, bag):
            contents.warn(f"nothing on {topic}{advice}")
    for topic in contents.ros.range_topics:
        if not any(c.topic == plain(topic) for c in bag.counts):
            contents.warn(f"nothing on {plain(topic)}, where ros.range_topics "
                           f"expects an anchor; {_named(bag)}")  # fmt: skip


def _say_of_two_voices(contents: BagContents, bag: Bag) -> None:
    """Say where several nodes, or bodies, are taken for one sensor."""
    for key in ONE_VOICE if len(contents.lasers) < 2 else ONE_VOICE[:1]:
        bodies = sorted(contents.bodies) if key == "odometry" else []
        for topic in contents.ros.topics.of(key):
            nodes = sorted({c.publisher for c in bag.counts if c.topic == topic and c.publisher})
            for many, names in (("publishers", nodes), ("child frames", bodies)):
                if len(names) > 1:
                    contents.warn(f"{topic} has {len(names)} {many}, {' and '.join(names)}, whose "
                           "messages are taken for those of one sensor; give each a topic, or "
                           "record one")  # fmt: skip


def _silent(contents: BagContents, bag: Bag) -> Iterator[tuple[str, str]]:
    there = {connection.topic for connection in bag.counts}
    for key in (*TYPES, "altitudes", "headings", "courses", "anchors", "landmarks", "truth"):
        for topic in contents.ros.topics.of(key):
            if topic not in there:
                yield key, topic


def _advice(contents: BagContents, key: str, bag: Bag) -> str:
    """Return which topics have the type that one without messages should have."""
    topics = contents.ros.topics
    configured = {name for one in ros.Topics.model_fields for name in topics.of(one)}
    types = ros.types_of(key) if key in TYPES else ()
    others = {c.topic: c.type for c in bag.counts
              if c.type in types and c.topic not in configured}  # fmt: skip
    if not others:
        return ""
    return f"; {' and '.join(sorted(others))} of that type " \
           f"({' and '.join(sorted(set(others.values())))}) may be meant: " \
           f"set ros.topics.{key}"  # fmt: skip


def nothing(contents: BagContents, bag: Bag) -> str:
    """Return why there is no log, in a sentence."""
    for topic, skipped in contents.skipped.items():
        return (f"{contents.path}: no message can be used; {skipped.count} on {topic} are left "
                f"out: {skipped.first}")  # fmt: skip
    for sentence in bag.damage:
        return sentence
    for key, topic in _silent(contents, bag):
        if advice := _advice(contents, key, bag):
            return f"{contents.path}: nothing on {topic}{advice}"
    return f"{contents.path}: no message on a topic that ros.topics names; {_named(bag)}"


def _named(bag: Bag) -> str:
    """Return which topics there are."""
    there = sorted({f"{c.topic} ({c.type})" for c in bag.counts})
    return f"the bag has {', '.join(there)}" if there else "the bag is empty"
