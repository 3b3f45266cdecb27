# SPDX-License-Identifier: Apache-2.0
"""Configuration of a run: source of messages, start pose, estimators.

Defaults are those of the C++ structs, which own them; names, bounds and the choices that are text
are repeated here, and a test compares them.
"""

from __future__ import annotations

import math
from operator import attrgetter
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, get_args

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from locfuse import _core
from locfuse.config.base import Strict
from locfuse.config.ros import Ros
from locfuse.config.scenario import Name, Probability, Rate, Scenario

Positive: TypeAlias = Annotated[float, Field(gt=0.0)]  # C++ checks the upper bound
NonNegative: TypeAlias = Annotated[float, Field(ge=0.0)]
DriftSigma: TypeAlias = Annotated[float, Field(ge=0.0, le=1e6)]
LostSigma: TypeAlias = Annotated[float, Field(gt=0.0, le=1e6)]
Angle: TypeAlias = Annotated[float, Field(ge=-360.0, le=360.0)]
Limit: TypeAlias = Annotated[float, Field(gt=0.0, le=1e12)]
Latency: TypeAlias = Annotated[float, Field(ge=0.0, le=3600.0)]
GateProbability: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0)]
Message: TypeAlias = Literal["odometry", "ranges", "positions", "poses", "landmark_sightings",
                             "altitudes", "headings"]  # fmt: skip
Source: TypeAlias = Literal[Message, "imu"]
SOURCES: tuple[Message, ...] = get_args(Message)
IN_THE_PLANE = tuple(source for source in SOURCES if source != "altitudes")
_BEFORE_HEADINGS = SOURCES[:-1]
USABLE: tuple[Source, ...] = (*SOURCES, "imu")  # which goes into odometry
# Whatever there is: as `use` says it by default, and before there were headings, or altitudes.
EVERYTHING: tuple[list[Source], ...] = ([*USABLE], [*_BEFORE_HEADINGS, "imu"],
                                        [*_BEFORE_HEADINGS[:-1], "imu"])  # fmt: skip
Kind: TypeAlias = Literal["pose", "landmark_slam", "tag_triangle", "air"]
# What an estimator of each kind fuses; it ignores the rest.
FUSES: dict[Kind, tuple[Source, ...]] = {
    "pose": IN_THE_PLANE,
    "landmark_slam": ("odometry", "positions", "landmark_sightings"),
    "tag_triangle": ("odometry", "ranges", "positions"),
    "air": _BEFORE_HEADINGS,
}


class Odometry(Strict):
    """Noise of wheel odometry; ``OdometryConfig`` in C++."""

    struct: ClassVar[Any] = _core.OdometryConfig()
    sigma_longitudinal_per_sqrt_m: DriftSigma = struct.sigma_longitudinal_per_sqrt_m
    """Along the motion, per distance driven [m/√m]."""
    sigma_lateral_per_sqrt_m: DriftSigma = struct.sigma_lateral_per_sqrt_m
    """Across the motion, per distance driven [m/√m]."""
    sigma_heading_per_sqrt_m: DriftSigma = struct.sigma_heading_per_sqrt_m
    """Heading, per distance driven [rad/√m]."""
    sigma_heading_per_sqrt_rad: DriftSigma = struct.sigma_heading_per_sqrt_rad
    """Heading, per angle turned [rad/√rad]."""
    sigma_xy_per_sqrt_s: DriftSigma = struct.sigma_xy_per_sqrt_s
    """Position, at any speed and at rest [m/√s]."""
    sigma_heading_per_sqrt_s: DriftSigma = struct.sigma_heading_per_sqrt_s
    """Heading, at any speed and at rest [rad/√s]."""
    sigma_longitudinal_per_sqrt_s: DriftSigma = struct.sigma_longitudinal_per_sqrt_s
    """Along the heading, at any speed [m/√s]."""
    distance_scale: Annotated[float, Field(ge=1e-3, le=1e3)] = 1.0
    """True distance per distance that wheels report."""
    turn_scale: Annotated[float, Field(ge=1e-3, le=1e3)] = 1.0
    """True turn per turn that they report."""
    direction_rad: Annotated[float, Field(ge=-0.5, le=0.5)] = 0.0
    """Direction of travel, to the left of that which they report [rad]."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""


# What is taken out of messages as they come: the models in C++ get them without.
OF_MESSAGES = ("latency_s", "distance_scale", "turn_scale", "direction_rad")


class Range(Strict):
    """Ranges: noise of those that bring no sigma of their own; ``RangeConfig`` in C++."""

    struct: ClassVar[Any] = _core.RangeConfig()
    sigma_m: NonNegative = struct.sigma_m
    """Absolute part [m]."""
    sigma_relative: NonNegative = struct.sigma_relative
    """Fraction of the distance; not both 0."""
    gate: GateProbability = struct.gate
    """Probability that a good range passes its gate; 1: no gate."""
    noise: Literal["gaussian", "one_sided", "student_t", "cauchy"] = "gaussian"
    """Noise distribution: [Robust updates](models/updates.md#2-robust-updates)."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""

    @model_validator(mode="after")
    def _some_noise(self) -> Range:
        if self.sigma_m == 0.0 and self.sigma_relative == 0.0:
            raise ValueError("sigma_m and sigma_relative are both 0; expected at least one > 0")
        return self


class Altitude(Strict):
    """Altimeter of a body that flies; ``AltitudeConfig`` in C++."""

    struct: ClassVar[Any] = _core.AltitudeConfig()
    altimeter_up_m: Annotated[float, Field(ge=-1e9, le=1e9)] = struct.altimeter_up_m
    """Height of the altimeter over the body's origin [m]."""
    sigma_m: Positive = struct.sigma_m
    """Sigma of an altitude without a sigma of its own [m]."""
    gate: GateProbability = struct.gate
    """Probability that a good altitude passes its gate; 1: no gate."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""


class Heading(Strict):
    """Compass, orientation of an IMU, two antennas, or course; ``HeadingConfig`` in C++."""

    struct: ClassVar[Any] = _core.HeadingConfig()
    fixed: ClassVar[Any] = ("antenna_forward_m", "antenna_left_m")

    offset_rad: float = struct.offset_rad
    """What it reads more than the heading: mount, declination [rad]."""
    sigma_rad: Positive = struct.sigma_rad
    """Sigma of a heading without a sigma of its own [rad]."""
    least_sigma_rad: Positive = struct.least_sigma_rad
    """Minimum sigma of any heading [rad]."""
    min_speed_mps: Positive = struct.min_speed_mps
    """Minimum speed at which a course is fused [m/s]."""
    gate: GateProbability = struct.gate
    """Probability that a good heading passes its gate; 1: no gate."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""


class Position(Strict):
    """Position fixes: lever arm of the antenna, and sigmas; ``PositionConfig`` in C++."""

    struct: ClassVar[Any] = _core.PositionConfig()
    antenna_forward_m: float = struct.antenna_forward_m
    """Antenna in body, forward [m]."""
    antenna_left_m: float = struct.antenna_left_m
    """Antenna in body, to the left [m]."""
    sigma_m: NonNegative = struct.sigma_m
    """Sigma of a fix [without one of its own](filter.md#what-drivers-do-not-know); 0: it is not
    modelled [m].
    """
    least_sigma_m: Positive = struct.least_sigma_m
    """Minimum sigma of any fix [m]."""
    gate: GateProbability = struct.gate
    """Probability that a good fix passes its gate; 1: no gate."""
    noise: Literal["gaussian", "student_t", "cauchy"] = "gaussian"
    """Noise distribution: [Robust updates](models/updates.md#2-robust-updates)."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""


class Pose(Strict):
    """Sigmas of poses of other localizers; ``PoseConfig`` in C++."""

    struct: ClassVar[Any] = _core.PoseConfig()
    sigma_m: NonNegative = struct.sigma_m
    """Position sigma of a pose without one; 0: it is not modelled [m]."""
    sigma_heading_rad: NonNegative = struct.sigma_heading_rad
    """Heading sigma of a pose without one; 0: it is not modelled [rad]."""
    least_sigma_m: Positive = struct.least_sigma_m
    """Minimum position sigma of any pose [m]."""
    least_sigma_heading_rad: Positive = struct.least_sigma_heading_rad
    """Minimum heading sigma of any pose [rad]."""
    shares_odometry: bool = struct.shares_odometry
    """Whether the localizer uses the same odometry; else [its
    delay](models/poses.md#3-another-localizer) is learnt.
    """
    gate: GateProbability = struct.gate
    """Probability that a good pose passes its gate; 1: no gate."""
    noise: Literal["gaussian", "student_t", "cauchy"] = "gaussian"
    """Noise distribution: [Robust updates](models/updates.md#2-robust-updates)."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""


class Limits(Strict):
    """Physical limits of robot and sensors; ``Limits`` in C++."""

    struct: ClassVar[Any] = _core.Limits()
    speed_mps: Limit = struct.speed_mps
    """Maximum speed of odometry [m/s]."""
    turn_rate_radps: Limit = struct.turn_rate_radps
    """Maximum turn rate of odometry [rad/s]."""
    range_m: Limit = struct.range_m
    """Maximum range to an anchor or landmark [m]."""
    distance_m: Limit = struct.distance_m
    """Maximum distance of a position or pose from the origin of the world [m]."""


class Adaptive(Strict):
    """Variances that follow innovations, 0 for none; ``AdaptiveNoise::Config`` in C++."""

    struct: ClassVar[Any] = _core.AdaptiveNoiseConfig()
    fixed: ClassVar[Any] = ("least", "most")

    messages: NonNegative = struct.messages
    """Messages in the memory, such as 200; 0: off, else at least 5."""

    @model_validator(mode="after")
    def _more_than_an_echo(self) -> Adaptive:
        if 0.0 < self.messages < 5.0:
            raise ValueError(f"messages is {self.messages}; expected 0 for off, or at least 5")
        return self


class Landmark(Strict):
    """Noise of sightings that bring no sigmas of their own; ``RangeBearingConfig`` in C++."""

    struct: ClassVar[Any] = _core.RangeBearingConfig()
    sigma_range_m: Positive = struct.sigma_range_m
    """Sigma of the range to a landmark [m]."""
    sigma_bearing_rad: Positive = struct.sigma_bearing_rad
    """Sigma of its bearing [rad]."""
    sigma_range_relative: NonNegative = struct.sigma_range_relative
    """Fraction of the range, added to `sigma_range_m`."""
    gate: GateProbability = struct.gate
    """Probability that a good observation passes its gate; 1: no gate."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""


class Calibration(Strict):
    """Errors that the pose EKF learns, 0 for none; ``CalibrationConfig`` in C++."""

    struct: ClassVar[Any] = _core.CalibrationConfig()
    sigma_scale: DriftSigma = struct.sigma_scale
    """Scale error of the odometry distance."""
    sigma_direction_rad: DriftSigma = struct.sigma_direction_rad
    """Angle between travel and heading [rad]."""
    sigma_turn_scale: DriftSigma = struct.sigma_turn_scale
    """Scale error of the odometry turn."""
    sigma_turn_bias_radps: DriftSigma = struct.sigma_turn_bias_radps
    """Bias of the turn rate, as of a gyro [rad/s]."""
    sigma_turn_bias_radps_per_sqrt_s: DriftSigma = struct.sigma_turn_bias_radps_per_sqrt_s
    """Random walk of that bias; only with the bias [rad/s/√s]."""
    sigma_sensor_m: DriftSigma = struct.sigma_sensor_m
    """Position of the landmark sensor in body, forward and left [m]."""
    sigma_sensor_rad: DriftSigma = struct.sigma_sensor_rad
    """Heading of the landmark sensor in body [rad]."""
    sigma_range_offset_m: DriftSigma = struct.sigma_range_offset_m
    """Constant part of the error of ranges to landmarks [m]."""
    sigma_range_scale: DriftSigma = struct.sigma_range_scale
    """Proportional part of the error of ranges to landmarks."""
    sigma_delay_s: DriftSigma = struct.sigma_delay_s
    """Latency of landmark observations [s]."""
    sigma_anchor_offset_m: DriftSigma = struct.sigma_anchor_offset_m
    """Constant part of the range error of each anchor, beyond `anchors` [m]."""
    anchor_offset_correlation_s: NonNegative = struct.anchor_offset_correlation_s
    """Correlation time of that offset; 0: it is constant [s]."""
    sigma_anchor_scale: DriftSigma = struct.sigma_anchor_scale
    """Proportional part of the range error of each anchor, beyond `anchors`."""
    sigma_range_delay_s: DriftSigma = struct.sigma_range_delay_s
    """Latency of all ranges [s]."""
    sigma_heading_offset_rad: DriftSigma = struct.sigma_heading_offset_rad
    """[What headings read more](models/poses.md#8-headings-and-courses) than
    `heading.offset_rad`; pi: unknown, 0: nothing [rad].
    """
    sigma_heading_offset_rad_per_sqrt_s: DriftSigma = struct.sigma_heading_offset_rad_per_sqrt_s
    """Random walk of that offset [rad/√s]."""
    consider: bool = struct.consider
    """Account for these errors without estimating them."""

    @model_validator(mode="after")
    def _wanders_as_state(self) -> Calibration:
        if self.sigma_turn_bias_radps_per_sqrt_s > 0.0 and self.sigma_turn_bias_radps == 0.0:
            raise ValueError(
                "sigma_turn_bias_radps_per_sqrt_s is set, but sigma_turn_bias_radps is 0: the bias "
                "is not a state; expected both or neither"
            )
        if self.anchor_offset_correlation_s > 0.0 and self.sigma_anchor_offset_m == 0.0:
            raise ValueError(
                "anchor_offset_correlation_s is set, but sigma_anchor_offset_m is 0: offsets are "
                "not states; expected both or neither"
            )
        return self


Bounded = Annotated[float, Field(ge=0.0, le=1e9)]  # its square is finite
_OF_POSE = ("calibration", "adaptive", "range.noise", "position.noise", "pose.noise", "heading")
LEFT_OUT: dict[Kind, tuple[str, ...]] = {  # settings of `Estimator` that a kind does not have
    "pose": ("landmark_slam", "tag_triangle", "air"),
    "landmark_slam": ("tag_triangle", "air", *_OF_POSE),
    "tag_triangle": ("landmark_slam", "air", *_OF_POSE),
    "air": ("landmark_slam", "tag_triangle", "calibration", "adaptive", "heading"),
}


class Cylinders(Strict):
    """Pillars, poles and trunks in the scans; ``CylinderDetectorConfig`` in C++."""

    struct: ClassVar[Any] = _core.CylinderDetectorConfig()
    fixed: ClassVar[Any] = ("jump_gaps", "misfit_probability", "leg_radius_m")

    method: Literal["arcs", "closest_beam", "cone"] = "arcs"
    """Detection: [a circle fitted to the beams, or its shortest
    beam](models/landmarks.md#which-method).
    """
    sigma_range_m: Annotated[float, Field(ge=1e-6, le=1e9)] = struct.sigma_range_m
    """Range noise of one beam [m]."""
    sigma_bearing_rad: Bounded = struct.sigma_bearing_rad
    """Direction noise of one beam: beam width, quantization [rad]."""
    radius_m: Bounded = struct.radius_m
    """Radius of all cylinders; 0: fitted for each cylinder [m]."""
    radius_min_m: Annotated[float, Field(ge=1e-3, le=1e9)] = struct.radius_min_m
    """Minimum fitted radius [m]."""
    radius_max_m: Annotated[float, Field(ge=1e-3, le=1e9)] = struct.radius_max_m
    """Maximum fitted radius; at least `radius_min_m` [m]."""
    least_beams: Annotated[int, Field(ge=1, le=10**9)] = struct.least_beams
    """Minimum number of beams on a cylinder."""
    least_evidence: Bounded = struct.least_evidence
    """Minimum excess of the chi-square of a straight wall."""
    least_corner_evidence: Annotated[float, Field(ge=-1e9, le=1e9)] = struct.least_corner_evidence
    """The same of a right-angled corner; -20 for places without boxes."""
    leg_distance_m: Bounded = struct.leg_distance_m
    """Maximum distance between two legs; 0: nobody walks here [m]."""
    least_intensity: Bounded = struct.least_intensity
    """Minimum intensity of the brightest beam; 0: any intensity."""

    @model_validator(mode="after")
    def _least_and_most(self) -> Cylinders:
        if self.radius_min_m > self.radius_max_m:
            raise ValueError(
                f"radius_min_m is {self.radius_min_m} and radius_max_m is {self.radius_max_m}; "
                "expected radius_min_m <= radius_max_m"
            )
        if self.method != "arcs" and self.radius_m == 0.0:
            raise ValueError(f"method {self.method} needs radius_m, which one beam does not "
                             "determine; set it, or use method: arcs")  # fmt: skip
        for key in ("least_evidence", "least_corner_evidence", "leg_distance_m"):
            if self.method == "cone" and getattr(self, key) != type(self).model_fields[key].default:
                raise ValueError(f"method cone does not use {key}; leave it out")
        return self


class LandmarkSlam(Strict):
    """How `landmark_slam` maps; with `estimator`, ``LandmarkEkfConfig`` in C++."""

    struct: ClassVar[Any] = _core.LandmarkEkfConfig()
    fixed: ClassVar[Any] = ("confirm_within_s",)

    use_map: bool = True
    """Whether the landmarks of the log are known."""
    gate_new: GateProbability = struct.gate_new
    """Probability of the gate outside of which a landmark is new; at least `landmark.gate`."""
    min_sightings: Annotated[int, Field(ge=1, le=10**9)] = struct.min_sightings
    """Number of sightings that confirm a landmark without a name."""
    max_landmarks: Annotated[int, Field(ge=0, le=10**6)] = struct.max_landmarks
    """Maximum number of landmarks that are mapped."""


class TagVelocity(Strict):
    """Noise of the velocities that odometry gives tags; ``VelocityConfig`` in C++."""

    struct: ClassVar[Any] = _core.VelocityConfig()
    sigma_forward_mps: NonNegative = struct.sigma_forward_mps
    """Forward speed of the wheels, common to all tags [m/s]."""
    sigma_lateral_mps: NonNegative = struct.sigma_lateral_mps
    """Speed to the side, common to all tags [m/s]."""
    sigma_turn_rate_radps: NonNegative = struct.sigma_turn_rate_radps
    """Turn rate of the wheels, common to all tags [rad/s]."""
    sigma_point_mps: Positive = struct.sigma_point_mps
    """Of each tag and axis by itself [m/s]."""
    gate: GateProbability = struct.gate
    """Probability that good odometry passes its gate; 1: no gate."""


class TagTriangle(Strict):
    """What `tag_triangle` needs; with `estimator`, ``TagTriangleEkfConfig`` in C++."""

    struct: ClassVar[Any] = _core.TagTriangleEkfConfig()
    fixed: ClassVar[Any] = ("sigma_start_velocity_mps",)
    renamed: ClassVar[Any] = {"gate_velocity": (0.999, "velocity.gate")}

    shape: Literal["soft", "rigid"] = "soft"
    """`soft`: the 12 states of the paper; `rigid`: one body, as `kind: pose`, and none of the keys
    below.
    """
    sigma_velocity_per_sqrt_s: Positive = struct.motion.sigma_velocity_per_sqrt_s
    """White acceleration of each tag [m/s/√s]."""
    velocity: TagVelocity = Field(default_factory=TagVelocity)
    """Noise of the tags' velocities by odometry."""
    sigma_side_m: Annotated[float, Field(ge=1e-4, le=1e6)] = struct.side.sigma_m
    """Sigma of the sides of the triangle [m]."""
    heading_is_known: bool = struct.heading_is_known
    """Take the heading of odometry as exact, as the paper does."""

    @model_validator(mode="after")
    def _rigid_has_no_more(self) -> TagTriangle:
        plain = TagTriangle.model_construct()
        more = [key for key, value in self if key != "shape" and value != getattr(plain, key)]
        if more and self.shape == "rigid":
            raise ValueError(f"shape rigid does not use {', '.join(more)}; leave it out")
        return self


class ConstantVelocity(Strict):
    """Motion that nobody measures; ``ConstantVelocityConfig`` in C++."""

    struct: ClassVar[Any] = _core.ConstantVelocityConfig()
    sigma_velocity_per_sqrt_s: Positive = struct.sigma_velocity_per_sqrt_s
    """White acceleration along x and y [m/s/√s]."""
    sigma_climb_per_sqrt_s: Positive = struct.sigma_climb_per_sqrt_s
    """White acceleration upwards [m/s/√s]."""
    sigma_heading_per_sqrt_s: Positive = struct.sigma_heading_per_sqrt_s
    """Random walk of the heading [rad/√s]."""


class Air(Strict):
    """What `air` needs; with `estimator`, ``AirEkfConfig`` in C++."""

    struct: ClassVar[Any] = _core.AirEkfConfig()
    fixed: ClassVar[Any] = ("sigma_lost_height_per_sqrt_s", "sigma_start_velocity_mps",
                       "sigma_start_climb_mps")  # fmt: skip
    renamed: ClassVar[Any] = {"gate_altitude": (0.999, "altitude.gate")}

    motion: Literal["odometry", "constant_velocity", "inertial"] = "constant_velocity"
    """What moves the body: odometry in the plane, constant velocity, or [an
    IMU](air.md#an-inertial-sensor)."""
    constant_velocity: ConstantVelocity = Field(default_factory=ConstantVelocity)
    """How the velocity changes; for `constant_velocity`, and while an IMU is silent."""
    sigma_height_per_sqrt_s: DriftSigma = struct.sigma_height_per_sqrt_s
    """Random walk of the height; for `odometry` [m/√s]."""
    start_height_m: Annotated[float, Field(ge=-1e9, le=1e9)] = 0.0
    """Height at the start; with `start: truth` the reference's [m]."""
    sigma_start_height_m: Annotated[float, Field(gt=0.0, le=1e9)] = 0.3
    """Sigma of that height [m]."""
    min_height_m: Annotated[float, Field(ge=-1e9, le=1e9)] = struct.min_height_m
    """Floor of the room: the body's origin is [above it](air.md#vague-beliefs) [m]."""
    max_height_m: Annotated[float, Field(ge=-1e9, le=1e9)] = struct.max_height_m
    """Ceiling of the room [m]."""
    sensor_up_m: Annotated[float, Field(ge=-1e9, le=1e9)] = struct.landmark_in_space.sensor_up_m
    """Height of the landmark sensor over the body's origin [m]."""
    sigma_elevation_rad: Positive = struct.landmark_in_space.sigma_elevation_rad
    """Sigma of an elevation without a sigma of its own [rad]."""
    altitude: Altitude = Field(default_factory=Altitude)
    """Altimeter: place in body, sigma, gate and latency."""

    @model_validator(mode="after")
    def _has_a_room(self) -> Air:
        low, start, high = self.min_height_m, self.start_height_m, self.max_height_m
        if not low < high:
            raise ValueError(f"min_height_m is {low:g} and max_height_m is {high:g}; "
                             "expected min_height_m < max_height_m")  # fmt: skip
        if start != 0.0 and not low <= start <= high:
            raise ValueError(f"start_height_m is {start:g}; expected min_height_m to "
                             f"max_height_m, {low:g} to {high:g}")  # fmt: skip
        return self


class ScanOdometry(Strict):
    """Odometry from scans; ``LocalMapConfig`` in C++."""

    struct: ClassVar[Any] = _core.LocalMapConfig()
    sigma_range_m: Annotated[float, Field(ge=1e-6, le=10.0)] = struct.sigma_range_m
    """Range noise of one beam [m]."""


class Imu(Strict):
    """Gyro and wheels, or in space gyro and accelerometer.

    ``GyroOdometryConfig`` and ``InertialConfig`` in C++.
    """

    struct: ClassVar[Any] = _core.GyroOdometryConfig()
    in_space: ClassVar[Any] = _core.InertialConfig()
    fixed: ClassVar[Any] = ("sigma_bias_radps_per_sqrt_s", "sigma_scale", "sigma_turn_scale")

    turn: Literal["weighted", "average"] = "weighted"
    """Turn by variances, or the mean of wheels and gyro."""
    sigma_turn_per_sqrt_s: LostSigma = struct.sigma_turn_per_sqrt_s
    """White noise of the gyro: heading error after a second [rad/√s]."""
    sigma_bias_radps: LostSigma = struct.sigma_bias_radps
    """Sigma of the gyro's bias at the start [rad/s]."""
    sigma_velocity_per_sqrt_s: LostSigma = in_space.sigma_velocity_per_sqrt_s
    """White noise of the accelerometer: velocity error after a second; in space [m/s/√s]."""
    sigma_bias_mps2: LostSigma = in_space.sigma_bias_mps2
    """Sigma of the accelerometer's bias at the start; in space [m/s²]."""
    mount_deg: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw of the sensor's axes in body; in space [deg]."""
    latency_s: Latency = 0.0
    """Constant latency, subtracted from each stamp [s]."""


class TagConditioner(Strict):
    """What is done to fixes of tags before they are fused; ``TagConditioner::Config`` in C++."""

    struct: ClassVar[Any] = _core.TagConditionerConfig()
    fixed: ClassVar[Any] = ("restart_after", "frozen_motion_m", "hold_s")

    cutoff_hz: Bounded = struct.cutoff_hz
    """Cut-off of the low-pass; 0: none, as the estimator smooths better [Hz]."""
    bias_x_m: Annotated[float, Field(ge=-1e9, le=1e9)] = struct.bias_x_m
    """Bias along x that is subtracted from each fix, in world [m]."""
    bias_y_m: Annotated[float, Field(ge=-1e9, le=1e9)] = struct.bias_y_m
    """The same along y [m]."""
    max_speed_mps: Positive = struct.max_speed_mps
    """Maximum speed of a tag [m/s]."""
    jump_margin_m: Positive = struct.jump_margin_m
    """Margin beyond the distance at that speed; farther fixes are rejected [m]."""


class Estimator(Strict):
    """An EKF: its kind, and its settings; ``PoseEkfConfig`` in C++ for `pose`."""

    struct: ClassVar[Any] = _core.PoseEkfConfig()
    fixed: ClassVar[Any] = ("robust_dof", "robust_late_share")
    renamed: ClassVar[Any] = {
        **{f"gate_{of}": (0.999, f"{of}.gate") for of in ("range", "position", "pose", "landmark")},
        **{f"robust_{of}": ("gaussian", f"{of}.noise") for of in ("range", "position", "pose")},
    }

    kind: Kind = "pose"
    """Estimator. `pose`: position and heading; `landmark_slam`: [and
    landmarks](models/landmarks.md#4-landmarks-as-state); `tag_triangle`: [three
    tags](models/poses.md#7-three-tags-as-twelve-states); `air`: [and height](air.md).
    """
    odometry: Odometry = Field(default_factory=Odometry)
    """Noise and latency of odometry."""
    range: Range = Field(default_factory=Range)
    """Noise, gate and latency of ranges."""
    position: Position = Field(default_factory=Position)
    """Antenna position in body; sigmas, gate and latency of position fixes."""
    pose: Pose = Field(default_factory=Pose)
    """Sigmas, gate and latency of poses."""
    heading: Heading = Field(default_factory=Heading)
    """Offset, sigmas, gate and latency of headings."""
    landmark: Landmark = Field(default_factory=Landmark)
    """Noise, gate and latency of landmark observations."""
    calibration: Calibration = Field(default_factory=Calibration)
    """Calibration errors that are estimated during the run."""
    limits: Limits = Field(default_factory=Limits)
    """Physical limits of robot and sensors."""
    adaptive: Adaptive = Field(default_factory=Adaptive)
    """Variances that adapt to the innovations."""
    correlation_s: NonNegative = struct.correlation_s
    """How long errors of a source stay; 0: they are independent [s]."""
    hold_s: Positive = struct.hold_s
    """Odometry timeout: the last motion is extrapolated for this time [s]."""
    sigma_lost_xy_per_sqrt_s: LostSigma = struct.sigma_lost_xy_per_sqrt_s
    """Position process noise without odometry [m/√s]."""
    sigma_lost_heading_per_sqrt_s: LostSigma = struct.sigma_lost_heading_per_sqrt_s
    """Heading process noise after the odometry timeout [rad/√s]."""
    landmark_slam: LandmarkSlam = Field(default_factory=LandmarkSlam)
    """Settings of `landmark_slam` alone."""
    tag_triangle: TagTriangle = Field(default_factory=TagTriangle)
    """Settings of `tag_triangle` alone."""
    air: Air = Field(default_factory=Air)
    """Settings of `air` alone."""

    @property
    def filter(self) -> Kind:
        """Kind of what fuses: a rigid triangle is a body with a pose."""
        is_rigid = self.kind == "tag_triangle" and self.tag_triangle.shape == "rigid"
        return "pose" if is_rigid else self.kind

    @model_validator(mode="after")
    def _settings_of_the_kind(self) -> Estimator:
        plain = type(self).model_construct()
        for key in LEFT_OUT[self.kind]:
            value = attrgetter(key)
            if value(self) != value(plain):
                of = "pose" if key in _OF_POSE else key
                raise ValueError(f"{key} is set, but it belongs to kind {of!r}, and kind is "
                                 f"{self.kind!r}; remove it, or change kind")  # fmt: skip
        if self.pose.shares_odometry and self.filter != "pose":
            raise ValueError(
                "pose.shares_odometry is set, but it belongs to kind 'pose'; remove it"
            )
        return self

    @model_validator(mode="after")
    def _new_is_wider(self) -> Estimator:
        if self.kind == "landmark_slam" and self.landmark_slam.gate_new < self.landmark.gate:
            raise ValueError(f"landmark_slam.gate_new is {self.landmark_slam.gate_new} and "
                             f"landmark.gate is {self.landmark.gate}; expected landmark.gate <= "
                             "gate_new")  # fmt: skip
        return self


def places_antennas(estimator: Estimator) -> bool:
    """Return whether fixes of an antenna that transforms place count as those of a tag there.

    Not where the configuration says where it is, or the kind knows no such tags.
    """
    antenna = estimator.position.antenna_forward_m, estimator.position.antenna_left_m
    return estimator.kind in ("pose", "air") and not any(antenna)


def ignored_by(estimator: Estimator) -> dict[Message, str]:
    """Return why an estimator ignores a source, for each one that it does not fuse."""
    kind = estimator.filter
    why = {source: f"{kind} does not fuse {source}"
           for source in SOURCES if source not in FUSES[kind]}  # fmt: skip
    if kind == "air" and estimator.air.motion != "odometry":
        why["odometry"] = f"air.motion is {estimator.air.motion}, which takes no odometry"
    return why


class Health(Strict):
    """Monitor of how far an estimate may be trusted; ``HealthConfig`` in C++."""

    struct: ClassVar[Any] = _core.HealthConfig()
    fixed: ClassVar[Any] = ("mean_s_between_losses", "wrong_share", "wrong_span_m", "chance_share",
                       "faulty_share", "faulty_share_unnamed", "faulty_s", "exclude_above",
                       "probability_lost", "probability_found", "doubt_s", "invalid_s")  # fmt: skip

    limit_m: Positive = struct.limit_m
    """Position error whose probability `within` reports [m]."""
    risk: Annotated[float, Field(gt=0.0, lt=0.5)] = struct.risk
    """Probability that an error exceeds its protection level."""
    aiding_lost_s: Positive = struct.aiding_lost_s
    """Time without a fused measurement until the state is dead reckoning [s]."""


class Initializer(Strict):
    """What a start from nothing asks for; ``InitializerConfig`` in C++."""

    struct: ClassVar[Any] = _core.InitializerConfig()
    fixed: ClassVar[Any] = ("epoch_s", "headings", "wrong_share", "wrong_span_m", "spacing_m",
                       "spacing_heading_rad", "standing_ranges")  # fmt: skip

    sigma_map_m: Annotated[float, Field(gt=0.0, lt=1000.0)] = struct.sigma_map_m
    """Position uncertainty of the map relative to the anchors [m]."""
    sigma_map_rad: Annotated[float, Field(gt=0.0, lt=10.0)] = struct.sigma_map_rad
    """Heading uncertainty of the map relative to the anchors [rad]."""
    probability_ready: Annotated[float, Field(gt=0.5, lt=1.0)] = struct.probability_ready
    """Minimum probability of the pose for `ready`."""
    sigma_xy_ready_m: Positive = struct.sigma_xy_ready_m
    """Maximum position sigma for `ready`, or that of the best fix [m]."""
    sigma_heading_ready_rad: Positive = struct.sigma_heading_ready_rad
    """Maximum heading sigma for `ready` [rad]."""


class LikelihoodField(Strict):
    """Where beams end; ``LikelihoodFieldConfig`` in C++, with the defaults of ``MclConfig``."""

    struct: ClassVar[Any] = _core.MclConfig().field
    sigma_hit_m: Annotated[float, Field(gt=1e-6, lt=1000.0)] = struct.sigma_hit_m
    """Minimum sigma of a return about its wall [m]."""
    random_share: Annotated[float, Field(gt=1e-9, lt=1.0)] = struct.random_share
    """Fraction of the returns that end anywhere."""
    max_range_m: Annotated[float, Field(gt=1e-3, lt=10_000.0)] = struct.max_range_m
    """Maximum range of a return that is used [m]."""
    clutter_per_m: Annotated[float, Field(ge=0.0, le=1e6)] = struct.clutter_per_m
    """Density of returns in free space, from people and objects off the map [1/m]."""
    unknown_per_m: Annotated[float, Field(ge=0.0, le=1e6)] = struct.unknown_per_m
    """Density of returns in unknown space [1/m]."""


class BeamModel(Strict):
    """How far beams go; ``BeamModelConfig`` in C++."""

    struct: ClassVar[Any] = _core.BeamModelConfig()
    hit: Probability = struct.hit
    """Weight of readings near the range that the map predicts."""
    shorter: Probability = struct.shorter
    """Weight of readings of objects off the map."""
    maximum: Probability = struct.maximum
    """Weight of beams without a return."""
    random: Probability = struct.random
    """Weight of readings anywhere."""
    sigma_hit_m: Annotated[float, Field(ge=1e-6, le=1000.0)] = struct.sigma_hit_m
    """Sigma of a reading about the range that the map predicts [m]."""
    shorter_per_m: Annotated[float, Field(ge=1e-6, le=1e6)] = struct.shorter_per_m
    """Rate at which a beam meets objects off the map [1/m]."""
    max_range_m: Annotated[float, Field(ge=1e-3, le=10_000.0)] = struct.max_range_m
    """Readings beyond this count as no return [m]."""

    @model_validator(mode="after")
    def _some_weight(self) -> BeamModel:
        if self.hit + self.shorter + self.maximum + self.random == 0.0:
            raise ValueError("hit, shorter, maximum and random are all 0; expected one > 0")
        return self


class Switch(Strict):
    """When UWB takes over from scans; ``SwitchingMclConfig`` in C++."""

    struct: ClassVar[Any] = _core.SwitchingMclConfig()
    sigma_unsure_m: Positive = struct.sigma_unsure_m
    """Position sigma of the particles above which scans are suspect [m]."""
    sigma_sure_m: Positive = struct.sigma_sure_m
    """Position sigma below which they no longer are; at most `sigma_unsure_m` [m]."""
    sigma_unsure_rad: Positive = struct.sigma_unsure_rad
    """Heading sigma of the particles above which scans are suspect [rad]."""
    sigma_sure_rad: Positive = struct.sigma_sure_rad
    """Heading sigma below which they no longer are; at most `sigma_unsure_rad` [rad]."""
    elsewhere_m: Positive = struct.elsewhere_m
    """Scans are suspect beyond this and three sigmas from the UWB pose [m]."""
    elsewhere_rad: Positive = struct.elsewhere_rad
    """The same for the heading [rad]."""
    doubt_s: Positive = struct.doubt_s
    """Time for which scans must be suspect until UWB takes over [s]."""
    uwb_sigma_m: Positive = struct.uwb_sigma_m
    """Maximum position sigma of a used UWB pose; at most `sigma_sure_m` [m]."""
    uwb_sigma_rad: Positive = struct.uwb_sigma_rad
    """Maximum heading sigma of a used UWB pose; at most `sigma_sure_rad` [rad]."""
    uwb_age_s: Positive = struct.uwb_age_s
    """Maximum time since the last fused range or position [s]."""
    uwb_nis: Positive = struct.uwb_nis
    """Maximum mean NIS per row of the last 50 or so."""
    share: Annotated[float, Field(gt=0.0, le=1.0)] = struct.share
    """Fraction of the particles that are replaced."""

    @model_validator(mode="after")
    def _doubt_ends(self) -> Switch:
        for unit in ("m", "rad"):
            uwb, sure, unsure = (f"{name}_{unit}" for name in ("uwb_sigma", "sigma_sure",
                                                               "sigma_unsure"))  # fmt: skip
            for low, high, why in (
                (sure, unsure, "else a suspicion would end where it begins"),
                (uwb, sure, "else UWB would take over for ever, as its own pose is suspect"),
            ):
                if getattr(self, low) > getattr(self, high):
                    raise ValueError(
                        f"{low} is {getattr(self, low)} and {high} is {getattr(self, high)}; "
                        f"expected {low} <= {high}: {why}"
                    )
        return self


# What `Estimator` says of wheels and sensors, which goes for particles, too.
SENSORS = ("odometry", "range", "position", "pose", "landmark", "limits")
ROBOT = (*SENSORS, "hold_s")


class Mcl(Strict):
    """Monte Carlo localization; ``MclConfig`` in C++, whose wheels and sensors are `estimator`'s.

    With a `switch` ranges and positions go to a filter of their own, by `estimator` and
    `initializer`, which rescues the particles.
    """

    struct: ClassVar[Any] = _core.MclConfig()
    fixed: ClassVar[Any] = ("kld_error", "kld_quantile", "effective_share", "outlier_share",
                       "resample_below", "most_drop", "min_explained", "scouts", "scout_draws",
                       "most_gain", "sigma_lost_xy_per_sqrt_s", "sigma_lost_heading_per_sqrt_s",
                       "bin_m", "bin_headings")  # fmt: skip
    renamed: ClassVar[Any] = {"refine_up_to": (0, "proposal: scan_match")}

    poses_hz: Rate | None = None
    """Rate of poses for the pose EKF; default: particles are the estimate [Hz]."""
    switch: Switch | None = None
    """Ranges and positions relocalize particles instead of weighting them."""
    min_particles: Annotated[int, Field(ge=1, le=2**28)] = struct.min_particles
    """Minimum number of particles."""
    max_particles: Annotated[int, Field(ge=1, le=2**28)] = struct.max_particles
    """Maximum number of particles, used while searching; at least `min_particles`."""
    beams: Annotated[int, Field(ge=1, le=100_000)] = struct.beams
    """Number of returns of a scan that are used, evenly spaced."""
    independent_beams: Annotated[float, Field(ge=1e-3, le=1e6)] = struct.independent_beams
    """Number of independent beams that they count as."""
    independent_beams_searching: Annotated[float, Field(ge=1e-3, le=1e6)] = (
        struct.independent_beams_searching
    )
    """The same during global localization."""
    proposal: Literal["odometry", "scan_match", "line_ekf", "line_ekf_paper"] = "odometry"
    """Where particles of a tracked robot [are
    drawn](models/particles.md#drawing-where-the-scan-says).
    """
    spacing_m: Annotated[float, Field(ge=0.0, le=1e6)] = struct.spacing_m
    """Minimum distance driven between two scans that are used [m]."""
    spacing_heading_rad: Annotated[float, Field(ge=0.0, le=1e6)] = struct.spacing_heading_rad
    """Minimum angle turned between two scans that are used [rad]."""
    kidnapping_probability: Annotated[float, Field(ge=0.0, le=0.5)] = struct.kidnapping_probability
    """Prior probability of kidnapping, which a recovery particle must outweigh."""
    probability_ready: Annotated[float, Field(ge=0.5, le=1.0)] = struct.probability_ready
    """Minimum probability of the best hypothesis for `ready`."""
    sigma_xy_ready_m: Annotated[float, Field(ge=0.0, le=1e6)] = struct.sigma_xy_ready_m
    """Maximum position sigma for `ready` [m]."""
    sigma_heading_ready_rad: Annotated[float, Field(ge=0.0, le=10.0)] = (
        struct.sigma_heading_ready_rad
    )
    """Maximum heading sigma for `ready` [rad]."""
    sigma_map_m: Annotated[float, Field(ge=0.0, le=1000.0)] = struct.sigma_map_m
    """Position uncertainty of the map, which scans cannot reduce [m]."""
    sigma_map_rad: Annotated[float, Field(ge=0.0, le=10.0)] = struct.sigma_map_rad
    """Heading uncertainty of the map, which scans cannot reduce [rad]."""
    seed: Annotated[int, Field(ge=0, lt=2**64)] | None = None
    """Seed of the particle filter; default: the seed of the run."""
    threads: Annotated[int, Field(ge=1, le=256)] = struct.threads
    """Number of threads; results do not depend on it."""
    field: LikelihoodField = Field(default_factory=LikelihoodField)
    """Likelihood field: where beams end."""
    sigma_widest_m: Annotated[float, Field(ge=0.0, le=1000.0)] = struct.sigma_widest_m
    """Maximum `sigma_hit_m` that is tried; the one that fits is used [m]."""
    likelihood: Literal["field", "beams", "zhang"] = "field"
    """Likelihood of a scan: [where beams end](models/scans.md#3-likelihood-field), or [how far
    they go](models/scans.md#4-beam-model).
    """
    beam_model: BeamModel = Field(default_factory=BeamModel)
    """Beam model: how far beams go."""

    @model_validator(mode="after")
    def _least_and_most(self) -> Mcl:
        for least, most, low, high in (
            ("min_particles", "max_particles", self.min_particles, self.max_particles),
            ("field.sigma_hit_m", "sigma_widest_m", self.field.sigma_hit_m, self.sigma_widest_m),
        ):
            if low > high:
                raise ValueError(
                    f"{least} is {low} and {most} is {high}; expected {least} <= {most}"
                )
        return self


class RangeError(Strict):
    """What ranges to an anchor read: scale * distance + offset."""

    offset_m: Annotated[float, Field(ge=-1e9, le=1e9)] = 0.0
    """Constant part of the range error [m]."""
    scale: Annotated[float, Field(ge=1e-6, le=1e6)] = 1.0
    """Proportional part: a range reads scale * distance + offset."""


class StartSigma(Strict):
    """How well the start pose is known."""

    xy_m: Annotated[float, Field(gt=0.0, le=1e9)] = 0.1
    """Standard deviation of x and of y [m]."""
    heading_deg: Annotated[float, Field(gt=0.0, le=1e9)] = 5.0
    """Standard deviation of the heading [deg]."""


class Dataset(Strict):
    """A recording in its publishers' format: converter, folder, and which run of it."""

    dataset: Name
    """Converter."""
    path: Name
    """Folder as published."""
    run: Name | None = None
    """Run to convert, if there are several; default: the first."""


def _origin_kind(value: Any) -> str:
    return "dataset" if isinstance(value, dict | Dataset) else "folder"


def _is_number(value: Any) -> bool:
    is_real = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        return is_real and math.isfinite(value)
    except OverflowError:  # an integer beyond float
        return False


def _start(value: Any) -> Any:
    is_pose = isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_number, value))
    if not is_pose and value not in ("truth", "auto", "srls_headings"):
        raise ValueError("expected 'truth', 'auto', 'srls_headings' or [x_m, y_m, heading_deg], "
                         "finite numbers")  # fmt: skip
    return value


Origin: TypeAlias = Annotated[
    Annotated[Name, Tag("folder")] | Annotated[Dataset, Tag("dataset")], Discriminator(_origin_kind)
]
Start: TypeAlias = Annotated[
    Literal["truth", "auto", "srls_headings"] | tuple[float, float, float], BeforeValidator(_start)
]


class SwitchedOff(Strict):
    """A source that is off from one arrival on, and perhaps on again from another."""

    source: Source
    """Source that is off; `imu` where `air.motion` is `inertial`."""
    from_s: Annotated[float, Field(ge=-4e9, le=4e9)]
    """First arrival time, on the clock of the log, at which it is off [s]."""
    until_s: Annotated[float, Field(ge=-4e9, le=4e9)] | None = None
    """Arrival time from which it is on again; default: never [s]."""


# The keys that most robots need; all others are for experts.
BASIC = (
    "log", "start", "use", "estimator.kind",
    "estimator.odometry.sigma_longitudinal_per_sqrt_m",
    "estimator.odometry.sigma_heading_per_sqrt_rad", "estimator.range.sigma_m",
    "estimator.position.sigma_m", "estimator.pose.sigma_m", "mcl", "cylinders", "scan_odometry",
    "health.limit_m", "ros.world", "ros.topics",
)  # fmt: skip


class RunConfig(Strict):
    """One run, from the messages of a log or a simulation to a pose.

    Paths are relative to the configuration's file.
    """

    name: str = "run"
    """Title of the report."""
    description: str = ""
    """Shown in the report; default: the description of the log."""
    log: Origin | None = None
    """Recorded messages; `--log` overrides it."""
    simulation: Scenario | None = None
    """Simulated messages instead of a log."""
    start: Start = "truth"
    """Start pose. `truth`: the reference; `auto`: [found without a prior](start.md);
    `srls_headings`: found [from one set of ranges and one scan](start.md#sr-ls-and-headings)
    [m, m, deg].
    """
    start_sigma: StartSigma = Field(default_factory=StartSigma)
    """Uncertainty of the start pose."""
    initializer: Initializer = Field(default_factory=Initializer)
    """Settings of the search for the start pose."""
    use: Annotated[list[Source], Field(min_length=1)] = Field(default_factory=lambda: list(USABLE))
    """Sources that are fused; messages of the others are left out."""
    anchors: dict[Name, RangeError] = Field(default_factory=dict)
    """Known range errors of an anchor; `all`: of those not named."""
    cylinders: Cylinders | None = None
    """Detect round objects in the scans as landmark observations."""
    scan_odometry: ScanOdometry | None = None
    """Make the odometry [of scans](models/scans.md#as-the-odometry-of-a-run), with wheels as a
    guess.
    """
    imu: Imu = Field(default_factory=Imu)
    """How [a gyro and wheels](models/motion.md#2-gyro-and-wheels) measure turns, if there is a
    gyro."""
    tag_conditioner: TagConditioner | None = None
    """Condition the position fixes of tags [before they are
    fused](models/poses.md#conditioning).
    """
    estimator: Estimator = Field(default_factory=Estimator)
    """EKF that fuses everything but scans."""
    health: Health = Field(default_factory=Health)
    """Monitor of [how far the estimate may be trusted](health.md)."""
    watch_poses: bool = False
    """Judge the poses of another localizer [by the estimate](watch.md) instead of fusing them."""
    when_lost: Literal["restart", "go_on"] = "restart"
    """What an EKF does once it is lost: relocalize, or continue."""
    smooth: bool = False
    """Estimate [all poses at once](smoothing.md), by all messages of the log."""
    mcl: Mcl | None = None
    """Fuse scans on the map of the log, too: [Localize on a map](localize.md)."""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    """Seed of the simulation and of the particle filter."""
    history_s: Annotated[float, Field(ge=0.0, le=1e9)] = 2.0
    """Maximum lateness of a message that is still fused at its stamp [s]."""
    history_messages: Annotated[int, Field(ge=512, le=1_000_000_000)] = 100_000
    """Maximum number of messages kept for late ones."""
    clock_jump: Literal["refuse", "reset", "continue"] = "refuse"
    """When [the clock goes back](filter.md#a-clock-that-goes-back): reject messages, start again,
    or continue.
    """
    switched_off: list[SwitchedOff] = Field(default_factory=list)
    """Intervals in which a source is switched off."""
    ros: Ros = Field(default_factory=Ros)
    """Topics and frames of a ROS robot."""

    renamed: ClassVar[Any] = {
        "delays_s": ({}, "latency_s of the sensor, as estimator.range.latency_s")
    }

    @property
    def is_inertial(self) -> bool:
        """Whether an estimator in space takes the samples of an IMU itself."""
        return (self.estimator.kind == "air" and self.estimator.air.motion == "inertial"
                and self.mcl is None)  # fmt: skip

    @property
    def latency_s(self) -> dict[Source, float]:
        """Constant latency of each source."""
        of = self.estimator
        return {"odometry": of.odometry.latency_s, "ranges": of.range.latency_s,
                "positions": of.position.latency_s, "poses": of.pose.latency_s,
                "landmark_sightings": of.landmark.latency_s,
                "altitudes": of.air.altitude.latency_s, "headings": of.heading.latency_s,
                "imu": self.imu.latency_s}  # fmt: skip

    @property
    def latency_of_tables_s(self) -> dict[Source, float]:
        """The same in a log that is prepared: what is made of scans has the stamps of scans."""
        made: dict[Source, object] = {"odometry": self.scan_odometry,
                                      "landmark_sightings": self.cylinders,
                                      "poses": self.mcl and self.mcl.poses_hz}  # fmt: skip
        return {source: late if made.get(source) is None else 0.0
                for source, late in self.latency_s.items()}  # fmt: skip

    @property
    def searches_start(self) -> bool:
        """Whether the run finds its start itself."""
        return self.start in ("auto", "srls_headings")

    @model_validator(mode="before")
    @classmethod
    def _sensors_stand_in_one_place(cls, data: Any) -> Any:
        """Refuse sensors of ``mcl``, which are those of ``estimator``, unless they say the same."""
        mcl = data.get("mcl") if isinstance(data, dict) else None
        if not isinstance(mcl, dict) or not any(key in mcl for key in ROBOT):
            return data
        estimator = data.get("estimator") or {}
        # What the EKF of poses_hz fuses was never of use to particles.
        used = ROBOT if mcl.get("poses_hz") is None else ("odometry", "limits", "hold_s")
        for key in (key for key in used if key in mcl):
            if not isinstance(estimator, dict) or estimator.get(key) != mcl[key]:
                raise ValueError(
                    f"mcl.{key} is not a key any more: the robot is described once, in estimator; "
                    f"move it to estimator.{key}"
                )
        return {**data, "mcl": {key: mcl[key] for key in mcl if key not in ROBOT}}

    @model_validator(mode="after")
    def _one_origin(self) -> RunConfig:
        if self.log is not None and self.simulation is not None:
            raise ValueError("both log and simulation are given; expected one of them")
        return self

    @model_validator(mode="after")
    def _what_is_made_is_used(self) -> RunConfig:
        for what, maker, source in (
            ("cylinders are", self.cylinders, "landmark_sightings"),
            ("mcl.poses_hz makes", self.mcl and self.mcl.poses_hz, "poses"),
            ("scan_odometry makes", self.scan_odometry, "odometry"),
        ):
            if maker is not None and source not in self.use:
                raise ValueError(f"{what} {source}, which use leaves out; add {source!r} to use, "
                                 f"or remove {what.split()[0]}")  # fmt: skip
        if self.cylinders is not None and getattr(self.simulation, "landmark_sightings", None):
            raise ValueError(
                "both cylinders and simulation.landmark_sightings are given; expected one of them"
            )
        return self

    @model_validator(mode="after")
    def _switch_has_something_to_switch_to(self) -> RunConfig:
        if self.mcl is None or self.mcl.switch is None:
            return self
        if self.mcl.poses_hz is not None:
            raise ValueError(
                "both mcl.switch and mcl.poses_hz are given; expected one of them: the pose EKF of "
                "poses_hz fuses ranges and positions itself"
            )
        if not {"ranges", "positions"} & set(self.use):
            raise ValueError(
                "mcl.switch needs ranges or positions, which use leaves out; add them to use, or "
                "remove the switch"
            )
        return self

    @model_validator(mode="after")
    def _poses_can_be_watched(self) -> RunConfig:
        if not self.watch_poses:
            return self
        for key, is_there in (("mcl.poses_hz", self.mcl and self.mcl.poses_hz),
                              ("smooth", self.smooth),
                              ("estimator.kind landmark_slam, whose map is relative to its start",
                               self.estimator.kind == "landmark_slam")):  # fmt: skip
            if is_there:
                raise ValueError(f"watch_poses does not go with {key}; remove one of the two")
        if "poses" not in self.use:
            raise ValueError("watch_poses judges poses, which use leaves out; add 'poses' to use")
        if self.use == ["poses"] and self.mcl is None and self.scan_odometry is None:
            raise ValueError("watch_poses judges poses by what else is fused, but use names poses "
                             "alone; add other sources to use, or set mcl")  # fmt: skip
        if (
            self.mcl is None
            and self.start == "auto"
            and not ({"ranges", "positions", "landmark_sightings"} & set(self.use))
        ):
            raise ValueError("start is 'auto', but watch_poses leaves poses out of the search, and "
                             "use names nothing else that knows a place; set start: "
                             "[x, y, heading_deg]")  # fmt: skip
        return self

    @model_validator(mode="after")
    def _headings_can_be_searched(self) -> RunConfig:
        if self.start == "srls_headings" and self.mcl is not None:
            raise ValueError("start is 'srls_headings', but mcl finds its start by particles; "
                             "expected 'auto', 'truth' or [x, y, heading_deg]")  # fmt: skip
        if self.start == "srls_headings" and "ranges" not in self.use:
            raise ValueError("start is 'srls_headings', which needs ranges, which use leaves out; "
                             "add 'ranges' to use, or set start: auto")  # fmt: skip
        return self

    @model_validator(mode="after")
    def _fixes_of_tags_are_fused(self) -> RunConfig:
        if self.tag_conditioner is None:
            return self
        if "positions" not in self.use or self.estimator.kind == "landmark_slam":
            what = (
                "use leaves out" if "positions" not in self.use else "landmark_slam does not fuse"
            )
            raise ValueError(
                f"tag_conditioner conditions positions of tags, which {what}; remove it"
            )
        if self.mcl is not None and self.mcl.poses_hz is None and self.mcl.switch is None:
            raise ValueError("tag_conditioner conditions what an EKF fuses, but particles fuse "
                             "positions themselves; set mcl.switch or mcl.poses_hz, or remove "
                             "it")  # fmt: skip
        return self

    @model_validator(mode="after")
    def _can_be_smoothed(self) -> RunConfig:
        for key, is_there in (("estimator.kind", self.estimator.kind != "pose"),
                              ("mcl without poses_hz", self.mcl and not self.mcl.poses_hz),
                              ("tag_conditioner", self.tag_conditioner),
                              ("switched_off", self.switched_off),
                              ("cylinders, whose sightings have no names", self.cylinders),
                              ("estimator.adaptive", self.estimator.adaptive.messages),
                              ("estimator.range.noise one_sided",
                               self.estimator.range.noise == "one_sided")):  # fmt: skip
            if self.smooth and is_there:
                raise ValueError(f"smooth does not go with {key}; remove one of the two")
        return self

    @model_validator(mode="after")
    def _can_be_switched_off(self) -> RunConfig:
        if not self.is_inertial and any(off.source == "imu" for off in self.switched_off):
            raise ValueError(
                "switched_off names imu, which is a source of its own only with "
                "estimator.kind 'air' and air.motion 'inertial'; remove it"
            )
        return self

    @model_validator(mode="after")
    def _kind_can_do_it(self) -> RunConfig:
        kind = self.estimator.kind
        if kind == "pose" and "altitudes" not in self.use:
            return self
        if kind != "pose" and self.mcl is not None:
            raise ValueError(
                f"both mcl and estimator.kind {kind!r} are given; expected one of them"
            )
        if kind == "air" and self.searches_start:
            raise ValueError(
                f"start is {self.start!r}, which finds no height; with estimator.kind 'air' set "
                "start: [x, y, heading_deg] and estimator.air.start_height_m"
            )
        if self.is_inertial and "imu" not in self.use:
            raise ValueError("estimator.air.motion is 'inertial', but use leaves 'imu' out; "
                             "add it, or set motion: constant_velocity")  # fmt: skip
        unused = [source for source in self.use
                  if source not in (*FUSES[self.estimator.filter], "imu")]  # fmt: skip
        if unused and [*self.use, "imu"] not in EVERYTHING and self.use not in EVERYTHING:
            raise ValueError(
                f"use names {unused}, which estimator.kind {kind!r} does not fuse; expected some "
                f"of {list(FUSES[self.estimator.filter])}"
            )
        return self

    @model_validator(mode="after")
    def _sigmas_to_fuse_with(self) -> RunConfig:
        for source in ("poses", "positions", "altitudes", "headings"):
            sensor = getattr(self.simulation, source, None)
            if sensor is None or source not in self.use:
                continue
            for key in ("sigma_xy_m", "sigma_heading_deg", "sigma_m", "sigma_deg"):
                if getattr(sensor, key, 1.0) == 0.0:
                    raise ValueError(
                        f"simulation.{source}.{key} is 0, but what is fused needs a sigma > 0; "
                        f"set it, or leave {source!r} out of use"
                    )
        return self
