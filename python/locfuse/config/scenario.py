# SPDX-License-Identifier: Apache-2.0
"""What to simulate: room, anchors, path, sensors, faults. The defaults are the room of ekim2020.

World: x east, y north, origin in a corner of the room, metres. Body: x forward, y left.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias, get_args

from pydantic import Field, field_validator, model_validator

from locfuse.config.base import Strict

Positive: TypeAlias = Annotated[float, Field(gt=0.0, le=1e9)]
NonNegative: TypeAlias = Annotated[float, Field(ge=0.0, le=1e9)]
Probability: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0)]
Rate: TypeAlias = Annotated[float, Field(gt=0.0, le=1e6)]
Name: TypeAlias = Annotated[str, Field(min_length=1)]
Point2: TypeAlias = tuple[float, float]
Point3: TypeAlias = tuple[float, float, float]
Segment: TypeAlias = tuple[float, float, float, float]
Source: TypeAlias = Literal["odometry", "ranges", "poses", "positions", "landmark_sightings",
                            "altitudes", "headings"]  # fmt: skip

MAX_MESSAGES = 5_000_000  # of one sensor: a day of wheels at 50 Hz
MAX_BEAMS = 200_000_000  # 1.6 GB
MAX_CELLS = 10_000  # along one side of a grid


# Paths ---------------------------------------------------------------------------------------


class Centred(Strict):
    """A path around a place."""

    center_m: Point2 = (5.0, 5.0)
    """Centre (x, y) in world [m]."""


class Straight(Strict):
    """Straight legs, and turns in place between them."""

    speed_mps: Positive = 0.22
    """Speed on straights [m/s]."""
    turn_rate_radps: Positive = 1.0
    """Turn rate when turning in place [rad/s]."""


class Circle(Centred):
    """Counter-clockwise without end; starts at the easternmost point, heading north.

    At a speed of 0 the robot stands there.
    """

    shape: Literal["circle"] = "circle"
    speed_mps: NonNegative = 0.22
    """Speed on the arc; 0: the robot stands [m/s]."""
    radius_m: Positive = 3.0
    """Radius of the circle [m]."""


class Eight(Centred):
    """Two circles side by side that touch in the centre: left turn, right turn.

    Starts in the centre, heading north, on the western circle.
    """

    shape: Literal["eight"] = "eight"
    speed_mps: Positive = 0.22
    """Speed [m/s]."""
    radius_m: Positive = 2.0
    """Radius of each circle [m]."""


class Square(Straight, Centred):
    """Straight sides, quarter turns in place to the left; starts south-west, heading east."""

    shape: Literal["square"] = "square"
    side_m: Positive = 6.0
    """Side of the square [m]."""


class Star(Straight, Centred):
    """Star polygon {points / (points - 1) / 2}: straight strokes, turns in place to the left.

    Five points are the pentagram. Starts at the northern tip; the tips lie on `radius_m`.
    """

    shape: Literal["star"] = "star"
    radius_m: Positive = 4.0
    """Distance of the tips from the centre [m]."""
    points: Annotated[int, Field(ge=5, le=1000)] = 5
    """Number of tips."""

    @field_validator("points")
    @classmethod
    def _odd(cls, points: int) -> int:
        if points % 2 == 0:
            raise ValueError(f"a star of {points} points is not one stroke; expected an odd number")
        return points


class Polygon(Straight, Centred):
    """Regular polygon: straight sides, turns in place to the left.

    Starts at the northern corner; the corners lie on `radius_m`. A `Square` stands on a side.
    """

    shape: Literal["polygon"] = "polygon"
    radius_m: Positive = 4.0
    """Distance of the corners from the centre [m]."""
    corners: Annotated[int, Field(ge=3, le=1000)] = 5
    """Number of corners."""


class Waypoints(Straight):
    """Random points of the room, one after another: turn in place the short way, drive straight.

    They are drawn evenly from the room less `margin_m` at each wall, as many as the duration needs.
    """

    shape: Literal["waypoints"] = "waypoints"
    margin_m: NonNegative = 1.0
    """Minimum distance from each wall [m]."""


class Roam(Straight):
    """Random places of the map, one after another, on ways that keep `clearance_m` from walls.

    Turns in place the short way, drives straight. Only the largest part of the free space that has
    room for the robot is visited; unknown cells and the outside are walls to it.
    """

    shape: Literal["roam"] = "roam"
    clearance_m: NonNegative = 0.3
    """Minimum distance from cells that are not free [m]."""


class Points(Straight):
    """Given points, one after another: turn in place the short way, drive straight.

    At the last one the robot stands; if `closed` it drives on to the first one, lap after lap.
    """

    shape: Literal["points"] = "points"
    points_m: Annotated[list[Point2], Field(min_length=2)]
    """Points in world, each different from the one before [m]."""
    closed: bool = False
    """Drive laps; else the robot stands at the last point."""

    @model_validator(mode="after")
    def _legs_have_length(self) -> Points:
        ends = self.points_m[1:] + (self.points_m[:1] if self.closed else [])
        for index, (begin, end) in enumerate(zip(self.points_m, ends, strict=False)):
            if begin == end:
                raise ValueError(
                    f"points_m.{index} and the point after it are both ({begin[0]}, {begin[1]}); "
                    "expected two different points"
                )
        return self


Path: TypeAlias = Annotated[
    Circle | Eight | Square | Star | Polygon | Waypoints | Points | Roam,
    Field(discriminator="shape"),
]


# Sensors -------------------------------------------------------------------------------------


class OdometrySensor(Strict):
    """Wheel odometry, with variances that grow with the distance driven and the angle turned.

    ``increments`` are motions since the row before; ``velocities`` hold until the row after.
    """

    rate_hz: Rate = 30.0
    """Rows per second [Hz]."""
    output: Literal["increments", "velocities"] = "increments"
    """Content of the rows."""
    sigma_longitudinal_per_sqrt_m: NonNegative = 0.03
    """Along the motion, per distance driven [m/√m]."""
    sigma_lateral_per_sqrt_m: NonNegative = 0.0
    """Across the motion, per distance driven; must be 0 with `velocities` [m/√m]."""
    sigma_heading_per_sqrt_m: NonNegative = 0.02
    """Heading, per distance driven [rad/√m]."""
    sigma_heading_per_sqrt_rad: NonNegative = 0.03
    """Heading, per angle turned [rad/√rad]."""
    turn_bias_radps: float = 0.0
    """Bias added to the turn rate, as of a gyro that drifts [rad/s]."""

    @model_validator(mode="after")
    def _velocities_have_no_lateral_part(self) -> OdometrySensor:
        if self.output == "velocities" and self.sigma_lateral_per_sqrt_m > 0.0:
            raise ValueError(
                f"sigma_lateral_per_sqrt_m is {self.sigma_lateral_per_sqrt_m}, but velocities "
                "carry no lateral motion; set it to 0 or output to 'increments'"
            )
        return self


class RangeSensor(Strict):
    """UWB: every tag to every anchor at each epoch; sigma = hypot(sigma_m, relative * distance)."""

    rate_hz: Rate = 5.0
    """Epochs per second [Hz]."""
    sigma_m: NonNegative = 0.0
    """Absolute part of the noise [m]."""
    sigma_relative: NonNegative = 0.015
    """Fraction of the distance; both parts are combined by hypot."""


class PoseSensor(Strict):
    """Stand-in for another localizer such as AMCL: the true pose plus white noise."""

    rate_hz: Rate = 2.0
    """Poses per second [Hz]."""
    sigma_xy_m: NonNegative = 0.06 / math.sqrt(2.0)
    """Sigma per axis; the default is an RMSE of 6 cm over both [m]."""
    sigma_heading_deg: NonNegative = 2.0
    """Sigma of the heading [deg]."""


class PositionSensor(Strict):
    """GPS-like: the true position of an antenna on the body plus white noise per axis.

    With `tags` it is an RTLS: the positions of these tags instead, all of them each time.
    """

    rate_hz: Rate = 1.0
    """Fixes per second [Hz]."""
    sigma_xy_m: NonNegative = 0.5
    """Sigma per axis [m]."""
    antenna_forward_m: float = 0.0
    """Antenna in body, forward [m]."""
    antenna_left_m: float = 0.0
    """Antenna in body, to the left [m]."""
    tags: list[Name] = Field(default_factory=list)
    """Report positions of these tags, as an RTLS does, instead of the antenna's."""


class Flight(Strict):
    """Height of a body that flies: it rises and sinks about a mean."""

    height_m: float = 1.5
    """Mean height over z = 0, at the start [m]."""
    swing_m: NonNegative = 0.5
    """How far it rises and sinks about that [m]."""
    period_s: Positive = 20.0
    """Time from one rise to the next [s]."""


class AltitudeSensor(Strict):
    """Altimeter: the true height plus white noise."""

    rate_hz: Rate = 10.0
    """Altitudes per second [Hz]."""
    sigma_m: NonNegative = 0.1
    """Sigma of each altitude [m]."""
    altimeter_up_m: float = 0.0
    """Height of the altimeter over the body's origin [m]."""


class HeadingSensor(Strict):
    """Compass, or the orientation of an IMU: the true heading, an offset and white noise."""

    rate_hz: Rate = 10.0
    """Headings per second [Hz]."""
    sigma_deg: NonNegative = 2.0
    """Sigma of each heading [deg]."""
    offset_deg: float = 0.0
    """What it reads more than the heading: mount, declination [deg]."""
    kind: Literal["heading", "course"] = "heading"
    """Report the heading of the body, or the course in which the antenna of `positions` travels."""


class ImuSensor(Strict):
    """Gyro and accelerometer on the body, however mounted, which like wheels feel no kidnapping."""

    rate_hz: Rate = 100.0
    """Samples per second [Hz]."""
    sigma_rate_radps_per_sqrt_hz: NonNegative = 0.001
    """White noise of the gyro [rad/s/√Hz]."""
    bias_radps: float = 0.01
    """Bias of the gyro about each axis at the start [rad/s]."""
    bias_walk_radps_per_sqrt_s: NonNegative = 1e-5
    """Random walk of the bias [rad/s/√s]."""
    scale: float = 0.0
    """Scale error of the gyro."""
    sigma_force_mps2: NonNegative = 0.05
    """Noise of the accelerometer per sample [m/s²]."""
    mount_deg: Point3 = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw of the sensor in body [deg]."""


class SightingSensor(Strict):
    """Range and bearing to every landmark in view, whatever stands in between."""

    rate_hz: Rate = 5.0
    """Epochs per second [Hz]."""
    pose_in_body: Point3 = (0.0, 0.0, 0.0)
    """Pose of the sensor in body [m, m, deg]."""
    sigma_range_m: NonNegative = 0.05
    """Sigma of each range [m]."""
    sigma_bearing_deg: NonNegative = 1.0
    """Sigma of each bearing [deg]."""
    sigma_elevation_deg: NonNegative | None = None
    """Sigma of each elevation; null: none is measured [deg]."""
    up_m: float = 0.0
    """Height of the sensor over the body's origin [m]."""
    range_max_m: Positive = 10.0
    """Maximum range at which a landmark is seen [m]."""
    field_of_view_deg: Annotated[float, Field(gt=0.0, le=360.0)] = 360.0
    """Field of view, centred straight ahead [deg]."""
    landmarks: Literal["named", "unnamed"] = "named"
    """Whether observations name their landmark."""


class LaserSensor(Strict):
    """2D laser scanner: beams evenly spread over a field of view, from its right edge on.

    Of one that is mounted `upside_down` they run clockwise from the left edge on.
    """

    rate_hz: Rate = 5.0
    """Scans per second [Hz]."""
    pose_in_body: Point3 = (0.0, 0.0, 0.0)
    """Pose of the scanner in body [m, m, deg]."""
    mounting: Literal["upright", "upside_down"] = "upright"
    """Upside down, beams run clockwise: a negative `angle_increment_rad` in the log."""
    beams: Annotated[int, Field(ge=2, le=100_000)] = 360
    """Number of beams of a scan, evenly spaced."""
    field_of_view_deg: Annotated[float, Field(gt=0.0, le=360.0)] = 360.0
    """Field of view, centred straight ahead [deg]."""
    range_min_m: NonNegative = 0.12
    """Minimum range of a return [m]."""
    range_max_m: Positive = 3.5
    """Maximum range of a return; more than `range_min_m` [m]."""
    sigma_m: NonNegative = 0.01
    """Sigma of each beam [m]."""
    dropout: Probability = 0.0
    """Probability that a beam gives no return."""

    @model_validator(mode="after")
    def _sees_something(self) -> LaserSensor:
        if not self.range_min_m < self.range_max_m:
            raise ValueError(
                f"range_min_m is {self.range_min_m} and range_max_m is {self.range_max_m}; "
                "expected range_min_m < range_max_m"
            )
        return self


class RoomMap(Strict):
    """What the laser sees: the grid map of a ROS yaml file, or the room as a grid.

    The room's grid holds its four walls, what `generate` makes inside of them from `seed`, `walls`
    and the walls of all nlos faults, each one cell thick with its line inside.
    """

    file: Name | None = None
    """YAML file of a ROS map; excludes the other keys."""
    generate: Literal["rooms", "hallways", "warehouse", "zhang", "floor"] | None = None
    """World generated inside the room, whose size is `room_m`."""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    """Seed of the generated world, independent of the `seed` of the run."""
    resolution_m: Annotated[float, Field(ge=1e-6, le=1e6)] = 0.05
    """Side of a cell; at most 0.25 m with `generate` [m]."""
    walls: list[Segment] = Field(default_factory=list)
    """Additional walls, which block beams but no ranges [m]."""

    @model_validator(mode="after")
    def _one_origin(self) -> RoomMap:
        # By value: a configuration that is written with its defaults filled in must read the same.
        default = RoomMap.model_construct()
        others = sorted(name for name in set(RoomMap.model_fields) - {"file"}
                        if getattr(self, name) != getattr(default, name))  # fmt: skip
        if self.file is not None and others:
            raise ValueError(f"file is {self.file!r}, which leaves nothing for {', '.join(others)}")
        if self.generate is None and self.seed != default.seed:
            raise ValueError(f"seed is {self.seed}, but nothing is made from it; add 'generate'")
        return self


# Faults --------------------------------------------------------------------------------------


class Nlos(Strict):
    """Ranges through a wall read long: gamma distributed, mean `extra_m`, deviation `sigma_m`.

    A wall is [x1, y1, x2, y2] and reaches from floor to ceiling. Several walls in the way lengthen
    once; `silent_walls` of them or more block it. A wall does not hide what touches it.
    """

    kind: Literal["nlos"] = "nlos"
    walls: Annotated[list[Segment], Field(min_length=1)]
    """Walls from floor to ceiling; several in the way lengthen a range once [m]."""
    extra_m: Positive
    """Mean excess of a blocked range [m]."""
    sigma_m: NonNegative = 0.0
    """Standard deviation of the excess; gamma distributed, never negative [m]."""
    silent_walls: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Number of walls that block a range completely; default: none does."""

    @field_validator("walls")
    @classmethod
    def _walls_have_length(cls, walls: list[Segment]) -> list[Segment]:
        for index, (x1, y1, x2, y2) in enumerate(walls):
            if (x1, y1) == (x2, y2):
                raise ValueError(
                    f"wall {index} begins and ends at ({x1}, {y1}); expected two different points"
                )
        return walls


class Bias(Strict):
    """Ranges read scale * range + offset, to one anchor or (None) to all."""

    kind: Literal["bias"] = "bias"
    anchor: Name | None = None
    """Anchor; default: all."""
    offset_m: float = 0.0
    """Offset added to the range [m]."""
    scale: Positive = 1.0
    """Factor applied before the offset."""

    @model_validator(mode="after")
    def _has_an_effect(self) -> Bias:
        if self.offset_m == 0.0 and self.scale == 1.0:
            raise ValueError("a bias of offset_m 0 and scale 1 changes nothing; set one of them")
        return self


class Wander(Strict):
    """Range errors that wander about 0, independent for each anchor.

    A Gauss-Markov process of standard deviation `sigma_m`: errors of one anchor that are t apart
    have the correlation exp(-t / `correlation_s`).
    """

    kind: Literal["wander"] = "wander"
    sigma_m: Positive
    """Standard deviation of the error of each anchor at any time [m]."""
    correlation_s: Positive
    """Time after which the correlation of the error has fallen to 1/e [s]."""


class Outliers(Strict):
    """Each row is, with some probability, wrong by exactly `magnitude_m`.

    Ranges: longer or shorter, evenly (longer where shorter would be below zero). Poses and
    positions: in a random direction; the heading of a pose stays as it is.
    """

    kind: Literal["outliers"] = "outliers"
    source: Literal["ranges", "poses", "positions"] = "ranges"
    """Sensor."""
    probability: Probability
    """Probability that a row is an outlier."""
    magnitude_m: Positive
    """Size of the error, of either sign or any direction [m]."""


class Dropouts(Strict):
    """Rows that are missing: each with `probability`, from `from_s` (inclusive) to `to_s`.

    A probability alone holds all the time; an interval alone loses every row in it. The motion of
    a lost odometry increment is lost with it.
    """

    kind: Literal["dropouts"] = "dropouts"
    source: Source = "ranges"
    """Sensor."""
    probability: Probability | None = None
    """Probability that a row is lost; default: every row of the interval."""
    from_s: NonNegative | None = None
    """Begin of the interval, inclusive; default: always [s]."""
    to_s: NonNegative | None = None
    """End of the interval [s]."""
    anchor: Name | None = None
    """Only ranges to this anchor."""

    @model_validator(mode="after")
    def _says_when(self) -> Dropouts:
        if (self.from_s is None) != (self.to_s is None):
            raise ValueError("from_s and to_s belong together; set both or none")
        if self.from_s is None and self.probability is None:
            raise ValueError("dropouts need a probability, or from_s and to_s, or all three")
        if self.from_s is not None and self.to_s is not None:
            _require_interval(self.from_s, self.to_s)
        if self.anchor is not None and self.source != "ranges":
            raise ValueError(
                f"anchor is {self.anchor!r}, but {self.source} have no anchor; only ranges do"
            )
        return self


class Latency(Strict):
    """Rows arrive `delay_s` plus up to `jitter_s` (evenly distributed) after their stamp.

    The stamp stays what it was; the table gains ``arrival_ns``. Several latencies add up.
    """

    kind: Literal["latency"] = "latency"
    source: Source = "poses"
    """Sensor."""
    delay_s: NonNegative
    """Time from stamp to arrival [s]."""
    jitter_s: NonNegative = 0.0
    """Maximum additional delay, uniformly distributed [s]."""


class WheelSlip(Strict):
    """Odometry reports its translation and rotation times these factors between two instants.

    A row that is partly inside is scaled for that part, whatever the rate.
    """

    kind: Literal["wheel_slip"] = "wheel_slip"
    from_s: NonNegative
    """Begin [s]."""
    to_s: NonNegative
    """End, after the begin [s]."""
    translation_factor: NonNegative = 1.0
    """Factor of the translation that odometry reports."""
    rotation_factor: NonNegative = 1.0
    """Factor of the rotation that odometry reports; not both 1."""

    @model_validator(mode="after")
    def _has_an_effect(self) -> WheelSlip:
        _require_interval(self.from_s, self.to_s)
        if self.translation_factor == 1.0 and self.rotation_factor == 1.0:
            raise ValueError("a slip with both factors 1 changes nothing; set one of them")
        return self


class SlipEpisodes(Strict):
    """Odometry slips every now and then, whether the robot moves or not."""

    kind: Literal["slip_episodes"] = "slip_episodes"
    every_s: Annotated[float, Field(ge=0.1, le=1e9)]
    """Mean time from one episode to the next, exponentially distributed [s]."""
    lasting_s: Positive
    """Mean length of an episode, exponentially distributed [s]."""
    translation_factor: NonNegative = 1.0
    """Factor of the translation that odometry reports during an episode."""
    turn_radps: NonNegative = 0.0
    """Turn rate added during an episode, left or right [rad/s]."""

    @model_validator(mode="after")
    def _has_an_effect(self) -> SlipEpisodes:
        if self.translation_factor == 1.0 and self.turn_radps == 0.0:
            raise ValueError(
                "slips of translation_factor 1 and turn_radps 0 change nothing; set one of them"
            )
        return self


class Glass(Strict):
    """Walls of the map that beams of the laser pass, each beam with `probability`.

    Glass are the occupied cells that `panes` touch, and a `share` of all walls, by pieces that fall
    into the same square metre of the map. A beam that passes a pane passes whatever is as clear.
    """

    kind: Literal["glass"] = "glass"
    panes: list[Segment] = Field(default_factory=list)
    """Walls of the map that these lines touch are glass [m]."""
    share: Probability = 0.0
    """Fraction of all walls of the map that are glass, by pieces of a metre."""
    probability: Annotated[float, Field(gt=0.0, le=1.0)]
    """Probability that a beam passes."""

    @model_validator(mode="after")
    def _has_an_effect(self) -> Glass:
        if not self.panes and self.share == 0.0:
            raise ValueError("glass of no panes and a share of 0 changes nothing; set one of them")
        return self


class People(Strict):
    """Discs that walk about the free space of the map and hide what is behind them.

    They walk at `speed_mps`, turn from time to time, and turn away where there is no room. They
    ignore the robot: a laser inside of one sees nothing.
    """

    kind: Literal["people"] = "people"
    count: Annotated[int, Field(ge=1, le=1000)]
    """Number of people."""
    radius_m: Positive = 0.25
    """Radius of each [m]."""
    speed_mps: Positive = 1.0
    """Walking speed [m/s]."""


class MaxRange(Strict):
    """Beams of the laser without a return read `range_max_m` instead, each with `probability`."""

    kind: Literal["max_range"] = "max_range"
    probability: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    """Probability that a beam without a return reads `range_max_m`."""


class Covered(Strict):
    """Beams of the laser that a cover hides: none of them gives a return.

    They are those from `from_deg` counter-clockwise to `to_deg`, both included, of straight ahead
    of the laser: -180 to 0 is its right half. Between `from_s` (inclusive) and `to_s`, or always.
    """

    kind: Literal["covered"] = "covered"
    from_deg: Annotated[float, Field(ge=-360.0, le=360.0)]
    """First hidden angle, counter-clockwise from straight ahead [deg]."""
    to_deg: Annotated[float, Field(ge=-360.0, le=360.0)]
    """Last hidden angle, after `from_deg` [deg]."""
    from_s: NonNegative | None = None
    """First instant; with `to_s`; default: always [s]."""
    to_s: NonNegative | None = None
    """End, after `from_s` [s]."""

    @model_validator(mode="after")
    def _has_an_effect(self) -> Covered:
        if not 0.0 < self.to_deg - self.from_deg <= 360.0:
            raise ValueError(
                f"from_deg is {self.from_deg} and to_deg is {self.to_deg}; expected from_deg < "
                "to_deg, and at most a full turn between them"
            )
        if (self.from_s is None) != (self.to_s is None):
            raise ValueError("from_s and to_s belong together; set both or none")
        if self.from_s is not None and self.to_s is not None:
            _require_interval(self.from_s, self.to_s)
        return self


class Kidnap(Strict):
    """The robot is carried at `at_s` to another pose, `to` (m, m, deg), without odometry.

    It continues its motion from the new pose.
    """

    kind: Literal["kidnap"] = "kidnap"
    at_s: Positive
    """Instant at which the robot is moved [s]."""
    to: Point3
    """Pose to which it is moved; odometry does not report the motion [m, m, deg]."""


LaserFault: TypeAlias = Glass | People | MaxRange | Covered
SensorFault: TypeAlias = (
    Nlos | Bias | Wander | Outliers | Dropouts | Latency | WheelSlip | SlipEpisodes | LaserFault
)
Fault: TypeAlias = Annotated[SensorFault | Kidnap, Field(discriminator="kind")]


def _require_interval(from_s: float, to_s: float) -> None:
    if not from_s < to_s:
        raise ValueError(f"from_s is {from_s} and to_s is {to_s}; expected from_s < to_s")


# Scenario ------------------------------------------------------------------------------------


def _paper_anchors() -> dict[Name, Point3]:
    return {
        "A1": (0.0, 0.0, 0.0),
        "A2": (10.0, 0.0, 0.0),
        "A3": (10.0, 10.0, 0.0),
        "A4": (0.0, 10.0, 0.0),
        "A5": (5.0, 0.0, 0.0),
    }


def _one_tag() -> dict[Name, Point3]:
    return {"tag": (0.0, 0.0, 0.0)}


class Scenario(Strict):
    """A drive through a room and the sensors that measure it.

    A sensor set to None is switched off. Faults are applied in the order in which they stand.
    Anchors and landmarks are in world, tags in body; without a `flight` the body moves on z = 0, as
    by default do all of them, in the planar model of ekim2020 eq. (8). Landmarks with a radius are
    discs that the laser sees and the map does not contain.
    """

    room_m: tuple[Positive, Positive] = (10.0, 10.0)
    """Width (x) and depth (y); one corner is the origin [m]."""
    anchors: dict[Name, Point3] = Field(default_factory=_paper_anchors)
    """Anchors in world [m]."""
    landmarks: dict[Name, Point2] = Field(default_factory=dict)
    """Landmarks in world [m]."""
    landmark_radius_m: NonNegative = 0.0
    """Radius of all landmarks, discs that only the laser sees [m]."""
    landmark_height_m: float = 0.0
    """Height of all landmarks over z = 0 [m]."""
    tags: dict[Name, Point3] = Field(default_factory=_one_tag)
    """Tags in body [m]."""
    path: Path = Field(default_factory=Circle)
    """Path of the robot."""
    flight: Flight | None = None
    """Its height; null: the body moves on z = 0."""
    duration_s: Positive = 60.0
    """Length of the drive [s]."""
    odometry: OdometrySensor | None = Field(default_factory=OdometrySensor)
    """Wheel odometry."""
    ranges: RangeSensor | None = Field(default_factory=RangeSensor)
    """UWB."""
    poses: PoseSensor | None = Field(default_factory=PoseSensor)
    """Stand-in for another localizer."""
    positions: PositionSensor | None = None
    """GPS-like fixes; off by default."""
    imu: ImuSensor | None = None
    """Gyro and accelerometer; off by default."""
    landmark_sightings: SightingSensor | None = None
    """Ranges and bearings to landmarks; off by default. Needs `landmarks`."""
    altitudes: AltitudeSensor | None = None
    """Altimeter; off by default."""
    headings: HeadingSensor | None = None
    """Compass or GPS course; off by default."""
    laser: LaserSensor | None = None
    """2D laser scanner; off by default. Needs a `map`."""
    lasers: dict[Name, LaserSensor] = Field(default_factory=dict)
    """Several of them by name, in place of `laser`."""
    map: RoomMap | None = None
    """World that the laser sees; written into the log."""
    faults: list[Fault] = Field(default_factory=list)
    """Faults, applied in this order."""

    @property
    def scanners(self) -> dict[str, LaserSensor]:
        """The lasers by name; a single one has none."""
        return self.lasers if self.laser is None else {"": self.laser}

    @model_validator(mode="after")
    def _sensors_have_what_they_need(self) -> Scenario:
        if self.laser is not None and self.lasers:
            raise ValueError("both laser and lasers are given; expected one of them")
        if all(getattr(self, name) is None for name in get_args(Source)) and not self.scanners:
            raise ValueError("no sensor is switched on; expected at least one")
        if self.ranges is not None and not (self.anchors and self.tags):
            missing = "anchors" if not self.anchors else "tags"
            raise ValueError(f"ranges need anchors and tags, but {missing} is empty")
        if self.positions is not None:
            for name in self.positions.tags:
                if name not in self.tags:
                    raise ValueError(
                        f"positions.tags names {name!r}; expected some of {', '.join(self.tags)}"
                    )
        if self.landmark_sightings is not None and not self.landmarks:
            raise ValueError("landmark_sightings need landmarks, but landmarks is empty")
        if self.scanners and self.map is None:
            raise ValueError("a laser needs something to see; add 'map: {}' for the room's walls")
        if isinstance(self.path, Roam) and self.map is None:
            raise ValueError("a robot that roams needs a map; add one, such as 'map: {}'")
        if self.odometry is not None:
            turn = fastest_turn_radps(self.path) / self.odometry.rate_hz
            if turn >= math.pi:
                raise ValueError(
                    f"between two odometry rows at {self.odometry.rate_hz} Hz the path turns "
                    f"{turn:.3g} rad; expected less than half a turn (a higher rate_hz)"
                )
        return self

    @model_validator(mode="after")
    def _fits_into_memory(self) -> Scenario:
        fixes = len(self.positions.tags) or 1 if self.positions is not None else 1
        each = {  # messages, or beams, of one instant
            "odometry": 1, "ranges": len(self.anchors) * len(self.tags), "poses": 1,
            "positions": fixes, "landmark_sightings": len(self.landmarks), "altitudes": 1,
            "headings": 1,
        }  # fmt: skip
        sensors = {name: (getattr(self, name), count) for name, count in each.items()}
        sensors |= {f"lasers.{name}" if name else "laser": (sensor, 1)
                    for name, sensor in self.scanners.items()}  # fmt: skip
        for name, (sensor, count) in sensors.items():
            if sensor is None:
                continue
            messages = self.duration_s * sensor.rate_hz * count
            beams = messages * getattr(sensor, "beams", 0)
            if messages > MAX_MESSAGES or beams > MAX_BEAMS:
                what = f"{messages:.3g} messages" + (f" with {beams:.3g} beams" if beams else "")
                raise ValueError(
                    f"duration_s {self.duration_s:g} and {name}.rate_hz {sensor.rate_hz:g} make "
                    f"{what}; expected at most {MAX_MESSAGES:.0e}"
                    + (f" with {MAX_BEAMS:.0e}" if beams else "")
                )
        return self

    @model_validator(mode="after")
    def _grid_is_not_too_fine(self) -> Scenario:
        if self.map is not None and self.map.file is None:
            cells = max(self.room_m) / self.map.resolution_m
            if cells > MAX_CELLS:
                raise ValueError(
                    f"map.resolution_m is {self.map.resolution_m}, which makes {cells:.3g} cells "
                    f"of the room's longer side; expected at most {MAX_CELLS}"
                )
        return self

    @model_validator(mode="after")
    def _path_is_in_the_room(self) -> Scenario:
        width, depth = self.room_m
        if isinstance(self.path, Roam):  # on the map, which may be a file
            return self
        if isinstance(self.path, Waypoints):
            if 2.0 * self.path.margin_m >= min(width, depth):
                raise ValueError(
                    f"margin_m is {self.path.margin_m}, which leaves nothing of a room of "
                    f"{width} m x {depth} m"
                )
            return self
        if isinstance(self.path, Points):
            if self.map is None or self.map.file is None:  # else the map says where it may be
                _require_in_room(self.path.points_m, self.room_m, "path.points_m.{}")
            return self
        reach_x, reach_y = _reach_m(self.path)
        x, y = self.path.center_m
        if not (reach_x <= x <= width - reach_x and reach_y <= y <= depth - reach_y):
            raise ValueError(
                f"the {self.path.shape} around ({x}, {y}) reaches {reach_x} m in x and {reach_y} m "
                f"in y, which leaves the room of {width} m x {depth} m; shrink it or enlarge room_m"
            )
        return self

    @model_validator(mode="after")
    def _faults_hit_something(self) -> Scenario:
        for index, fault in enumerate(self.faults):
            anchor = getattr(fault, "anchor", None)
            if anchor is not None and anchor not in self.anchors:
                raise ValueError(
                    f"faults.{index} ({fault.kind}) names anchor {anchor!r}; "
                    f"expected one of {', '.join(self.anchors)}"
                )
            if isinstance(fault, Kidnap):
                if self.map is None or self.map.file is None:
                    _require_in_room([fault.to[:2]], self.room_m, f"faults.{index}.to")
                continue
            source = fault_source(fault)
            is_on = self.scanners if source == "laser" else getattr(self, source) is not None
            if not is_on:
                raise ValueError(
                    f"faults.{index} ({fault.kind}) acts on {source}, which is switched off"
                )
        return self


def _require_in_room(points: list[Point2], room_m: tuple[float, float], key: str) -> None:
    width, depth = room_m
    for index, (x, y) in enumerate(points):
        if not (0.0 <= x <= width and 0.0 <= y <= depth):
            raise ValueError(
                f"{key.format(index)} is ({x}, {y}), outside of the room of {width} m x {depth} "
                "m; move it or enlarge room_m"
            )


def fault_source(fault: SensorFault) -> Source | Literal["laser"]:
    """Return the sensor that a fault acts on."""
    if isinstance(fault, Nlos | Bias | Wander):
        return "ranges"
    if isinstance(fault, WheelSlip | SlipEpisodes):
        return "odometry"
    if isinstance(fault, LaserFault):
        return "laser"
    return fault.source


def fastest_turn_radps(path: Path) -> float:
    """Return the largest turn rate along a path, rad/s."""
    if isinstance(path, Circle | Eight):
        return path.speed_mps / path.radius_m
    return path.turn_rate_radps


def _reach_m(path: Circle | Eight | Square | Star | Polygon) -> tuple[float, float]:
    """Return how far a path reaches from its centre in x and in y, metres."""
    if isinstance(path, Eight):
        return 2.0 * path.radius_m, path.radius_m
    if isinstance(path, Square):
        return 0.5 * path.side_m, 0.5 * path.side_m
    return path.radius_m, path.radius_m
