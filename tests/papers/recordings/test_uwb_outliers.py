# SPDX-License-Identifier: Apache-2.0
"""What outliers cost: a spiral whose wrong ranges are known, and recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse import _core
from locfuse.types import NANOSECONDS, Log, LogError
from papers.recordings import draw_outliers, uwb_3d
from papers.recordings import figures as drawn
from papers.recordings import uwb_outliers as outliers
from papers.recordings.uwb_3d import Recording
from papers.recordings.uwb_outliers import CASES, Case
from papers.scores import rms
from support_flights import on_a_spiral
from support_runs import CONFIGS

SPIRAL = Case(Recording("", "", "", (0.1, 0.1)))


def with_outliers(log: Log, by_m: float, every: int = 9) -> tuple[Log, NDArray[np.bool_]]:
    """Return the log with ranges that read longer, one in so many, and which those are."""
    wrong = np.arange(len(log["ranges"]["stamp_ns"])) % every == every - 1
    ranges = {**log["ranges"], "range_m": log["ranges"]["range_m"] + by_m * wrong}
    return replace(log, tables={**log.tables, "ranges": ranges}), wrong


def noisy(log: Log) -> Log:
    """Return the log with the noise that the filter expects."""
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(log["ranges"]["range_m"]))
    ranges = {**log["ranges"], "range_m": log["ranges"]["range_m"] + noise}
    return replace(log, tables={**log.tables, "ranges": ranges})


def ratio(case: Case, log: Log, config: _core.AirEkfConfig | None = None) -> float:
    """Return by how much outliers increase the RMSE."""
    flown = outliers.fly(case, log, 0, config or outliers.robust_config())
    whole, clean = (uwb_3d.errors_of(f, log)[0] for f in (flown.whole, flown.clean))
    assert len(whole) == len(clean)
    return rms(whole) / rms(clean)


def gullible() -> _core.AirEkfConfig:
    """Return settings that believe every range."""
    config = uwb_3d.filter_config()
    config.range.gate = 1.0
    return config


def recorded(name: str) -> Log:
    """Return the recording of a case, or skip the test if it is absent."""
    try:
        return uwb_3d.load_flight(CONFIGS, CASES[name].recording)
    except LogError as error:
        pytest.skip(str(error))


def test_the_error_of_a_range_is_that_to_its_tag_in_space() -> None:
    log, wrong = with_outliers(on_a_spiral(), -1.25)
    assert outliers.range_errors(log) == pytest.approx(-1.25 * wrong, abs=1e-9)


def test_the_error_of_a_range_is_unknown_where_truth_is() -> None:
    log = on_a_spiral()
    truth = {key: column[100:] for key, column in log["truth"].items()}
    off = outliers.range_errors(replace(log, tables={**log.tables, "truth": truth}))
    assert np.isnan(off).tolist() == [row < 100 for row in range(len(off))]


def test_ranges_that_truth_calls_wrong_are_gated_or_never_used() -> None:
    log, wrong = with_outliers(on_a_spiral(), 3.0)
    flown = outliers.fly(SPIRAL, log, 0, uwb_3d.filter_config())
    used = log["ranges"]["stamp_ns"] >= flown.whole.stamp_ns[0]
    assert flown.whole.gated.tolist() == (wrong & used).tolist()
    assert flown.gated.gated.tolist() == flown.whole.gated.tolist()
    assert not flown.clean.gated.any()
    assert flown.whole.stamp_ns.tolist() == flown.clean.stamp_ns.tolist()
    assert outliers.distances(flown.clean, log).max() < 0.2


def test_outliers_cost_little_and_who_believes_them_much() -> None:
    log, _ = with_outliers(noisy(on_a_spiral()), 3.0, every=29)
    assert ratio(SPIRAL, log, uwb_3d.filter_config()) < 1.05
    assert ratio(SPIRAL, log) < 1.1
    assert ratio(SPIRAL, log, gullible()) > 3.0


def test_heights_are_those_of_truth_with_their_noise_or_the_ground() -> None:
    log = on_a_spiral()
    heights = outliers.altimeter(log, 3)
    t = np.array([z.stamp for z in heights]) / NANOSECONDS
    assert np.diff(t) == pytest.approx(0.2)
    off = np.array([z.height for z in heights]) - (1.0 + 0.1 * t)
    assert np.std(off) == pytest.approx(outliers.ALTIMETER_SIGMA_M, rel=0.2)
    assert [z.height for z in heights] == [z.height for z in outliers.altimeter(log, 3)]
    assert [z.height for z in heights] != [z.height for z in outliers.altimeter(log, 4)]
    assert {z.height for z in outliers.ground_heights(log, 0)} == {0.0}
    assert len(outliers.ground_heights(log, 0)) == 30


@pytest.mark.parametrize(
    ("name", "believed"),
    [("rig s1", 2.0), ("rig s5", 2.5), ("yard los_a1", 5.0), ("yard nlos_a1", 5.0),
     ("yard los_b3", 5.0), ("yard nlos_b3", 5.0)],
)  # fmt: skip
def test_real_outliers_cost_a_tenth_at_most(name: str, believed: float) -> None:
    log = recorded(name)
    assert ratio(CASES[name], log) <= 1.1
    assert ratio(CASES[name], log, gullible()) > believed


@pytest.mark.parametrize("name", ["drone seq3", "drone seq5 with altimeter", "head"])
def test_small_outliers_cost_a_tenth_at_most(name: str) -> None:
    assert ratio(CASES[name], recorded(name)) <= 1.1


def test_a_range_that_passes_the_gate_shuts_out_good_ones_and_a_robust_filter_fuses_them() -> None:
    """One range 0.55 m short: two of four anchors were gated for 8 s, 2 m beside the truth."""
    name = "drone seq3 with altimeter"
    log = recorded(name)
    flown = outliers.fly(CASES[name], log, 0, outliers.robust_config())
    assert outliers.distances(flown.gated, log).max() > 2.0
    assert ratio(CASES[name], log, uwb_3d.filter_config()) > 2.0
    assert outliers.distances(flown.whole, log).max() < 0.8
    assert ratio(CASES[name], log) <= 1.1


@pytest.mark.parametrize("configs", [None, "empty"])
def test_rows_of_absent_recordings_say_why(configs: str | None, tmp_path: Path) -> None:
    folder = tmp_path / "configs" if configs else None
    claims = outliers.outlier_claims(1, lambda *_: None, folder)
    assert len(claims) == len(CASES) + 1  # and the office
    assert all(claim.met is None and claim.note for claim in claims)
    assert draw_outliers(tmp_path / "out", tmp_path / "configs") == []


def test_each_case_whose_recording_is_there_has_rows_and_a_picture(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    name = "drone seq3 with altimeter"
    recorded(name)
    for module in (outliers, drawn):
        monkeypatch.setattr(module, "CASES", {name: CASES[name]})
    claims = outliers.outlier_claims(2, lambda *_: None, CONFIGS)
    figures = {claim.id.rsplit("_", 1)[1]: claim.ours_median or 0.0 for claim in claims}
    assert figures["ratio"] == pytest.approx(figures["rmse"] / figures["clean"], rel=0.02)
    (picture,) = draw_outliers(tmp_path / "out", CONFIGS)
    assert picture.name == "drone_seq3_with_altimeter.png"
    assert picture.stat().st_size > 10_000
