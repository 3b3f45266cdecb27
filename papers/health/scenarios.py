# SPDX-License-Identifier: Apache-2.0
"""Faults of a robot that is localized by ranges: simulated drives of five minutes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import errors_against
from locfuse.run.run import run
from locfuse.sim.scenario import simulate
from locfuse.types import NANOSECONDS, Columns, FloatArray, Health, Log, RunResult

DURATION_S = 300.0
ANCHORS = {"SW": [0.0, 0.0, 0.0], "SE": [10.0, 0.0, 0.0], "NE": [10.0, 10.0, 0.0],
           "NW": [0.0, 10.0, 0.0], "S": [4.0, 0.0, 0.0], "E": [10.0, 6.0, 0.0]}  # fmt: skip
WALLS = [[3.0, 6.0, 7.0, 6.0], [6.0, 2.0, 6.0, 4.5]]
LIMIT_M = 1.0  # farther off is lost

Scenario = Callable[[int], tuple[RunConfig, Log]]  # of a seed
SLIPS = {"kind": "slip_episodes", "every_s": 30.0, "lasting_s": 1.0, "translation_factor": 2.0,
         "turn_radps": 0.3}  # fmt: skip
WHEELS = {  # those of the simulation
    "sigma_longitudinal_per_sqrt_m": 0.03,
    "sigma_lateral_per_sqrt_m": 0.01,
    "sigma_heading_per_sqrt_m": 0.02,
    "sigma_heading_per_sqrt_rad": 0.03,
}
# E[T^2] = 2 of lengths T with mean 1, over 30 s.
SLIP_NOISE = {"sigma_heading_per_sqrt_s": 0.3 * np.sqrt(2.0 / 30.0),
              "sigma_xy_per_sqrt_s": 0.22 * np.sqrt(2.0 / 30.0)}  # fmt: skip


@dataclass(frozen=True)
class Drive:
    """One drive, and what was said of it.

    Attributes
    ----------
    health : Health
    error : float64 array, shape (n, 3)
        Of x, y (metres) and heading (radians) at the stamps of `health`.
    """

    health: Health
    error: FloatArray

    @property
    def distance(self) -> FloatArray:
        """Return the position errors, metres."""
        distance: FloatArray = np.hypot(self.error[:, 0], self.error[:, 1])
        return distance


def config_of(duration_s: float = DURATION_S, **simulation: Any) -> RunConfig:
    """Return a room with six anchors, odometry, ranges and what else is asked for."""
    return parse_config(
        {
            "simulation": {
                "anchors": ANCHORS,
                "path": {"shape": "waypoints"},
                "duration_s": duration_s,
                "poses": None,
                "ranges": {"rate_hz": 5.0, "sigma_m": 0.1, "sigma_relative": 0.0},
                **simulation,
            },
            "estimator": {  # as simulated
                "odometry": WHEELS,
                "range": {"sigma_m": 0.1},
                "correlation_s": 0,
            },
        }
    )


def drive(name: str, seed: int, risk: float = 0.01) -> Drive:
    """Drive a scenario of `SCENARIOS`, with protection levels of some risk."""
    return drive_in(SCENARIOS[name], seed, risk)


def drive_in(scenario: Scenario, seed: int, risk: float) -> Drive:
    """Drive any scenario, with protection levels of some risk."""
    config, log = scenario(seed)
    health = config.health.model_copy(update={"risk": risk, "limit_m": LIMIT_M})
    return drive_of(run(config.model_copy(update={"health": health}), log))


def drive_of(result: RunResult) -> Drive:
    """Return what a run says of itself, and how right it is."""
    assert result.health is not None
    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)
    assert errors.heading is not None
    health = result.health
    row = np.searchsorted(errors.stamp_ns, health.stamp_ns, side="right") - 1
    known = row >= 0
    error = np.column_stack([errors.position, errors.heading])[row[known]]
    return Drive(rows_of_health(health, known), error)


def rows_of_health(health: Health, kept: NDArray[np.bool_]) -> Health:
    """Return the rows of a health, or of watched poses, that are kept."""
    columns = {field.name: getattr(health, field.name)[kept] for field in fields(health)}
    return replace(health, **columns)


def simulated(config: RunConfig, seed: int) -> Log:
    """Return the log of a simulated drive."""
    assert config.simulation is not None
    return simulate(config.simulation, np.random.default_rng(seed))


def drives_of(config_of: Callable[[int], RunConfig]) -> Scenario:
    """Return the scenario of a configuration for each seed."""

    def scenario(seed: int) -> tuple[RunConfig, Log]:
        config = config_of(seed)
        return config, simulated(config, seed)

    return scenario


def _with_faults(*faults: dict[str, Any]) -> Scenario:
    return drives_of(lambda _: config_of(faults=list(faults)))


def with_slip_noise(config: RunConfig) -> RunConfig:
    """Return a configuration whose odometry has a noise of the same variance as `SLIPS`."""
    odometry = config.estimator.odometry.model_copy(update=SLIP_NOISE)
    estimator = config.estimator.model_copy(update={"odometry": odometry})
    return config.model_copy(update={"estimator": estimator})


def carried_off(config_of: Callable[[int], RunConfig], *tables: str) -> Scenario:
    """Carry the robot off in mid-drive, to anywhere at least 2 m away, where `tables` go on."""

    def scenario(seed: int) -> tuple[RunConfig, Log]:
        config = config_of(seed)
        before, other = simulated(config, seed), seed
        cut = int(before["truth"]["stamp_ns"][0]) + round(0.5 * DURATION_S * NANOSECONDS)
        while True:
            other += 100_000
            after = simulated(config, other)
            if np.hypot(*(_place_at(after, cut) - _place_at(before, cut))) >= 2.0:
                return config, _joined(before, after, cut, tables)

    return scenario


def _place_at(log: Log, stamp: int) -> FloatArray:
    truth = log["truth"]
    row = int(np.searchsorted(truth["stamp_ns"], stamp))
    place: FloatArray = np.array([truth["x_m"][row], truth["y_m"][row]])
    return place


def _joined(before: Log, after: Log, cut: int, tables: Sequence[str]) -> Log:
    def rows(stem: str) -> Columns:
        early = before[stem]["stamp_ns"] <= cut
        late = after[stem]["stamp_ns"] > cut
        return {name: np.concatenate([values[early], after[stem][name][late]])
                for name, values in before[stem].items()}  # fmt: skip

    return replace(before, tables={**before.tables, **{stem: rows(stem) for stem in tables}})


def _moved_anchor(seed: int) -> tuple[RunConfig, Log]:
    """Move an anchor by 1.5 m after half a minute, which the map does not show."""
    config = config_of()
    log = simulated(config, seed)
    moved = simulated(config_of(anchors={**ANCHORS, "NE": [9.0, 8.9, 0.0]}), seed)
    begin = log["truth"]["stamp_ns"][0] + 30 * NANOSECONDS
    ranges = dict(log["ranges"])
    ranges["range_m"] = np.where((ranges["anchor"] == "NE") & (ranges["stamp_ns"] > begin),
                                 moved["ranges"]["range_m"], ranges["range_m"])  # fmt: skip
    return config, replace(log, tables={**log.tables, "ranges": ranges})


def _swapped_anchors(seed: int) -> tuple[RunConfig, Log]:
    """Swap the names of any two anchors in the map."""
    config = config_of()
    log = simulated(config, seed)
    anchors = dict(log["anchors"])
    names = anchors["anchor"].copy()
    first, second = np.random.default_rng([seed, 2]).choice(len(names), 2, replace=False)
    names[[first, second]] = names[[second, first]]
    return config, replace(log, tables={**log.tables, "anchors": {**anchors, "anchor": names}})


SCENARIOS: dict[str, Scenario] = {
    "clean": _with_faults(),
    "walls that lengthen ranges": _with_faults(
        {"kind": "nlos", "walls": WALLS, "extra_m": 1.0, "sigma_m": 0.5}
    ),
    "outliers": _with_faults({"kind": "outliers", "probability": 0.05, "magnitude_m": 5.0}),
    "an anchor moved": _moved_anchor,
    "two anchors swapped": _swapped_anchors,
    "wheels slip, and it is known": drives_of(
        lambda _: with_slip_noise(config_of(faults=[SLIPS]))
    ),
    "wheels slip, and nobody knows": _with_faults(SLIPS),
    "blackout": _with_faults({"kind": "dropouts", "from_s": 140.0, "to_s": 160.0}),
    "kidnapped": carried_off(lambda _: config_of(), "odometry", "ranges", "truth"),
}  # fmt: skip
