# SPDX-License-Identifier: Apache-2.0
"""What outliers cost: a spiral whose wrong ranges are known, and recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse import in_the_air, outliers
from locfuse.in_the_air import Recording
from locfuse.outliers import CASES, Case
from locfuse.types import NANOSECONDS, Log, LogError
from support_flights import on_a_spiral
from support_runs import CONFIGS

SPIRAL = Case(Recording("", "", "", (0.1, 0.1)))


def spoilt(log: Log, by_m: float, every: int = 9) -> tuple[Log, NDArray[np.bool_]]:
    """Return the log with ranges that read longer, one in so many, and which those are."""
    wrong = np.arange(len(log["ranges"]["stamp_ns"])) % every == every - 1
    ranges = {**log["ranges"], "range_m": log["ranges"]["range_m"] + by_m * wrong}
    return replace(log, tables={**log.tables, "ranges": ranges}), wrong


def ratio(case: Case, log: Log, gate: float = 0.999) -> float:
    """Return by how much outliers increase the RMSE."""
    config = in_the_air.filter_config()
    config.gate_range = gate
    pair = outliers.localize_twice(case, log, 0, config)
    whole, clean = (in_the_air.errors_of(f, log)[0] for f in (pair.whole, pair.clean))
    assert len(whole) == len(clean)
    return in_the_air.rms(whole) / in_the_air.rms(clean)


def recorded(name: str) -> Log:
    """Return the recording of a case, or skip the test if it is absent."""
    try:
        return in_the_air.recorded(CONFIGS, CASES[name].recording)
    except LogError as error:
        pytest.skip(str(error))


def test_the_error_of_a_range_is_that_to_its_tag_in_space() -> None:
    log, wrong = spoilt(on_a_spiral(), -1.25)
    assert outliers.range_errors(log) == pytest.approx(-1.25 * wrong, abs=1e-9)


def test_the_error_of_a_range_is_unknown_where_truth_is() -> None:
    log = on_a_spiral()
    truth = {key: column[100:] for key, column in log["truth"].items()}
    off = outliers.range_errors(replace(log, tables={**log.tables, "truth": truth}))
    assert np.isnan(off).tolist() == [row < 100 for row in range(len(off))]


def test_ranges_that_truth_calls_wrong_are_gated_or_never_heard() -> None:
    log, wrong = spoilt(on_a_spiral(), 3.0)
    pair = outliers.localize_twice(SPIRAL, log, 0, in_the_air.filter_config())
    heard = log["ranges"]["stamp_ns"] >= pair.whole.stamp_ns[0]
    assert pair.whole.gated.tolist() == (wrong & heard).tolist()
    assert not pair.clean.gated.any()
    assert pair.whole.stamp_ns.tolist() == pair.clean.stamp_ns.tolist()
    assert outliers.distances(pair.clean, log).max() < 0.2


def test_outliers_cost_nothing_behind_a_gate_and_much_without() -> None:
    log, _ = spoilt(on_a_spiral(), 3.0)
    assert ratio(SPIRAL, log) < 1.05
    assert ratio(SPIRAL, log, gate=1.0) > 3.0


def test_heights_are_those_of_truth_with_their_noise_or_the_ground() -> None:
    log = on_a_spiral()
    told = outliers.altimeter(log, 3)
    t = np.array([z.stamp for z in told]) / NANOSECONDS
    assert np.diff(t) == pytest.approx(0.2)
    off = np.array([z.height for z in told]) - (1.0 + 0.1 * t)
    assert np.std(off) == pytest.approx(outliers.ALTIMETER_SIGMA_M, rel=0.2)
    assert [z.height for z in told] == [z.height for z in outliers.altimeter(log, 3)]
    assert [z.height for z in told] != [z.height for z in outliers.altimeter(log, 4)]
    assert {z.height for z in outliers.on_the_ground(log, 0)} == {0.0}
    assert len(outliers.on_the_ground(log, 0)) == 30


@pytest.mark.parametrize(
    ("name", "without_gate"),
    [("rig s1", 2.0), ("rig s5", 2.5), ("yard los_a1", 5.0), ("yard nlos_a1", 5.0),
     ("yard los_b3", 5.0), ("yard nlos_b3", 5.0)],
)  # fmt: skip
def test_real_outliers_cost_a_tenth_at_most(name: str, without_gate: float) -> None:
    log = recorded(name)
    assert ratio(CASES[name], log) <= 1.1
    assert ratio(CASES[name], log, gate=1.0) > without_gate


@pytest.mark.parametrize("name", ["drone seq3", "drone seq5 with altimeter", "head"])
def test_small_outliers_cost_a_tenth_at_most(name: str) -> None:
    assert ratio(CASES[name], recorded(name)) <= 1.1


@pytest.mark.parametrize("configs", [None, "empty"])
def test_rows_of_absent_recordings_say_why(configs: str | None, tmp_path: Path) -> None:
    folder = tmp_path / "configs" if configs else None
    claims = outliers.outlier_claims(folder, 1, lambda *_: None)
    assert len(claims) == len(CASES)
    assert all(claim.met is None and claim.note for claim in claims)
    assert outliers.draw_pictures(tmp_path / "configs", tmp_path / "out") == []


def test_each_case_whose_recording_is_there_has_rows_and_a_picture(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    name = "drone seq3 with altimeter"
    recorded(name)
    monkeypatch.setattr(outliers, "CASES", {name: CASES[name]})
    claims = outliers.outlier_claims(CONFIGS, 2, lambda *_: None)
    figures = {claim.id.rsplit("_", 1)[1]: claim.ours_median or 0.0 for claim in claims}
    assert figures["ratio"] == pytest.approx(figures["rmse"] / figures["clean"], rel=0.02)
    (picture,) = outliers.draw_pictures(CONFIGS, tmp_path / "out")
    assert picture.name == "drone_seq3_with_altimeter.png"
    assert picture.stat().st_size > 10_000
