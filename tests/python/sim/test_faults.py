# SPDX-License-Identifier: Apache-2.0
"""Each fault does what it says, and changes no bit of anything else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse.config.scenario import Scenario
from locfuse.sim.faults import walls_between
from locfuse.sim.scenario import simulate
from locfuse.types import Columns, Log
from support_statistics import Z, chi_squared_band

BASE: dict[str, Any] = {"positions": {}, "duration_s": 120.0}


def run(*faults: dict[str, Any], **changes: Any) -> Log:
    scenario = Scenario.model_validate({**BASE, **changes, "faults": list(faults)})
    return simulate(scenario, np.random.default_rng(5))


def assert_equal(first: Columns, second: Columns, *, but: tuple[str, ...] = ()) -> None:
    assert set(first) == set(second)
    for name in set(first) - set(but):
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)


def assert_others_equal(first: Log, second: Log, changed: str) -> None:
    assert set(first.tables) == set(second.tables)
    for stem in set(first.tables) - {changed}:
        assert_equal(first[stem], second[stem])


def rows_of(table: Columns) -> set[tuple[Any, ...]]:
    return set(zip(*(column.tolist() for column in table.values()), strict=True))


def assert_share(hits: NDArray[np.bool_], probability: float) -> None:
    spread = Z * np.sqrt(probability * (1.0 - probability) / len(hits))
    assert abs(hits.mean() - probability) < spread


# NLOS ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wall", "blocked"),
    [
        ((2.0, -1.0, 2.0, 1.0), True),  # across
        ((2.0, 1.0, 2.0, -1.0), True),  # the other way round
        ((2.0, 0.0, 2.0, 1.0), True),  # its end in the line of sight
        ((1.0, -1.0, 3.0, 1.0), True),  # aslant
        ((2.0, 0.1, 2.0, 1.0), False),  # beside
        ((2.0, -1.0, 2.0, -0.1), False),  # beside, on the other hand
        ((5.0, -1.0, 5.0, 1.0), False),  # beyond the anchor
        ((-1.0, -1.0, -1.0, 1.0), False),  # behind the tag
        ((4.0, -1.0, 4.0, 1.0), False),  # the anchor hangs on it
        ((0.0, -1.0, 0.0, 1.0), False),  # the tag touches it
        ((1.0, 0.0, 3.0, 0.0), False),  # along the line of sight
        ((1.0, 1.0, 3.0, 1.0), False),  # parallel to it
    ],
)
def test_a_wall_blocks_what_it_stands_between(
    wall: tuple[float, float, float, float], blocked: bool
) -> None:
    tag, anchor = np.array([[0.0, 0.0]]), np.array([[4.0, 0.0]])

    assert walls_between(tag, anchor, [wall]).tolist() == [blocked]
    assert walls_between(anchor, tag, [wall]).tolist() == [blocked]


def test_an_anchor_on_a_slanted_wall_is_never_behind_it() -> None:
    rng = np.random.default_rng(2)
    start, along, share = (
        rng.uniform(-9, 9, (500, 2)),
        rng.uniform(-5, 5, (500, 2)),
        rng.random(500),
    )
    anchor = start + share[:, None] * along
    tag = rng.uniform(-9, 9, (500, 2))

    for k in range(500):
        wall = (*start[k].tolist(), *(start[k] + along[k]).tolist())
        assert not walls_between(tag[k : k + 1], anchor[k : k + 1], [wall])[0]


def test_nlos_lengthens_ranges_through_the_wall_by_the_extra_and_no_others() -> None:
    east_wall = [8.5, -1.0, 8.5, 11.0]  # the circle ends at x = 8; A2 and A3 hang at x = 10

    clean, faulty = run(), run({"kind": "nlos", "walls": [east_wall], "extra_m": 0.4})

    extra = faulty["ranges"]["range_m"] - clean["ranges"]["range_m"]
    blocked = np.isin(clean["ranges"]["anchor"], ["A2", "A3"])
    np.testing.assert_allclose(extra[blocked], 0.4, atol=1e-14)
    np.testing.assert_array_equal(extra[~blocked], 0.0)
    assert_equal(clean["ranges"], faulty["ranges"], but=("range_m",))
    assert_others_equal(clean, faulty, "ranges")


def test_nlos_sees_the_lever_arm_and_counts_two_walls_once() -> None:
    # Seen from far south, what lies north of the walls is the mast, 1 m ahead of the robot.
    walls = [[0.0, 7.5, 10.0, 7.5], [0.0, 7.6, 10.0, 7.6]]
    tags = {"mast": (1.0, 0.0, 0.0)}

    clean = run(tags=tags, anchors={"S": (5.0, -40.0, 0.0)})
    faulty = run(
        {"kind": "nlos", "walls": walls, "extra_m": 0.4},
        tags=tags,
        anchors={"S": (5.0, -40.0, 0.0)},
    )

    truth = {int(t): row for row, t in enumerate(clean["truth"]["stamp_ns"])}
    rows = [truth[int(t)] for t in clean["ranges"]["stamp_ns"]]
    mast_y = clean["truth"]["y_m"][rows] + np.sin(clean["truth"]["heading_rad"][rows])
    blocked = mast_y > 7.5
    extra = faulty["ranges"]["range_m"] - clean["ranges"]["range_m"]
    assert 0 < blocked.sum() < len(blocked)
    np.testing.assert_allclose(extra, np.where(blocked, 0.4, 0.0), atol=1e-13)


def test_walls_count_and_enough_of_them_silence_a_range() -> None:
    walls = [[8.5, -1.0, 8.5, 11.0], [9.0, -1.0, 9.0, 11.0], [9.5, 5.0, 9.5, 11.0]]
    tag, anchor = np.array([[5.0, 2.0], [5.0, 8.0], [8.7, 8.0]]), np.full((3, 2), [10.0, 8.0])
    assert walls_between(tag, anchor, [tuple(w) for w in walls]).tolist() == [3, 3, 2]  # type: ignore[misc]
    fault = {"kind": "nlos", "walls": walls, "extra_m": 0.4, "sigma_m": 0.3}

    deep = run({**fault, "silent_walls": 4})
    long = run(fault)
    silent = run({**fault, "silent_walls": 3})

    assert_equal(deep["ranges"], long["ranges"])
    north_east = long["ranges"]["anchor"] == "A3"  # behind all three; A2 behind two
    assert north_east.any()
    for name, column in long["ranges"].items():
        np.testing.assert_array_equal(silent["ranges"][name], column[~north_east])
    assert_others_equal(long, silent, "ranges")


def test_random_nlos_is_never_negative_and_has_the_mean_and_deviation_asked_for() -> None:
    everywhere = [[8.5, -1.0, 8.5, 11.0]]
    far = {"E": (30.0, 5.0, 0.0)}
    fault = {"kind": "nlos", "walls": everywhere, "extra_m": 0.5, "sigma_m": 0.3}

    clean = run(anchors=far, duration_s=2000.0)
    extra = run(fault, anchors=far, duration_s=2000.0)["ranges"]["range_m"]
    extra = extra - clean["ranges"]["range_m"]

    n = len(extra)
    shape = (0.5 / 0.3) ** 2
    kurtosis = 3.0 + 6.0 / shape
    assert extra.min() > 0.0
    assert abs(extra.mean() - 0.5) < Z * 0.3 / np.sqrt(n)
    assert abs(extra.var() / 0.09 - 1.0) < Z * np.sqrt((kurtosis - 1.0) / n)


# Bias ----------------------------------------------------------------------------------------


def test_bias_of_one_anchor_scales_and_shifts_its_ranges_only() -> None:
    clean = run()
    faulty = run({"kind": "bias", "anchor": "A3", "offset_m": 0.2, "scale": 1.05})

    hit = clean["ranges"]["anchor"] == "A3"
    before, after = clean["ranges"]["range_m"], faulty["ranges"]["range_m"]
    np.testing.assert_allclose(after[hit], 1.05 * before[hit] + 0.2, rtol=1e-15)
    np.testing.assert_array_equal(after[~hit], before[~hit])
    assert_equal(clean["ranges"], faulty["ranges"], but=("range_m",))
    assert_others_equal(clean, faulty, "ranges")


def test_bias_without_an_anchor_hits_all_and_leaves_no_negative_range() -> None:
    clean, faulty = run(), run({"kind": "bias", "offset_m": -5.0})

    before, after = clean["ranges"]["range_m"], faulty["ranges"]["range_m"]
    np.testing.assert_array_equal(after, np.maximum(before - 5.0, 0.0))
    assert after.min() == 0.0


# Wander --------------------------------------------------------------------------------------


def test_errors_that_wander_are_as_large_as_stated_and_alike_for_as_long_as_stated() -> None:
    clean = run(duration_s=4000.0)
    faulty = run({"kind": "wander", "sigma_m": 0.3, "correlation_s": 2.0}, duration_s=4000.0)
    assert_equal(clean["ranges"], faulty["ranges"], but=("range_m",))
    assert_others_equal(clean, faulty, "ranges")

    error = faulty["ranges"]["range_m"] - clean["ranges"]["range_m"]
    of = [error[clean["ranges"]["anchor"] == anchor] for anchor in ("A1", "A2")]
    step = float(np.diff(clean["ranges"]["stamp_ns"][clean["ranges"]["anchor"] == "A1"])[0]) / 1e9
    for one in of:  # 4,000 s are 2,000 independent errors
        assert one.std() == pytest.approx(0.3, rel=0.08)
        assert one.mean() == pytest.approx(0.0, abs=0.03)
        for rows in (1, round(2.0 / step)):
            correlation = np.mean(one[rows:] * one[:-rows]) / one.var()
            assert correlation == pytest.approx(np.exp(-rows * step / 2.0), abs=0.06)
    assert abs(np.mean(of[0] * of[1])) < 0.06 * 0.3**2  # each anchor by itself


# Outliers ------------------------------------------------------------------------------------


def test_range_outliers_are_wrong_by_the_magnitude_with_the_probability() -> None:
    clean = run(duration_s=1000.0)
    faulty = run({"kind": "outliers", "probability": 0.1, "magnitude_m": 1.5}, duration_s=1000.0)

    error = faulty["ranges"]["range_m"] - clean["ranges"]["range_m"]
    hit = error != 0.0
    np.testing.assert_allclose(np.abs(error[hit]), 1.5, atol=1e-13)
    assert_share(hit, 0.1)
    assert_share(error[hit] > 0.0, 0.5)
    assert_equal(clean["ranges"], faulty["ranges"], but=("range_m",))
    assert_others_equal(clean, faulty, "ranges")


def test_range_outliers_that_could_not_be_shorter_are_longer() -> None:
    clean = run()
    faulty = run({"kind": "outliers", "probability": 1.0, "magnitude_m": 50.0})

    np.testing.assert_allclose(faulty["ranges"]["range_m"], clean["ranges"]["range_m"] + 50.0)


@pytest.mark.parametrize("source", ["poses", "positions"])
def test_outliers_of_places_lie_at_the_magnitude_in_any_direction(source: str) -> None:
    fault = {"kind": "outliers", "source": source, "probability": 0.3, "magnitude_m": 2.0}
    clean, faulty = run(duration_s=2000.0), run(fault, duration_s=2000.0)

    dx = faulty[source]["x_m"] - clean[source]["x_m"]
    dy = faulty[source]["y_m"] - clean[source]["y_m"]
    hit = (dx != 0.0) | (dy != 0.0)
    np.testing.assert_allclose(np.hypot(dx, dy)[hit], 2.0, atol=1e-12)
    assert_share(hit, 0.3)
    for quadrant in (dx > 0.0) & (dy > 0.0), (dx < 0.0) & (dy < 0.0):
        assert_share(quadrant[hit], 0.25)
    assert_equal(clean[source], faulty[source], but=("x_m", "y_m"))
    assert_others_equal(clean, faulty, source)


# Dropouts ------------------------------------------------------------------------------------


@pytest.mark.parametrize("source", ["odometry", "ranges", "poses", "positions"])
def test_dropouts_of_an_interval_lose_its_rows_and_keep_the_rest_as_they_are(source: str) -> None:
    clean = run()
    faulty = run({"kind": "dropouts", "source": source, "from_s": 10.0, "to_s": 20.0})

    stamp_ns = clean[source]["stamp_ns"]
    kept = (stamp_ns < 10_000_000_000) | (stamp_ns >= 20_000_000_000)
    assert_equal({name: column[kept] for name, column in clean[source].items()}, faulty[source])
    assert_others_equal(clean, faulty, source)


def test_dropouts_by_chance_lose_the_share_asked_for() -> None:
    clean = run(duration_s=1000.0)
    faulty = run({"kind": "dropouts", "probability": 0.2}, duration_s=1000.0)

    before, after = rows_of(clean["ranges"]), rows_of(faulty["ranges"])
    assert after < before
    assert_share(np.arange(len(before)) >= len(after), 0.2)


def test_dropouts_of_one_anchor_by_chance_in_an_interval_touch_nothing_else() -> None:
    fault = {"kind": "dropouts", "anchor": "A4", "probability": 0.5, "from_s": 30.0, "to_s": 90.0}
    clean, faulty = run(), run(fault)

    def inside(table: Columns) -> NDArray[np.bool_]:
        late = (table["stamp_ns"] >= 30_000_000_000) & (table["stamp_ns"] < 90_000_000_000)
        return np.asarray(late & (table["anchor"] == "A4"))

    before, after = clean["ranges"], faulty["ranges"]
    assert_equal(
        {name: column[~inside(before)] for name, column in before.items()},
        {name: column[~inside(after)] for name, column in after.items()},
    )
    asked = int(inside(before).sum())
    assert_share(np.arange(asked) >= inside(after).sum(), 0.5)


# Latency -------------------------------------------------------------------------------------


@pytest.mark.parametrize("source", ["odometry", "ranges", "poses", "positions"])
def test_latency_adds_an_arrival_and_keeps_the_stamps(source: str) -> None:
    clean, faulty = run(), run({"kind": "latency", "source": source, "delay_s": 0.15})

    table = dict(faulty[source])
    arrival_ns = table.pop("arrival_ns")
    assert arrival_ns.dtype == np.int64
    np.testing.assert_array_equal(arrival_ns, clean[source]["stamp_ns"] + 150_000_000)
    assert_equal(clean[source], table)
    assert_others_equal(clean, faulty, source)


def test_jitter_spreads_the_delay_evenly_and_never_below_it() -> None:
    fault = {"kind": "latency", "source": "ranges", "delay_s": 0.1, "jitter_s": 0.3}

    table = run(fault, duration_s=1000.0)["ranges"]

    jitter = (table["arrival_ns"] - table["stamp_ns"]) * 1e-9 - 0.1
    assert jitter.min() >= -1e-9
    assert jitter.max() <= 0.3
    counts = np.histogram(jitter, bins=20, range=(0.0, 0.3))[0]
    expected = len(jitter) / 20
    low, high = chi_squared_band(19)
    assert low < np.sum((counts - expected) ** 2 / expected) < high


def test_two_latencies_add_up() -> None:
    table = run(
        {"kind": "latency", "source": "poses", "delay_s": 0.1},
        {"kind": "latency", "source": "poses", "delay_s": 0.25},
    )["poses"]

    np.testing.assert_array_equal(table["arrival_ns"] - table["stamp_ns"], 350_000_000)


# Wheel slip ----------------------------------------------------------------------------------


def test_wheel_slip_scales_increments_that_end_inside() -> None:
    clean = run()
    faulty = run(
        {
            "kind": "wheel_slip",
            "from_s": 10.0,
            "to_s": 12.0,
            "translation_factor": 1.5,
            "rotation_factor": 0.5,
        }
    )

    stamp_ns = clean["odometry"]["stamp_ns"]
    slips = (stamp_ns > 10_000_000_000) & (stamp_ns <= 12_000_000_000)
    assert slips.sum() == 60
    for name, factor in (("dx_m", 1.5), ("dy_m", 1.5), ("dheading_rad", 0.5)):
        before, after = clean["odometry"][name], faulty["odometry"][name]
        np.testing.assert_allclose(after, np.where(slips, factor * before, before), rtol=1e-13)
        np.testing.assert_array_equal(after[~slips], before[~slips])
    assert_others_equal(clean, faulty, "odometry")


def test_wheel_slip_scales_velocities_that_hold_inside() -> None:
    odometry = {"output": "velocities"}
    clean = run(odometry=odometry)
    faulty = run(
        {"kind": "wheel_slip", "from_s": 10.0, "to_s": 12.0, "translation_factor": 0.0},
        odometry=odometry,
    )

    stamp_ns = clean["odometry"]["stamp_ns"]
    slips = (stamp_ns >= 10_000_000_000) & (stamp_ns < 12_000_000_000)
    before, after = clean["odometry"]["v_mps"], faulty["odometry"]["v_mps"]
    np.testing.assert_allclose(after[slips], 0.0, atol=1e-15)
    np.testing.assert_array_equal(after[~slips], before[~slips])
    np.testing.assert_array_equal(
        clean["odometry"]["omega_radps"], faulty["odometry"]["omega_radps"]
    )


@pytest.mark.parametrize("rate_hz", [1.0, 7.0, 30.0])
@pytest.mark.parametrize("output", ["increments", "velocities"])
def test_wheel_slip_adds_the_same_distance_at_any_rate(rate_hz: float, output: str) -> None:
    odometry = {
        "rate_hz": rate_hz,
        "output": output,
        "sigma_longitudinal_per_sqrt_m": 0.0,
        "sigma_heading_per_sqrt_m": 0.0,
        "sigma_heading_per_sqrt_rad": 0.0,
    }
    slip = {"kind": "wheel_slip", "from_s": 3.3, "to_s": 8.1, "translation_factor": 1.5}
    path = {"shape": "square", "side_m": 8.0, "speed_mps": 0.5}  # 16 s straight
    changes = {"odometry": odometry, "path": path, "duration_s": 12.0}

    distance = []
    for log in run(**changes), run(slip, **changes):
        table = log["odometry"]
        moved = table["dx_m"] if output == "increments" else table["v_mps"] / rate_hz
        distance.append(moved.sum())

    assert distance[1] - distance[0] == pytest.approx(0.5 * 0.5 * 4.8, abs=1e-7)


# Slip episodes -------------------------------------------------------------------------------

EXACT = {
    "sigma_longitudinal_per_sqrt_m": 0.0,
    "sigma_heading_per_sqrt_m": 0.0,
    "sigma_heading_per_sqrt_rad": 0.0,
}
SLIPS = {"kind": "slip_episodes", "every_s": 8.0, "lasting_s": 2.0, "translation_factor": 1.5,
         "turn_radps": 0.2}  # fmt: skip


def test_slip_episodes_scale_and_turn_what_lies_inside_and_nothing_else() -> None:
    odometry = {**EXACT, "rate_hz": 50.0}
    clean = run(odometry=odometry, duration_s=600.0)
    faulty = run(SLIPS, odometry=odometry, duration_s=600.0)

    factor = faulty["odometry"]["dx_m"][1:] / clean["odometry"]["dx_m"][1:]
    more = (faulty["odometry"]["dheading_rad"] - clean["odometry"]["dheading_rad"])[1:]
    whole, none = np.isclose(factor, 1.5, rtol=1e-9), factor == 1.0
    partly = ~whole & ~none
    np.testing.assert_allclose(np.abs(more[whole]), 0.2 / 50.0, atol=1e-9)
    np.testing.assert_array_equal(more[none], 0.0)
    # A row that is partly inside has the same part of both.
    np.testing.assert_allclose(
        np.abs(more[partly]) * 50.0 / 0.2, (factor[partly] - 1.0) / 0.5, atol=1e-6
    )
    episodes = int((np.diff(whole.astype(int)) == 1).sum())
    assert partly.sum() <= 2 * episodes + 4
    # A renewal of means 8 s + 2 s: 60 episodes in 600 s, give or take sqrt(60 (8^2 + 2^2)) / 10;
    # of the time a fifth.
    assert abs(episodes - 60) < Z * np.sqrt(60 * (8.0**2 + 2.0**2)) / 10.0
    assert abs(whole.mean() - 0.2) < Z * 2.0 * np.sqrt(2.0 * 60.0) / 600.0
    sides = np.sign(more[whole])
    assert {-1.0, 1.0} == set(sides.tolist())
    np.testing.assert_array_equal(clean["odometry"]["stamp_ns"], faulty["odometry"]["stamp_ns"])
    assert_others_equal(clean, faulty, "odometry")


@pytest.mark.parametrize("output", ["increments", "velocities"])
def test_slip_episodes_are_the_same_at_any_rate(output: str) -> None:
    path = {"shape": "square", "side_m": 8.0, "speed_mps": 0.1}  # 80 s straight
    sums = []
    for rate_hz in (1.0, 7.0, 30.0):
        changes = {
            "odometry": {**EXACT, "rate_hz": rate_hz, "output": output},
            "path": path,
            "duration_s": 60.0,
        }
        table = run(SLIPS, **changes)["odometry"]
        if output == "increments":
            sums.append([table["dx_m"].sum(), table["dheading_rad"].sum()])
        else:
            lasted = np.diff(table["stamp_ns"], append=60_000_000_000) * 1e-9
            sums.append([(table["v_mps"] * lasted).sum(), (table["omega_radps"] * lasted).sum()])

    assert sums[0][0] > 6.05
    np.testing.assert_allclose(sums, [sums[0]] * 3, atol=1e-3)


def test_slip_episodes_are_off_unless_asked_for_and_the_same_for_a_seed() -> None:
    assert Scenario().faults == []
    clean, first, again = run(), run(SLIPS), run(SLIPS)
    assert_equal(first["odometry"], again["odometry"])
    assert (first["odometry"]["dx_m"] != clean["odometry"]["dx_m"]).any()
    # A longer drive has the same episodes to begin with.
    longer = run(SLIPS, duration_s=240.0)["odometry"]["dx_m"]
    long_clean = run(duration_s=240.0)["odometry"]["dx_m"]
    short = first["odometry"]["dx_m"] != clean["odometry"]["dx_m"]
    np.testing.assert_array_equal((longer != long_clean)[: len(short)], short)


def test_wheels_that_spin_tell_a_turn_even_of_a_robot_that_stands() -> None:
    path = {"shape": "circle", "speed_mps": 1e-9}
    spin = {"kind": "slip_episodes", "every_s": 1.0, "lasting_s": 5.0, "turn_radps": 0.3}
    table = run(spin, odometry=EXACT, path=path, duration_s=30.0)["odometry"]
    assert np.abs(table["dheading_rad"]).max() == pytest.approx(0.3 / 30.0)
    assert np.abs(table["dx_m"]).max() < 1e-9


# Kidnapping ----------------------------------------------------------------------------------


KIDNAP = {"kind": "kidnap", "at_s": 40.0, "to": [3.0, 6.0, 30.0]}


def test_a_kidnapped_robot_is_elsewhere_from_then_on_and_its_odometry_tells_nothing() -> None:
    path = {"shape": "waypoints", "margin_m": 4.0}
    clean, carried = run(path=path), run(KIDNAP, path=path)

    assert_equal(clean["odometry"], carried["odometry"])
    before = clean["truth"]["stamp_ns"] < 40_000_000_000
    for name in ("x_m", "y_m", "heading_rad"):
        np.testing.assert_array_equal(clean["truth"][name][before], carried["truth"][name][before])
    first = int(np.argmin(before))
    at = [carried["truth"][name][first] for name in ("x_m", "y_m", "heading_rad")]
    np.testing.assert_allclose(at, [3.0, 6.0, np.deg2rad(30.0)], atol=1e-12)


def test_a_kidnapped_robot_drives_on_as_it_would_have() -> None:
    path = {"shape": "waypoints", "margin_m": 4.0}
    clean, carried = run(path=path)["truth"], run(KIDNAP, path=path)["truth"]
    later = clean["stamp_ns"] >= 40_000_000_000

    steps = [np.hypot(np.diff(truth["x_m"][later]), np.diff(truth["y_m"][later]))
             for truth in (clean, carried)]  # fmt: skip

    np.testing.assert_allclose(steps[0], steps[1], atol=1e-12)
    assert steps[0].max() > 0.0


def test_sensors_hear_of_the_place_where_a_kidnapped_robot_is() -> None:
    quiet = {"ranges": {"sigma_relative": 0.0}, "path": {"shape": "circle", "speed_mps": 0.0}}
    table = run(KIDNAP, **quiet)["ranges"]

    late = (table["stamp_ns"] >= 40_000_000_000) & (table["anchor"] == "A1")

    np.testing.assert_allclose(table["range_m"][late], np.hypot(3.0, 6.0), atol=1e-12)
    np.testing.assert_allclose(table["range_m"][(table["anchor"] == "A1") & ~late],
                               np.hypot(8.0, 5.0), atol=1e-12)  # fmt: skip


def test_a_robot_kidnapped_twice_is_where_it_was_carried_last() -> None:
    again = {"kind": "kidnap", "at_s": 60.0, "to": [7.0, 2.0, 0.0]}
    truth = run(again, KIDNAP, path={"shape": "circle", "speed_mps": 0.0})["truth"]

    place = {(x, y) for x, y in zip(truth["x_m"], truth["y_m"], strict=True)}

    assert place == {(8.0, 5.0), (3.0, 6.0), (7.0, 2.0)}


def test_a_kidnapped_robot_must_stay_in_the_room() -> None:
    with pytest.raises(ValueError, match=r"faults.0.to is \(30.0, 6.0\), outside of the room"):
        run({**KIDNAP, "to": [30.0, 6.0, 0.0]})
    with pytest.raises(ValueError, match=r"drives after .* s out of the room"):
        run({**KIDNAP, "to": [0.1, 6.0, 0.0]}, path={"shape": "circle"})


# Together ------------------------------------------------------------------------------------


def test_a_dropout_does_not_change_what_a_later_fault_does_to_the_rows_that_stay() -> None:
    outliers = {"kind": "outliers", "probability": 0.2, "magnitude_m": 1.0}
    harmless = {"kind": "dropouts", "probability": 0.0}
    lossy = {"kind": "dropouts", "anchor": "A1", "probability": 1.0}

    without, with_loss = run(harmless, outliers), run(lossy, outliers)

    kept = without["ranges"]["anchor"] != "A1"
    assert_equal(
        {name: column[kept] for name, column in without["ranges"].items()}, with_loss["ranges"]
    )


def test_what_stands_before_a_fault_does_not_change_its_draws() -> None:
    outliers = {"kind": "outliers", "probability": 0.2, "magnitude_m": 1.0}
    before = [
        {"kind": "latency", "source": "poses", "delay_s": 0.1, "jitter_s": 0.1},
        {"kind": "dropouts", "source": "odometry", "probability": 0.1},
        {"kind": "wheel_slip", "from_s": 1.0, "to_s": 2.0, "rotation_factor": 0.5},
    ]

    first, *others = (run(fault, outliers)["ranges"] for fault in before)

    for other in others:
        assert_equal(first, other)


def test_faults_apply_in_their_order() -> None:
    shift = {"kind": "bias", "offset_m": 1.0}
    stretch = {"kind": "bias", "scale": 2.0}

    clean = run()["ranges"]["range_m"]

    np.testing.assert_allclose(run(shift, stretch)["ranges"]["range_m"], 2.0 * (clean + 1.0))
    np.testing.assert_allclose(run(stretch, shift)["ranges"]["range_m"], 2.0 * clean + 1.0)
