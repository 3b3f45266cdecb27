# SPDX-License-Identifier: Apache-2.0
"""What a log holds that no message holds, as text on a topic of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import yaml

from locfuse.config.safe_yaml import StrictYamlLoader
from locfuse.io.log_folder import IN_MEMORY, MAX_STAMP_NS, MESSAGES, SCHEMA
from locfuse.io.log_yaml import checked
from locfuse.io.rosbag.decode import MessageError
from locfuse.types import YAML_ERRORS, Log, LogError, shown

TOPIC = "locfuse/log"
RELATIONS = "locfuse/relations"
FORMAT = 1


@dataclass(frozen=True)
class Settings:
    """What a bag that was written from a log says besides messages.

    Stamps of the bag are `shift_ns` later than those of the log: ROS has none before 1970, and
    takes 0 for none at all. `columns` are those of each table; `log` is what ``log.yaml`` holds.
    """

    shift_ns: int = 0
    columns: Mapping[str, list[str]] = field(default_factory=dict)
    log: Mapping[str, Any] = field(default_factory=dict)


def text_of(log: Log, shift_ns: int) -> str:
    """Return the text that `settings_of` reads."""
    given = {"tags": {name: list(at) for name, at in log.tags.items()}, "laser": log.laser,
            "lasers": dict(log.lasers), "landmark_sensor": log.landmark_sensor,
            "map": log.map if log.grid else None, "description": log.description,
            "licence": log.licence,
            "gps_origin": list(log.gps_origin) if log.gps_origin else None}  # fmt: skip
    data = {
        "format": FORMAT,
        "shift_ns": shift_ns,
        "columns": {stem: list(table) for stem, table in log.tables.items()},
        "log": {key: value for key, value in given.items() if value},
    }
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None)


def settings_of(text: str) -> Settings:
    """Read what `text_of` wrote.

    Raises MessageError if it is something else.
    """
    try:
        data = yaml.load(text, StrictYamlLoader)
        if data["format"] != FORMAT:
            raise MessageError(f"{TOPIC} has format {data['format']!r}, expected {FORMAT}")
        columns = {str(stem): [str(name) for name in names]
                   for stem, names in data["columns"].items() if stem in SCHEMA}  # fmt: skip
        for stem, names in columns.items():
            _check_columns(stem, names)
        shift_ns = int(data["shift_ns"])
        if not 0 <= shift_ns < MAX_STAMP_NS:
            raise MessageError(f"{TOPIC} has stamps that are {shift_ns} ns late, which is no time")
        return Settings(shift_ns, columns, checked(data["log"], TOPIC))
    except LogError as error:
        raise MessageError(str(error)) from None
    except (*YAML_ERRORS, yaml.YAMLError) as error:
        if isinstance(error, MessageError):
            raise
        raise MessageError(f"{TOPIC} holds something else ({error})") from None


def _check_columns(stem: str, names: list[str]) -> None:
    forms = [{IN_MEMORY.get(name, name) for name in form} for form in SCHEMA[stem]]
    if set(names) - ({"arrival_ns"} if stem in MESSAGES else set()) not in forms:
        raise MessageError(f"{TOPIC} has {stem} with the columns {shown(names)}, which no such "
                           "table has")  # fmt: skip
