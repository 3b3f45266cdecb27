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
    """Return latitude and longitude [deg] of a point of the map on the ellipsoid.

    Raises ValueError for a point farther than the Earth reaches.

    Examples
    --------
    >>> latitude, longitude = to_degrees(*to_plane(48.01, 8.42, 0.0, (48.0, 8.4, 30.0)),
    ...                                  (48.0, 8.4, 30.0))
    >>> round(latitude, 9), round(longitude, 9)
    (48.01, 8.42)
    """
    c, s = math.cos(math.radians(origin[2])), math.sin(math.radians(origin[2]))
    east, north = c * x - s * y, s * x + c * y
    phi, lam = math.radians(origin[0]), math.radians(origin[1])
    sin_phi, cos_phi, sin_lam, cos_lam = math.sin(phi), math.cos(phi), math.sin(lam), math.cos(lam)
    here = _centred(origin[0], origin[1], 0.0)
    level = (here[0] - sin_lam * east - sin_phi * cos_lam * north,
             here[1] + cos_lam * east - sin_phi * sin_lam * north,
             here[2] + cos_phi * north)  # fmt: skip
    up = cos_phi * cos_lam, cos_phi * sin_lam, sin_phi
    # Along the vertical of the origin to the ellipsoid p' W p = 1.
    weight = (1.0, 1.0, 1.0 / (1.0 - ECCENTRICITY_SQUARED))
    uu, up_p, pp = (sum(w * a * b for w, a, b in zip(weight, one, other, strict=True))
                    for one, other in ((up, up), (up, level), (level, level)))  # fmt: skip
    under = up_p**2 - uu * (pp - SEMI_MAJOR_M**2)
    if not under >= 0.0:
        raise ValueError(f"({x:g}, {y:g}) m is beyond the horizon of the map's origin")
    height = (math.sqrt(under) - up_p) / uu
    at = [p + height * u for p, u in zip(level, up, strict=True)]
    latitude = math.atan2(at[2] / (1.0 - ECCENTRICITY_SQUARED), math.hypot(at[0], at[1]))
    return math.degrees(latitude), math.degrees(math.atan2(at[1], at[0]))


def distance(latitude: float, longitude: float, origin: Origin) -> float:
    """Return how far a point of WGS 84 is from the origin of a map, in a straight line [m]."""
    return math.dist(_centred(latitude, longitude, 0.0), _centred(origin[0], origin[1], 0.0))


def origin_at(latitude: float, longitude: float) -> Origin:
    """Return the origin of a map whose x axis points east, its longitude from -180 to 180."""
    longitude = float(longitude)
    return float(latitude), math.remainder(longitude, 360.0), 0.0


def _centred(latitude: float, longitude: float, altitude: float) -> tuple[float, float, float]:
    """Return a point in the frame that is fixed to the Earth and centred in it, metres."""
    phi, lam = math.radians(latitude), math.radians(longitude)
    normal = SEMI_MAJOR_M / math.sqrt(1.0 - ECCENTRICITY_SQUARED * math.sin(phi) ** 2)
    level = (normal + altitude) * math.cos(phi)
    return (level * math.cos(lam), level * math.sin(lam),
            (normal * (1.0 - ECCENTRICITY_SQUARED) + altitude) * math.sin(phi))  # fmt: skip
