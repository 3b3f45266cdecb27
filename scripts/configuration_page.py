# SPDX-License-Identifier: Apache-2.0
"""Write keys, defaults, units and meanings of the tables in docs/configuration.md from the schema.

Headings, prose and the column "allowed" are kept; a test compares it with the schema.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from locfuse.config import ros, scenario, schema
from locfuse.config.base import Strict, description, is_tag

CONFIGURATION = Path(__file__).parents[1] / "docs" / "configuration.md"
FIRST = "## First keys"
UNITS = {
    "_per_m": "1/m",
    "_per_sqrt_m": "/√m",
    "_per_sqrt_rad": "/√rad",
    "_per_sqrt_s": "/√s",
    "_mps": "m/s",
    "_radps": "rad/s",
    "_rad": "rad",
    "_deg": "deg",
    "_hz": "Hz",
    "_m": "m",
    "_s": "s",
}
SECTIONS: dict[str, type[Strict]] = {
    "## Top level": schema.RunConfig,
    "### `switched_off`": schema.SwitchedOff,
    "### `log` as a data set": schema.Dataset,
    "### `start_sigma`": schema.StartSigma,
    "### `initializer`": schema.Initializer,
    "### `health`": schema.Health,
    "### `anchors`": schema.RangeError,
    "## `cylinders`": schema.Cylinders,
    "## `scan_odometry`": schema.ScanOdometry,
    "## `imu`": schema.Imu,
    "## `tag_conditioner`": schema.TagConditioner,
    "## `estimator`": schema.Estimator,
    "### `estimator.landmark_slam`": schema.LandmarkSlam,
    "### `estimator.tag_triangle`": schema.TagTriangle,
    "### `estimator.tag_triangle.velocity`": schema.TagVelocity,
    "### `estimator.air`": schema.Air,
    "### `estimator.air.altitude`": schema.Altitude,
    "### `estimator.air.constant_velocity`": schema.ConstantVelocity,
    "### `estimator.odometry`": schema.Odometry,
    "### `estimator.range`": schema.Range,
    "### `estimator.position`": schema.Position,
    "### `estimator.landmark`": schema.Landmark,
    "### `estimator.calibration`": schema.Calibration,
    "### `estimator.pose`": schema.Pose,
    "### `estimator.heading`": schema.Heading,
    "### `estimator.limits`": schema.Limits,
    "### `estimator.adaptive`": schema.Adaptive,
    "## `mcl`": schema.Mcl,
    "### `mcl.switch`": schema.Switch,
    "### `mcl.field`": schema.LikelihoodField,
    "### `mcl.beam_model`": schema.BeamModel,
    "## `ros`": ros.Ros,
    "### `ros.topics`": ros.Topics,
    "### `ros.fields`": ros.Fields,
    "### `ros.frames`": ros.Frames,
    "## `simulation`": scenario.Scenario,
    "### `path`, shape `circle`": scenario.Circle,
    "### `path`, shape `eight`": scenario.Eight,
    "### `path`, shape `square`": scenario.Square,
    "### `path`, shape `star`": scenario.Star,
    "### `path`, shape `polygon`": scenario.Polygon,
    "### `path`, shape `waypoints`": scenario.Waypoints,
    "### `path`, shape `points`": scenario.Points,
    "### `path`, shape `roam`": scenario.Roam,
    "### `simulation.odometry`": scenario.OdometrySensor,
    "### `simulation.imu`": scenario.ImuSensor,
    "### `simulation.ranges`": scenario.RangeSensor,
    "### `simulation.poses`": scenario.PoseSensor,
    "### `simulation.positions`": scenario.PositionSensor,
    "### `simulation.landmark_sightings`": scenario.SightingSensor,
    "### `simulation.altitudes`": scenario.AltitudeSensor,
    "### `simulation.headings`": scenario.HeadingSensor,
    "### `simulation.flight`": scenario.Flight,
    "### `simulation.laser`": scenario.LaserSensor,
    "### `simulation.map`": scenario.RoomMap,
    "### Fault `nlos`": scenario.Nlos,
    "### Fault `bias`": scenario.Bias,
    "### Fault `wander`": scenario.Wander,
    "### Fault `outliers`": scenario.Outliers,
    "### Fault `dropouts`": scenario.Dropouts,
    "### Fault `latency`": scenario.Latency,
    "### Fault `wheel_slip`": scenario.WheelSlip,
    "### Fault `slip_episodes`": scenario.SlipEpisodes,
    "### Fault `kidnap`": scenario.Kidnap,
    "### Fault `glass`": scenario.Glass,
    "### Fault `people`": scenario.People,
    "### Fault `max_range`": scenario.MaxRange,
    "### Fault `covered`": scenario.Covered,
}


def configuration_page() -> str:
    """Return the page with its tables as the schema says."""
    lines = iter(CONFIGURATION.read_text("utf-8").splitlines())
    written: list[str] = []
    model, is_first = None, False
    for line in lines:
        written.append(line)
        if line.startswith("#"):
            model = SECTIONS.get(line)
            is_first = line == FIRST
        elif line.startswith("`log`") and is_first:
            del written[-1]
            written += textwrap.wrap(", ".join(f"`{path}`" for path in schema.BASIC) + ".", 128)
            while next(lines):
                pass
            written.append("")
        elif line.startswith("|---") and model is not None:
            written += _rows(model, lines)
    return "\n".join(written) + "\n"


def _meaning(model: type[Strict], key: str) -> str:
    """Return what a key means, and its unit where the key does not spell it."""
    text, unit = description(model, key)
    return text.removesuffix(".") + (f" [{unit}]" if unit and unit_of(key) is None else "")


def unit_of(key: str) -> str | None:
    """Return the unit that a key spells; None if it spells none."""
    if key.endswith("_radps_per_sqrt_s"):
        return "rad/s/√s"
    if key.endswith("_radps_per_sqrt_hz"):
        return "rad/s/√Hz"
    if key in ("sigma_velocity_per_sqrt_s", "sigma_climb_per_sqrt_s"):
        return "m/s/√s"
    ending = next((ending for ending in UNITS if key.endswith(ending)), None)
    if ending is None:
        return None
    angle = "rad" if "heading" in key or "turn" in key else "m"
    return (angle if "sqrt" in ending else "") + UNITS[ending]


def _default(field: FieldInfo) -> str:
    """Return the cell of a default: rounded to three digits, or where its own table is."""
    value = field.get_default(call_default_factory=True)
    if field.is_required() or value is None:
        return "required" if field.is_required() else "none"
    if isinstance(value, BaseModel):
        (heading,) = (h for h, model in SECTIONS.items() if model is type(value))
        anchor = re.sub(r"[^\w\s-]", "", heading.lstrip("# ").lower()).replace(" ", "-")
        return f"[below](#{anchor})"
    return f"`{_text(value)}`"


def _text(value: Any) -> str:
    """Return a value as YAML has it in one line."""
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, float):
        return f"{value:.6g}" if float(f"{value:.6g}") == value else f"{value:.3g}"
    return str(yaml.safe_dump(value, width=1000).removesuffix("\n...\n").strip())


def _rows(model: type[Strict], lines: Iterator[str]) -> Iterator[str]:
    """Yield a row per key, and the line after the table, which `lines` stand at."""
    line, old = next(lines, None), {}
    while line is not None and line.startswith("|"):
        key, _, allowed, _ = (cell.strip() for cell in line.strip("|").split("|"))
        old[key] = allowed
        line = next(lines, None)
    for key, field in model.model_fields.items():
        if not is_tag(model, key):  # which the heading names
            default, allowed = _default(field), old.get(f"`{key}`", "")
            yield f"| `{key}` | {default} | {allowed} | {_meaning(model, key)} |"
    if line is not None:
        yield line


if __name__ == "__main__":
    CONFIGURATION.write_text(configuration_page(), encoding="utf-8")
