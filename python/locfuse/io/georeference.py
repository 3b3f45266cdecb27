# SPDX-License-Identifier: Apache-2.0
"""Tables of a log whose places are latitudes and longitudes: in metres from the map's origin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.geodesy import Origin, distance, origin_at, to_degrees, to_plane
from locfuse.types import MAX_SPEED_MPS, NANOSECONDS, Columns, FloatArray, LogError

FAR_SIGMAS = 5.0  # beyond which two fixes do not agree
UNKNOWN_SIGMA_M = 10.0  # of a fix that brings none

# Of a fix by the quality of NMEA's GGA [m], where no sigma is given: of one receiver, with
# corrections, military, RTK with and without fixed ambiguities, by satellite. Others measure
# nothing: no fix, dead reckoning, typed in, simulated.
SIGMA_OF_QUALITY_M = {1: 3.0, 2: 1.0, 3: 3.0, 4: 0.02, 5: 0.3, 9: 1.0}
FARTHEST_M = 1e6  # from the origin of a plane that touches the Earth


def is_on_earth(table: Mapping[str, Any]) -> bool:
    """Return whether the places of a table are latitudes and longitudes."""
    return "latitude_deg" in table


def agree(distance_m: float, seconds: float, sigma_m: float) -> bool:
    """Return whether a vehicle can go from one fix to another, with sigmas of both together."""
    return distance_m <= MAX_SPEED_MPS * seconds + FAR_SIGMAS * sigma_m


def origin_sentence(origin: Origin) -> str:
    """Return where the map begins whose origin is a fix."""
    return (f"the map's origin is the first fix, at latitude {origin[0]!r} and longitude "
            f"{origin[1]!r}; ros.gps_origin says where it is")  # fmt: skip


def measured(fixes: Columns) -> Columns:
    """Return the fixes of a receiver that has one, each with a sigma [m]."""
    table = dict(fixes)
    good = (table["latitude_deg"] != 0.0) | (table["longitude_deg"] != 0.0)
    if "quality" in table:
        quality = table.pop("quality")
        good &= np.isin(quality, list(SIGMA_OF_QUALITY_M))
        sigma = np.array([SIGMA_OF_QUALITY_M.get(one, -1.0) for one in quality.tolist()])
        given = table.get("sigma_m")
        table["sigma_m"] = sigma if given is None else np.where(given > 0.0, given, sigma)
    return {name: column[good] for name, column in table.items()}


def origin_of(fixes: Columns) -> Origin | None:
    """Return the first fix that the next one agrees with, or the last; None without a fix."""
    rows = len(fixes["stamp_ns"])
    degrees = fixes["latitude_deg"].tolist(), fixes["longitude_deg"].tolist()
    sigma = np.where(fixes["sigma_m"] > 0.0, fixes["sigma_m"], UNKNOWN_SIGMA_M).tolist()
    for row in range(rows):
        origin = origin_at(degrees[0][row], degrees[1][row])
        if row + 1 == rows:
            return origin
        there = to_plane(degrees[0][row + 1], degrees[1][row + 1], 0.0, origin)
        seconds = int(fixes["stamp_ns"][row + 1] - fixes["stamp_ns"][row]) / NANOSECONDS
        if agree(math.hypot(*there), abs(seconds), math.hypot(sigma[row], sigma[row + 1])):
            return origin
    return None


def in_plane(table: Columns, origin: Origin, where: str, *, may_leap: bool = False) -> Columns:
    """Return a table with `x_m` and `y_m` in the map in place of latitude, longitude and altitude.

    Without the rows too far from the origin where a place `may_leap`, unless all are. Raises
    LogError, which begins with `where`, for any other place too far from it.
    """
    places = zip(table["latitude_deg"].tolist(), table["longitude_deg"].tolist(), strict=True)
    away = np.array([distance(*place, origin) for place in places])
    far = away > FARTHEST_M
    if may_leap and not far.all():
        table = {name: column[~far] for name, column in table.items()}
        far = far[~far]
    latitude, longitude = table["latitude_deg"], table["longitude_deg"]
    for row in np.flatnonzero(far)[:1]:
        raise LogError(f"{where}: latitude {latitude[row]:g}, longitude {longitude[row]:g} is "
                       f"{away[row] / 1000.0:.4g} km from the map's origin at {origin[0]:g}, "
                       f"{origin[1]:g}; gps_origin has to be near the drive")  # fmt: skip
    altitude = table.get("altitude_m", np.zeros(len(latitude)))
    points = zip(latitude.tolist(), longitude.tolist(), altitude.tolist(), strict=True)
    at = np.array([to_plane(*point, origin) for point in points]).reshape(-1, 2)
    found: dict[str, NDArray[Any]] = {}
    for name, column in table.items():
        if name == "latitude_deg":
            found["x_m"] = at[:, 0]
        elif name == "longitude_deg":
            found["y_m"] = at[:, 1]
        elif name != "altitude_m":
            found[name] = column
    return found


def on_earth(position: FloatArray, origin: Origin) -> dict[str, FloatArray]:
    """Return columns `latitude_deg` and `longitude_deg` of points of the map, shape (n, 2).

    On the ellipsoid, as of `to_degrees`; NaN where a point is farther than the Earth reaches.
    """
    degrees = np.full(position.shape, np.nan)
    for row, (x, y) in enumerate(position.tolist()):
        with suppress(ValueError):
            degrees[row] = to_degrees(x, y, origin)
    return {"latitude_deg": degrees[:, 0], "longitude_deg": degrees[:, 1]}
