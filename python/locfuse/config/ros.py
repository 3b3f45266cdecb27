# SPDX-License-Identifier: Apache-2.0
"""Topics, frames and units of a ROS robot, for bags and for the live nodes."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import yaml
from pydantic import ConfigDict, Field, model_validator

from locfuse.config.base import Strict
from locfuse.config.scenario import Name, Rate
from locfuse.types import nearest

Latitude: TypeAlias = Annotated[float, Field(ge=-90.0, le=90.0)]
Longitude: TypeAlias = Annotated[float, Field(ge=-180.0, le=180.0)]

SUBSCRIBED = ("odometry", "imu", "scans", "ranges", "poses", "positions", "landmark_sightings",
              "altitudes", "headings", "courses", "map", "anchors", "landmarks", "initial_pose",
              "truth")  # fmt: skip
BOTH = {"imu", "headings"}  # which may be of one topic
PUBLISHED = ("estimate", "path", "start", "fallback", "mapped")
POSE = "geometry_msgs/PoseWithCovarianceStamped"
# What may come on the topic of a source; the first is the usual one.
TYPES: dict[str, tuple[str, ...]] = {
    "odometry": ("nav_msgs/Odometry",),
    "imu": ("sensor_msgs/Imu",),
    "scans": ("sensor_msgs/LaserScan", "sensor_msgs/PointCloud2"),
    "ranges": ("locfuse_msgs/UwbRanges", "locfuse_msgs/UwbRange", "locfuse_msgs/UwbData"),
    "poses": (POSE,),
    "positions": ("sensor_msgs/NavSatFix", "locfuse_msgs/TagPosition"),
    "landmark_sightings": ("locfuse_msgs/LandmarkSightings", "locfuse_msgs/LandmarkSighting"),
    "altitudes": ("sensor_msgs/Range", POSE, "geometry_msgs/PointStamped"),
    "headings": ("sensor_msgs/Imu", "geometry_msgs/QuaternionStamped"),
    "courses": ("geometry_msgs/TwistWithCovarianceStamped", "geometry_msgs/TwistStamped"),
    "map": ("nav_msgs/OccupancyGrid",),
    "anchors": ("locfuse_msgs/NamedPoints",),
    "landmarks": ("locfuse_msgs/NamedPoints",),
    "initial_pose": (POSE,),
    "transforms": ("tf2_msgs/TFMessage",),
}


Mapped: TypeAlias = Literal["ranges", "positions", "poses", "landmark_sightings", "imu"]
LENGTHS, ANGLES, TIMES = ("m", "cm", "mm"), ("rad", "deg"), ("s", "ms", "us", "ns")
# Columns of a source, with the units that their names may end in: the first where they do not.
COLUMNS: dict[Mapped, dict[str, tuple[str, ...]]] = {
    "ranges": {"anchor": (), "range": LENGTHS, "tag": (), "sigma": LENGTHS},
    "positions": {"x": LENGTHS, "y": LENGTHS, "z": LENGTHS, "tag": (), "sigma": LENGTHS},
    "poses": {"x": LENGTHS, "y": LENGTHS, "heading": ANGLES, "z": LENGTHS, "sigma_xy": LENGTHS,
              "sigma_heading": ANGLES},
    "landmark_sightings": {"range": LENGTHS, "bearing": ANGLES, "forward": LENGTHS,
                           "left": LENGTHS, "landmark": (), "sigma_range": LENGTHS,
                           "sigma_bearing": ANGLES},
    "imu": {**{f"rate_{axis}": ANGLES for axis in "xyz"}, **{f"force_{a}": () for a in "xyz"}},
}  # fmt: skip
NEEDED: dict[Mapped, tuple[tuple[str, ...], ...]] = {  # one of these sets, and no other
    "ranges": (("anchor", "range"),), "positions": (("x", "y"),),
    "poses": (("x", "y", "heading"),), "imu": (("rate_x", "rate_y", "rate_z"),),
    "landmark_sightings": (("range", "bearing"), ("forward", "left")),
}  # fmt: skip


class Fields(Strict):
    """Which fields of a driver's message are what.

    Beside these keys those of the columns of the source, as ``anchor: id``, ``range_mm: dist``:
    the path of a field, with dots, in an element of `each`, or behind a slash in the message, or a
    number. `key` and `value` are those of a mapping, and of a list of numbers its places.
    """

    model_config = ConfigDict(json_schema_extra={
        "type": ["object", "string"], "additionalProperties": {"type": ["string", "number"]}
    })  # fmt: skip

    preset: Name | None = None
    """[Driver](ros.md#messages-of-other-drivers) whose fields are those of all keys not given."""
    json_of: Name | None = None
    """Field that holds JSON, in which the paths are then."""
    each: Name | None = None
    """List in the message, one measurement an element; default: the message is one."""
    only: dict[Name, int | bool | str] = Field(default_factory=dict)
    """Values that fields of an element must have; others are left out."""
    names: dict[str, Name] = Field(default_factory=dict)
    """Our names of anchors, tags or landmarks by what the driver calls them."""
    quality: Name | None = None
    """Field by which measurements are rejected."""
    minus: Name | None = None
    """Field that is subtracted from it."""
    reject_above: float | None = None
    """Maximum of that."""
    columns: dict[Name, Name | float] = Field(default_factory=dict)
    """The columns; as keys beside the others they are the same."""

    @model_validator(mode="before")
    @classmethod
    def _whole(cls, data: Any) -> Any:
        """Return the keys with the columns in one place and those of the preset."""
        if isinstance(data, str):
            data = {"preset": data}
        if not isinstance(data, dict):
            return data
        kept = {key: data[key] for key in data if key in cls.model_fields}
        columns = kept.get("columns") or {}
        if not isinstance(columns, dict):
            raise ValueError("columns are no keys and values")
        columns = {**columns, **{key: data[key] for key in data if key not in cls.model_fields}}
        named = [column_of(str(key))[0] for key in columns]
        for key, path in columns.items():
            if named.count(column_of(str(key))[0]) > 1:
                raise ValueError(f"{column_of(str(key))[0]} is given twice")
            if isinstance(path, bool):
                raise ValueError(f"{key} is {path}; expected the path of a field, or a number")
        names = kept.get("names")
        if isinstance(names, dict):  # ids are numbers in YAML
            kept["names"] = {str(key): name for key, name in names.items()}
            if len(kept["names"]) < len(names):
                raise ValueError("names has one name twice, as a number and as text")
        if (name := kept.pop("preset", None)) is not None:
            if name not in presets():
                raise ValueError(f"there is no preset {name!r}; {nearest(str(name), presets())}")
            of = presets()[name].fields.model_dump(exclude_unset=True)
            others = {key: path for key, path in of.pop("columns").items()
                      if column_of(key)[0] not in named}  # fmt: skip
            kept, columns = {**of, **kept}, {**others, **columns}
        return {**kept, "columns": columns}

    @model_validator(mode="after")
    def _rejects_by_something(self) -> Fields:
        if (self.quality is None) != (self.reject_above is None):
            raise ValueError("expected both quality and reject_above, or neither")
        if self.minus is not None and self.quality is None:
            raise ValueError("minus is given, but no quality to subtract it from")
        return self


class Preset(NamedTuple):
    """How a driver's messages are read, and of which types they are."""

    source: Mapped
    types: tuple[str, ...]
    fields: Fields


@cache
def presets() -> dict[str, Preset]:
    """Return the presets by name, as ``presets.yaml`` beside this file has them."""
    found = yaml.safe_load(Path(__file__).with_name("presets.yaml").read_text("utf-8"))
    return {name: Preset(one["source"], tuple(one["types"]), Fields.model_validate(one["fields"]))
            for name, one in found.items()}  # fmt: skip


def types_of(source: str) -> tuple[str, ...]:
    """Return what may come on the topic of a source, the usual type first, drivers' types last."""
    drivers = [kind for one in presets().values() if one.source == source for kind in one.types]
    return tuple(dict.fromkeys((*TYPES[source], *drivers)))


def column_of(key: str) -> tuple[str, str]:
    """Return the name of a column and the unit that it ends in, empty where it does not.

    Examples
    --------
    >>> column_of("range_mm"), column_of("sigma_heading_deg"), column_of("anchor")
    (('range', 'mm'), ('sigma_heading', 'deg'), ('anchor', ''))
    """
    found = re.fullmatch(rf"(.+)_({'|'.join((*LENGTHS, *ANGLES, *TIMES))})", key)
    return (key, "") if found is None else (found[1], found[2])


class Topics(Strict):
    """Names of topics, with or without a leading slash; null switches one off."""

    odometry: Name | None = "odom"
    """nav_msgs/Odometry."""
    imu: Name | None = "imu"
    """sensor_msgs/Imu."""
    scans: Name | Annotated[list[Name], Field(min_length=1)] | None = "scan"
    """sensor_msgs/LaserScan or PointCloud2; a list of topics for
    [several lasers](ros.md#several-lasers).
    """
    ranges: Name | None = "uwb"
    """locfuse_msgs/UwbRanges, UwbRange or UwbData."""
    poses: Name | None = "amcl_pose"
    """geometry_msgs/PoseWithCovarianceStamped of another localizer."""
    positions: Name | None = "fix"
    """sensor_msgs/NavSatFix or locfuse_msgs/TagPosition."""
    landmark_sightings: Name | None = "sightings"
    """locfuse_msgs/LandmarkSightings or LandmarkSighting."""
    altitudes: Name | None = "altitude"
    """Range down to z = 0, PoseWithCovarianceStamped or PointStamped; kind `air`."""
    headings: Name | None = "heading"
    """sensor_msgs/Imu, of which the orientation counts, or QuaternionStamped. It may be the topic
    of `imu`.
    """
    courses: Name | None = "course"
    """Velocity over ground, east and north: TwistWithCovarianceStamped or TwistStamped."""
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
    """Published latched once a start is found, for AMCL, usually `initialpose`."""
    fallback: Name | None = None
    """Published with `watch_poses`: the watched poses while they are not lost, else the estimate.
    """
    mapped: Name | None = "locfuse/landmarks"
    """Published latched by an estimator that maps: locfuse_msgs/NamedPoints."""

    @model_validator(mode="after")
    def _one_meaning(self) -> Topics:
        for names in (SUBSCRIBED, PUBLISHED):
            given = [(key, topic) for key in names for topic in self.of(key)]
            for topic, times in Counter(topic for _, topic in given).items():
                if times > 1 and {key for key, name in given if name == topic} != BOTH:
                    keys = " and ".join(key for key, name in given if name == topic)
                    raise ValueError(f"{keys} are both {topic!r}; expected a topic for each")
        return self

    def of(self, key: str) -> tuple[str, ...]:
        """Return the topics of a key without their leading slash: none, one, or several.

        Examples
        --------
        >>> Topics(scans=["/front", "rear"]).of("scans"), Topics(imu=None).of("imu")
        (('front', 'rear'), ())
        """
        names = getattr(self, key)
        return tuple(map(plain, names if isinstance(names, list) else [names] if names else []))


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
    tags, mounts and map, which override those of a recording or of topics.
    """

    world: Name | None = None
    """Anchors, landmarks, tags, mounts and map as a [log folder](log_format.md); they override
    those of a recording or of topics.
    """
    topics: Topics = Field(default_factory=Topics)
    """Names of topics."""
    fields: dict[Mapped, Fields] = Field(default_factory=dict)
    """Fields of messages of types that are not ours, by source:
    [Messages of other drivers](ros.md#messages-of-other-drivers).
    """
    range_topics: dict[Name, Name] = Field(default_factory=dict)
    """sensor_msgs/Range, one topic per anchor."""
    frames: Frames = Field(default_factory=Frames)
    """Names of frames."""
    odometry_from: Literal["pose", "twist"] = "pose"
    """Use increments between the poses of odometry, or its velocities."""
    estimate_at: Literal["odometry", "fused"] = "odometry"
    """The published pose is that at the newest `odometry`, or at the newest `fused` message."""
    cloud_heights_m: tuple[float, float] | None = None
    """Heights over the body's origin of which points of a PointCloud2 count [m]."""
    uwb_unit: Literal["m", "mm"] = "m"
    """Unit of the distances of locfuse_msgs/UwbData."""
    uwb_tag: Name = "tag"
    """Name of the tag where a range names none."""
    gps_origin: tuple[Latitude, Longitude, float] | None = None
    """Latitude and longitude of the map's origin, angle of its x axis from east; default: the
    first fix [deg].
    """
    publish_transform: bool = True
    """Publish the transform from map to odom."""
    transform_ahead_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    """Time by which the stamp of that transform lies in the future [s]."""
    path_hz: Rate = 2.0
    """Poses of the path per second [Hz]."""

    @model_validator(mode="after")
    def _fields_are_of_their_source(self) -> Ros:
        for source, fields in self.fields.items():
            where, known, needed = f"fields.{source}", COLUMNS[source], NEEDED[source]
            for key, path in fields.columns.items():
                name, unit = column_of(key)
                if name not in (*known, "stamp"):
                    raise ValueError(f"{where}: unknown key {key!r}; "
                                     f"{nearest(key, (*known, *Fields.model_fields))}")  # fmt: skip
                units = TIMES if name == "stamp" else known[name]
                if unit and unit not in units:
                    expected = ", ".join(units) if units else "none"
                    raise ValueError(f"{where}: {key} ends in {unit!r}, which is no unit of it; "
                                     f"expected {expected}")  # fmt: skip
                if not isinstance(path, str) and name in ("anchor", "tag", "landmark", "stamp"):
                    raise ValueError(f"{where}: {key} is {path:g}; expected the path of a field")
            given = {column_of(key)[0] for key in fields.columns}
            of_sets = given & {name for one in needed for name in one}
            if of_sets not in map(set, needed):
                expected = " or ".join(" and ".join(one) for one in needed)
                raise ValueError(f"{where}: expected a preset, or {expected}")
            if source == "imu" and len(given & {"force_x", "force_y", "force_z"}) not in (0, 3):
                raise ValueError(f"{where}: expected all of force_x, force_y and force_z, or none")
        return self

    @model_validator(mode="after")
    def _heights_increase(self) -> Ros:
        low, high = self.cloud_heights_m or (0.0, 1.0)
        if not low < high:
            raise ValueError(f"cloud_heights_m is [{low:g}, {high:g}]; expected low < high")
        return self

    @model_validator(mode="after")
    def _range_topics_are_their_own(self) -> Ros:
        taken = {topic: key for key in SUBSCRIBED for topic in self.topics.of(key)}
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
