# SPDX-License-Identifier: Apache-2.0
"""``log.yaml`` of a log folder: tags, laser, landmark sensor, map, description and licence."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from locfuse.config.safe_yaml import StrictYamlLoader
from locfuse.io.csv_table import read_bytes
from locfuse.io.whole import write_whole
from locfuse.types import YAML_ERRORS, LogError, nearest, shown, words

KEYS = ("tags", "laser", "lasers", "landmark_sensor", "map", "gps_origin", "description", "licence")
LASER_KEYS = ("pose_in_body", "angle_min_rad", "angle_increment_rad", "range_min_m", "range_max_m")
LANDMARK_SENSOR_KEYS = ("pose_in_body",)


class _Loader(StrictYamlLoader):
    """Safe YAML whose keys are texts as written (a tag may be called 2) and given once."""


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode):
            raise LogError(f"line {line}: a key must be a name")
        if key.value in found:
            raise LogError(f"line {line}: key {shown(key.value)} is given twice")
        found[key.value] = loader.construct_object(value, deep=True)
    return found


_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)


def read_log_yaml(path: Path) -> dict[str, Any]:
    """Read the settings that `Log` holds besides its tables, checked; absent keys are absent.

    Raises LogError if the file cannot be read or a key is unknown, given twice or of the wrong
    type.
    """
    found = load_yaml(path)
    return checked({} if found is None else found, str(path))


def load_yaml(path: Path) -> Any:
    """Return what a YAML file holds, its keys as texts.

    Raises LogError if the file cannot be read, is no YAML or gives a key twice.
    """
    data = read_bytes(path)
    try:
        return yaml.load(data, _Loader)
    except yaml.YAMLError as error:
        raise LogError(f"{path}: {words(error)}") from error
    except YAML_ERRORS as error:
        raise LogError(f"{path}, {error}") from error


def write_log_yaml(path: Path, settings: Mapping[str, Any]) -> None:
    """Write settings as `checked` returns them."""
    plain = {key: value for key, value in settings.items() if value}
    if "tags" in plain:
        plain["tags"] = {name: list(position) for name, position in plain["tags"].items()}
    if "gps_origin" in plain:
        plain["gps_origin"] = list(plain["gps_origin"])
    text = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, default_flow_style=None)
    write_whole(path, text)


def checked(settings: Any, where: str) -> dict[str, Any]:
    """Return settings with numbers as float and tags as tuples, or raise LogError."""
    _check_keys(settings, KEYS, where)
    values = dict(settings)
    for key in ("map", "description", "licence"):
        if key in values and not isinstance(values[key], str):
            raise LogError(f"{where}: {key} is {shown(values[key])}, expected text")
    if "tags" in values:
        values["tags"] = _tags(values["tags"], where)
    if "laser" in values:
        values["laser"] = _laser(values["laser"], f"{where}: laser")
    if "lasers" in values:
        values["lasers"] = _lasers(values, where)
    if "landmark_sensor" in values:
        values["landmark_sensor"] = _landmark_sensor(values["landmark_sensor"], where)
    if "gps_origin" in values:
        values["gps_origin"] = _gps_origin(values["gps_origin"], f"{where}: gps_origin")
    return values


def _check_keys(settings: Any, known: tuple[str, ...], where: str) -> None:
    if not isinstance(settings, Mapping):
        raise LogError(f"{where}: {shown(settings)}, expected keys {', '.join(known)}")
    for key in settings:
        if key not in known:
            raise LogError(f"{where}: unknown key {shown(key)}; {nearest(str(key), known)}")


def _tags(value: Any, where: str) -> dict[str, tuple[float, ...]]:
    if not isinstance(value, Mapping):
        raise LogError(f"{where}: tags is {shown(value)}, expected NAME: [x, y, z]")
    return {name: _triple(at, f"{where}: tags.{name}") for name, at in value.items()}


def _all_keys(value: Any, keys: tuple[str, ...], where: str) -> None:
    _check_keys(value, keys, where)
    for key in keys:
        if key not in value:
            raise LogError(f"{where}: {key} is missing")


def _landmark_sensor(value: Any, where: str) -> dict[str, Any]:
    where = f"{where}: landmark_sensor"
    _all_keys(value, LANDMARK_SENSOR_KEYS, where)
    return {"pose_in_body": list(_triple(value["pose_in_body"], f"{where}.pose_in_body"))}


def _lasers(values: Mapping[str, Any], where: str) -> dict[str, dict[str, Any]]:
    named = values["lasers"]
    if "laser" in values:
        raise LogError(f"{where}: both laser and lasers are given, expected one of them")
    if not isinstance(named, Mapping) or not named:
        raise LogError(f"{where}: lasers is {shown(named)}, expected NAME: {{pose_in_body: ...}}")
    return {name: _laser(laser, f"{where}: lasers.{name}") for name, laser in named.items()}


def _laser(value: Any, where: str) -> dict[str, Any]:
    optional = [key for key in ("time_increment_s",) if isinstance(value, Mapping) and key in value]
    _all_keys(value, (*LASER_KEYS, *optional), where)
    laser: dict[str, Any] = {
        "pose_in_body": list(_triple(value["pose_in_body"], f"{where}.pose_in_body"))
    }
    laser |= {key: number(value[key], f"{where}.{key}") for key in (*LASER_KEYS[1:], *optional)}
    if laser["angle_increment_rad"] == 0.0:
        raise LogError(f"{where}.angle_increment_rad is 0, expected another number")
    if not 0.0 <= laser["range_min_m"] < laser["range_max_m"]:
        found = f"{laser['range_min_m']:g} and {laser['range_max_m']:g}"
        raise LogError(f"{where}: range_min_m and range_max_m are {found}, expected 0 <= min < max")
    if laser.get("time_increment_s", 0.0) < 0.0:
        raise LogError(f"{where}.time_increment_s is negative, expected 0 or more")
    return laser


def _gps_origin(value: Any, where: str) -> tuple[float, ...]:
    latitude, longitude, heading = _triple(value, where)
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise LogError(f"{where} is {shown(value)}, expected [latitude, longitude, heading of the "
                       "x axis from east] in degrees")  # fmt: skip
    return latitude, longitude, heading


def _triple(value: Any, where: str) -> tuple[float, ...]:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise LogError(f"{where} is {shown(value)}, expected three numbers")
    return tuple(number(part, where) for part in value)


def number(value: Any, where: str) -> float:
    """Return a number from YAML, or raise LogError."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(value, int) and abs(value) > sys.float_info.max:  # there may be no text of it
        raise LogError(f"{where} is out of bounds, expected a finite number")
    if not is_number or not math.isfinite(value):
        raise LogError(f"{where} is {shown(value)}, expected a finite number")
    return float(value)
