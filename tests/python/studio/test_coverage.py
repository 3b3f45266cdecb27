# SPDX-License-Identifier: Apache-2.0
"""The coverage is that of `locfuse check`, walls block, and it keeps up with a mouse."""

from __future__ import annotations

import json
import struct
import time

import numpy as np

from locfuse.check import check
from locfuse.config.load import parse_config
from locfuse.config.scenario import Scenario
from locfuse.studio.coverage import BEST, Floor, coverage, floor_of, packed
from locfuse.types import FREE, UNKNOWN, GridMap

ROOM = Scenario()
HIGH = {"A1": (0.0, 0.0, 2.5), "A2": (10.0, 0.0, 2.0), "A3": (4.0, 9.0, 3.0)}


def test_the_dilution_is_that_of_check() -> None:
    simulation = {"anchors": {name: list(at) for name, at in HIGH.items()}, "duration_s": 2.0}
    layout = check(parse_config({"simulation": simulation})).layout
    assert layout is not None
    step = float(layout.x[1] - layout.x[0])
    floor = Floor((0.0, 0.0), step, len(layout.x), len(layout.y), layout.height)

    found = coverage(HIGH, [], floor)

    np.testing.assert_allclose(found.hdop, np.minimum(layout.hdop, 20.0), rtol=1e-6)
    assert np.all(found.seen == 3)


def test_the_floor_of_the_room_is_looked_at_every_5_cm() -> None:
    floor = floor_of(ROOM, None)

    assert (floor.columns, floor.rows, floor.step_m) == (201, 201, 0.05)
    expected = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.05], [10.0, 10.0]])
    np.testing.assert_allclose(floor.points()[[0, 1, 201, -1]], expected, atol=1e-12)


def test_of_a_hall_the_cells_are_larger_and_not_more() -> None:
    floor = floor_of(Scenario(room_m=(300.0, 200.0)), None)

    assert floor.columns * floor.rows < 65_000
    np.testing.assert_allclose(floor.points()[-1], [300.0, 200.0], atol=2.0 * floor.step_m)


def test_a_wall_hides_an_anchor_from_what_lies_behind_it() -> None:
    floor = Floor((0.0, 0.0), 1.0, 11, 11, 0.0)
    wall = (2.0, 4.5, 8.0, 4.5)

    seen = coverage(ROOM.anchors, [wall], floor).seen
    clear = coverage(ROOM.anchors, [], floor)

    assert seen[5, 5] == 3 - 1  # of the southern anchors none, of the northern ones both
    assert seen[1, 5] == 5 - 2
    assert seen[0, 0] == 5 - 1  # across the room
    assert seen[5, 0] == 5  # past the end of the wall
    behind = coverage(ROOM.anchors, [wall], floor)
    assert behind.hdop[5, 5] > clear.hdop[5, 5]
    without = {name: at for name, at in ROOM.anchors.items() if name in ("A3", "A4")}
    np.testing.assert_allclose(behind.hdop[5, 5], coverage(without, [], floor).hdop[5, 5])


def test_there_is_no_floor_where_the_map_knows_nothing() -> None:
    cells = np.full((100, 100), FREE, np.int8)
    cells[:, 50:] = UNKNOWN
    grid = GridMap(cells, 0.1)
    floor = Floor((0.0, 0.0), 0.5, 20, 20, 0.0)

    found = coverage(ROOM.anchors, [], floor, grid)

    assert np.all(np.isnan(found.hdop[:, 14:]))
    assert np.all(np.isfinite(found.hdop[1:-1, 1:7]))


def test_what_is_packed_is_what_was_found() -> None:
    found = coverage({"A1": (0, 0, 0), "A2": (10, 0, 0)}, [], floor_of(ROOM, None))

    data = packed(found)

    (length,) = struct.unpack_from("<I", data)
    head = json.loads(data[4 : 4 + length])
    cells = head["columns"] * head["rows"]
    assert length % 4 == 0
    assert len(data) == 4 + length + 2 * cells
    level = np.frombuffer(data, np.uint8, cells, 4 + length).reshape(head["rows"], head["columns"])
    seen = np.frombuffer(data, np.uint8, cells, 4 + length + cells)
    assert np.all(seen == 2)
    known = level < 255
    dop = head["best"] * (head["none"] / head["best"]) ** ((level - 0.5) / 253.0)
    np.testing.assert_allclose(dop[known], found.hdop[known], rtol=0.01)
    assert np.all(found.hdop[~known] == 20.0)
    assert not known[0].any()  # between the two, ranges have no information across
    assert head["worst"] == 20.0
    assert found.hdop.min() > BEST


def test_a_moved_anchor_gives_what_all_anew_would_give() -> None:
    floor = floor_of(ROOM, None)
    moved = {**ROOM.anchors, "A5": (3.0, 4.0, 0.0)}
    coverage(ROOM.anchors, [], floor)

    other_height = Floor(floor.low, floor.step_m, floor.columns, floor.rows, 1e-12)
    np.testing.assert_allclose(coverage(moved, [], floor).hdop,
                               coverage(moved, [], other_height).hdop, rtol=1e-9)  # fmt: skip
    assert not np.allclose(coverage(moved, [], floor).hdop, coverage(ROOM.anchors, [], floor).hdop)


def test_a_moving_anchor_is_followed_in_a_few_milliseconds() -> None:
    floor = floor_of(ROOM, None)
    walls = [(4.0, 4.0, 6.0, 4.0)]
    took = []
    for step in range(12):
        moved = {**ROOM.anchors, "A5": (5.0 + 0.1 * step, 1.0, 0.0)}
        began = time.perf_counter()
        packed(coverage(moved, walls, floor))
        took.append(time.perf_counter() - began)

    assert min(took[1:]) < 0.02  # of 100 ms from the mouse to the picture
