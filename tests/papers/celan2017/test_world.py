# SPDX-License-Identifier: Apache-2.0
"""The lap of celan2017: as long as theirs, closed, on a map that is bent but for one room."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse.sim.faults import walls_between
from locfuse.sim.sensors import point_in_world, seconds, stamps
from locfuse.sim.space import cell_of, room_for
from locfuse.types import OCCUPIED, wrap_angle
from papers.celan2017.world import (
    CLEARANCE_M,
    DISTORTION_M,
    LAP_M,
    MIN_RANGES,
    OUTAGE_EVERY_S,
    OUTAGE_S,
    SIGMA_RANGE_M,
    SILENT_WALLS,
    SIZE_M,
    SPEED_MPS,
    STAND_S,
    TAGS,
    TURN_RADPS,
    UWB_HZ,
    UWB_RANGE_M,
    Lap,
    floor_of,
    lap,
    outages,
    stops,
    there_and_back,
    wheels,
)


@pytest.fixture(scope="module")
def of() -> Lap:
    return lap(0)


def test_a_seed_makes_one_lap_and_another_seed_another_one(of: Lap) -> None:
    same, other = lap.__wrapped__(0), lap(1)
    for table in ("odometry", "scans", "ranges"):
        for name, column in of.log[table].items():
            np.testing.assert_array_equal(column, same.log[table][name])
    assert not np.array_equal(of.floor.true.cells, other.floor.true.cells)


@pytest.mark.parametrize("seed", range(5))
def test_the_map_is_right_in_the_room_with_the_anchors_and_bent_in_the_hallways(seed: int) -> None:
    floor = floor_of(seed)
    x1, y1, x2, y2 = floor.plan.open_room
    rng = np.random.default_rng(seed)
    assert not floor.shift(rng.uniform([x1, y1], [x2, y2], (500, 2))).any()
    off = np.hypot(*floor.shift(rng.uniform([0.0, 0.0], SIZE_M, (5000, 2))).T)
    assert 0.75 * DISTORTION_M < off.max() <= 1.01 * DISTORTION_M
    assert np.median(off) > 0.02
    size = floor.true.cells.shape
    rim = (floor.map.cells.shape[0] - size[0]) // 2
    inner = floor.map.cells[rim:-rim, rim:-rim]
    # Walls of the room are where they are: what is bent begins a metre behind them.
    (left, bottom), (right, top) = cell_of(floor.true, np.array([[x1, y1], [x2, y2]]))[:, ::-1]
    room = (slice(bottom, top + 1), slice(left, right + 1))
    np.testing.assert_array_equal(inner[room], floor.true.cells[room])
    assert (inner != floor.true.cells).any()


@pytest.mark.parametrize("seed", range(2))
def test_a_lap_is_200_m_in_a_quarter_of_an_hour_and_ends_where_it_began(seed: int) -> None:
    of = lap(seed)
    assert of.length_m == pytest.approx(LAP_M, rel=0.05)
    assert of.length_m / of.duration_s == pytest.approx(0.22, abs=0.02)
    begin, stood, end = of.drive.pose_at([0.0, of.duration_s - STAND_S, of.duration_s])
    np.testing.assert_allclose(end[:2], begin[:2], atol=1e-9)
    assert abs(wrap_angle(end[2] - begin[2])) < 1e-9
    np.testing.assert_array_equal(stood, end)
    assert of.floor.in_open_room(np.array([begin[:2]])).all()


def test_a_lap_keeps_clear_of_walls_and_goes_around_the_floor_and_into_rooms(of: Lap) -> None:
    truth = np.column_stack([of.log["truth"]["x_m"], of.log["truth"]["y_m"]])
    row, column = cell_of(of.floor.true, truth).T
    assert room_for(of.floor.true, CLEARANCE_M - 0.05)[row, column].all()
    assert np.ptp(truth[:, 0]) > 45.0, "both ends of the hallways"
    boxes = np.array(of.floor.plan.rooms)
    inside = np.all((truth[:, None] > boxes[:, :2]) & (truth[:, None] < boxes[:, 2:]), axis=2)
    assert inside.any(axis=0).sum() >= 4
    assert 0.0 < of.floor.in_open_room(truth).mean() < 0.2


def test_wheels_drift_as_far_as_theirs() -> None:
    ends = []
    for seed in range(9):
        rng = np.random.default_rng(seed)
        drive, duration_s = there_and_back(stops(floor_of(seed), rng), SPEED_MPS, TURN_RADPS, 1.0)
        table = wheels(drive, duration_s, rng)
        heading = np.cumsum(table["dheading_rad"])
        before = heading - table["dheading_rad"]
        c, s = np.cos(before), np.sin(before)
        x = np.sum(c * table["dx_m"] - s * table["dy_m"])
        y = np.sum(s * table["dx_m"] + c * table["dy_m"])
        ends.append((np.hypot(x, y), abs(wrap_angle(heading[-1]))))
    far, turned = np.median(ends, axis=0)
    assert 5.0 < far < 40.0
    assert 15.0 < np.rad2deg(turned) < 100.0


def test_the_laser_sees_the_floor_as_it_is_not_as_it_is_drawn(of: Lap) -> None:
    scans = of.log["scans"]
    pose = of.drive.pose_at(seconds(scans["stamp_ns"]))[::20]
    beam = -np.pi + 2.0 * np.pi / 360.0 * np.arange(360)
    angle = pose[:, 2:] + beam
    ranges = scans["ranges_m"][::20]
    end = pose[:, None, :2] + ranges[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    end = end[np.isfinite(ranges)]

    def wall_beside(cells: NDArray[np.int8], rim: int) -> float:
        row, column = (cell_of(of.floor.true, end) + rim).T
        wide = np.pad(cells, 2)
        near = [wide[row + 2 + i, column + 2 + j] == OCCUPIED
                for i in (-1, 0, 1) for j in (-1, 0, 1)]  # fmt: skip
        return float(np.any(near, axis=0).mean())

    rim = (of.floor.map.cells.shape[0] - of.floor.true.cells.shape[0]) // 2
    assert wall_beside(of.floor.true.cells, 0) > 0.99
    assert wall_beside(of.floor.map.cells, rim) < 0.95
    assert np.nanmin(scans["ranges_m"]) >= 0.2
    assert np.nanmax(scans["ranges_m"]) <= 6.0


def test_radios_are_received_near_the_master_and_err_more_behind_walls(of: Lap) -> None:
    inside, outside = [], []
    for one in (of, lap(1)):
        fixes = one.fixes
        pose = one.drive.pose_at(seconds(fixes["stamp_ns"]))
        levers = np.array([TAGS[name] for name in fixes["tag"].tolist()])
        at = np.array([point_in_world(at_once[None], tuple(lever))[0]
                       for at_once, lever in zip(pose, levers, strict=True)])  # fmt: skip
        master = np.array(next(iter(one.floor.anchors.values())))
        assert (np.linalg.norm(at - master, axis=1) <= UWB_RANGE_M).all()
        off = np.column_stack([fixes["x_m"], fixes["y_m"]]) - at[:, :2]
        in_room = one.floor.in_open_room(at[:, :2])
        inside.append(off[in_room])
        outside.append(off[~in_room])
    per_axis = np.sqrt(np.mean(np.concatenate(inside) ** 2))
    assert 0.10 < per_axis < 0.15
    assert np.sqrt(np.mean(np.concatenate(outside) ** 2)) > 2.0 * per_axis
    assert per_axis < SIGMA_RANGE_M, "five ranges are better than one"


def received(of: Lap) -> dict[tuple[int, str], set[str]]:
    """Return which anchors each tag ranges to at each stamp."""
    found: dict[tuple[int, str], set[str]] = {}
    table = of.log["ranges"]
    for stamp, tag, anchor in zip(*(table[key].tolist() for key in ("stamp_ns", "tag", "anchor")),
                                  strict=True):  # fmt: skip
        found.setdefault((stamp, tag), set()).add(anchor)
    return found


def test_walls_block_ranges_and_the_rtls_has_positions_where_it_receives_three(of: Lap) -> None:
    names = list(of.floor.anchors)
    at_all, walls = received(of), list(dict.fromkeys(of.floor.plan.walls))
    uwb_ns = np.unique([stamp for stamp, _ in at_all])
    pose = of.drive.pose_at(seconds(uwb_ns))
    for tag, lever in TAGS.items():
        at = point_in_world(pose, lever)
        within = np.linalg.norm(at - of.floor.anchors[names[0]], axis=1) <= UWB_RANGE_M
        for name in names:
            anchor = np.broadcast_to(of.floor.anchors[name][:2], (len(at), 2))
            open_to = (walls_between(at[:, :2], anchor, walls) < SILENT_WALLS) & within
            present = [name in at_all.get((stamp, tag), set()) for stamp in uwb_ns.tolist()]
            np.testing.assert_array_equal(present, open_to)
    fixes = set(zip(of.fixes["stamp_ns"].tolist(), of.fixes["tag"].tolist(), strict=True))
    assert fixes == {key for key, anchors in at_all.items() if len(anchors) >= MIN_RANGES}
    assert {len(anchors) for anchors in at_all.values()} >= {1, 5}, "some through, some not"


def test_where_anchors_are_the_radios_are_silent_in_outages_alone() -> None:
    silent_s, outage_s = 0.0, 0.0
    for seed in range(4):
        of = lap(seed)
        present = {stamp for stamp, _ in received(of)}
        stamp_ns = stamps(UWB_HZ, of.duration_s)
        inside = of.floor.in_open_room(of.drive.pose_at(seconds(stamp_ns))[:, :2])
        gone = [stamp for stamp in stamp_ns[inside].tolist() if stamp not in present]
        out = [(one.from_s or 0.0, one.to_s or 0.0)
               for one in outages(of.duration_s, np.random.default_rng([seed, 1]).spawn(6)[5])
               if one.source == "ranges"]  # fmt: skip
        for stamp in gone:
            assert any(begin <= stamp / 1e9 < end for begin, end in out), stamp
        silent_s += len(gone)
        outage_s += sum(end - begin for begin, end in out)
    assert silent_s > 0.0
    assert 0.3 < outage_s / (4 * 900.0) / (OUTAGE_S / (OUTAGE_S + OUTAGE_EVERY_S)) < 3.0


def test_a_round_trip_ends_as_it_began_and_stands() -> None:
    points = [np.array(p) for p in ([1.0, 1.0], [3.0, 1.0], [3.0, 2.0], [1.0, 1.0])]
    drive, duration_s = there_and_back(points, 0.5, 1.0, 2.0)
    length = 2.0 + 1.0 + np.sqrt(5.0)
    turns = 0.5 * np.pi + 2.0 * np.pi - 0.5 * np.pi  # all to the left, once around
    assert duration_s == pytest.approx(length / 0.5 + turns + 2.0)
    ends = drive.pose_at([0.0, duration_s - 2.0, duration_s])
    np.testing.assert_allclose(ends, [[1.0, 1.0, 0.0]] * 3, atol=1e-12)
    at = drive.pose_at(np.linspace(0.0, duration_s, 2000))[:, :2]
    assert all(np.hypot(*(at - point).T).min() < 0.01 for point in points)


def test_a_trip_that_does_not_come_back_is_no_round_trip() -> None:
    points = [np.array(p) for p in ([1.0, 1.0], [3.0, 1.0], [3.0, 2.0])]
    with pytest.raises(ValueError, match="3 points, expected three or more, the last being"):
        there_and_back(points, 0.5, 1.0, 2.0)
