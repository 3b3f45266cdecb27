# SPDX-License-Identifier: Apache-2.0
"""Rows of localization in the air: recorded flights, and a flight whose ranges are exact."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse import in_the_air
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError
from support_runs import ROOT

CONFIGS = ROOT / "examples" / "configs"
TAG = np.array([0.2, -0.1, 0.3])


def recorded(name: str) -> tuple[Log, float]:
    """Return a recording and how long its ranges read, or skip the test if it is absent."""
    try:
        log = in_the_air.recorded(CONFIGS, name)
    except LogError as error:
        pytest.skip(str(error))
    return log, float(np.mean(in_the_air.RECORDINGS[name].long))


def errors(log: Log, offset: float, gate: float = 0.999) -> tuple[FloatArray, FloatArray]:
    config = in_the_air.filter_config()
    config.gate_range = gate
    return in_the_air.errors_of(in_the_air.localize(log, offset, config), log)


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


def test_exact_ranges_are_followed_and_wrong_ones_are_not() -> None:
    log = on_a_spiral()
    followed, _ = errors(log, 0.1)
    assert len(followed) == len(log["ranges"]["stamp_ns"]) - 3  # all, once each anchor was heard
    assert in_the_air.rms(followed) < 0.05
    assert in_the_air.rms(errors(log, 0.0)[0]) > 0.1
    assert in_the_air.rms(errors(flat(log), 0.1)[0]) > 0.5


def test_a_log_without_a_second_of_all_anchors_is_refused() -> None:
    log = on_a_spiral()
    kept = log["ranges"]["anchor"] != "C"
    ranges = {key: column[kept] for key, column in log["ranges"].items()}
    with pytest.raises(LogError, match="all anchors"):
        errors(replace(log, tables={**log.tables, "ranges": ranges}), 0.1)


@pytest.mark.parametrize(("name", "limit"), [("rig s1", 0.2), ("rig s5", 0.35)])
def test_a_rig_is_followed_in_space(name: str, limit: float) -> None:
    log, offset = recorded(name)
    error, _ = errors(log, offset)
    assert in_the_air.rms(error) < limit
    assert in_the_air.rms(errors(log, 0.0)[0]) > 1.5 * limit
    assert in_the_air.rms(errors(flat(log), offset)[0]) > 2.0 * limit
    assert in_the_air.rms(errors(log, offset, gate=1.0)[0]) > 1.5 * limit


def test_a_drone_is_followed_in_space_where_anchors_have_heights_of_their_own() -> None:
    log, offset = recorded("drone seq3")
    assert in_the_air.rms(errors(log, offset)[0]) < 0.4
    assert in_the_air.rms(errors(log, 0.0)[0]) > 0.8
    assert in_the_air.rms(errors(flat(log), offset)[0]) > 0.8


def test_anchors_of_one_height_tell_where_a_drone_is_but_not_on_which_side_of_them() -> None:
    log, offset = recorded("drone seq1")
    error, _ = errors(log, offset)
    assert in_the_air.rms(error[:, :2]) < 0.3
    assert in_the_air.rms(error[:, 2:]) > 1.0  # mirrored at the anchors' height, below the floor
    flight = in_the_air.localize(log, offset, in_the_air.filter_config())
    assert flight.position[:, 2].min() < -0.5


@pytest.mark.parametrize("configs", [None, "empty"])
def test_rows_of_absent_recordings_say_why(configs: str | None, tmp_path: Path) -> None:
    claims = in_the_air.air_claims(tmp_path / "configs" if configs else None, lambda *_: None)
    assert len(claims) == len(in_the_air.RECORDINGS)
    assert all(claim.met is None and claim.note for claim in claims)


def test_rows_of_present_recordings_are_numbers() -> None:
    recorded("drone seq3")
    recorded("rig s5")
    claims = in_the_air.air_claims(CONFIGS, lambda *_: None)
    assert len(claims) == 5 * len(in_the_air.RECORDINGS)
    assert all(claim.met and claim.ours_median is not None for claim in claims)
