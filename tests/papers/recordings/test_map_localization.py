# SPDX-License-Identifier: Apache-2.0
"""Rows of localization on maps: what is counted is what is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.run.mcl import localize
from locfuse.run.messages import truth_of
from locfuse.types import Trajectory
from papers.recordings import map_localization


def line(offset_m: float, turn: float = 0.0) -> Trajectory:
    stamp = np.arange(0, 11, dtype=np.int64) * 1_000_000_000
    position = np.column_stack([np.arange(11.0) + offset_m, np.zeros(11)])
    return Trajectory(stamp, position, np.full(11, turn))


def test_a_place_is_right_within_half_a_metre_and_twenty_degrees() -> None:
    for offset, turn, expected in ((0.4, 0.3, True), (0.6, 0.0, False), (0.0, 0.4, False)):
        good, gone = map_localization.right(line(offset, turn), line(0.0))
        assert good.all() == expected
        assert not expected or np.allclose(gone, np.arange(11.0))


def test_a_log_can_begin_later() -> None:
    _, log = map_localization.simulated(0)
    stamp = int(log["scans"]["stamp_ns"][50])
    part = map_localization.excerpt(log, lambda stamps: stamps >= stamp)
    assert int(part["scans"]["stamp_ns"][0]) == stamp
    assert len(part["scans"]["ranges_m"]) == len(log["scans"]["ranges_m"]) - 50
    assert int(part["odometry"]["stamp_ns"][0]) >= stamp


def test_a_simulated_floor_is_tracked_to_centimetres_and_with_one_beam_it_is_not() -> None:
    config, log = map_localization.simulated(3)
    truth = truth_of(log)
    assert truth is not None
    good, _ = map_localization.right(
        localize(config, log, start=map_localization.drawn(log, 3)).estimate, truth
    )
    assert good.all()
    assert config.mcl is not None
    blind = config.model_copy(update={"mcl": config.mcl.model_copy(update={"beams": 1})})
    lost, _ = map_localization.right(
        localize(blind, log, start=map_localization.drawn(log, 3)).estimate, truth
    )
    assert not lost.all()


def test_recordings_that_are_not_there_are_rows_that_say_so(tmp_path: Path) -> None:
    rows = [
        *map_localization._tracked(tmp_path, "TurtleBot 4", 1),
        *map_localization._intel(tmp_path),
        *map_localization._found(tmp_path, "Wean Hall 1"),
        *map_localization._fused(tmp_path, "Gazebo run3", 1),
    ]
    assert len(rows) == 4
    assert all(row.met is None and row.note for row in rows)
