# SPDX-License-Identifier: Apache-2.0
"""Latitudes and longitudes as metres in a plane that touches the Earth at the map's origin."""

from __future__ import annotations

import math
from typing import TypeAlias

# Latitude and longitude [deg] of the map's origin, and the angle [deg] from east,
# counter-clockwise, of its x axis.
Origin: TypeAlias = tuple[float, float, float]

# Of the ellipsoid of WGS 84.
SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)


def to_plane(
    latitude: float, longitude: float, altitude: float, origin: Origin
) -> tuple[float, float]:
    """Return x and y [m] in the map of a point of WGS 84.

    The plane touches the ellipsoid's normal direction at the origin, at the point's own altitude:
    so a distance on a hill is that on the hill, and heights of the two need not agree. `latitude`
    and `longitude` are in degrees, `altitude` in metres above the ellipsoid; `origin` is
    (latitude_deg, longitude_deg, heading_deg).

    Examples
    --------
    >>> x, y = to_plane(0.0, 1e-5, 0.0, (0.0, 0.0, 0.0))
    >>> round(x, 6), round(y, 6)
    (1.113195, 0.0)
    >>> x, y = to_plane(0.0, 1e-5, 0.0, (0.0, 0.0, 90.0))
    >>> round(x, 6), round(y, 6)
    (0.0, -1.113195)
    """
    there = _centred(latitude, longitude, altitude)
    here = _centred(origin[0], origin[1], altitude)
    dx, dy, dz = (a - b for a, b in zip(there, here, strict=True))
    phi, lam = math.radians(origin[0]), math.radians(origin[1])
    east = -math.sin(lam) * dx + math.cos(lam) * dy
    north = (-math.sin(phi) * (math.cos(lam) * dx + math.sin(lam) * dy)
             + math.cos(phi) * dz)  # fmt: skip
    c, s = math.cos(math.radians(origin[2])), math.sin(math.radians(origin[2]))
    return c * east + s * north, c * north - s * east


def to_degrees(x: float, y: float, origin: Origin) -> tuple[float, float]:
    """Return latitude and longitude [deg] of a point of the map, as `to_plane` takes them.

    Examples
    --------
    >>> latitude, longitude = to_degrees(*to_plane(48.01, 8.42, 0.0, (48.0, 8.4, 30.0)),
    ...                                  (48.0, 8.4, 30.0))
    >>> round(latitude, 9), round(longitude, 9)
    (48.01, 8.42)
    """
    c, s = math.cos(math.radians(origin[2])), math.sin(math.radians(origin[2]))
    east, north = c * x - s * y, s * x + c * y
    level = SEMI_MAJOR_M * max(math.cos(math.radians(origin[0])), 1e-6)
    latitude, longitude = origin[0], origin[1]
    for _ in range(8):  # Newton on a sphere
        there = to_plane(latitude, longitude, 0.0, (origin[0], origin[1], 0.0))
        longitude += math.degrees((east - there[0]) / level)
        latitude += math.degrees((north - there[1]) / SEMI_MAJOR_M)
    return latitude, longitude


def _centred(latitude: float, longitude: float, altitude: float) -> tuple[float, float, float]:
    """Return a point in the frame that is fixed to the Earth and centred in it, metres."""
    phi, lam = math.radians(latitude), math.radians(longitude)
    normal = SEMI_MAJOR_M / math.sqrt(1.0 - ECCENTRICITY_SQUARED * math.sin(phi) ** 2)
    level = (normal + altitude) * math.cos(phi)
    return (level * math.cos(lam), level * math.sin(lam),
            (normal * (1.0 - ECCENTRICITY_SQUARED) + altitude) * math.sin(phi))  # fmt: skip
