# SPDX-License-Identifier: Apache-2.0
"""Point clouds as scans: what is nearest in each direction, of a slice of heights."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.config.ros import plain
from locfuse.io.rosbag import decode
from locfuse.io.rosbag.decode import MessageError, Mount, ScanRow
from locfuse.types import FloatArray

BEAMS = 1440  # of a full turn
REACH_M = 200.0  # no return is one that is farther
SAME_M = 0.1  # points that are so much farther than the nearest may be of the same surface
MAX_POINTS = 5_000_000
FLOATS = {7: "f4", 8: "f8"}  # datatypes of sensor_msgs/PointField
ABOVE_M, BELOW_M, BELOW_SHARE = 0.3, 0.1, 0.5  # of the sensor's height, the slice by default

Heights = tuple[float, float]


def is_cloud(message: Any) -> bool:
    """Return whether a message is a sensor_msgs/PointCloud2 rather than a scan."""
    return hasattr(message, "point_step")


def slice_of(sensor_m: float, heights: Heights | None) -> Heights:
    """Return the heights over the body's origin of which points count, metres.

    By default from half the height of the sensor up to 0.3 m above it, and at least from 0.1 m
    below it: what stands there stands in a map of walls, and the floor does not.

    Examples
    --------
    >>> slice_of(1.8, None), slice_of(1.8, (0.2, 0.4))
    ((0.9, 2.1), (0.2, 0.4))
    """
    if heights is not None:
        return heights
    below = max(BELOW_M, BELOW_SHARE * sensor_m)
    return sensor_m - below, sensor_m + ABOVE_M


def scan_of(message: Any, pose: FloatArray, heights: Heights | None) -> ScanRow:
    """Return a sensor_msgs/PointCloud2 as a turn of a laser at the sensor, upright, ahead 0.

    Points may be organised or not, dense or not, float32 or float64, in either order of bytes.

    Parameters
    ----------
    message : sensor_msgs/PointCloud2
    pose : float64 array, shape (4, 4)
        Of the cloud's frame in the body, metres.
    heights : (low, high), optional
        Over the body's origin, metres; default: `slice_of`.

    Returns
    -------
    ScanRow
        With `mount`, and 1440 beams, each the mean of the points that are at most 0.1 m behind the
        nearest of its quarter of a degree.

    Raises
    ------
    MessageError
        If it is no cloud of x, y and z, its stamp is 0, or no point of it is at these heights.
    """
    points = _points(message) @ pose[:3, :3].T
    low, high = slice_of(float(pose[2, 3]), heights)
    up = points[:, 2] + pose[2, 3]
    flat = points[(low <= up) & (up <= high), :2]
    if len(flat) == 0:
        span = f"{up.min():.3g} to {up.max():.3g}" if len(up) else "no height at all"
        raise MessageError(f"no point of the cloud is {low:.3g} to {high:.3g} m over the body's "
                           f"origin, its points are at {span}; ros.cloud_heights_m says which "
                           "count")  # fmt: skip
    reach = np.hypot(flat[:, 0], flat[:, 1])
    step = 2.0 * math.pi / BEAMS
    beam = np.floor((np.arctan2(flat[:, 1], flat[:, 0]) + math.pi) / step).astype(np.intp) % BEAMS
    ranges = _means_of_nearest(beam, reach)
    mount = Mount(float(pose[0, 3]), float(pose[1, 3]), float(pose[2, 3]), 0.0)
    stamp, frame = decode.stamped(message.header), plain(decode.frame_of(message))
    return ScanRow(stamp, frame, 0.5 * step - math.pi, step, 0.0, REACH_M, ranges, None,
                   mount=mount)  # fmt: skip


def _means_of_nearest(beam: NDArray[np.intp], reach: FloatArray) -> FloatArray:
    """Return the range of each beam, NaN where it has no point.

    Rings see the same wall, each with its own noise: the nearest alone would be too near.
    """
    nearest = np.full(BEAMS, np.nan)
    far_first = np.argsort(-reach, kind="stable")
    nearest[beam[far_first]] = reach[far_first]  # of several the last stays
    same = reach <= nearest[beam] + SAME_M
    total = np.bincount(beam[same], reach[same], BEAMS)
    count = np.bincount(beam[same], minlength=BEAMS)
    mean = np.full(BEAMS, np.nan)
    np.divide(total, count, out=mean, where=count > 0)
    return mean


@decode.is_message("sensor_msgs/PointCloud2")
def _points(message: Any) -> FloatArray:
    """Return the points of a cloud that are finite, (n, 3)."""
    height, width = int(message.height), int(message.width)
    if not 0 <= height * width <= MAX_POINTS:
        raise MessageError(f"a cloud of {height} x {width} points, expected at most {MAX_POINTS}")
    named = {str(field.name): field for field in message.fields}
    missing = [axis for axis in "xyz" if axis not in named]
    if missing:
        raise MessageError(f"the cloud has no {' and no '.join(missing)}; it has "
                           f"{', '.join(named) or 'no field'}")  # fmt: skip
    order = ">" if message.is_bigendian else "<"
    step, row = int(message.point_step), int(message.row_step)
    data = np.frombuffer(message.data, np.uint8)
    if height * width and not (width * step <= row and (height - 1) * row + width * step
                               <= len(data)):  # fmt: skip
        raise MessageError(f"the cloud has {len(data)} bytes for {height} rows of {width} points "
                           f"of {step} bytes")  # fmt: skip
    axes = []
    for axis in "xyz":
        field = named[axis]
        if int(field.datatype) not in FLOATS:
            raise MessageError(f"{axis} of the cloud has the datatype {field.datatype}, expected "
                               "float32 or float64")  # fmt: skip
        kind = np.dtype(order + FLOATS[int(field.datatype)])
        offset = int(field.offset)
        if not 0 <= offset <= step - kind.itemsize:
            raise MessageError(f"{axis} of the cloud is at byte {offset} of {step}")
        axes.append(_axis(data, kind, (height, width), offset, (row, step)))
    points = np.stack(axes, axis=-1)
    finite: FloatArray = points[np.isfinite(points).all(axis=1)]
    return finite


def _axis(
    data: NDArray[np.uint8],
    kind: np.dtype[Any],
    shape: tuple[int, int],
    offset: int,
    strides: tuple[int, int],
) -> FloatArray:
    if 0 in shape:
        return np.empty(0)
    view = np.ndarray(shape, kind, data, offset, strides)
    return view.astype(np.float64).ravel()
