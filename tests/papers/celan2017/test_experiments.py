# SPDX-License-Identifier: Apache-2.0
"""Set-ups on one lap: what each is given, and that the claims can fail."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from locfuse import _core
from locfuse.sim.sensors import point_in_world, seconds
from locfuse.types import NANOSECONDS
from papers.celan2017 import claims as rows_of
from papers.celan2017 import draw_figures, experiments, figure_eights, figures
from papers.celan2017.claims import celan_claims
from papers.celan2017.experiments import SETUPS, Run, follow, marked_start, messages
from papers.celan2017.figures import plot_eight
from papers.celan2017.methods import SWITCH, mcl
from papers.celan2017.world import (
    BLIND_S,
    LASER,
    SEEN_S,
    SPIN_WAY,
    TAGS,
    Lap,
    increments,
    lap,
    spinning,
    tag_poses,
)
from papers.claims import Claim

SEED = 2


@pytest.fixture(scope="module")
def of() -> Lap:
    return lap(SEED)


@pytest.fixture(scope="module")
def runs() -> dict[str, Run]:
    return experiments.runs_of(SEED)


def test_messages_come_in_order_of_time_and_only_those_that_a_setup_is_given(of: Lap) -> None:
    for setup in SETUPS.values():
        given = list(messages(of, setup))
        stamps = [m.begin if isinstance(m, _core.Increment) else m.stamp for _, m in given]
        assert stamps == sorted(stamps)
        kinds = {type(m) for _, m in given}
        uwb = {"fixes": _core.PositionFix, "ranges": _core.Range}.get(setup.uwb)
        assert kinds - {uwb} == {_core.Increment, _core.LaserScan}
        assert (uwb in kinds) == (setup.uwb != "none")
        assert all(is_scan == isinstance(m, _core.LaserScan) for is_scan, m in given)


def test_covers_hide_the_right_half_and_everything_in_the_hall(of: Lap) -> None:
    def returns(name: str) -> NDArray[np.bool_]:
        given = [message for _, message in messages(of, SETUPS[name])]
        return np.isfinite([z.ranges for z in given if isinstance(z, _core.LaserScan)])

    bare, half, hall = returns("lidar"), returns("covered"), returns("hall")
    assert not half[:, :181].any()
    np.testing.assert_array_equal(half[:, 181:], bare[:, 181:])
    dark, seen = round(BLIND_S * LASER.rate_hz), round(SEEN_S * LASER.rate_hz)
    assert not hall[-dark - seen : -seen - 1].any()
    np.testing.assert_array_equal(hall[: -dark - seen - 1], half[: -dark - seen - 1])
    np.testing.assert_array_equal(hall[-seen + 1 :], half[-seen + 1 :])


def test_wheels_spin_in_the_hall_and_nowhere_else(of: Lap) -> None:
    driven = spinning(of)
    ratio = driven["dx_m"] / np.where(of.log["odometry"]["dx_m"] == 0.0, np.nan,
                                    of.log["odometry"]["dx_m"])  # fmt: skip
    time_s = seconds(driven["stamp_ns"])
    end_s = of.duration_s - SEEN_S
    inside = (time_s > end_s - BLIND_S + 0.2) & (time_s < end_s - 0.2)
    outside = (time_s < end_s - BLIND_S) | (time_s > end_s + 0.2)
    np.testing.assert_allclose(ratio[inside & np.isfinite(ratio)], SPIN_WAY)
    np.testing.assert_allclose(ratio[outside & np.isfinite(ratio)], 1.0)


def test_odometry_adds_up_to_the_sum_of_its_motions(of: Lap, runs: dict[str, Run]) -> None:
    pose = marked_start(of, SEED).pose
    for u in increments(of.log["odometry"]):
        pose = pose * u.motion
    np.testing.assert_allclose(runs["odometry"].estimate[-1],
                               [pose.x, pose.y, pose.heading])  # fmt: skip
    assert len(list(increments(of.log["odometry"]))) == len(of.log["odometry"]["stamp_ns"]) - 1


def test_the_pose_of_three_tags_is_exact_without_noise_and_its_covariance_is_right(of: Lap) -> None:
    stamp_ns = np.arange(200, dtype=np.int64) * 1_000_000_000
    pose = of.drive.pose_at(seconds(stamp_ns))
    at = np.stack([point_in_world(pose, arm)[:, :2] for arm in TAGS.values()], axis=1)
    covariance = np.array([[0.002, 0.0008], [0.0008, 0.001]])
    rng = np.random.default_rng(1)
    table = {
        "stamp_ns": np.repeat(stamp_ns, 3),
        "tag": np.tile(np.array(list(TAGS)), len(stamp_ns)),
        "covariance": np.tile(covariance, (3 * len(stamp_ns), 1, 1)),
    }
    nees = []
    for noise in (0.0, 1.0):
        drawn = rng.multivariate_normal([0.0, 0.0], covariance, at.shape[:2])
        x, y = (at + noise * drawn).reshape(-1, 2).T
        found = list(tag_poses({**table, "x_m": x, "y_m": y}))
        off = np.array([_core.local(z.pose, _core.Pose2(*one))
                        for z, one in zip(found, pose, strict=True)])  # fmt: skip
        nees.append([e @ np.linalg.solve(z.covariance, e) for e, z in zip(off, found, strict=True)])
        assert noise > 0.0 or np.abs(off).max() < 1e-9
    assert 2.5 < np.mean(nees[1]) < 3.6, "three, of which 200 draws leave 0.17"


def test_epochs_at_which_a_tag_is_not_received_make_no_pose(of: Lap) -> None:
    keep = np.arange(len(of.fixes["stamp_ns"])) != 4
    less = {name: column[keep] for name, column in of.fixes.items()}
    stamps = [z.stamp for z in tag_poses(of.fixes)]
    assert [z.stamp for z in tag_poses(less)] == [s for s in stamps
                                                  if s != of.fixes["stamp_ns"][4]]  # fmt: skip


def test_wheels_lose_the_way_and_the_laser_does_not_even_half_covered(runs: dict[str, Run]) -> None:
    assert np.hypot(*runs["odometry"].end[:2]) > 3.0
    for name in ("lidar", "covered"):
        assert np.hypot(*runs[name].end[:2]) < 0.1
        assert np.rad2deg(abs(runs[name].end[2])) < 2.0
        assert runs[name].off_m.max() < 0.5
    assert np.median(runs["lidar"].off_map_m) < np.median(runs["lidar"].off_m), "the map is bent"


def test_uncertainty_grows_without_a_laser_and_uwb_reduces_it(runs: dict[str, Run]) -> None:
    in_hall = slice(-round((BLIND_S + SEEN_S) * LASER.rate_hz), -round(SEEN_S * LASER.rate_hz))
    widest = {name: runs[name].sigma_in_body[in_hall].max() for name in SETUPS}
    assert widest["hall"] > 5.0 * widest["lidar"]
    assert widest["hall_ranges"] < 0.25 * widest["hall"]


def test_the_switch_acts_in_the_hall_alone(runs: dict[str, Run]) -> None:
    assert runs["lidar_switch"].injections == runs["covered_switch"].injections == ()
    np.testing.assert_array_equal(runs["lidar_switch"].estimate, runs["lidar"].estimate)
    events = runs["hall_switch"].injections
    begin_s = runs["hall"].duration_s - BLIND_S - SEEN_S
    assert events
    assert all(event.stamp / NANOSECONDS > begin_s for event in events)
    assert runs["hall_switch"].off_m.max() < runs["hall"].off_m.max()
    assert np.hypot(*runs["hall_switch"].end[:2]) < 0.15


class IndependentErrors(_core.RecoveringEkfConfig):
    """Of a filter that takes errors that last for independent ones."""

    def __init__(self) -> None:
        super().__init__()
        self.start.estimator.correlation_s = 0.0


def test_uwb_that_comes_back_is_not_certain_of_a_wrong_place(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After ten minutes out of reach its filter was certain of a place 19 m off."""
    of = lap(16)
    run = follow(of, SETUPS["lidar_switch"], 16)
    assert run.injections == ()
    assert run.off_m.max() < 0.5
    monkeypatch.setitem(SWITCH, "elsewhere_m", 1.0)
    monkeypatch.setitem(SWITCH, "elsewhere_rad", 0.5)
    ready_to_overrule = follow(of, SETUPS["lidar_switch"], 16)
    assert ready_to_overrule.off_m.max() < 0.5
    monkeypatch.setattr(_core, "RecoveringEkfConfig", IndependentErrors)
    overruled = follow(of, SETUPS["lidar_switch"], 16)
    assert overruled.injections[0].reason == _core.InjectionReason.ELSEWHERE
    assert overruled.off_m.max() > 5.0


def test_uwb_filter_that_contradicts_its_ranges_recovers() -> None:
    """Certain of a place 2 m off, its filter gated all 15 ranges a second out, for 38 s."""
    of = lap(13)
    run = follow(of, SETUPS["hall_switch"], 13)
    assert experiments.longest_lost_s(run) < 20.0


def test_claims_of_the_switch_can_fail(runs: dict[str, Run]) -> None:
    far = replace(runs["hall"], estimate=runs["hall"].estimate + [5.0, 0.0, 0.0])
    given = {name: [run] for name, run in runs.items()} | {"hall": [far]}
    good = {claim.id: claim for claim in rows_of.switch_claims(given)}
    assert good["celan_false_switches"].met
    assert good["celan_switch_gain"].met
    found = {**given, "hall": given["hall_switch"]}
    never = {claim.id: claim for claim in rows_of.switch_claims(found)}["celan_switch_gain"]
    assert never.met is None
    assert never.note == "no lap ends lost"
    events = runs["hall_switch"].injections
    restless = replace(runs["lidar"], injections=events)
    vain = replace(far, injections=events)
    bad = {claim.id: claim for claim in rows_of.switch_claims(
        {**given, "lidar_switch": [restless], "hall_switch": [vain]})}  # fmt: skip
    assert bad["celan_false_switches"].met is False
    assert bad["celan_switch_gain"].met is False
    assert good["celan_hall_switch_lost_long"].met
    assert bad["celan_hall_switch_lost_long"].met is False
    assert experiments.longest_lost_s(vain) > rows_of.LONGEST_S
    assert experiments.longest_lost_s(runs["covered_switch"]) == 0.0


def test_the_switch_is_asked_where_it_acts(runs: dict[str, Run]) -> None:
    """Half a laser needs no switch: what was asked of it there was met by doing nothing."""
    [asked] = [claim for claim in rows_of.setup_claims("hall_switch", [runs["hall_switch"]])
               if claim.id == "celan_hall_switch_room"]  # fmt: skip
    [alone] = [claim for claim in rows_of.setup_claims("hall_switch", [runs["hall"]])
               if claim.id == "celan_hall_switch_room"]  # fmt: skip
    assert asked.required == ">= 95"
    assert asked.met
    assert alone.met is False


def test_sigmas_ahead_and_to_the_side_are_those_of_a_turned_covariance(
    runs: dict[str, Run],
) -> None:
    covariance = np.diag([4.0, 1.0, 0.0])[None]
    heading = np.array([[0.0, 0.0, 0.5 * np.pi]])
    turned = replace(runs["lidar"], estimate=heading, covariance=covariance)
    np.testing.assert_allclose(turned.sigma_in_body, [[1.0, 2.0]])


def test_any_estimator_can_be_plugged_in(of: Lap) -> None:
    class Counting:
        def __init__(self) -> None:
            self.scans = 0
            self.mcl = mcl(of, marked_start(of, SEED), SEED)

        def on(self, message: object, /) -> None:
            self.scans += isinstance(message, _core.LaserScan)

        def estimate(self) -> _core.PoseEstimate:
            return self.mcl.estimate()

    counting = Counting()
    setup = replace(SETUPS["lidar"], make=lambda of, start, seed: counting)
    run = follow(of, setup, SEED)
    assert counting.scans == len(of.log["scans"]["stamp_ns"]) == len(run.estimate)


def claims_by_id(setup: str, runs: list[Run]) -> dict[str, Claim]:
    return {claim.id: claim for claim in rows_of.setup_claims(setup, runs)}


def test_claims_hold_on_one_lap_and_fail_for_another_estimator(runs: dict[str, Run]) -> None:
    good = claims_by_id("lidar", [runs["lidar"]])
    assert all(claim.met for claim in good.values())
    blind = claims_by_id("lidar", [runs["odometry"]])
    assert blind["celan_lidar_end"].met is False
    assert blind["celan_lidar_end_heading"].met is False
    assert blind["celan_lidar_lost"].met is False
    still = claims_by_id("odometry", [runs["lidar"]])
    assert still["celan_odometry_end"].met is False, "wheels that do not drift are not theirs"
    assert rows_of.speed_claim([runs["lidar"]]).met
    slow = replace(runs["lidar"], wall_s=runs["lidar"].duration_s / 50.0)
    assert rows_of.speed_claim([slow]).met is False


def test_claims_report_progress_and_have_ids_of_their_own(
    runs: dict[str, Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(experiments, "runs_of", lambda seed: runs)
    steps: list[tuple[int, int]] = []
    claims = celan_claims(2, lambda done, total: steps.append((done, total)))
    assert steps == [(1, 2), (2, 2)]
    assert len({claim.id for claim in claims}) == len(claims)
    assert {claim.paper for claim in claims} >= {18.96, 38.68, 0.78, 3.86, 2.22, 15.14}


def test_eights_are_55_m_in_three_minutes_and_both_are_better_than_one() -> None:
    of = figure_eights.ride(0)
    end = of.drive.pose_at(np.linspace(0.0, figure_eights.DURATION_S, 5000))[:, :2]
    assert np.hypot(*np.diff(end, axis=0).T).sum() == pytest.approx(figure_eights.LENGTH_M, abs=0.1)
    assert of.floor.in_open_room(end).all()
    by_id = {claim.id: claim for claim in rows_of.eight_claims(3)}
    for name, least in (("triangle", 1.3), ("kindest", 1.0)):
        for what in ("position", "heading"):
            gain = by_id[f"celan_eight_{name}_gain_{what}"].ours_median
            assert gain is not None
            assert gain > least
    assert by_id["celan_eight_rigid_better"].met
    for name in figure_eights.FUSED:
        assert by_id[f"celan_eight_{name}_better"].required == ">= 100"
    ours, odometry = (by_id[f"celan_eight_{name}_y"].ours_median for name in ("rigid", "odometry"))
    assert ours is not None
    assert odometry is not None
    assert ours < 0.1 < odometry


def test_a_late_rtls_reports_where_the_tags_were() -> None:
    late = figure_eights.ride(0, 3.0)
    found = figure_eights.uwb_alone(late)
    truth = late.drive.pose_at(seconds(found.stamp_ns) - 3.0)[:, :2]
    assert np.hypot(*(found.position - truth).T).max() < 0.4
    assert np.sqrt(np.mean(figure_eights.errors_of(late, found)[:, :2] ** 2)) > 0.4


def test_pictures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "SEED", SEED)
    paths = draw_figures(tmp_path)
    names = ["celan_laps", "celan_radios", "celan_doubt", "celan_sigmas", "celan_eight"]
    assert [path.stem for path in paths] == names
    assert all(path.stat().st_size > 20_000 for path in paths)


def labels_of(figure: Figure) -> set[str]:
    return {text.get_text() for legend in figure.legends for text in legend.get_texts()}


def test_the_picture_of_an_eight_has_every_method(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fourth method once found no colour and was left out without a word."""
    monkeypatch.setattr(figures, "SEED", SEED)
    assert labels_of(figures._eight()) == {"truth", *figure_eights.NAMES.values()}


def test_what_stands_above_a_lap_fits_the_picture(of: Lap, runs: dict[str, Run]) -> None:
    figure = figures._laps(of, runs)
    figure.canvas.draw()
    for axes in figure.axes:
        [above] = [text for text in (axes.title, axes._left_title) if text.get_text()]  # type: ignore[attr-defined]
        assert above.get_window_extent().x1 < figure.bbox.x1, above.get_text()


def test_more_tracks_than_colours_are_no_picture() -> None:
    tracks = {str(k): np.zeros((2, 2)) for k in range(6)}
    with pytest.raises(ValueError, match="zip"):
        plot_eight(np.zeros((2, 2)), tracks, "six")


def test_an_injection_is_seen_where_the_anchors_are(of: Lap, runs: dict[str, Run]) -> None:
    figure = figures._uncertainty(of, runs)
    assert {"injection", "before it", "after it"} <= labels_of(figure)
    low, high = figure.axes[0].get_xlim()
    assert high - low < 12.0, "an ellipse of a decimetre has to be seen"
