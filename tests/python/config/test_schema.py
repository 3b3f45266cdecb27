# SPDX-License-Identifier: Apache-2.0
"""The schema and the C++ structs say the same: fields, defaults, bounds."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from locfuse import _core
from locfuse.config.build import build_estimator_config
from locfuse.config.schema import Estimator, Odometry, Position, Range, RunConfig
from support_runs import ROOT, room

PAIRS: dict[str, tuple[type[BaseModel], type[Any], str]] = {
    "Estimator": (Estimator, _core.PoseEkfConfig, "estimators/pose_ekf.hpp"),
    "Odometry": (Odometry, _core.OdometryConfig, "models/motion/odometry.hpp"),
    "Range": (Range, _core.RangeConfig, "models/measurement/range.hpp"),
    "Position": (Position, _core.PositionConfig, "models/measurement/position.hpp"),
}


def bound_fields(struct: type[Any]) -> set[str]:
    return {name for name in dir(struct) if isinstance(getattr(struct, name), property)}


def declared_fields(header: str) -> set[str]:
    text = (ROOT / "cpp" / "include" / "locfuse" / header).read_text(encoding="utf-8")
    body = re.search(r"struct Config \{(.*?)\n  \};", text, re.DOTALL)
    assert body is not None, f"{header} declares no Config"
    return set(re.findall(r"^\s*[\w:]+ (\w+)(?: = [^;]+)?;", body[1], re.MULTILINE))


def leaves(model: type[BaseModel], prefix: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    found = []
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            found += leaves(inner, (*prefix, name))
        else:
            found.append((*prefix, name))
    return found


LEAVES = leaves(Estimator)


def nested(path: tuple[str, ...], value: Any) -> dict[str, Any]:
    for name in reversed(path):
        value = {name: value}
    return dict(value)


def at(holder: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        holder = getattr(holder, name)
    return holder


@pytest.mark.parametrize("name", PAIRS)
def test_schema_binding_and_header_have_the_same_fields(name: str) -> None:
    model, struct, header = PAIRS[name]

    assert set(model.model_fields) == bound_fields(struct), f"{name}: schema and binding differ"
    assert declared_fields(header) == bound_fields(struct), f"{name}: header and binding differ"


@pytest.mark.parametrize("path", LEAVES, ids=".".join)
def test_every_default_is_that_of_the_struct(path: tuple[str, ...]) -> None:
    assert at(Estimator(), path) == at(_core.PoseEkfConfig(), path)


@pytest.mark.parametrize("name", ["Odometry", "Range", "Position"])
def test_a_model_of_its_own_has_the_defaults_it_has_inside_the_estimator(name: str) -> None:
    model, struct, _ = PAIRS[name]
    for field in model.model_fields:
        assert getattr(model(), field) == getattr(struct(), field)
        assert getattr(getattr(_core.PoseEkfConfig(), name.lower()), field) == getattr(
            struct(), field
        )


@pytest.mark.parametrize("path", LEAVES, ids=".".join)
def test_every_value_reaches_the_struct(path: tuple[str, ...]) -> None:
    config = build_estimator_config(Estimator.model_validate(nested(path, 0.625)))

    assert at(config, path) == 0.625
    others = [other for other in LEAVES if other != path]
    assert all(at(config, other) == at(_core.PoseEkfConfig(), other) for other in others)


def schema_accepts(path: tuple[str, ...], value: float) -> bool:
    try:
        Estimator.model_validate(nested(path, value))
    except ValidationError:
        return False
    return True


def core_accepts(path: tuple[str, ...], value: float) -> bool:
    config = _core.PoseEkfConfig()
    setattr(at(config, path[:-1]), path[-1], value)
    start = _core.PoseEstimate(0, _core.Pose2(), np.eye(3))
    try:
        _core.PoseEkf(config, _core.AnchorMap([]), [], start)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("path", LEAVES, ids=".".join)
def test_the_schema_refuses_what_the_core_refuses_and_nothing_else(path: tuple[str, ...]) -> None:
    values = [-math.inf, -1e9, -1.0, -1e-12, -0.0, 0.0, 1e-12, 0.5, 1.0, math.nextafter(1.0, 2.0),
              100.0, 1e6, 1e12, math.inf, math.nan]  # fmt: skip
    schema = {value: schema_accepts(path, value) for value in values}
    core = {value: core_accepts(path, value) for value in values}

    assert schema == core
    assert any(schema.values())
    assert not all(schema.values())


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
