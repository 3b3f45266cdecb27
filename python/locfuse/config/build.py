# SPDX-License-Identifier: Apache-2.0
"""From checked configuration to C++ objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel

from locfuse import _core
from locfuse.config.schema import (
    OF_MESSAGES,
    SENSORS,
    Cylinders,
    Estimator,
    Health,
    Imu,
    Initializer,
    Mcl,
    RangeError,
    RunConfig,
    Switch,
    TagConditioner,
)
from locfuse.types import Columns, ConfigError, nearest

_OTHER_KINDS = ("kind", "landmark_slam", "tag_triangle", "air")


def build_estimator_config(estimator: Estimator) -> _core.PoseEkfConfig:
    """Return the C++ struct of a pose EKF with every value of `estimator`."""
    config = _core.PoseEkfConfig()
    _fill(config, estimator, leave=_OTHER_KINDS)
    antenna = estimator.position  # whose courses are those of the same receiver
    config.heading.antenna_forward_m = antenna.antenna_forward_m
    config.heading.antenna_left_m = antenna.antenna_left_m
    return config


def build_landmark_config(estimator: Estimator) -> _core.LandmarkEkfConfig:
    """Return the C++ struct with every value of `estimator` that maps landmarks."""
    config = _core.LandmarkEkfConfig()
    _copy(config, estimator, ("correlation_s", "hold_s", "sigma_lost_xy_per_sqrt_s",
                              "sigma_lost_heading_per_sqrt_s"),
          ("odometry", "landmark", "position", "limits"))  # fmt: skip
    _fill(config, estimator.landmark_slam, leave=("use_map",))
    return config


def build_triangle_config(estimator: Estimator) -> _core.TagTriangleEkfConfig:
    """Return the C++ struct with every value of `estimator` for three tags."""
    config, triangle = _core.TagTriangleEkfConfig(), estimator.tag_triangle
    _copy(config, estimator, ("correlation_s",), ("range", "position", "limits"))
    _copy(config, triangle, ("heading_is_known",), ("velocity",))
    config.motion.sigma_velocity_per_sqrt_s = triangle.sigma_velocity_per_sqrt_s
    config.side.sigma_m = triangle.sigma_side_m
    config.holds_sides = True
    return config


def build_air_config(estimator: Estimator, imu: Imu | None = None) -> _core.AirEkfConfig:
    """Return the C++ struct with every value of `estimator` and `imu` for a body that flies."""
    config, air, imu = _core.AirEkfConfig(), estimator.air, imu or Imu()
    for name in ("sigma_turn_per_sqrt_s", "sigma_bias_radps", "sigma_velocity_per_sqrt_s",
                 "sigma_bias_mps2"):  # fmt: skip
        setattr(config.inertial, name, getattr(imu, name))
    config.inertial.mount = np.radians(imu.mount_deg)
    _fill(config, estimator, leave=(*_OTHER_KINDS, "calibration", "adaptive", "heading"))
    _fill(config, air, leave=("motion", "start_height_m", "sigma_start_height_m", "sensor_up_m",
                               "sigma_elevation_rad"))  # fmt: skip
    config.motion = _core.AirMotion[air.motion.upper()]
    config.landmark_in_space.sensor_up_m = air.sensor_up_m
    config.landmark_in_space.sigma_elevation_rad = air.sigma_elevation_rad
    return config


def build_initializer_config(
    initializer: Initializer, start: Any = "auto"
) -> _core.InitializerConfig:
    """Return the C++ struct with every value of `initializer`, for a ``start``."""
    config = _core.InitializerConfig()
    if start == "srls_headings":
        config.method = _core.StartMethod.SRLS_HEADINGS
    _fill(config, initializer)
    return config


def build_health_config(health: Health) -> _core.HealthConfig:
    """Return the C++ struct with every value of `health`."""
    config = _core.HealthConfig()
    _fill(config, health)
    return config


def build_mcl_config(
    mcl: Mcl, estimator: Estimator, seed: int, watch_poses: bool = False
) -> _core.MclConfig:
    """Return the C++ struct with every value of `mcl`, and the wheels and sensors of `estimator`.

    `seed` counts where `mcl` has none of its own.
    """
    config = _core.MclConfig()
    _fill(config, mcl, leave=("poses_hz", "seed", "likelihood", "switch"))
    _copy(config, estimator, ("hold_s",), SENSORS)
    if mcl.likelihood != "field":
        config.likelihood = _core.ScanLikelihood.BEAMS
    if mcl.likelihood == "zhang":
        config.beam_model = _core.BeamModelConfig.gaussian_and_no_return()
    config.seed = seed if mcl.seed is None else mcl.seed
    config.watch_poses = watch_poses
    return config


def build_switching_config(switch: Switch) -> _core.SwitchingMclConfig:
    """Return the C++ struct with every value of `switch`."""
    config = _core.SwitchingMclConfig()
    _fill(config, switch)
    return config


def build_start_config(config: RunConfig) -> _core.InitializerConfig:
    """Return a search for a start and its pose EKF, as a run configures them."""
    start = build_initializer_config(config.initializer, config.start)
    start.estimator = build_estimator_config(config.estimator)
    if config.mcl is not None:
        start.estimator.pose.shares_odometry = True
    start.tag_conditioner = build_tag_conditioner_config(config.tag_conditioner)
    start.watch_poses = config.watch_poses
    return start


def build_recovering_config(
    config: RunConfig, known: Sequence[_core.KnownLandmark] = ()
) -> _core.RecoveringEkfConfig:
    """Return a filter that starts by itself and reports when it is lost, as a run configures it.

    One that maps begins with `known` landmarks.
    """
    recovering = _core.RecoveringEkfConfig()
    if config.estimator.kind == "landmark_slam":
        tracker = build_landmark_config(config.estimator)
        tracker.known = list(known)
        recovering.tracker = tracker
    elif config.estimator.filter == "tag_triangle":
        recovering.tracker = build_triangle_config(config.estimator)
    elif config.estimator.kind == "air":
        recovering.tracker = build_air_config(config.estimator, config.imu)
        recovering.start_height = config.estimator.air.start_height_m
        recovering.sigma_start_height = config.estimator.air.sigma_start_height_m
    recovering.start = build_start_config(config)
    recovering.health = build_health_config(config.health)
    recovering.restart = config.when_lost == "restart"
    return recovering


def build_gyro_config(config: RunConfig) -> _core.GyroOdometryConfig:
    """Return the C++ struct with every value of ``imu``, and the wheels of ``estimator``."""
    gyro = _core.GyroOdometryConfig()
    _fill(gyro, config.imu, leave=("sigma_velocity_per_sqrt_s", "sigma_bias_mps2", "mount_deg"))
    _fill(gyro.odometry, config.estimator.odometry)
    return gyro


def build_tag_conditioner_config(
    conditioner: TagConditioner | None,
) -> _core.TagConditionerConfig | None:
    """Return the C++ struct with every value of `conditioner`; None of None."""
    if conditioner is None:
        return None
    config = _core.TagConditionerConfig()
    _fill(config, conditioner)
    return config


def build_cylinder_detector(cylinders: Cylinders) -> _core.CylinderDetector:
    """Return a detector with every value of `cylinders`."""
    method = _core.CylinderMethod[cylinders.method.upper()]
    settings = {**cylinders.model_dump(), "method": method}
    return _core.CylinderDetector(_core.CylinderDetectorConfig(**settings))


def _fill(struct: Any, model: BaseModel, leave: tuple[str, ...] = ()) -> None:
    for name in type(model).model_fields:
        if name in leave or name in OF_MESSAGES:
            continue
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            _fill(getattr(struct, name), value)
        elif isinstance(value, str):
            setattr(struct, name, type(getattr(struct, name))[value.upper()])
        else:
            setattr(struct, name, value)


def _copy(
    struct: Any, model: BaseModel, values: tuple[str, ...], sections: tuple[str, ...]
) -> None:
    for name in values:
        setattr(struct, name, getattr(model, name))
    for name in sections:
        _fill(getattr(struct, name), getattr(model, name))


def build_anchors(
    table: Columns | None, names: Sequence[str], errors: Mapping[str, RangeError]
) -> _core.AnchorMap:
    """Return the map of the anchors in a log.

    `names` is in order of id; `errors` is by anchor name, with ``all`` for those not named. No
    table means no anchors. Raises ConfigError where `errors` names an anchor that is not in the
    table.
    """
    known = [] if table is None else [str(name) for name in table["anchor"]]
    for name in errors:
        if name != "all" and name not in known:
            raise ConfigError(f"anchors: the log has no anchor {name!r}; {nearest(name, known)}")
    rest = errors.get("all", RangeError())
    ids = {name: index for index, name in enumerate(names)}
    anchors = []
    for row, name in enumerate(known):
        assert table is not None
        error = errors.get(name, rest)
        position = [float(table[axis][row]) for axis in ("x_m", "y_m", "z_m")]
        anchors.append(_core.Anchor(ids[name], position, error.offset_m, error.scale))
    return _core.AnchorMap(anchors)
