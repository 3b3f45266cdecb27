# SPDX-License-Identifier: Apache-2.0
"""Topics, frames and units of a ROS robot, for bags and for the live nodes."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from locfuse.config.base import Strict
from locfuse.config.scenario import Name, Rate

Latitude: TypeAlias = Annotated[float, Field(ge=-90.0, le=90.0)]
Longitude: TypeAlias = Annotated[float, Field(ge=-180.0, le=180.0)]

SUBSCRIBED = ("odometry", "imu", "scans", "ranges", "poses", "positions", "landmark_sightings",
         "altitudes", "map", "anchors", "landmarks", "initial_pose", "truth")  # fmt: skip
PUBLISHED = ("estimate", "path", "start", "mapped")
POSE = "geometry_msgs/PoseWithCovarianceStamped"
# What may come on the topic of a source; the first is the usual one.
TYPES: dict[str, tuple[str, ...]] = {
    "odometry": ("nav_msgs/Odometry",),
    "imu": ("sensor_msgs/Imu",),
    "scans": ("sensor_msgs/LaserScan",),
    "ranges": ("locfuse_msgs/UwbRanges", "locfuse_msgs/UwbRange", "locfuse_msgs/UwbData"),
    "poses": (POSE,),
    "positions": ("sensor_msgs/NavSatFix", "locfuse_msgs/TagPosition"),
    "landmark_sightings": ("locfuse_msgs/LandmarkSightings", "locfuse_msgs/LandmarkSighting"),
    "altitudes": ("sensor_msgs/Range", POSE, "geometry_msgs/PointStamped"),
    "map": ("nav_msgs/OccupancyGrid",),
    "anchors": ("locfuse_msgs/NamedPoints",),
    "landmarks": ("locfuse_msgs/NamedPoints",),
    "initial_pose": (POSE,),
    "transforms": ("tf2_msgs/TFMessage",),
}


class Topics(Strict):
    """Names of topics, with or without a leading slash; null switches one off."""

    odometry: Name | None = "odom"
    """nav_msgs/Odometry."""
    imu: Name | None = "imu"
    """sensor_msgs/Imu."""
    scans: Name | None = "scan"
    """sensor_msgs/LaserScan."""
    ranges: Name | None = "uwb"
    """locfuse_msgs/UwbRanges, UwbRange or UwbData."""
    poses: Name | None = "amcl_pose"
    """geometry_msgs/PoseWithCovarianceStamped of another localizer."""
    positions: Name | None = "fix"
    """sensor_msgs/NavSatFix or locfuse_msgs/TagPosition."""
    landmark_sightings: Name | None = "sightings"
    """locfuse_msgs/LandmarkSightings or LandmarkSighting."""
    altitudes: Name | None = "altitude"
    """Of the kind `air`: sensor_msgs/Range down to z = 0, or z of
    geometry_msgs/PoseWithCovarianceStamped or PointStamped.
    """
    map: Name | None = "map"
    """nav_msgs/OccupancyGrid."""
    anchors: Name | None = "anchors"
    """locfuse_msgs/NamedPoints."""
    landmarks: Name | None = "landmarks"
    """locfuse_msgs/NamedPoints."""
    initial_pose: Name | None = "initialpose"
    """geometry_msgs/PoseWithCovarianceStamped: start pose given by a person."""
    truth: Name | None = "ground_truth"
    """nav_msgs/Odometry of a reference, in bags."""
    estimate: Name | None = "locfuse/pose"
    """Published: geometry_msgs/PoseWithCovarianceStamped."""
    path: Name | None = "locfuse/path"
    """Published: nav_msgs/Path."""
    start: Name | None = None
    """Published latched once a start without a prior is `ready`: PoseWithCovarianceStamped for
    AMCL, usually `initialpose`.
    """
    mapped: Name | None = "locfuse/landmarks"
    """Published latched by an estimator that maps: locfuse_msgs/NamedPoints."""

    @model_validator(mode="after")
    def _one_meaning(self) -> Topics:
        for names in (SUBSCRIBED, PUBLISHED):
            given = {key: plain(topic) for key in names if (topic := getattr(self, key))}
            for topic, times in Counter(given.values()).items():
                if times > 1:
                    keys = " and ".join(key for key, name in given.items() if name == topic)
                    raise ValueError(f"{keys} are both {topic!r}; expected a topic for each")
        return self


class Frames(Strict):
    """Names of the frames of REP 105, with or without a leading slash."""

    map: Name = "map"
    """World frame."""
    odom: Name = "odom"
    """Frame of odometry."""
    base: Name = "base_link"
    """Body frame."""

    @model_validator(mode="after")
    def _three(self) -> Frames:
        names = [plain(self.map), plain(self.odom), plain(self.base)]
        if len(set(names)) < 3:
            raise ValueError(f"map, odom and base are {', '.join(names)}; expected three names")
        return self


class Ros(Strict):
    """Topics, frames and units that bags are read by and nodes subscribe to.

    `world` names a log folder without messages, relative to the configuration: anchors, landmarks,
    tags, mounts and map, which override those of topics.
    """

    world: Name | None = None
    """Anchors, landmarks, tags, mounts and map as in a [log folder](log_format.md), without
    messages; they override those of topics.
    """
    topics: Topics = Field(default_factory=Topics)
    """Names of topics."""
    range_topics: dict[Name, Name] = Field(default_factory=dict)
    """sensor_msgs/Range, one topic per anchor."""
    frames: Frames = Field(default_factory=Frames)
    """Names of frames."""
    odometry_from: Literal["pose", "twist"] = "pose"
    """Use increments between the poses of odometry, or its velocities."""
    estimate_at: Literal["odometry", "fused"] = "odometry"
    """`odometry`: the published pose is propagated to the newest odometry, once for each of its
    stamps and ten times a second at rest; `fused`: it is that of the newest fused message, as in
    `estimate.csv`.
    """
    uwb_unit: Literal["m", "mm"] = "m"
    """Unit of the distances of locfuse_msgs/UwbData."""
    uwb_tag: Name = "tag"
    """Name of the tag where a range names none."""
    gps_origin: tuple[Latitude, Longitude, float] | None = None
    """Origin of the map, and angle of its x axis counter-clockwise from east; default: the first
    fix, x to the east [deg].
    """
    publish_transform: bool = True
    """Publish the transform from map to odom."""
    transform_ahead_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    """Time by which the stamp of that transform lies in the future [s]."""
    path_hz: Rate = 2.0
    """Poses of the path per second [Hz]."""

    @model_validator(mode="after")
    def _range_topics_are_their_own(self) -> Ros:
        taken = {plain(topic): key for key in SUBSCRIBED if (topic := getattr(self.topics, key))}
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
