# SPDX-License-Identifier: Apache-2.0
"""What a run is told: where messages come from, where the robot starts, what the filter believes.

The estimator's models repeat the names, bounds and defaults of the C++ structs, which own them; a
test compares the two.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from locfuse.config.base import Strict
from locfuse.config.ros import Ros
from locfuse.config.scenario import Name, Probability, Rate, Scenario

Positive: TypeAlias = Annotated[float, Field(gt=0.0)]  # as in C++: what is too much for it, it says
NonNegative: TypeAlias = Annotated[float, Field(ge=0.0)]
DriftSigma: TypeAlias = Annotated[float, Field(ge=0.0, le=1e6)]
LostSigma: TypeAlias = Annotated[float, Field(gt=0.0, le=1e6)]
Limit: TypeAlias = Annotated[float, Field(gt=0.0, le=1e12)]
GateProbability: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0)]
Source: TypeAlias = Literal["odometry", "ranges", "positions", "poses", "landmark_sightings"]
SOURCES: tuple[Source, ...] = ("odometry", "ranges", "positions", "poses", "landmark_sightings")


class Odometry(Strict):
    """Noise of wheel odometry; ``OdometryConfig`` in C++."""

    sigma_longitudinal_per_sqrt_m: DriftSigma = 0.03
    sigma_lateral_per_sqrt_m: DriftSigma = 0.01
    sigma_heading_per_sqrt_m: DriftSigma = 0.02
    sigma_heading_per_sqrt_rad: DriftSigma = 0.03
    sigma_xy_per_sqrt_s: DriftSigma = 0.0
    sigma_heading_per_sqrt_s: DriftSigma = 0.0
    sigma_longitudinal_per_sqrt_s: DriftSigma = 0.0


class Range(Strict):
    """Noise of ranges that bring no sigma of their own; ``RangeConfig`` in C++."""

    sigma_m: NonNegative = 0.1
    sigma_relative: NonNegative = 0.0

    @model_validator(mode="after")
    def _some_noise(self) -> Range:
        if self.sigma_m == 0.0 and self.sigma_relative == 0.0:
            raise ValueError("sigma_m and sigma_relative are both 0; expected at least one > 0")
        return self


class Position(Strict):
    """Position fixes: lever arm of the antenna, and sigmas; ``PositionConfig`` in C++."""

    antenna_forward_m: float = 0.0
    antenna_left_m: float = 0.0
    sigma_m: NonNegative = 0.0
    least_sigma_m: Positive = 1e-3


class Pose(Strict):
    """Sigmas of poses of other localizers; ``PoseConfig`` in C++."""

    sigma_m: NonNegative = 0.0
    sigma_heading_rad: NonNegative = 0.0
    least_sigma_m: Positive = 1e-3
    least_sigma_heading_rad: Positive = 1e-4


class Limits(Strict):
    """What no robot and no sensor exceeds; ``Limits`` in C++."""

    speed_mps: Limit = 100.0
    turn_rate_radps: Limit = 50.0
    range_m: Limit = 1e4
    distance_m: Limit = 2e7


class Adaptive(Strict):
    """Variances that follow innovations, 0 for none; ``AdaptiveNoise::Config`` in C++."""

    messages: NonNegative = 0.0
    least: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    most: Annotated[float, Field(ge=1.0)] = 100.0

    @model_validator(mode="after")
    def _more_than_an_echo(self) -> Adaptive:
        if 0.0 < self.messages < 5.0:
            raise ValueError(f"messages is {self.messages}; expected 0 for off, or at least 5")
        return self


class Landmark(Strict):
    """Noise of sightings that bring no sigmas of their own; ``RangeBearingConfig`` in C++."""

    sigma_range_m: Positive = 0.1
    sigma_bearing_rad: Positive = 0.02
    sigma_range_relative: NonNegative = 0.0


class Calibration(Strict):
    """Errors that the pose EKF learns, 0 for none; ``CalibrationConfig`` in C++."""

    sigma_scale: DriftSigma = 0.0
    sigma_direction_rad: DriftSigma = 0.0
    sigma_turn_scale: DriftSigma = 0.0
    sigma_turn_bias_radps: DriftSigma = 0.0
    sigma_turn_bias_radps_per_sqrt_s: DriftSigma = 0.0
    sigma_sensor_m: DriftSigma = 0.0
    sigma_sensor_rad: DriftSigma = 0.0
    sigma_range_offset_m: DriftSigma = 0.0
    sigma_range_scale: DriftSigma = 0.0
    sigma_delay_s: DriftSigma = 0.0
    sigma_anchor_offset_m: DriftSigma = 0.0
    anchor_offset_correlation_s: NonNegative = 0.0
    sigma_anchor_scale: DriftSigma = 0.0
    sigma_range_delay_s: DriftSigma = 0.0
    consider: bool = False

    @model_validator(mode="after")
    def _wanders_as_state(self) -> Calibration:
        if self.sigma_turn_bias_radps_per_sqrt_s > 0.0 and self.sigma_turn_bias_radps == 0.0:
            raise ValueError(
                "sigma_turn_bias_radps_per_sqrt_s is set, but sigma_turn_bias_radps is 0: the bias "
                "is no state; expected both or neither"
            )
        if self.anchor_offset_correlation_s > 0.0 and self.sigma_anchor_offset_m == 0.0:
            raise ValueError(
                "anchor_offset_correlation_s is set, but sigma_anchor_offset_m is 0: offsets are "
                "no states; expected both or neither"
            )
        return self


Bounded = Annotated[float, Field(ge=0.0, le=1e9)]  # its square is finite


class Cylinders(Strict):
    """Pillars, poles and trunks in the scans; ``CylinderDetectorConfig`` in C++."""

    sigma_range_m: Annotated[float, Field(ge=1e-6, le=1e9)] = 0.01
    sigma_bearing_rad: Bounded = 0.0
    radius_m: Bounded = 0.0
    radius_min_m: Annotated[float, Field(ge=1e-3, le=1e9)] = 0.03
    radius_max_m: Annotated[float, Field(ge=1e-3, le=1e9)] = 1.5
    least_beams: Annotated[int, Field(ge=1, le=10**9)] = 7
    jump_gaps: Annotated[float, Field(ge=1.0, le=1e9)] = 6.0
    misfit_probability: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.99999
    least_evidence: Bounded = 25.0
    least_corner_evidence: Annotated[float, Field(ge=-1e9, le=1e9)] = 4.0
    leg_radius_m: Bounded = 0.12
    leg_distance_m: Bounded = 0.0
    least_intensity: Bounded = 0.0

    @model_validator(mode="after")
    def _least_and_most(self) -> Cylinders:
        if self.radius_min_m > self.radius_max_m:
            raise ValueError(
                f"radius_min_m is {self.radius_min_m} and radius_max_m is {self.radius_max_m}; "
                "expected radius_min_m <= radius_max_m"
            )
        return self


class Estimator(Strict):
    """The pose EKF; ``PoseEkfConfig`` in C++."""

    odometry: Odometry = Field(default_factory=Odometry)
    range: Range = Field(default_factory=Range)
    position: Position = Field(default_factory=Position)
    pose: Pose = Field(default_factory=Pose)
    landmark: Landmark = Field(default_factory=Landmark)
    calibration: Calibration = Field(default_factory=Calibration)
    limits: Limits = Field(default_factory=Limits)
    adaptive: Adaptive = Field(default_factory=Adaptive)
    gate_range: GateProbability = 0.999
    gate_position: GateProbability = 0.999
    gate_pose: GateProbability = 0.999
    gate_landmark: GateProbability = 0.999
    robust_range: Literal["gaussian", "one_sided", "student_t", "cauchy"] = "gaussian"
    robust_position: Literal["gaussian", "student_t", "cauchy"] = "gaussian"
    robust_pose: Literal["gaussian", "student_t", "cauchy"] = "gaussian"
    robust_dof: Annotated[float, Field(ge=1.0, le=1e6)] = 4.0
    robust_late_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.05
    hold_s: Positive = 1.0
    sigma_lost_xy_per_sqrt_s: LostSigma = 0.5
    sigma_lost_heading_per_sqrt_s: LostSigma = 0.5


class Health(Strict):
    """What tells how far an estimate may be trusted; ``HealthConfig`` in C++."""

    limit_m: Positive = 1.0
    risk: Annotated[float, Field(gt=0.0, lt=0.5)] = 0.01
    mean_s_between_losses: Annotated[float, Field(gt=1e-3, lt=1e12)] = 14400.0
    wrong_share: Annotated[float, Field(gt=1e-9, lt=1.0)] = 0.02
    wrong_span_m: Annotated[float, Field(gt=1e-6, lt=1e12)] = 20.0
    chance_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.4
    faulty_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    faulty_share_unnamed: Annotated[float, Field(gt=0.0, lt=1.0)] = 1e-6
    faulty_s: Positive = 10.0
    exclude_above: Annotated[float, Field(gt=0.0, le=1.0)] = 0.999
    probability_lost: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
    probability_found: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    doubt_s: Positive = 0.5
    aiding_lost_s: Positive = 2.0
    invalid_s: Positive = 60.0

    @model_validator(mode="after")
    def _found_ends_lost(self) -> Health:
        if self.probability_found > self.probability_lost:
            raise ValueError(
                f"probability_found is {self.probability_found} and probability_lost is "
                f"{self.probability_lost}; expected probability_found <= probability_lost"
            )
        return self


class Initializer(Strict):
    """What a start from nothing asks for; ``InitializerConfig`` in C++."""

    epoch_s: Annotated[float, Field(gt=0.0, lt=3600.0)] = 0.2
    headings: Annotated[int, Field(gt=3, le=360)] = 36
    wrong_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.01
    wrong_span_m: Positive = 20.0
    spacing_m: Positive = 0.2
    spacing_heading_rad: Positive = 0.35
    sigma_map_m: Annotated[float, Field(gt=0.0, lt=1000.0)] = 0.03
    sigma_map_rad: Annotated[float, Field(gt=0.0, lt=10.0)] = 0.02
    standing_ranges: Annotated[int, Field(gt=0, le=1_000_000_000)] = 10
    probability_ready: Annotated[float, Field(gt=0.5, lt=1.0)] = 0.999
    sigma_xy_ready_m: Positive = 0.5
    sigma_heading_ready_rad: Positive = 0.087


class LikelihoodField(Strict):
    """Where beams end; ``LikelihoodFieldConfig`` in C++, with the defaults of ``MclConfig``."""

    sigma_hit_m: Annotated[float, Field(gt=1e-6, lt=1000.0)] = 0.05
    random_share: Annotated[float, Field(gt=1e-9, lt=1.0)] = 0.05
    max_range_m: Annotated[float, Field(gt=1e-3, lt=10_000.0)] = 30.0
    clutter_per_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.1
    unknown_per_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.002


class BeamModel(Strict):
    """How far beams go; ``BeamModelConfig`` in C++."""

    hit: Probability = 0.8
    shorter: Probability = 0.1
    maximum: Probability = 0.05
    random: Probability = 0.05
    sigma_hit_m: Annotated[float, Field(ge=1e-6, le=1000.0)] = 0.1
    shorter_per_m: Annotated[float, Field(ge=1e-6, le=1e6)] = 0.5
    max_range_m: Annotated[float, Field(ge=1e-3, le=10_000.0)] = 30.0

    @model_validator(mode="after")
    def _some_weight(self) -> BeamModel:
        if self.hit + self.shorter + self.maximum + self.random == 0.0:
            raise ValueError("hit, shorter, maximum and random are all 0; expected one > 0")
        return self


class Switch(Strict):
    """When UWB takes over from scans; ``SwitchingMclConfig`` in C++."""

    sigma_unsure_m: Positive = 0.5
    sigma_sure_m: Positive = 0.3
    sigma_unsure_rad: Positive = 0.35
    sigma_sure_rad: Positive = 0.2
    elsewhere_m: Positive = 1.0
    elsewhere_rad: Positive = 0.5
    doubt_s: Positive = 2.0
    uwb_sigma_m: Positive = 0.25
    uwb_sigma_rad: Positive = 0.2
    uwb_age_s: Positive = 2.5
    uwb_nis: Positive = 1.4
    share: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0

    @model_validator(mode="after")
    def _doubt_ends(self) -> Switch:
        for unit in ("m", "rad"):
            uwb, sure, unsure = (f"{name}_{unit}" for name in ("uwb_sigma", "sigma_sure",
                                                               "sigma_unsure"))  # fmt: skip
            for low, high, why in (
                (sure, unsure, "else doubt would end where it begins"),
                (uwb, sure, "else UWB would take over for ever, as its own pose leaves doubt"),
            ):
                if getattr(self, low) > getattr(self, high):
                    raise ValueError(
                        f"{low} is {getattr(self, low)} and {high} is {getattr(self, high)}; "
                        f"expected {low} <= {high}: {why}"
                    )
        return self


class Mcl(Strict):
    """Monte Carlo localization; ``MclConfig`` in C++, but for four keys.

    `likelihood` is by which scans weigh particles: ``zhang`` is the beam model with the mixture of
    that paper in place of `beam_model`. `poses_hz` makes its estimates the poses of a pose EKF.
    Without a `seed` it is the run's. With a `switch` ranges and positions do not weigh particles:
    they go to a filter of their own, by `estimator` and `initializer`, which rescues them.
    """

    poses_hz: Rate | None = None
    switch: Switch | None = None
    min_particles: Annotated[int, Field(ge=1, le=2**28)] = 500
    max_particles: Annotated[int, Field(ge=1, le=2**28)] = 5000
    kld_error: Annotated[float, Field(ge=1e-6, le=1.0)] = 0.05
    kld_quantile: Annotated[float, Field(ge=0.0, le=10.0)] = 2.33
    beams: Annotated[int, Field(ge=1, le=100_000)] = 60
    independent_beams: Annotated[float, Field(ge=1e-3, le=1e6)] = 10.0
    independent_beams_searching: Annotated[float, Field(ge=1e-3, le=1e6)] = 2.0
    effective_share: Probability = 0.2
    outlier_share: Annotated[float, Field(ge=0.0, le=0.999)] = 0.01
    resample_below: Probability = 0.5
    refine_up_to: Annotated[int, Field(ge=0, le=2**28)] = 0
    spacing_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.1
    spacing_heading_rad: Annotated[float, Field(ge=0.0, le=1e6)] = 0.05
    most_drop: Annotated[float, Field(ge=0.0, le=1e6)] = 1.5
    min_explained: Probability = 0.75
    scouts: Annotated[int, Field(ge=0, le=100_000)] = 64
    scout_draws: Annotated[int, Field(ge=0, le=2**28)] = 20_000
    most_gain: Annotated[float, Field(ge=0.1, le=1e6)] = 2.0
    kidnapping_probability: Annotated[float, Field(ge=0.0, le=0.5)] = 1e-4
    hold_s: Annotated[float, Field(ge=1e-9, le=1e9)] = 1.0
    sigma_lost_xy_per_sqrt_s: Annotated[float, Field(ge=0.0, le=1e6)] = 0.5
    sigma_lost_heading_per_sqrt_s: Annotated[float, Field(ge=0.0, le=1e6)] = 0.5
    probability_ready: Annotated[float, Field(ge=0.5, le=1.0)] = 0.999
    sigma_xy_ready_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.5
    sigma_heading_ready_rad: Annotated[float, Field(ge=0.0, le=10.0)] = 0.17
    bin_m: Annotated[float, Field(ge=1e-3, le=1e6)] = 0.5
    bin_headings: Annotated[int, Field(ge=1, le=3600)] = 24
    sigma_map_m: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.03
    sigma_map_rad: Annotated[float, Field(ge=0.0, le=10.0)] = 0.005
    seed: Annotated[int, Field(ge=0, lt=2**64)] | None = None
    threads: Annotated[int, Field(ge=1, le=256)] = 1
    odometry: Odometry = Field(default_factory=Odometry)
    field: LikelihoodField = Field(default_factory=LikelihoodField)
    sigma_widest_m: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.4
    likelihood: Literal["field", "beams", "zhang"] = "field"
    beam_model: BeamModel = Field(default_factory=BeamModel)
    range: Range = Field(default_factory=Range)
    position: Position = Field(default_factory=Position)
    pose: Pose = Field(default_factory=Pose)
    landmark: Landmark = Field(default_factory=Landmark)
    limits: Limits = Field(default_factory=Limits)

    @model_validator(mode="after")
    def _least_and_most(self) -> Mcl:
        for least, most, low, high in (
            ("min_particles", "max_particles", self.min_particles, self.max_particles),
            ("scouts", "scout_draws", self.scouts, self.scout_draws),
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
    scale: Annotated[float, Field(ge=1e-6, le=1e6)] = 1.0


class StartSigma(Strict):
    """How well the start pose is known."""

    xy_m: Annotated[float, Field(gt=0.0, le=1e9)] = 0.1
    heading_deg: Annotated[float, Field(gt=0.0, le=1e9)] = 5.0


class Dataset(Strict):
    """A recording in its publishers' format: converter, folder, and which run of it."""

    dataset: Name
    path: Name
    run: Name | None = None


def _origin_kind(value: Any) -> str:
    return "dataset" if isinstance(value, dict | Dataset) else "folder"


def _is_number(value: Any) -> bool:
    is_real = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        return is_real and math.isfinite(value)
    except OverflowError:  # an integer that is no float
        return False


def _start(value: Any) -> Any:
    is_pose = isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_number, value))
    if value not in ("truth", "auto") and not is_pose:
        raise ValueError("expected 'truth', 'auto' or [x_m, y_m, heading_deg], finite numbers")
    return value


Origin: TypeAlias = Annotated[
    Annotated[Name, Tag("folder")] | Annotated[Dataset, Tag("dataset")],
    Discriminator(_origin_kind),
]
Start: TypeAlias = Annotated[
    Literal["truth", "auto"] | tuple[float, float, float], BeforeValidator(_start)
]


class SwitchedOff(Strict):
    """A source that is off from one arrival on, and perhaps on again from another."""

    source: Source
    from_s: Annotated[float, Field(ge=-4e9, le=4e9)]
    until_s: Annotated[float, Field(ge=-4e9, le=4e9)] | None = None


class RunConfig(Strict):
    """One run, from messages to a pose.

    Messages come from ``simulation``, or from ``log``: a log folder, or a dataset to convert.
    Paths are relative to the configuration's file. ``anchors`` says what is known of the ranges to
    an anchor, by name; ``all`` holds for those not named. With ``mcl`` scans tell of the pose, too;
    with ``cylinders`` what is round in them is a sighting of a landmark. A pose EKF that is lost
    looks for another place, or does as ``when_lost`` says.
    """

    name: str = "run"
    description: str = ""
    log: Origin | None = None
    simulation: Scenario | None = None
    start: Start = "truth"
    start_sigma: StartSigma = Field(default_factory=StartSigma)
    initializer: Initializer = Field(default_factory=Initializer)
    use: Annotated[list[Source], Field(min_length=1)] = Field(default_factory=lambda: list(SOURCES))
    anchors: dict[Name, RangeError] = Field(default_factory=dict)
    cylinders: Cylinders | None = None
    estimator: Estimator = Field(default_factory=Estimator)
    health: Health = Field(default_factory=Health)
    when_lost: Literal["restart", "go_on"] = "restart"
    mcl: Mcl | None = None
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    history_s: Annotated[float, Field(ge=0.0, le=1e9)] = 2.0
    history_messages: Annotated[int, Field(ge=512, le=1_000_000_000)] = 100_000
    delays_s: dict[Source, Annotated[float, Field(ge=0.0, le=3600.0)]] = Field(default_factory=dict)
    clock_jump: Literal["refuse", "reset", "continue"] = "refuse"
    switched_off: list[SwitchedOff] = Field(default_factory=list)
    ros: Ros = Field(default_factory=Ros)

    @model_validator(mode="after")
    def _one_origin(self) -> RunConfig:
        if self.log is not None and self.simulation is not None:
            raise ValueError("both log and simulation are given; expected one of them")
        return self

    @model_validator(mode="after")
    def _cylinders_are_used(self) -> RunConfig:
        if self.cylinders is not None and "landmark_sightings" not in self.use:
            raise ValueError(
                "cylinders are landmark_sightings, which use leaves out; add them to use, or "
                "remove cylinders"
            )
        if self.cylinders is not None and getattr(self.simulation, "landmark_sightings", None):
            raise ValueError(
                "both cylinders and simulation.landmark_sightings are given; expected one of them"
            )
        return self

    @model_validator(mode="after")
    def _poses_of_mcl_are_used(self) -> RunConfig:
        if self.mcl is not None and self.mcl.poses_hz is not None and "poses" not in self.use:
            raise ValueError(
                "mcl.poses_hz makes poses, which use leaves out; add 'poses' to use, or remove it"
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
    def _sigmas_to_fuse_with(self) -> RunConfig:
        for source in ("poses", "positions"):
            sensor = getattr(self.simulation, source, None)
            if sensor is None or source not in self.use:
                continue
            for key in ("sigma_xy_m", "sigma_heading_deg"):
                if getattr(sensor, key, 1.0) == 0.0:
                    raise ValueError(
                        f"simulation.{source}.{key} is 0, but what is fused needs a sigma > 0; "
                        f"set it, or leave {source!r} out of use"
                    )
        return self
