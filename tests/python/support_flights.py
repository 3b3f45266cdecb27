# SPDX-License-Identifier: Apache-2.0
"""Flights by hand, for the tests of localization by ranges alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.types import NANOSECONDS, Log

TAG = np.array([0.2, -0.1, 0.3])


def flat(log: Log) -> Log:
    """Return the log with every anchor on the floor."""
    anchors = {**log["anchors"], "z_m": np.zeros(len(log["anchors"]["z_m"]))}
    return replace(log, tables={**log.tables, "anchors": anchors})


def on_a_spiral() -> Log:
    """Return half a minute of exact ranges from a tag that climbs around, 0.1 m long."""
    t = np.arange(0.0, 30.0, 0.05)
    place = np.column_stack([np.cos(0.5 * t), np.sin(0.5 * t), 1.0 + 0.1 * t])
    heading = np.full(len(t), 0.3)
    c, s = np.cos(0.3), np.sin(0.3)
    tag = place + [c * TAG[0] - s * TAG[1], s * TAG[0] + c * TAG[1], TAG[2]]
    corners = np.array([[-4.0, -4.0, 0.2], [4.0, -4.0, 4.0], [4.0, 4.0, 0.1], [-4.0, 4.0, 3.5]])
    names = np.array(["A", "B", "C", "D"])
    stamp_ns = np.round(t * NANOSECONDS).astype(np.int64)
    k = np.arange(len(t)) % 4  # one anchor after the other
    return Log(
        tables={
            "ranges": {
                "stamp_ns": stamp_ns,
                "tag": np.full(len(t), "tag"),
                "anchor": names[k],
                "range_m": np.linalg.norm(tag - corners[k], axis=1) + 0.1,
            },
            "truth": {
                "stamp_ns": stamp_ns,
                "x_m": place[:, 0],
                "y_m": place[:, 1],
                "z_m": place[:, 2],
                "heading_rad": heading,
            },
            "anchors": {
                "anchor": names,
                **{f"{axis}_m": corners[:, i] for i, axis in enumerate("xyz")},
            },
        },
        tags={"tag": tuple(TAG)},
    )
