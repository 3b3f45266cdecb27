# SPDX-License-Identifier: Apache-2.0
"""The comparison with the paper: its rows, its bound, and that a worse filter does not pass."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import locfuse.core as lf
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.run.messages import to_messages, truth_of
from locfuse.run.run import load_log, run
from locfuse.run.start import start_of
from locfuse.types import ConfigError, FloatArray
from papers.claims import Claim
from papers.ekim2020 import claims as module
from papers.ekim2020.methods import linearized_at_truth
from papers.ekim2020.world import PATHS, RECORDINGS, room_config
from papers.reproduce import reproduce
from support_runs import DATA, MRPT

ROW = {"id", "claim", "unit", "paper", "ours_median", "ours_low", "ours_high", "required", "met"}
SIMULATED = 4 * len(PATHS)


@pytest.fixture(autouse=True, scope="module")
def without_power_ups() -> Iterator[None]:
    """Leave out the rows about starts, which test_power_up_claims.py is about."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "power_up_claims", lambda configs: [])
        yield


@pytest.fixture(scope="module")
def claims(without_power_ups: None) -> list[Claim]:
    return reproduce("ekim2020", seeds=4)


def test_every_row_has_the_keys_of_the_comparison(claims: list[Claim]) -> None:
    rows = json.loads(json.dumps([claim.row() for claim in claims], allow_nan=False))
    assert all(set(row) >= ROW for row in rows)
    assert len({row["id"] for row in rows}) == len(rows) == SIMULATED + len(RECORDINGS)
    for row in rows:
        if row["met"] is not None:
            assert row["ours_low"] <= row["ours_high"]


def test_the_paper_is_met_on_every_path(claims: list[Claim]) -> None:
    by_id = {claim.id: claim for claim in claims}
    for path in PATHS:
        rmse, gain, bound, nees = (
            by_id[f"room_{path}_{what}"] for what in ("rmse", "gain", "bound", "nees")
        )
        assert (rmse.paper, rmse.unit, rmse.required) == (3.0, "cm", "<= 2.6")
        assert (gain.paper, gain.required) == (2.0, ">= 2.3")
        assert bound.required == "<= 1.05"
        for claim in (rmse, bound, nees):
            assert claim.met, claim
        assert rmse.ours_median is not None
        assert 1.0 < rmse.ours_median <= 2.6
        assert bound.ours_median == pytest.approx(1.0, abs=0.05)


def test_recordings_meet_their_limits_or_say_why_they_were_skipped(claims: list[Claim]) -> None:
    for claim in claims[SIMULATED:]:
        if claim.met is None:
            assert claim.note
            assert claim.ours_median is None
        else:
            assert claim.met, claim
    if DATA.is_dir() and (MRPT / "uwb_ro-localization_demo.rawlog").is_file():
        assert all(claim.met for claim in claims[SIMULATED:])


def test_absent_recordings_are_skipped_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def moved(path: Any) -> RunConfig:
        config = original(path)
        log = config.log
        if log is None or isinstance(log, str):
            return config
        return config.model_copy(update={"log": log.model_copy(update={"path": "nowhere"})})

    original = load_config
    monkeypatch.setattr("papers.ekim2020.world.load_config", moved)
    monkeypatch.setattr(module, "PATHS", ("eight",))
    skipped = reproduce("ekim2020", seeds=2)[4:]
    assert len(skipped) == len(RECORDINGS)
    for claim in skipped:
        assert claim.met is None
        assert "nowhere" in claim.note


def test_progress_is_reported_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATHS", ("eight", "star"))
    steps: list[tuple[int, int]] = []
    reproduce("ekim2020", 2, lambda done, total: steps.append((done, total)))
    total = 2 * 2 + len(RECORDINGS) + 1  # all rows about starts are one
    assert steps == [(done, total) for done in range(1, total + 1)]


def test_an_unknown_paper_is_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigError, match="did you mean 'ekim2020'"):
        reproduce("ekim2002", seeds=2)


def changed_filter(**sections: dict[str, float]) -> Callable[..., RunConfig]:
    def make(path: str, duration_s: float = 120.0) -> RunConfig:
        config = room_config(path, duration_s)
        estimator = config.estimator.model_copy(
            update={
                name: getattr(config.estimator, name).model_copy(update=values)
                for name, values in sections.items()
            }
        )
        return config.model_copy(update={"estimator": estimator})

    return make


@pytest.mark.parametrize(
    ("make", "broken"),
    [
        (changed_filter(range={"sigma_relative": 0.0015}), "rmse"),
        (changed_filter(range={"sigma_relative": 0.003}), "nees"),
        (changed_filter(odometry={"sigma_longitudinal_per_sqrt_m": 3.0,
                                  "sigma_lateral_per_sqrt_m": 3.0}), "rmse"),
    ],
    ids=["range noise / 10", "range noise / 5", "odometry noise x 100"],
)  # fmt: skip
def test_a_filter_that_is_wrong_about_its_noise_breaks_the_claims(
    monkeypatch: pytest.MonkeyPatch, make: Callable[..., RunConfig], broken: str
) -> None:
    monkeypatch.setattr(module, "room_config", make)
    monkeypatch.setattr(module, "PATHS", ("eight",))
    by_id = {claim.id: claim for claim in reproduce("ekim2020", seeds=4)}
    assert by_id[f"room_eight_{broken}"].met is False


def test_a_biased_sensor_breaks_the_claims(monkeypatch: pytest.MonkeyPatch) -> None:
    def biased(path: str, duration_s: float = 120.0) -> RunConfig:
        data = room_config(path, duration_s).model_dump(mode="json")
        data["simulation"]["faults"] = [{"kind": "bias", "offset_m": 0.3, "anchor": "A1"}]
        return parse_config(data)

    monkeypatch.setattr(module, "room_config", biased)
    monkeypatch.setattr(module, "PATHS", ("eight",))
    by_id = {claim.id: claim for claim in reproduce("ekim2020", seeds=4)}
    for what in ("rmse", "gain", "nees"):
        assert by_id[f"room_eight_{what}"].met is False, what


# The bound ------------------------------------------------------------------------------------


def straight_kalman(log: Any, start: lf.PoseEstimate, config: RunConfig) -> FloatArray:
    """Return position errors of a Kalman filter for a robot that drives with poses, written out.

    The mean is that of the nonlinear prediction by differences in the truth's frame: with poses
    only, H is the identity and F depends on the true heading and true motion alone.
    """
    truth, odometry, poses = log["truth"], log["odometry"], log["poses"]
    rows = {int(stamp): row for row, stamp in enumerate(poses["stamp_ns"])}
    at = np.column_stack([truth["x_m"], truth["y_m"], truth["heading_rad"]])
    e = np.array([start.pose.x, start.pose.y, start.pose.heading]) - at[0]
    P = start.covariance.copy()
    noise = config.estimator.odometry
    errors = []
    for k, stamp in enumerate(odometry["stamp_ns"]):
        if k > 0:
            c, s = np.cos(at[k - 1, 2]), np.sin(at[k - 1, 2])
            turn = np.array([[c, -s], [s, c]])
            step = at[k, :2] - at[k - 1, :2]
            measured = turn @ [odometry["dx_m"][k], odometry["dy_m"][k]]
            spun = lf.wrap_angle(odometry["dheading_rad"][k] - (at[k, 2] - at[k - 1, 2]))
            F = np.array([[1.0, 0.0, -step[1]], [0.0, 1.0, step[0]], [0.0, 0.0, 1.0]])
            length = float(np.hypot(*step))
            Q = np.zeros((3, 3))
            Q[:2, :2] = turn @ np.diag([
                noise.sigma_longitudinal_per_sqrt_m**2 * length,
                noise.sigma_lateral_per_sqrt_m**2 * length,
            ]) @ turn.T  # fmt: skip
            turned = abs(lf.wrap_angle(at[k, 2] - at[k - 1, 2]))
            Q[2, 2] = (noise.sigma_heading_per_sqrt_m**2 * length
                       + noise.sigma_heading_per_sqrt_rad**2 * turned)  # fmt: skip
            e = F @ e + np.array([*(measured - step), spun])
            P = F @ P @ F.T + Q
        if int(stamp) in rows:
            row = rows[int(stamp)]
            seen = np.array([poses["x_m"][row], poses["y_m"][row], poses["heading_rad"][row]])
            residual = seen - at[k]
            residual[2] = lf.wrap_angle(residual[2])
            sigma = np.array([poses["sigma_xy_m"][row]] * 2 + [poses["sigma_heading_rad"][row]])
            K = P @ np.linalg.inv(P + np.diag(sigma**2))
            e, P = e + K @ (residual - e), (np.eye(3) - K) @ P
        errors.append(e[:2])
    return np.array(errors)


def test_the_bound_is_the_kalman_filter_written_out_by_hand() -> None:
    config = room_config("waypoints", 20.0)
    log = load_log(config, None, 3)
    silent = {name: values[:0] for name, values in log["ranges"].items()}
    log = type(log)(tables={**log.tables, "ranges": silent}, tags=log.tags)
    start = start_of(config, truth_of(log), to_messages(log, config))

    bound, by_hand = linearized_at_truth(config, log, start), straight_kalman(log, start, config)

    assert bound.shape == by_hand.shape
    np.testing.assert_allclose(bound, by_hand, rtol=0.0, atol=2e-4)
    assert np.abs(bound).max() > 0.02, "errors of zero would agree with anything"


def test_the_bound_is_the_filter_itself_where_both_linearize_at_almost_the_truth() -> None:
    config = room_config("circle", 20.0)
    assert config.simulation is not None
    data = config.model_dump(mode="json")
    small = 1e-3  # of every sigma: the estimate is so close that its Jacobians are the truth's
    for sensor, keys in {
        "odometry": ("sigma_longitudinal_per_sqrt_m", "sigma_heading_per_sqrt_m",
                     "sigma_heading_per_sqrt_rad"),
        "ranges": ("sigma_relative",),
        "poses": ("sigma_xy_m", "sigma_heading_deg"),
    }.items():  # fmt: skip
        for key in keys:
            sigma = type(getattr(config.simulation, sensor))()
            data["simulation"][sensor][key] = small * getattr(sigma, key)
    data["estimator"]["odometry"] = {
        key: small * value for key, value in data["estimator"]["odometry"].items()
        if key.startswith("sigma_")
    }  # fmt: skip
    data["estimator"]["range"]["sigma_relative"] *= small
    data["start_sigma"] = {"xy_m": 1e-4, "heading_deg": 0.003}
    config = parse_config(data)
    log = load_log(config, None, 1)
    truth = truth_of(log)
    assert truth is not None
    start = start_of(config, truth, to_messages(log, config))
    pose = lf.Pose2(start.pose.x + 1e-4, start.pose.y, start.pose.heading)
    start = lf.PoseEstimate(start.stamp, pose, start.covariance)

    bound = linearized_at_truth(config, log, start)
    ours = run(config, log, start=start).estimate.position - truth.position

    np.testing.assert_allclose(ours, bound, rtol=0.0, atol=1e-7)
    assert np.abs(bound).max() > 1e-5


def test_no_filter_beats_the_bound_on_average(claims: list[Claim]) -> None:
    ratios = [claim.ours_median for claim in claims if claim.id.endswith("_bound")]
    assert float(np.mean([ratio for ratio in ratios if ratio is not None])) > 0.97
