# SPDX-License-Identifier: Apache-2.0
"""What people are told of a bag: what was left out, and what is not there."""

from __future__ import annotations

from collections.abc import Iterator

from locfuse.config.ros import plain
from locfuse.io.rosbag.bag_contents import Heard
from locfuse.io.rosbag.bag_stream import Bag

# What the standard messages of a topic are, for advice.
TYPES = {
    "odometry": "nav_msgs/Odometry",
    "scans": "sensor_msgs/LaserScan",
    "ranges": "locfuse_msgs/UwbRanges",
    "poses": "geometry_msgs/PoseWithCovarianceStamped",
    "positions": "sensor_msgs/NavSatFix",
    "landmark_sightings": "locfuse_msgs/LandmarkSightings",
    "map": "nav_msgs/OccupancyGrid",
}

ONE_VOICE = ("odometry", "scans")  # of which two publishers at once are a mistake


def say(heard: Heard, bag: Bag) -> None:
    """Say what was left out, and which topics were asked for by name but are not there."""
    for topic, trouble in heard.trouble.items():
        total = trouble.count + heard.counts.get(topic, 0)
        heard.tell(f"{trouble.count} of {total} messages on {topic} are left "
                       f"out: {trouble.first}")  # fmt: skip
    _say_of_two_voices(heard, bag)
    for key, topic in _silent(heard, bag):
        if key in heard.ros.topics.model_fields_set:
            advice = _advice(heard, key, bag) or f"; {_named(bag)}"
            heard.tell(f"nothing on {topic}, where ros.topics.{key} is expected{advice}")
        elif advice := _advice(heard, key, bag):
            heard.tell(f"nothing on {topic}{advice}")
    for topic in heard.ros.range_topics:
        if not any(c.topic == plain(topic) for c in bag.counts):
            heard.tell(f"nothing on {plain(topic)}, where ros.range_topics "
                           f"expects an anchor; {_named(bag)}")  # fmt: skip


def _say_of_two_voices(heard: Heard, bag: Bag) -> None:
    """Say where several nodes, or bodies, are taken for one sensor."""
    for key in ONE_VOICE:
        topic = plain(getattr(heard.ros.topics, key) or "")
        nodes = sorted({c.publisher for c in bag.counts if c.topic == topic and c.publisher})
        bodies = sorted(heard.bodies) if key == "odometry" else []
        for many, names in (("publishers", nodes), ("child frames", bodies)):
            if len(names) > 1:
                heard.tell(f"{topic} has {len(names)} {many}, {' and '.join(names)}, whose "
                           "messages are taken for those of one sensor; give each a topic, or "
                           "record one")  # fmt: skip


def _silent(heard: Heard, bag: Bag) -> Iterator[tuple[str, str]]:
    there = {connection.topic for connection in bag.counts}
    for key in (*TYPES, "anchors", "landmarks", "truth"):
        topic = getattr(heard.ros.topics, key)
        if topic is not None and plain(topic) not in there:
            yield key, plain(topic)


def _advice(heard: Heard, key: str, bag: Bag) -> str:
    """Return which topics have the type that one without messages should have."""
    told = {plain(t) for t in vars(heard.ros.topics).values() if t is not None}
    others = sorted(c.topic for c in bag.counts
                    if c.type == TYPES.get(key) and c.topic not in told)  # fmt: skip
    if not others:
        return ""
    return f"; {' and '.join(others)} of that type ({TYPES[key]}) may be meant: " \
           f"set ros.topics.{key}"  # fmt: skip


def nothing(heard: Heard, bag: Bag) -> str:
    """Return why there is no log, in a sentence."""
    for topic, trouble in heard.trouble.items():
        return (f"{heard.path}: no message can be used; {trouble.count} on {topic} are left "
                f"out: {trouble.first}")  # fmt: skip
    for sentence in bag.damage:
        return sentence
    for key, topic in _silent(heard, bag):
        if advice := _advice(heard, key, bag):
            return f"{heard.path}: nothing on {topic}{advice}"
    return f"{heard.path}: no message on a topic that ros.topics names; {_named(bag)}"


def _named(bag: Bag) -> str:
    """Return which topics there are."""
    there = sorted({f"{c.topic} ({c.type})" for c in bag.counts})
    return f"the bag has {', '.join(there)}" if there else "the bag is empty"
