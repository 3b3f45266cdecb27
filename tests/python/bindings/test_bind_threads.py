# SPDX-License-Identifier: Apache-2.0
"""Objects that several threads of Python use: each call is whole, whatever others do."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np

import locfuse.core as lf

ANGLES = np.linspace(-3.1, 3.1, 180)


def make_room() -> tuple[lf.OccupancyGrid, lf.LaserGeometry, np.ndarray]:
    """Return a room of 8 x 6 m, a laser and what it sees there."""
    cells = np.zeros((120, 160), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    grid = lf.OccupancyGrid(cells, 0.05)
    step = ANGLES[1] - ANGLES[0]
    seen = lf.RayCaster(grid).scan(lf.Pose2(2, 2, 0.3), ANGLES[0], step, len(ANGLES))
    return grid, lf.LaserGeometry(lf.Pose2(), ANGLES[0], step, 0.1, 10.0), seen


def make_mcl() -> tuple[lf.Mcl, lf.LaserGeometry, np.ndarray]:
    """Return particles that read every scan."""
    grid, geometry, seen = make_room()
    config = lf.MclConfig()
    config.spacing_m = 0.0
    return lf.Mcl(config, lf.World(grid=grid)), geometry, seen


def test_others_wait_until_particles_have_been_weighed_and_whoever_is_called_back_does_not() -> (
    None
):
    estimator, geometry, seen = make_mcl()
    mcl = lf.LiveMcl(estimator)
    scans = [lf.LaserScan(k * 10**8, geometry, seen) for k in range(1, 4)]
    began = threading.Event()
    read: list[Any] = []

    def look() -> None:
        began.set()
        read.append(mcl.estimate().stamp)

    other = threading.Thread(target=look)
    waited: list[bool] = []

    def progress(done: int, _run: object) -> None:
        assert mcl.estimate().stamp == done * 10**8
        if done == 1:
            other.start()
            began.wait()
        else:
            time.sleep(0.05)
            waited.append(not read)

    lf.localize(mcl, lf.MessageLog(), scans, progress=progress)
    other.join()
    assert waited == [True, True]
    assert read == [3 * 10**8]


def read_while_it_changes(change: Any, looks: tuple[Any, ...]) -> int:
    """Change an object in two threads and look at it for a second; return how often it was seen."""
    ends = time.monotonic() + 1.0

    def feed() -> None:
        while time.monotonic() < ends:
            change()

    threads = [threading.Thread(target=feed) for _ in range(2)]
    for thread in threads:
        thread.start()
    count = 0
    while time.monotonic() < ends:
        for look in looks:
            look()
        count += 1
    for thread in threads:
        thread.join()
    return count


def test_particles_are_read_while_other_threads_weigh_them() -> None:
    mcl, geometry, seen = make_mcl()
    stamps = iter(range(10**6, 10**12, 10**6))
    count = read_while_it_changes(
        lambda: mcl.on(lf.LaserScan(next(stamps), geometry, seen)),
        (lambda: mcl.hypotheses, lambda: mcl.particles, mcl.estimate, mcl.health),
    )
    assert count > 1


def test_a_pose_is_read_while_other_threads_tell_of_it() -> None:
    live = lf.Live(lf.RecoveringEkf(lf.RecoveringEkfConfig(), lf.World()))
    live.start_at(lf.PoseEstimate(0, lf.Pose2(1, 2, 0), 0.01 * np.eye(3)))
    stamps = iter(range(10**6, 10**12, 10**6))

    def feed() -> None:
        stamp = next(stamps)
        live.on(lf.Velocity(stamp, 0.1, 0.05))
        live.on(lf.PositionFix(stamp, [1.0, 2.0], 0.01 * np.eye(2)))

    count = read_while_it_changes(feed, (live.current, live.estimate, live.health))
    assert count > 1
