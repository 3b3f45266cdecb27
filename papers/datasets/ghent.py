# SPDX-License-Identifier: Apache-2.0
"""Ghent University's industrial hall: a UWB tag at rest at seven sites, most anchors blocked."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import NANOSECONDS, Columns, Log, LogError, StampArray
from papers.datasets.source import read_source

TAG = "tag"


def convert(source: Path, out: Path) -> list[Path]:
    """Write each site of the tag as a log folder ``site_NUMBER`` below `out`.

    Source: selected columns of ``meta_IIoT_19.csv``, GitHub
    JaronFontaine/UWB-dataset-from-an-office-industrial-and-university-environment (IDLab, Ghent
    University and imec; J. Fontaine et al., IEEE Internet of Things Journal 2023, doi
    10.1109/JIOT.2023.3299319): ``ranges.csv.gz`` (tag_site, anchor, range, condition, rx_power,
    fp_power, noise_std), ``tag_sites.csv`` (tag_site, x, y, z), ``anchors.csv`` (anchor, x, y, z).

    Licence: none stated; published as open data sets, whose paper is to be cited.

    Quirks: the recording has no usable clock. The stamp of a range is its number among those of its
    site and anchor, in seconds: an epoch holds repeat k of every anchor that has so many. Truth is
    the site at every epoch. Anchors stand at 0.46 m to 2.9 m, the tag at 1.5 m. Seven ranges of ten
    have no line of sight and read up to 5 m long; the others read 0.07 m short. The published
    labels (LOS, NLOS) and powers have no place in a log.
    """
    measured = read_source(
        source / "ranges.csv.gz",
        dict(tag_site="t", anchor="t", range="f", condition="t", rx_power="f", fp_power="f",
             noise_std="f"),
    )  # fmt: skip
    sites = read_source(source / "tag_sites.csv", dict(tag_site="t", x="f", y="f", z="f"))
    anchors = read_source(source / "anchors.csv", dict(anchor="t", x="f", y="f", z="f"))
    logs: dict[str, Log] = {}
    for name, x, y, z in zip(*sites.values(), strict=True):
        rows = measured["tag_site"] == name
        if not rows.any():
            raise LogError(f"{source / 'ranges.csv.gz'}: no range from tag site {name}")
        ranges = _ranges({key: measured[key][rows] for key in ("anchor", "range")})
        logs[f"site_{name}"] = _log(str(name), (x, y, z), ranges, anchors)
    for folder, log in logs.items():
        write_log(log, out / folder)
    return [out / folder for folder in logs]


def _ranges(measured: Columns) -> Columns:
    """Return the ranges of a site, the k-th of every anchor at k seconds."""
    repeat: StampArray = np.zeros(len(measured["anchor"]), np.int64)
    for anchor in np.unique(measured["anchor"]):
        rows = measured["anchor"] == anchor
        repeat[rows] = np.arange(rows.sum())
    order = np.argsort(repeat, kind="stable")
    return {
        "stamp_ns": NANOSECONDS * repeat[order],
        "tag": np.full(len(order), TAG),
        "anchor": measured["anchor"][order],
        "range_m": measured["range"][order],
    }


def _log(name: str, at: tuple[float, float, float], ranges: Columns, anchors: Columns) -> Log:
    x, y, z = (float(part) for part in at)
    stamp_ns = np.unique(ranges["stamp_ns"])
    return Log(
        tables={
            "ranges": ranges,
            "truth": {
                "stamp_ns": stamp_ns,
                "x_m": np.full(len(stamp_ns), x),
                "y_m": np.full(len(stamp_ns), y),
            },
            "anchors": {
                "anchor": anchors["anchor"],
                "x_m": anchors["x"],
                "y_m": anchors["y"],
                "z_m": anchors["z"],
            },
        },
        tags={TAG: (0.0, 0.0, z)},
        description=f"Ghent industrial hall (IIoT 2019), tag at site {name}: UWB ranges at rest",
        licence="None stated, published as open data; to be cited: doi 10.1109/JIOT.2023.3299319",
    )
