# SPDX-License-Identifier: Apache-2.0
"""Messages of other drivers in the shape of those that we read, by the names of their fields."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from types import SimpleNamespace as Shape
from typing import Any

import numpy as np

from locfuse.config.ros import Fields, Ros, column_of, plain, presets
from locfuse.io.log_folder import MAX_STAMP_NS
from locfuse.io.rosbag.decode import MessageError, stamp_ns
from locfuse.types import NANOSECONDS

# Our unit in each unit that the name of a column may end in.
UNITS = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "rad": 1.0, "deg": math.pi / 180.0, "s": 1.0,
         "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # fmt: skip
UNKNOWN_COVARIANCE = [0.0] * 36


NOTHING_PASSES = 20  # measurements, none of which passes the settings
Report = Callable[[MessageError], None]
WRONG = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)


class OtherMessages:
    """Reshapes messages of types that we do not know, by ``ros.fields`` or the preset of a type."""

    def __init__(self, ros: Ros) -> None:
        self._fields: dict[str, Fields] = dict(ros.fields.items())
        self._tag = ros.uwb_tag
        self._filtered: Counter[str] = Counter()  # by source, while nothing has passed

    def shaped(
        self, source: str, message: Any, type_name: str, received_ns: int, on_error: Report
    ) -> Any:
        """Return a message as one that `decode` reads; itself, where it already is one.

        Parameters
        ----------
        source : str
            Table that the message is for.
        type_name : str
            Of the message, as ``nlink_parser/LinktrackNodeframe2``.
        received_ns : int
            Its stamp, where it has none.
        on_error : callable
            Called with the error of a single measurement of several, which is left out.

        Returns
        -------
        object
            None where the settings leave out all that is in it.

        Raises
        ------
        MessageError
            If a field is not there, or holds something else.
        """
        fields = self._fields.get(source) or preset_of(source, type_name, message)
        if fields is None:
            return message
        try:
            return self._shaped(source, message, fields, received_ns, on_error)
        except MessageError:
            raise
        except WRONG as error:
            raise MessageError(f"it cannot be read by ros.fields.{source} ({error})") from None

    def _shaped(
        self, source: str, message: Any, fields: Fields, received_ns: int, on_error: Report
    ) -> Any:
        header, inner = _header(message, received_ns), message
        if fields.json_of is not None:
            text = _at(message, fields.json_of)
            try:
                inner = json.loads(text)
            except (TypeError, ValueError, RecursionError) as error:
                raise MessageError(f"{fields.json_of} holds no JSON ({error})") from None
        for column, path in fields.columns.items():
            if column_of(column)[0] == "stamp" and isinstance(path, str):
                header = _stamped(header, _stamp(inner, column, path))
        rows, errors, elements = [], [], _elements(inner, fields.each)
        for one in elements:
            try:
                row = _row(one, inner, fields, header)
            except MessageError as error:
                errors.append(error)
            else:
                rows += [row] if row is not None else []
        if errors and not rows:
            raise errors[0]
        for one_error in errors:
            on_error(one_error)
        if rows or self._filtered[source] < 0:
            self._filtered[source] = -1
        else:
            self._filtered[source] += len(elements)
        if not rows and fields.each is None:
            return None
        return SHAPES[source](rows, header, self._tag)

    def problems(self) -> list[str]:
        """Return a sentence for each source of which nothing passes the settings."""
        return [f"no measurement of {source} passes 'only' and 'reject_above' of its fields; see "
                "ros.fields" for source, count in self._filtered.items()
                if count >= NOTHING_PASSES]  # fmt: skip


def preset_of(source: str, type_name: str, message: Any) -> Fields | None:
    """Return how a message of a driver is read whose type is known, of several by its fields."""
    found = _presets_of(source, type_name)
    fits = (fields for fields in found if all(
        hasattr(message, path) for path in fields.columns.values()
        if fields.each is None and isinstance(path, str)))  # fmt: skip
    return next(fits, found[0]) if found else None


@cache  # asked for each message
def _presets_of(source: str, type_name: str) -> tuple[Fields, ...]:
    name = type_name.replace("/msg/", "/")
    return tuple(one.fields for one in presets().values()
                 if one.source == source and name in one.types)  # fmt: skip


def _at(message: Any, path: str) -> Any:
    """Return a field of a field of a message, of a mapping or of a sequence."""
    value = message
    for part in path.split("."):
        try:
            if isinstance(value, Mapping):
                value = value[part]
            elif part.isdigit():
                value = value[int(part)]
            else:
                value = getattr(value, part)
        except (KeyError, IndexError, AttributeError, TypeError):
            raise MessageError(f"the message has no field {path!r}") from None
    return value


def _elements(message: Any, each: str | None) -> list[Any]:
    if each is None:
        return [message]
    found = _at(message, each)
    if isinstance(found, Mapping):
        return [{"key": key, "value": value} for key, value in found.items()]
    if isinstance(found, str) or not hasattr(found, "__len__"):
        raise MessageError(f"{each} is no list")
    if all(one is None or isinstance(one, int | float | str | np.generic) for one in found):
        return [{"key": place, "value": value} for place, value in enumerate(found)]
    return list(found)


def _header(message: Any, received_ns: int) -> Shape:
    """Return stamp and frame of the message; without a stamp that of when it was received."""
    header = _get(message, "header")
    stamp = _get(message if header is None else header, "stamp")
    found = Shape(stamp=None, frame_id=plain(str(_get(header, "frame_id") or "")))
    known = stamp_ns(stamp) if _is_stamp(stamp) else 0
    return _stamped(found, known or received_ns)


def _get(holder: Any, name: str) -> Any:
    return holder.get(name) if isinstance(holder, Mapping) else getattr(holder, name, None)


def _is_stamp(given: Any) -> bool:
    return hasattr(given, "sec") or hasattr(given, "secs")


def _stamped(header: Shape, stamp: int) -> Shape:
    at = Shape(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)
    return Shape(stamp=at, frame_id=header.frame_id)


def _stamp(message: Any, column: str, path: str) -> int:
    given = _at(message, path.removeprefix("/"))
    if _is_stamp(given):
        return stamp_ns(given)
    seconds = _number(message, message, column, path)
    if not 0.0 < seconds < MAX_STAMP_NS / NANOSECONDS:
        raise MessageError(f"{path} is {seconds:g} s, which is no time")
    if isinstance(given, int | np.integer):  # exactly
        return int(given) * round(UNITS[column_of(column)[1]] * NANOSECONDS)
    return round(seconds * NANOSECONDS)


def _row(one: Any, message: Any, fields: Fields, header: Shape) -> dict[str, Any] | None:
    """Return the values of the columns; None of one that the settings leave out."""
    for field, wanted in fields.only.items():
        given = _value(one, message, field)
        if given != wanted and str(given) != str(wanted):
            return None
    if fields.quality is not None and fields.reject_above is not None:
        quality = _number(one, message, "quality", fields.quality)
        if fields.minus is not None:
            quality -= _number(one, message, "minus", fields.minus)
        if not quality <= fields.reject_above:
            return None
    row: dict[str, Any] = {"header": header}
    for column, path in fields.columns.items():
        name = column_of(column)[0]
        if name in ("anchor", "tag", "landmark"):
            given = _value(one, message, path)
            if given is None:
                raise MessageError(f"{path} holds nothing, expected the name of the {name}")
            row[name] = fields.names.get(str(given), str(given))
        elif name != "stamp":
            row[name] = _number(one, message, column, path)
    return row


def _value(one: Any, message: Any, path: str | float) -> Any:
    """Return what is at a path from an element or, behind a slash, from the whole message."""
    if not isinstance(path, str):
        return path
    return _at(message, path[1:]) if path.startswith("/") else _at(one, path)


def _number(one: Any, message: Any, column: str, path: str | float) -> float:
    negative = isinstance(path, str) and path.startswith("-")
    given = _value(one, message, path[1:] if negative and isinstance(path, str) else path)
    try:
        if isinstance(given, bool | np.bool_):
            raise TypeError
        value = float(given) * UNITS[column_of(column)[1]]
    except (TypeError, ValueError, OverflowError):
        raise MessageError(f"{path} holds {str(given)[:20]!r}, expected a number") from None
    return -value if negative else value


def _ranges(rows: list[dict[str, Any]], header: Shape, tag: str) -> Shape:
    """Return a UwbRanges; a range of 0 is one that failed."""
    good = [row for row in rows if row["range"] != 0.0]
    return Shape(header=header, ranges=[Shape(**{"tag": tag, "sigma": 0.0} | row) for row in good])


def _position(rows: list[dict[str, Any]], header: Shape, _: str) -> Shape:
    """Return a TagPosition."""
    row = {"tag": "", "sigma": -1.0, **_single(rows)}
    return Shape(header=header, tag=row["tag"], sigma=row["sigma"],
                 position=Shape(x=row["x"], y=row["y"], z=row.get("z", 0.0)))  # fmt: skip


def _pose(rows: list[dict[str, Any]], header: Shape, _: str) -> Shape:
    """Return a PoseWithCovarianceStamped."""
    row = _single(rows)
    covariance = list(UNKNOWN_COVARIANCE)
    sigma, of_heading = row.get("sigma_xy", 0.0), row.get("sigma_heading", 0.0)
    covariance[0] = covariance[7] = sigma * sigma
    covariance[35] = of_heading * of_heading
    if not math.isfinite(row["heading"]):
        raise MessageError(f"the heading is {row['heading']:g}, expected a finite number")
    half = 0.5 * row["heading"]
    at = Shape(position=Shape(x=row["x"], y=row["y"], z=row.get("z", 0.0)),
               orientation=Shape(x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)))  # fmt: skip
    return Shape(header=header, pose=Shape(pose=at, covariance=covariance))


def _sightings(rows: list[dict[str, Any]], header: Shape, _: str) -> Shape:
    """Return a LandmarkSightings, of ranges and bearings or of points in the sensor's frame."""
    found = []
    for row in rows:
        if "forward" in row:
            row["range"] = math.hypot(row["forward"], row["left"])
            row["bearing"] = math.atan2(row["left"], row["forward"])
        found.append(Shape(**{"landmark": "", "sigma_range": 0.0, "sigma_bearing": 0.0} | row))
    return Shape(header=header, sightings=found)


def _imu(rows: list[dict[str, Any]], header: Shape, _: str) -> Shape:
    """Return an Imu."""
    row = _single(rows)
    rate, force = (Shape(**{axis: row.get(f"{of}_{axis}", 0.0) for axis in "xyz"})
                   for of in ("rate", "force"))  # fmt: skip
    known = 0.0 if "force_z" in row else -1.0
    return Shape(header=header, angular_velocity=rate, linear_acceleration=force,
                 angular_velocity_covariance=[0.0] * 9,
                 linear_acceleration_covariance=[known] * 9)  # fmt: skip


def _single(rows: list[dict[str, Any]]) -> dict[str, Any]:
    if len(rows) != 1:
        raise MessageError(f"the message holds {len(rows)} of them, expected one")
    return rows[0]


SHAPES = {"ranges": _ranges, "positions": _position, "poses": _pose,
          "landmark_sightings": _sightings, "imu": _imu}  # fmt: skip
