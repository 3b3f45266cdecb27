# SPDX-License-Identifier: Apache-2.0
"""Beams, particles and the three methods: what each must do, and what breaks it."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse.sim.beams import cast
from locfuse.types import FloatArray, wrap_angle
from papers.zhang import motion
from papers.zhang.experiments import localizer
from papers.zhang.methods import moving_obstacles, settings
from papers.zhang.particle_filter import (
    COUNT,
    PEAK,
    SHARE_MAXIMUM,
    SIGMA_M,
    EnergyMap,
    RangeMap,
    anywhere,
    drawn_again,
    errors_of,
    is_free,
    log_likelihoods,
    mean_pose,
    relative,
)
from papers.zhang.world import BEAM_RAD, ITERATIONS, World, world


@pytest.fixture(scope="module")
def empty_world() -> World:
    """Return a world without people."""
    return world(1, people=0)


def last_errors(method: str, of: World) -> FloatArray:
    tracked = localizer(method, of, 1, known_start=True)
    errors = []
    for step in of.steps:
        tracked.on(step)
        errors.append(errors_of(tracked.estimate(), step.truth))
    mean: FloatArray = np.array(errors)[ITERATIONS // 2 :].mean(axis=0)
    return mean


def test_a_seed_gives_its_world_again_and_another_seed_another() -> None:
    first, again, other = world(2), world(2), world(3)
    np.testing.assert_array_equal(first.steps[4].ranges, again.steps[4].ranges)
    np.testing.assert_array_equal(first.steps[4].control, again.steps[4].control)
    assert np.any(first.grid.cells != other.grid.cells)


def test_controls_lead_from_the_start_to_the_truth(empty_world: World) -> None:
    pose = empty_world.start
    for step in empty_world.steps:
        for control in step.control:
            pose = motion.drive(pose, control)
    assert np.all(errors_of(pose, empty_world.steps[-1].truth) < [0.4, 0.1])
    assert np.hypot(*(empty_world.steps[-1].truth - empty_world.start)[:2]) > 1.0


def test_beams_are_expected_where_the_simulator_casts_them(empty_world: World) -> None:
    grid = empty_world.grid
    pose = anywhere(grid, 50, np.random.default_rng(5))
    expected = RangeMap(grid).expected(pose)
    start, direction = np.repeat(pose[:, :2], 181, axis=0), (pose[:, 2:] + BEAM_RAD).ravel()
    off = expected.ravel() - cast(grid, start, direction, 30.0)
    assert np.mean(np.abs(off) < grid.resolution_m) > 0.99  # others graze a corner
    assert abs(np.median(off)) < 0.2 * grid.resolution_m


def test_a_reading_as_expected_is_at_the_peak_and_one_sigma_off_half_a_nat_below() -> None:
    ranges = np.array([2.0, 2.0 + SIGMA_M, np.nan])
    found = log_likelihoods(ranges, np.full((1, 3), 2.0))[0]
    np.testing.assert_allclose(found, [PEAK, PEAK - 0.5, np.log(SHARE_MAXIMUM)])


def test_particles_are_drawn_as_often_as_their_weight_says() -> None:
    weight = np.array([0.0, 0.15, 0.55, 0.3, 0.0])
    for seed in range(50):
        drawn = drawn_again(weight, 100, np.random.default_rng(seed))
        np.testing.assert_allclose(np.bincount(drawn, minlength=5), 100.0 * weight, atol=1.0)
    assert np.all(relative(np.full(3, -np.inf)) == 1.0)


def test_the_mean_of_headings_about_pi_is_pi() -> None:
    poses = np.array([[0.0, 2.0, np.pi - 0.1], [2.0, 4.0, -np.pi + 0.1]])
    mean = mean_pose(poses)
    assert mean[:2].tolist() == [1.0, 3.0]
    assert abs(mean[2]) == pytest.approx(np.pi)
    assert mean_pose(poses, np.array([1.0, 0.0]))[0] == 0.0


def test_particles_start_all_over_the_free_space(empty_world: World) -> None:
    drawn = anywhere(empty_world.grid, 4000, np.random.default_rng(6))
    assert is_free(empty_world.grid, drawn).all()
    assert not is_free(empty_world.grid, np.array([[-3.0, 1.0, 0.0], [0.0, 1.0, 0.0]])).any()
    assert np.ptp(drawn, axis=0) == pytest.approx([9.9, 9.9, 2.0 * np.pi], abs=0.3)


def test_readings_in_front_of_what_all_particles_expect_are_obstacles() -> None:
    expected = np.full((100, 10), 5.0)
    ranges = np.full(10, 5.0)
    ranges[3], ranges[4] = 2.0, 8.0
    assert np.flatnonzero(moving_obstacles(ranges, expected)).tolist() == [3]
    expected[:2] = 1.0  # two in a hundred know a wall there
    assert not moving_obstacles(ranges, expected).any()
    assert not moving_obstacles(np.ones(10), np.full((100, 10), 5.0)).any()  # a set that is lost


def test_the_region_of_similar_energy_holds_the_robot(empty_world: World) -> None:
    energy, rng = EnergyMap(empty_world.grid), np.random.default_rng(7)
    similar = evenly = 0
    for step in empty_world.steps[::5]:
        similar += near(energy.draw(step.ranges, 4000, rng), step.truth)
        evenly += near(anywhere(empty_world.grid, 4000, rng), step.truth)
    assert similar > 3 * evenly > 0


def near(pose: FloatArray, truth: FloatArray) -> int:
    turn = np.abs(wrap_angle(pose[:, 2] - truth[2]))
    return int(np.sum((np.hypot(*(pose - truth)[:, :2].T) < 0.5) & (turn < 0.35)))


@pytest.mark.parametrize("method", ["standard", "paper", "ours"])
def test_each_method_tracks_a_robot_whose_start_is_known(method: str, empty_world: World) -> None:
    assert np.all(last_errors(method, empty_world) < [0.15, 0.05])


def test_a_filter_that_turns_the_wrong_way_loses_the_robot(
    empty_world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = motion.sample
    monkeypatch.setattr(motion, "sample", lambda p, u, rng: right(p, u * [1.0, -1.0], rng))
    assert last_errors("standard", empty_world)[0] > 0.5


def test_without_the_correction_the_papers_method_finds_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def found() -> int:
        count = 0
        for seed in range(4):
            of = world(seed, people=0)
            method = localizer("paper", of, seed)
            for step in of.steps[:20]:
                method.on(step)
            count += bool(errors_of(method.estimate(), of.steps[19].truth)[0] < 0.5)
        return count

    with_lines = found()
    monkeypatch.setattr("papers.zhang.methods.correct", lambda pose, P, seen, walls: (pose, P))
    assert with_lines >= 3 > found()


def test_a_scan_without_returns_moves_particles_and_weighs_none(empty_world: World) -> None:
    step = empty_world.steps[0]
    blind = type(step)(step.stamp_ns, step.control, np.full(181, np.nan), step.scan, step.truth)
    for method in ("standard", "paper"):
        tracked = localizer(method, empty_world, 1, known_start=True)
        tracked.on(blind)
        assert errors_of(tracked.estimate(), step.truth)[0] < 0.1


def test_ours_has_no_more_particles_than_the_papers(empty_world: World) -> None:
    ours = localizer("ours", empty_world, 1)
    for step in empty_world.steps[:3]:
        ours.on(step)
        assert ours.particles.shape == (COUNT, 3)
    assert settings(0).max_particles == COUNT
