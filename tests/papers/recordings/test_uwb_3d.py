# SPDX-License-Identifier: Apache-2.0
"""Rows of localization in the air: recorded flights, and a flight whose ranges are exact."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse.types import FloatArray, Log, LogError
from papers.recorded import ready_run
from papers.recordings import uwb_3d
from papers.recordings.silence import DRIVES
from papers.scores import rms
from support_flights import flat, on_a_spiral
from support_runs import ROOT

CONFIGS = ROOT / "examples" / "configs"


def recorded(name: str) -> tuple[Log, float]:
    """Return a recording and how long its ranges read, or skip the test if it is absent."""
    try:
        log = uwb_3d.load_flight(CONFIGS, uwb_3d.RECORDINGS[name])
    except LogError as error:
        pytest.skip(str(error))
    return log, float(np.mean(uwb_3d.RECORDINGS[name].long))


def errors(log: Log, offset: float, gate: float = 0.999) -> tuple[FloatArray, FloatArray]:
    config = uwb_3d.filter_config()
    config.range.gate = gate
    return uwb_3d.errors_of(uwb_3d.localize(log, offset, config), log)


def test_exact_ranges_are_followed_and_wrong_ones_are_not() -> None:
    log = on_a_spiral()
    followed, _ = errors(log, 0.1)
    assert len(followed) == len(log["ranges"]["stamp_ns"]) - 3  # all, once each anchor has reported
    assert rms(followed) < 0.05
    assert rms(errors(log, 0.0)[0]) > 0.1
    assert rms(errors(flat(log), 0.1)[0]) > 0.5


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
    assert rms(error) < limit
    assert rms(errors(log, 0.0)[0]) > 1.5 * limit
    assert rms(errors(flat(log), offset)[0]) > 2.0 * limit
    assert rms(errors(log, offset, gate=1.0)[0]) > 1.5 * limit


def test_a_drone_is_followed_in_space_where_anchors_have_heights_of_their_own() -> None:
    log, offset = recorded("drone seq3")
    assert rms(errors(log, offset)[0]) < 0.4
    assert rms(errors(log, 0.0)[0]) > 0.8
    assert rms(errors(flat(log), offset)[0]) > 0.8


def test_anchors_of_one_height_determine_where_a_drone_is_but_not_on_which_side_of_them() -> None:
    log, offset = recorded("drone seq1")
    error, _ = errors(log, offset)
    assert rms(error[:, :2]) < 0.3
    assert rms(error[:, 2:]) > 1.0  # mirrored at the anchors' height, below the floor
    flight = uwb_3d.localize(log, offset, uwb_3d.filter_config())
    assert flight.position[:, 2].min() < -0.5


@pytest.mark.parametrize("configs", [None, "empty"])
def test_rows_of_absent_recordings_say_why(configs: str | None, tmp_path: Path) -> None:
    claims = uwb_3d.air_claims(lambda *_: None, tmp_path / "configs" if configs else None)
    assert len(claims) == len(uwb_3d.RECORDINGS) + len(DRIVES) + len(uwb_3d.READY)
    assert all(claim.met is None and claim.note for claim in claims)


def test_rows_of_present_recordings_are_numbers() -> None:
    recorded("drone seq3")
    recorded("rig s5")
    recorded("head")
    recorded("drone seq1")
    claims = uwb_3d.air_claims(lambda *_: None, CONFIGS)
    assert sum(claim.id.startswith("air_") for claim in claims) == 5 * len(uwb_3d.RECORDINGS)
    assert {"ready_air_ranges_nees_mean", "ready_rcv_drone_height_rmse_m"} <= {
        claim.id for claim in claims
    }
    assert all(claim.met and claim.ours_median is not None for claim in claims)


def test_the_sensor_of_the_head_gives_its_attitude() -> None:
    """With defaults; the reference jumps now and then, so medians are far below the RMS."""
    recorded("head")
    metrics = ready_run(CONFIGS, "inrol_head.yaml").metrics
    assert metrics["roll_rmse_deg"] < 2.0
    assert metrics["pitch_rmse_deg"] < 2.0
    assert metrics["heading_rmse_deg"] < 5.0
    assert metrics["nees_mean"] < 3.0
    assert metrics["position_rmse_m"] < 0.11
    assert set(metrics["counts"]["imu"]) == {"fused"}
