# SPDX-License-Identifier: Apache-2.0
"""The rows about starts: all met, and broken by what would be wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import locfuse as lf
from locfuse.config.load import load_config
from papers.claims import Claim, share
from papers.ekim2020 import draw_figures
from papers.ekim2020.claims import power_up_claims
from papers.ekim2020.experiments import bad_starts
from papers.ekim2020.methods import power_ups, rmse_over_bound
from papers.ekim2020.world import LAYOUTS, trials
from papers.ekim2020.world import recording as ready_recording
from papers.recordings.reference_alignment import registration
from support_runs import CONFIGS, DATA, recording


@pytest.fixture(scope="module")
def claims() -> dict[str, Claim]:
    return {claim.id: claim for claim in power_up_claims(CONFIGS)}


def test_every_requirement_is_met_or_the_recording_is_absent(claims: dict[str, Claim]) -> None:
    for claim in claims.values():
        assert claim.met or (claim.met is None and claim.note), claim
    if DATA.is_dir():
        assert all(claim.met for claim in claims.values())


def test_rows_of_every_layout_solver_and_recording_are_there(claims: dict[str, Claim]) -> None:
    for layout in ("2d_5", "2d_8", "3d_5", "3d_8"):
        for solver in ("ceres", "srwls", "srls"):
            assert f"start_{layout}_{solver}_bound" in claims
            assert f"start_{layout}_{solver}_nees" in claims
    assert {"start_wrong_side", "start_culprit", "start_false_alarms"} <= set(claims)


def test_without_the_ready_configurations_only_simulated_rows_are_left() -> None:
    assert len(power_up_claims(None)) == 4 * 6 + 3


def test_a_solver_with_a_wrong_sigma_fails_the_consistency() -> None:
    drawn = trials(LAYOUTS["2D, 5 anchors"], 0.1, 1, 2000)
    _, nees = rmse_over_bound(drawn, 0.1, "newton")
    _, bold = rmse_over_bound(drawn, 0.05, "newton")
    assert abs(nees.mean() - 2.0) < 0.2
    assert bold.mean() > 6.0


def test_noise_free_ranges_give_the_place_to_a_nanometre() -> None:
    for name, anchors in LAYOUTS.items():
        drawn = trials(anchors, 1e-12, 5, 500)
        for solver in ("newton", "ceres", "srls", "srwls"):
            found = lf.locate_batch(anchors, drawn.ranges, 0.1, solver=solver)
            error = np.linalg.norm(found.position - drawn.points, axis=1)
            assert error.max() < 1e-9, (name, solver)


def test_shares_carry_their_interval() -> None:
    row = share("id", "claim", 99, 100, 0.98)
    assert row.met
    assert row.ours_low is not None
    assert row.ours_high is not None
    assert row.ours_low < 99.0 <= row.ours_high
    assert not share("id", "claim", 97, 100, 0.98).met
    assert not share("id", "claim", 1, 100, 0.0, at_most=True).met


def test_the_gazebo_map_is_turned_in_its_world() -> None:
    recording("ieu-gazebo-uwb-lidar")
    _, log = ready_recording(CONFIGS, "ieu_gazebo.yaml", "run3")
    x, y, turn = registration(log)
    assert np.rad2deg(turn) == pytest.approx(1.27, abs=0.1)
    assert (x, y) == pytest.approx((0.035, 0.014), abs=0.005)


def test_a_laser_mounted_the_wrong_way_round_is_never_ready_and_right() -> None:
    recording("ieu-gazebo-uwb-lidar")
    config, log = ready_recording(CONFIGS, "ieu_gazebo.yaml", "static")
    assert log.laser is not None
    x, y, _ = log.laser["pose_in_body"]
    log.laser["pose_in_body"][:] = [x, y, np.pi / 2.0]
    found = power_ups(log, config, 0.3, 10.0)
    assert not found.fits.any()


def test_a_wrong_start_leads_odometry_astray_and_a_start_from_nothing_does_not() -> None:
    recording("ieu-gazebo-uwb-lidar")
    degrees, ends = bad_starts(CONFIGS)
    assert (np.diff(ends["odometry"]) > 0.0).all()
    assert ends["odometry"][degrees >= 10.0].min() > 0.5
    assert ends["filter"][degrees >= 45.0].min() > 1.0
    assert ends["auto"].max() < 0.03


def test_pictures_are_drawn(tmp_path: Path) -> None:
    names = {path.name for path in draw_figures(tmp_path, None)}
    assert names == {"room_paths.png", "start_bound.png", "start_ambiguous.png"}
    assert all((tmp_path / name).stat().st_size > 10_000 for name in names)


def test_the_ready_configurations_name_what_the_rows_run() -> None:
    for file in ("ieu_gazebo.yaml", "mrpt_office.yaml"):
        assert load_config(CONFIGS / file).log is not None
