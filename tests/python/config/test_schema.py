# SPDX-License-Identifier: Apache-2.0
"""The schema and the C++ structs say the same: fields, defaults, bounds."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from locfuse import _core
from locfuse.config import schema
from locfuse.config.base import Strict
from locfuse.config.build import (
    build_air_config,
    build_estimator_config,
    build_health_config,
    build_initializer_config,
    build_landmark_config,
    build_mcl_config,
    build_switching_config,
    build_tag_conditioner_config,
    build_triangle_config,
)
from locfuse.config.load import parse_config
from locfuse.config.schema import (
    BASIC,
    OF_MESSAGES,
    ROBOT,
    Adaptive,
    BeamModel,
    Calibration,
    Estimator,
    Heading,
    Health,
    Initializer,
    Landmark,
    LikelihoodField,
    Limits,
    Mcl,
    Odometry,
    Pose,
    Position,
    Range,
    RunConfig,
    ScanOdometry,
    Switch,
    TagConditioner,
)
from locfuse.types import ConfigError
from support_runs import ROOT, room

PAIRS: dict[str, tuple[type[Strict], type[Any], str]] = {
    "Estimator": (Estimator, _core.PoseEkfConfig, "estimators/pose_ekf.hpp"),
    "Health": (Health, _core.HealthConfig, "recovery/health.hpp"),
    "Initializer": (Initializer, _core.InitializerConfig, "recovery/initializer.hpp"),
    "Mcl": (Mcl, _core.MclConfig, "particles/mcl_config.hpp"),
    "Switch": (Switch, _core.SwitchingMclConfig, "particles/switching_mcl.hpp"),
    "TagConditioner": (TagConditioner, _core.TagConditionerConfig, "frontends/tag_conditioner.hpp"),
    "LikelihoodField": (
        LikelihoodField,
        _core.LikelihoodFieldConfig,
        "models/measurement/likelihood_field.hpp",
    ),
    "BeamModel": (BeamModel, _core.BeamModelConfig, "models/measurement/beam_model.hpp"),
    "Landmark": (Landmark, _core.RangeBearingConfig, "models/measurement/range_bearing.hpp"),
    "Calibration": (Calibration, _core.CalibrationConfig, "estimators/calibration.hpp"),
    "Odometry": (Odometry, _core.OdometryConfig, "models/motion/odometry.hpp"),
    "Range": (Range, _core.RangeConfig, "models/measurement/range.hpp"),
    "Position": (Position, _core.PositionConfig, "models/measurement/position.hpp"),
    "Pose": (Pose, _core.PoseConfig, "models/measurement/pose.hpp"),
    "Heading": (Heading, _core.HeadingConfig, "models/measurement/heading.hpp"),
    "Adaptive": (Adaptive, _core.AdaptiveNoiseConfig, "estimators/adaptive_noise.hpp"),
    "Limits": (Limits, _core.Limits, "messages/limits.hpp"),
}
OF_THE_RUN = {
    "Estimator": {"kind", "landmark_slam", "tag_triangle", "air"},
    "Mcl": {"poses_hz", "switch", "seed", "likelihood"},
}  # keys that say more, or other things, than the struct
BESIDE = {
    "Mcl": {"health", "watch_poses", *ROBOT},
    "Initializer": {"method", "estimator", "tag_conditioner", "watch_poses"},
}  # of the struct, set by other keys


def bound_fields(struct: type[Any]) -> set[str]:
    return {name for name in dir(struct) if isinstance(getattr(struct, name), property)}


def declared_fields(header: str, struct: str = "Config") -> set[str]:
    text = (ROOT / "cpp" / "include" / "locfuse" / header).read_text(encoding="utf-8")
    body = re.search(rf"^( *)struct {struct} \{{(.*?)\n\1\}};", text, re.DOTALL | re.MULTILINE)
    assert body is not None, f"{header} declares no {struct}"
    fields = body[2].partition(" static ")[0]  # named defaults may follow
    return set(re.findall(r"^\s*[\w:<>]+ (\w+)(?:\s=\s[^;]+|\{[^;]+\})?;", fields, re.MULTILINE))


def leaves(model: type[BaseModel], prefix: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    found = []
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            found += leaves(inner, (*prefix, name))
        else:
            found.append((*prefix, name))
    return found


def at(holder: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        holder = getattr(holder, name)
    return holder


BUILDERS: dict[str, Callable[[Any], Any]] = {
    "Estimator": build_estimator_config,
    "Health": build_health_config,
    "Initializer": build_initializer_config,
    "Mcl": lambda mcl: build_mcl_config(mcl, Estimator(), _core.MclConfig().seed),
    "Switch": build_switching_config,
    "TagConditioner": build_tag_conditioner_config,
}
LEAVES = [
    (root, *path)
    for root in BUILDERS
    for path in leaves(PAIRS[root][0])
    if path[0] not in OF_THE_RUN.get(root, ())
    and path[-1] not in OF_MESSAGES
    and not isinstance(at(PAIRS[root][0](), path), str | bool)
]


def nested(path: tuple[str, ...], value: Any) -> dict[str, Any]:
    for name in reversed(path):
        value = {name: value}
    return dict(value)


@pytest.mark.parametrize("name", PAIRS)
def test_schema_binding_and_header_have_the_same_fields(name: str) -> None:
    model, struct, header = PAIRS[name]

    ours = (OF_THE_RUN.get(name, set()) | set(OF_MESSAGES)) - bound_fields(struct)
    beside = BESIDE.get(name, set())
    bound = bound_fields(struct)
    keys = set(model.model_fields) - ours
    assert keys | set(model.fixed) == bound - beside, f"{name}: schema and binding"
    assert not keys & set(model.fixed)
    named = {"Limits": "Limits", "Mcl": "MclConfig"}
    declared = declared_fields(header, named.get(name, "Config"))
    assert declared == bound_fields(struct), f"{name}: header and binding differ"


@pytest.mark.parametrize("leaf", LEAVES, ids=".".join)
def test_every_default_is_that_of_the_struct(leaf: tuple[str, ...]) -> None:
    (model, struct, _), path = PAIRS[leaf[0]], leaf[1:]
    assert at(model(), path) == at(struct(), path)


@pytest.mark.parametrize("name", ["Odometry", "Range", "Position", "Pose"])
def test_a_model_of_its_own_has_the_defaults_it_has_inside_the_estimator(name: str) -> None:
    model, struct, _ = PAIRS[name]
    for field in set(model.model_fields) - {*OF_MESSAGES, "noise"}:
        assert getattr(model(), field) == getattr(struct(), field)
        assert getattr(getattr(_core.PoseEkfConfig(), name.lower()), field) == getattr(
            struct(), field
        )


def counts(leaf: tuple[str, ...]) -> bool:
    """Return whether a field holds whole numbers."""
    return isinstance(at(PAIRS[leaf[0]][1](), leaf[1:]), int)


ALLOWED = {
    ("Health", "risk"): 0.25,
    ("Mcl", "max_particles"): 700,
    ("Mcl", "kidnapping_probability"): 0.25,
    ("Mcl", "field", "sigma_hit_m"): 0.25,
    ("Estimator", "adaptive", "messages"): 12.5,
    ("Switch", "sigma_sure_m"): 0.4,
    ("Switch", "sigma_sure_rad"): 0.25,
    ("Switch", "uwb_sigma_m"): 0.125,
    ("Switch", "uwb_sigma_rad"): 0.125,
}


BIAS = ("calibration", "sigma_turn_bias_radps")
OFFSET = ("calibration", "sigma_anchor_offset_m")
NEEDS: dict[tuple[str, ...], tuple[str, ...]] = {
    ("Estimator", "calibration", "sigma_turn_bias_radps_per_sqrt_s"): BIAS,
    ("Estimator", "calibration", "anchor_offset_correlation_s"): OFFSET,
}


@pytest.mark.parametrize("leaf", LEAVES, ids=".".join)
def test_every_value_reaches_the_struct(leaf: tuple[str, ...]) -> None:
    (model, struct, _), path = PAIRS[leaf[0]], leaf[1:]
    value = ALLOWED.get(leaf, 7 if counts(leaf) else 0.625)
    text = nested(path, value)
    needed = NEEDS.get(leaf)
    if needed is not None:
        text[path[0]] |= nested(needed, 0.5)[path[0]]
    config = BUILDERS[leaf[0]](model.model_validate(text))

    assert at(config, path) == value
    others = [other for root, *other in LEAVES
              if root == leaf[0] and tuple(other) not in (path, needed)]  # fmt: skip
    assert all(at(config, tuple(other)) == at(struct(), tuple(other)) for other in others)


def schema_accepts(leaf: tuple[str, ...], value: float) -> bool:
    try:
        PAIRS[leaf[0]][0].model_validate(nested(leaf[1:], value))
    except ValidationError:
        return False
    return True


# Around the map a likelihood field reaches as far as max_range_m, in cells of the map.
COARSE = _core.OccupancyGrid(np.array([[0, 100]], np.int8), resolution=100.0)


def core_accepts(leaf: tuple[str, ...], value: float | _core.NoiseKind) -> bool:
    config = PAIRS[leaf[0]][1]()
    setattr(at(config, leaf[1:-1]), leaf[-1], value)
    try:
        if isinstance(config, _core.MclConfig):
            _core.Mcl(config, _core.World(grid=COARSE), 0)
        elif isinstance(config, _core.InitializerConfig):
            _core.Initializer(config, _core.World())
        elif isinstance(config, _core.TagConditionerConfig):
            _core.TagConditioner(config, [])
        elif isinstance(config, _core.HealthConfig):
            _core.Health(config)
        elif isinstance(config, _core.SwitchingMclConfig):
            uwb = _core.RecoveringEkf(_core.RecoveringEkfConfig(), _core.World())
            _core.SwitchingMcl(
                config, _core.Mcl(_core.MclConfig(), _core.World(grid=COARSE), 0), uwb
            )
        else:
            start = _core.PoseEstimate(0, _core.Pose2(), np.eye(3))
            _core.PoseEkf(config, _core.World(), start)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("leaf", LEAVES, ids=".".join)
def test_the_schema_refuses_what_the_core_refuses_and_nothing_else(leaf: tuple[str, ...]) -> None:
    values = [-math.inf, -1e9, -1.0, -1e-12, -0.0, 0.0, 1e-12, 0.25, 0.5,
              math.nextafter(0.5, 1.0), 1.0, math.nextafter(1.0, 2.0), 100.0,
              3600.0, 1e6, 1e12, math.inf, math.nan]  # fmt: skip
    if counts(leaf):
        values = [-1, 0, 1, 3, 4, 100, 3600, 3601, 5000, 10**9]
    schema = {value: schema_accepts(leaf, value) for value in values}
    core = {value: core_accepts(leaf, value) for value in values}

    assert schema == core
    assert any(schema.values())
    assert not all(schema.values())


def test_considering_reaches_the_struct() -> None:
    assert Calibration().consider is _core.CalibrationConfig().consider is False
    estimator = Estimator.model_validate({"calibration": {"consider": True}})
    assert build_estimator_config(estimator).calibration.consider is True


@pytest.mark.parametrize("kind", ["range", "position", "pose"])
def test_schema_and_core_name_the_same_noise(kind: str) -> None:
    path = (kind, "noise")
    assert at(Estimator(), path) == at(_core.PoseEkfConfig(), path).name.lower()
    for noise in _core.NoiseKind:
        leaf, name = ("Estimator", *path), noise.name.lower()
        accepted = not (noise is _core.NoiseKind.ONE_SIDED and kind != "range")
        assert core_accepts(leaf, noise) == accepted
        if not accepted:
            with pytest.raises(ValidationError, match="'gaussian', 'student_t' or 'cauchy'"):
                Estimator.model_validate(nested(path, name))
            continue
        built = build_estimator_config(Estimator.model_validate(nested(path, name)))
        assert at(built, path) is noise
    with pytest.raises(ValueError, match=rf"{kind}\.noise"):
        parse_config({"estimator": nested(path, "laplace")})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({"estimator": {"gate_range": 0.9}}, "write range.gate"),
        ({"estimator": {"robust_pose": "cauchy"}}, "write pose.noise"),
        ({"estimator": {"tag_triangle": {"gate_velocity": 0.9}}}, "write velocity.gate"),
        ({"estimator": {"air": {"gate_altitude": 0.9}}}, "write altitude.gate"),
        ({"delays_s": {"ranges": 0.1}}, "write latency_s of the sensor"),
    ],
)
def test_a_key_of_before_says_where_it_is_now(old: dict[str, Any], new: str) -> None:
    with pytest.raises(ValueError, match=f"is no key any more; {new}"):
        parse_config(old)


def test_keys_of_before_at_their_defaults_still_load() -> None:
    """As in capsules and dumps of older versions."""
    old = {"estimator": {"gate_range": 0.999, "robust_range": "gaussian"}, "delays_s": {}}
    assert parse_config(old) == parse_config({})


def test_ranges_without_any_noise_are_refused_by_both() -> None:
    with pytest.raises(ValidationError, match="both 0"):
        Range(sigma_m=0.0, sigma_relative=0.0)
    config = _core.RangeConfig()
    config.sigma_m = config.sigma_relative = 0.0
    with pytest.raises(ValueError, match="not both 0"):
        _core.RangeModel(config, _core.AnchorMap([]), [])


@pytest.mark.parametrize("scale", [-1.0, 0.0, math.nan, math.inf])
def test_a_scale_that_is_not_positive_is_refused_by_both(scale: float) -> None:
    with pytest.raises(ValidationError):
        RunConfig.model_validate({"anchors": {"all": {"scale": scale}}})
    with pytest.raises(ValueError, match="scale"):
        _core.AnchorMap([_core.Anchor(1, [0, 0, 0], scale=scale)])


def test_a_configuration_never_changes_once_made() -> None:
    config = room()
    with pytest.raises(ValidationError):
        config.history_s = 1.0
    with pytest.raises(ValidationError):
        config.estimator.range.sigma_m = 1.0


def test_particles_have_the_seed_of_the_run_unless_they_have_one_of_their_own() -> None:
    assert build_mcl_config(Mcl(), Estimator(), 5).seed == 5
    assert build_mcl_config(Mcl(seed=2**64 - 1), Estimator(), 5).seed == 2**64 - 1
    for wrong in (-1, 2**64):
        with pytest.raises(ValidationError):
            Mcl(seed=wrong)


@pytest.mark.parametrize(
    ("mcl", "said"),
    [
        ({"max_particels": 5}, "mcl: unknown key 'max_particels'; did you mean 'max_particles'"),
        ({"field": {"sigma_hitm": 0.1}}, "did you mean 'sigma_hit_m'"),
        ({"min_particles": 9000}, "expected min_particles <= max_particles"),
        ({"scouts": 3}, "mcl: scouts is 3, but is fixed at 64; remove it"),
        ({"refine_up_to": 9}, "mcl: refine_up_to is no key any more; write proposal: scan_match"),
        ({"proposal": "line"}, "mcl.proposal: did you mean 'line_ekf'? (got 'line')"),
        ({"sigma_widest_m": 0.01}, "expected field.sigma_hit_m <= sigma_widest_m"),
        ({"poses_hz": 0}, "poses_hz"),
        ({"switch": {"sigma_sure_m": 0.6}}, "expected sigma_sure_m <= sigma_unsure_m"),
        ({"switch": {"uwb_sigma_m": 0.4}}, "expected uwb_sigma_m <= sigma_sure_m: else UWB would"),
        ({"switch": {"uwb_sigma_rad": 0.3}}, "expected uwb_sigma_rad <= sigma_sure_rad"),
        ({"switch": {"share": 0}}, "share"),
        ({"switch": {}, "poses_hz": 2}, "both mcl.switch and mcl.poses_hz are given"),
    ],
)
def test_what_mcl_cannot_mean_is_one_sentence(mcl: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        parse_config({"mcl": mcl})


def test_a_constant_that_was_a_key_may_be_written_as_it_is() -> None:
    """As in capsules and dumps of older versions."""
    assert parse_config({"mcl": {"scouts": 64}}) == parse_config({"mcl": {}})


def test_a_switch_needs_something_to_switch_to() -> None:
    with pytest.raises(ValueError, match=r"mcl\.switch needs ranges or positions"):
        parse_config({"mcl": {"switch": {}}, "use": ["odometry", "poses"]})


def test_poses_of_mcl_must_be_used() -> None:
    with pytest.raises(ValueError, match="add 'poses' to use"):
        parse_config({"mcl": {"poses_hz": 2}, "use": ["odometry", "ranges"]})


@pytest.mark.parametrize(
    ("scene", "named"),
    [
        ({"duration_s": 1e9}, r"duration_s 1e\+09 and odometry.rate_hz 30 make 3e\+10 messages"),
        ({"duration_s": 10, "odometry": {"rate_hz": 1e6}}, r"odometry.rate_hz 1e\+06"),
        ({"duration_s": 1e5, "ranges": {"rate_hz": 50}}, "ranges.rate_hz 50"),
        (
            {"map": {}, "laser": {"beams": 100_000, "rate_hz": 50}},
            r"3e\+03 messages with 3e\+08 beams",
        ),
    ],
)
def test_a_drive_that_does_not_fit_into_memory_is_refused(
    scene: dict[str, Any], named: str
) -> None:
    with pytest.raises(ConfigError, match=named):
        parse_config({"simulation": scene})


# Kinds beside `pose`: each field of the struct, and the key of `estimator` that sets it.
SHARED = ("limits", "position")
KINDS: dict[str, tuple[type[Any], Callable[[Estimator], Any], dict[str, str]]] = {
    "landmark_slam": (_core.LandmarkEkfConfig, build_landmark_config, {
        "correlation_s": "correlation_s",
        **{name: name for name in (*SHARED, "odometry", "landmark", "hold_s",
                                   "sigma_lost_xy_per_sqrt_s", "sigma_lost_heading_per_sqrt_s")},
        **{name: f"landmark_slam.{name}" for name in ("gate_new", "min_sightings",
                                                      "max_landmarks")},
    }),
    "tag_triangle": (_core.TagTriangleEkfConfig, build_triangle_config, {
        **{name: name for name in (*SHARED, "range", "correlation_s")},
        **{name: f"tag_triangle.{name}" for name in ("velocity", "heading_is_known")},
        "motion": "tag_triangle.sigma_velocity_per_sqrt_s",
        "side": "tag_triangle.sigma_side_m",
        "sides_m": "",  # tags have their places from the log
        "holds_sides": "",  # always
    }),
    "air": (_core.AirEkfConfig, build_air_config, {
        **{name: name for name in Estimator.model_fields
           if name not in (*OF_THE_RUN["Estimator"], "calibration", "adaptive", "heading")},
        **{name: f"air.{name}" for name in ("motion", "constant_velocity", "min_height_m",
                                            "max_height_m", "sigma_height_per_sqrt_s")},
        "landmark_in_space": "air.sensor_up_m",
        "inertial": "",  # of the section imu
        "altitude": "air.altitude",
    }),
}  # fmt: skip
INSIDE = {
    ("tag_triangle", "motion"): "sigma_velocity_per_sqrt_s",
    ("tag_triangle", "side"): "sigma_m",
    ("air", "landmark_in_space"): "sensor_up_m",
}  # the field that the key sets
# Keys of a kind that are of the start, or of the run, or differ from the struct on purpose.
BESIDE_KIND = {"use_map", "start_height_m", "sigma_start_height_m", "shape",
               "sigma_elevation_rad"}  # fmt: skip
OTHER: dict[str, Any] = {
    "air.motion": "odometry", "constant_velocity": {"sigma_climb_per_sqrt_s": 0.625},
    "pose": {"gate": 0.625},
    "gate_new": 0.9995, "min_sightings": 7, "max_landmarks": 7,
    "heading_is_known": True, "limits": {"speed_mps": 3.0}, "position": {"sigma_m": 0.625},
    "odometry": {"sigma_xy_per_sqrt_s": 0.625}, "landmark": {"sigma_range_m": 0.625},
    "range": {"sigma_m": 0.625}, "altitude": {"sigma_m": 0.625},
    "velocity": {"sigma_point_mps": 0.625},
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_of_a_kind_has_its_key(kind: str) -> None:
    struct, build, keys = KINDS[kind]
    fixed = {*Estimator.fixed, *type(getattr(Estimator(), kind)).fixed}
    assert set(keys) == bound_fields(struct) - fixed - {"known"}  # landmarks are of the log
    ours = {key.removeprefix(f"{kind}.") for key in keys.values() if key.startswith(f"{kind}.")}
    assert ours == set(getattr(Estimator(), kind).model_dump()) - BESIDE_KIND
    built = build(Estimator(kind=kind))  # type: ignore[arg-type]
    other = (
        {"motion", "inertial"} if kind == "air" else {"holds_sides"}
    )  # see the test of the mount
    for name in set(keys) - other:
        mine, theirs = getattr(built, name), getattr(struct(), name)
        inside = bound_fields(type(theirs))
        assert mine == theirs or {n: getattr(mine, n) for n in inside} == {
            n: getattr(theirs, n) for n in inside
        }


@pytest.mark.parametrize(
    ("kind", "name"),
    [(kind, name) for kind in KINDS for name, key in KINDS[kind][2].items() if key],
)
def test_every_key_of_a_kind_reaches_its_struct(kind: str, name: str) -> None:
    _, build, keys = KINDS[kind]
    value = OTHER.get(f"{kind}.{name}", OTHER.get(name, 0.625))
    text = nested(tuple(keys[name].split(".")), value)
    built = getattr(build(Estimator.model_validate({"kind": kind, **text})), name)
    if isinstance(value, dict):
        (inner, expected), *_ = value.items()
        assert getattr(built, inner) == expected
    else:
        found = getattr(built, INSIDE[kind, name]) if (kind, name) in INSIDE else built
        assert (found.name.lower() if isinstance(value, str) else found) == value


@pytest.mark.parametrize(
    ("kind", "key"),
    [(kind, key) for kind, (_, _, keys) in KINDS.items() for key in keys.values()
     if key.startswith(f"{kind}.") and key != "tag_triangle.velocity"
     and key not in ("tag_triangle.heading_is_known", "air.motion", "air.constant_velocity",
                     "air.sensor_up_m")]
    + [("tag_triangle", f"tag_triangle.velocity.{name}") for name in
       ("sigma_forward_mps", "sigma_lateral_mps", "sigma_turn_rate_radps", "sigma_point_mps")],
)  # fmt: skip
def test_a_kind_refuses_in_the_schema_what_its_core_refuses(kind: str, key: str) -> None:
    start = _core.PoseEstimate(0, _core.Pose2(), np.eye(3))
    tags = [_core.Tag(k, at) for k, at in enumerate([[1, 0, 0], [0, 1, 0], [-1, 0, 0]])]

    def makes(estimator: Estimator) -> Any:
        config = KINDS[kind][1](estimator)
        if isinstance(config, _core.LandmarkEkfConfig):
            return _core.LandmarkEkf(config, _core.World(), start)
        if isinstance(config, _core.AirEkfConfig):
            there = _core.AirEstimate(0, _core.Pose2(), 0.0, np.eye(4))
            return _core.AirEkf(config, _core.World(), there)
        return _core.TagTriangleEkf(config, _core.World(tags=tags), start)

    refused = 0
    for value in (-1, 0, 1e-5, 1e-4, 0.5, 1, 2, 1e7, math.inf, math.nan):
        number = int(value) if value in (-1, 0, 1, 2) else value
        text = {"kind": kind, **nested(tuple(key.split(".")), number)}
        try:
            estimator = Estimator.model_validate(text)
        except ValidationError:
            refused += 1
            continue
        makes(estimator)  # what the schema allows the core allows
    assert refused


def test_at_most_fifteen_keys_are_for_everybody() -> None:
    assert len(set(BASIC)) == len(BASIC) <= 15
    everything = parse_config({"mcl": {}, "cylinders": {}, "scan_odometry": {}})
    assert all(at(everything, tuple(key.split("."))) != () for key in BASIC)  # each is a key


def test_wheels_and_sensors_are_described_once() -> None:
    wheels = {"sigma_heading_per_sqrt_m": 0.5}
    config = parse_config({"estimator": {"odometry": wheels, "hold_s": 2}, "mcl": {}})
    assert config.mcl is not None
    built = build_mcl_config(config.mcl, config.estimator, 1)
    assert built.odometry.sigma_heading_per_sqrt_m == 0.5
    assert built.hold_s == 2.0
    same = {"estimator": {"odometry": wheels}, "mcl": {"odometry": wheels}}  # as files had it
    assert parse_config(same) == parse_config({"estimator": {"odometry": wheels}, "mcl": {}})
    others: list[Any] = [{}, {"odometry": {}}, None]
    for estimator in others:
        with pytest.raises(ConfigError, match=r"mcl.odometry .* move it to estimator.odometry"):
            parse_config({"estimator": estimator, "mcl": {"odometry": wheels}})


def test_scan_odometry_has_the_default_of_the_struct() -> None:
    assert ScanOdometry().sigma_range_m == _core.LocalMapConfig().sigma_range_m
    with pytest.raises(ValueError, match="odometry, which use leaves out"):
        parse_config({"scan_odometry": {}, "use": ["ranges"]})


def test_class_variables_name_their_type_which_python_3_10_needs() -> None:
    text = Path(str(schema.__file__)).read_text(encoding="utf-8")
    assert "ClassVar[Any]" in text
    assert not re.search(r": ClassVar\b(?!\[)", text)
