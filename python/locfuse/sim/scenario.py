# SPDX-License-Identifier: Apache-2.0
"""From a scenario to a log: drive, sense, break."""

from __future__ import annotations

import numpy as np

from locfuse.config.scenario import Scenario
from locfuse.sim import sensors
from locfuse.sim.faults import World, with_faults
from locfuse.sim.trajectory import plan
from locfuse.types import Columns, Log


def simulate(scenario: Scenario, rng: np.random.Generator) -> Log:
    """Return the log of a simulated drive.

    Path, odometry, ranges, poses, positions and faults draw from children of `rng`, always spawned
    in that order: switching one off changes no bit of the others.

    Parameters
    ----------
    scenario : Scenario
    rng : numpy Generator
        Spawns the children, so a second call with the same one gives another drive; equal fresh
        generators give equal bits.

    Returns
    -------
    Log
        With tables ``odometry``, ``ranges``, ``poses``, ``positions`` (those that are switched on),
        ``truth`` at every stamp of any of them, dropped out or not, and ``anchors``.

    Examples
    --------
    >>> log = simulate(Scenario(duration_s=1.0), np.random.default_rng(7))
    >>> len(log["ranges"]["range_m"])  # 5 anchors, 6 epochs
    30
    """
    for_path, for_odometry, for_ranges, for_poses, for_positions, for_faults = rng.spawn(6)
    drive = plan(scenario.path, scenario.room_m, scenario.duration_s, for_path)
    epochs = {
        name: sensors.stamps(sensor.rate_hz, scenario.duration_s)
        for name, sensor in (
            ("odometry", scenario.odometry),
            ("ranges", scenario.ranges),
            ("poses", scenario.poses),
            ("positions", scenario.positions),
        )
        if sensor is not None
    }
    heard: dict[str, Columns] = {}
    if scenario.odometry is not None:
        heard["odometry"] = sensors.odometry(
            drive, epochs["odometry"], scenario.odometry, for_odometry
        )
    if scenario.ranges is not None:
        heard["ranges"] = sensors.ranges(
            drive, epochs["ranges"], scenario.tags, scenario.anchors, scenario.ranges, for_ranges
        )
    if scenario.poses is not None:
        heard["poses"] = sensors.poses(drive, epochs["poses"], scenario.poses, for_poses)
    if scenario.positions is not None:
        heard["positions"] = sensors.positions(
            drive, epochs["positions"], scenario.positions, for_positions
        )
    odometry_ns = epochs.get("odometry", np.empty(0, np.int64))
    world = World(drive, scenario.tags, scenario.anchors, odometry_ns)
    tables = with_faults(heard, scenario.faults, world, for_faults)
    tables["truth"] = sensors.truth(drive, np.unique(np.concatenate(list(epochs.values()))))
    if scenario.anchors:
        at = np.array(list(scenario.anchors.values()), dtype=np.float64)
        tables["anchors"] = {
            "anchor": np.array(list(scenario.anchors)),
            "x_m": at[:, 0],
            "y_m": at[:, 1],
            "z_m": at[:, 2],
        }
    return Log(
        tables=tables,
        tags=dict(scenario.tags),
        description=f"Simulated: {scenario.path.shape}, {scenario.duration_s:g} s",
    )
