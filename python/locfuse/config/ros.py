# SPDX-License-Identifier: Apache-2.0
"""What is where in a robot's ROS: topics, frames, units; for bags and for the live nodes alike."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from locfuse.config.base import Strict
from locfuse.config.scenario import Name, Rate

Latitude: TypeAlias = Annotated[float, Field(ge=-90.0, le=90.0)]
Longitude: TypeAlias = Annotated[float, Field(ge=-180.0, le=180.0)]

HEARD = ("odometry", "scans", "ranges", "poses", "positions", "landmark_sightings", "map",
         "anchors", "landmarks", "initial_pose", "truth")  # fmt: skip
TOLD = ("estimate", "path", "start")


class Topics(Strict):
    """Names of topics, with or without a leading slash; null switches one off."""

    odometry: Name | None = "odom"
    scans: Name | None = "scan"
    ranges: Name | None = "uwb"
    poses: Name | None = "amcl_pose"
    positions: Name | None = "fix"
    landmark_sightings: Name | None = "sightings"
    map: Name | None = "map"
    anchors: Name | None = "anchors"
    landmarks: Name | None = "landmarks"
    initial_pose: Name | None = "initialpose"
    truth: Name | None = "ground_truth"
    estimate: Name | None = "locfuse/pose"
    path: Name | None = "locfuse/path"
    start: Name | None = None

    @model_validator(mode="after")
    def _one_meaning(self) -> Topics:
        for names in (HEARD, TOLD):
            given = {key: plain(topic) for key in names if (topic := getattr(self, key))}
            for topic, times in Counter(given.values()).items():
                if times > 1:
                    keys = " and ".join(key for key, name in given.items() if name == topic)
                    raise ValueError(f"{keys} are both {topic!r}; expected a topic for each")
        return self


class Frames(Strict):
    """Names of the frames of REP 105, with or without a leading slash."""

    map: Name = "map"
    odom: Name = "odom"
    base: Name = "base_link"

    @model_validator(mode="after")
    def _three(self) -> Frames:
        names = [plain(self.map), plain(self.odom), plain(self.base)]
        if len(set(names)) < 3:
            raise ValueError(f"map, odom and base are {', '.join(names)}; expected three names")
        return self


class Ros(Strict):
    """Where a robot's ROS says what, read from bags and heard by the nodes.

    `world` names a log folder without messages, relative to the configuration: anchors, landmarks,
    tags, mounts and map, which count more than what topics say of them.
    """

    world: Name | None = None
    topics: Topics = Field(default_factory=Topics)
    range_topics: dict[Name, Name] = Field(default_factory=dict)
    frames: Frames = Field(default_factory=Frames)
    odometry_from: Literal["pose", "twist"] = "pose"
    estimate_at: Literal["odometry", "fused"] = "odometry"
    uwb_unit: Literal["m", "mm"] = "m"
    uwb_tag: Name = "tag"
    gps_origin: tuple[Latitude, Longitude, float] | None = None
    publish_transform: bool = True
    transform_ahead_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    path_hz: Rate = 2.0

    @model_validator(mode="after")
    def _range_topics_are_their_own(self) -> Ros:
        taken = {plain(topic): key for key in HEARD if (topic := getattr(self.topics, key))}
        given = set()
        for name in map(plain, self.range_topics):
            if name in taken:
                raise ValueError(
                    f"range_topics and topics.{taken[name]} are both {name!r}; expected a topic "
                    "for each"
                )
            if name in given:
                raise ValueError(f"range_topics names {name!r} twice")
            given.add(name)
        return self


def plain(name: str) -> str:
    """Return the name of a topic or frame without its leading slash.

    Examples
    --------
    >>> plain("/odom"), plain("robot/odom")
    ('odom', 'robot/odom')
    """
    return name.removeprefix("/")
