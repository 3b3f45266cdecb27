# SPDX-License-Identifier: Apache-2.0
"""MRPT office run: real UWB ranges, 2D laser scans, wheel odometry, grid map and reference."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import write_log
from locfuse.types import Columns, Log, LogError, wrap_angle
from papers.datasets.rawlog import read_gridmap, read_mrpt_office
from papers.datasets.source import check_map, copy_map, read_source, with_start

NAME = "uwb_ro-localization_demo"
TAG = "antenna"
BEAM_STEP_DEG = 0.5

MAP_YAML = """\
image: map.pgm
resolution: {resolution!r}
origin: [{origin[0]!r}, {origin[1]!r}, {origin[2]!r}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def convert(source: Path, out: Path) -> list[Path]:
    """Write the run as a log folder.

    Source: the MRPT project (J. L. Blanco and contributors), recorded in May 2007. Either MRPT's
    own files, as Debian's package mrpt-common has them in ``/usr/share/mrpt/datasets`` (343 frames,
    363 s, 112 m; ``uwb_ro-localization_demo.rawlog``, ``..._GT.txt``, ``..._map.gridmap.gz``), or
    the first 200 frames decoded to CSV: ``odometry.csv`` (frame, t, dx, dy, dphi), ``ranges.csv``
    (frame, t, beacon, range), ``scans.csv.gz`` (frame, t, r0...), ``groundtruth.csv`` (frame, t,
    x, y, phi), ``beacons.csv`` (beacon, x, y, z), ``map.pgm`` and ``map.yaml``.

    Licence: BSD-3-Clause.

    Quirks: ranges have no stamp of their own and take that of their frame's scan; a range of
    exactly 0 means no reply and is left out. Beacon 1 reads up to 13 m short for long stretches,
    never long. The reference, most likely found with the laser, begins at frame 1, odometry with a
    row of zeros at frame 0. Anchors and antenna are at different heights.
    """
    if (source / f"{NAME}.rawlog").is_file():
        log = read_mrpt_office(source)
        first_ns = int(log["scans"]["stamp_ns"][0])
        odometry = with_start(first_ns, log["odometry"])
        log = replace(log, tables={**log.tables, "odometry": odometry}, map="map.yaml")
        image, resolution, origin = read_gridmap(source / f"{NAME}_map.gridmap.gz")
        write_log(log, out)
        _write_map(out, image, resolution, origin)
        return [out]
    if not (source / "odometry.csv").is_file():
        raise LogError(f"{source}: holds neither {NAME}.rawlog nor odometry.csv")
    check_map(source)
    write_log(_read_csv(source), out)
    copy_map(source, out)
    return [out]


def _write_map(
    out: Path, image: NDArray[np.uint8], resolution: float, origin: tuple[float, float, float]
) -> None:
    rows, columns = image.shape
    (out / "map.pgm").write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + image.tobytes())
    text = MAP_YAML.format(resolution=resolution, origin=origin)
    (out / "map.yaml").write_text(text, encoding="utf-8", newline="\n")


def _read_csv(source: Path) -> Log:
    beacons = read_source(source / "beacons.csv", dict(beacon="t", x="f", y="f", z="f"))
    scans = read_source(source / "scans.csv.gz", dict(frame="f", t="s"), beams="r")
    half = np.deg2rad(BEAM_STEP_DEG) * (scans["beams"].shape[1] - 1) / 2
    tables: dict[str, Columns] = {
        "odometry": _odometry(source, int(scans["t"][0])),
        "ranges": _ranges(source),
        "scans": {"stamp_ns": scans["t"], "ranges_m": scans["beams"]},
        "truth": _truth(source),
        "anchors": {
            "anchor": beacons["beacon"],
            "x_m": beacons["x"],
            "y_m": beacons["y"],
            "z_m": beacons["z"],
        },
    }
    return Log(
        tables=tables,
        tags={TAG: (0.16, 0.0, 1.12)},
        laser={
            "pose_in_body": [0.095, 0.0, 0.0],
            "angle_min_rad": -float(half),
            "angle_increment_rad": float(np.deg2rad(BEAM_STEP_DEG)),
            "range_min_m": 0.0,
            "range_max_m": 80.0,
        },
        map="map.yaml",
        description="MRPT office run: UWB ranges, 2D laser scans, wheel odometry and reference",
        licence="BSD-3-Clause",
    )


def _odometry(source: Path, first_ns: int) -> Columns:
    moved = read_source(source / "odometry.csv", dict(frame="f", t="s", dx="f", dy="f", dphi="f"))
    return with_start(
        first_ns,
        {
            "stamp_ns": moved["t"],
            "dx_m": moved["dx"],
            "dy_m": moved["dy"],
            "dheading_rad": moved["dphi"],
        },
    )


def _ranges(source: Path) -> Columns:
    measured = read_source(source / "ranges.csv", dict(frame="f", t="s", beacon="t", range="f"))
    replied = measured["range"] != 0.0
    return {
        "stamp_ns": measured["t"][replied],
        "tag": np.full(int(replied.sum()), TAG),
        "anchor": measured["beacon"][replied],
        "range_m": measured["range"][replied],
    }


def _truth(source: Path) -> Columns:
    reference = read_source(
        source / "groundtruth.csv", dict(frame="f", t="s", x="f", y="f", phi="f")
    )
    return {
        "stamp_ns": reference["t"],
        "x_m": reference["x"],
        "y_m": reference["y"],
        "heading_rad": wrap_angle(reference["phi"]),
    }
