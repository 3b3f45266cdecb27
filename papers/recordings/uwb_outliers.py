# SPDX-License-Identifier: Apache-2.0
"""What real outliers cost: recorded ranges as they are, and without what truth says is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.load import load_config
from locfuse.config.schema import Dataset
from locfuse.run.run import run
from locfuse.types import NANOSECONDS, ConfigError, FloatArray, Log, LogError
from papers.claims import Claim, Progress, absent, claim_of, claims_of
from papers.recorded import DATA
from papers.recordings.uwb_3d import (
    RECORDINGS,
    Flight,
    Recording,
    errors_of,
    filter_config,
    load_flight,
    localize,
    true_at,
)
from papers.scores import rms

OUTLIER_M = 0.5  # from the median of its anchor: what the notes of the drone call gross
FINE_M = 0.3  # the same, stricter: three sigma of the filter's default
LARGEST_RATIO = 1.1
OFFICE_M = 0.13
ROOM_M, YARD_M = 3.0, 5.0  # half the width of where bodies move
GROUND_SIGMA_M = 0.1
ALTIMETER_SIGMA_M = 0.1

Heights = Callable[[Log, int], Sequence[_core.Altitude]]


@dataclass(frozen=True)
class Case:
    """A recording, and what is known of heights beside its ranges.

    Attributes
    ----------
    recording : Recording
    heights : callable
        From log and seed.
    drawn : bool
        Whether the seed makes a difference.
    observable : bool
        Whether these measurements determine the position.
    lost_m : float
        Who errs by more is lost [m].
    """

    recording: Recording
    heights: Heights = lambda log, seed: ()
    drawn: bool = False
    observable: bool = True
    lost_m: float = ROOM_M


@dataclass(frozen=True)
class Flights:
    """One recording localized three times, at the same stamps.

    Attributes
    ----------
    off : float64 array, shape (ranges,)
        Error of each range less the median of its anchor [m]; NaN where truth is not known.
    whole, clean : Flight
        By all ranges, and by those that are not outliers.
    gated : Flight
        By all ranges, Gaussian and behind a gate.
    """

    off: FloatArray
    whole: Flight
    clean: Flight
    gated: Flight


def robust_config() -> _core.AirEkfConfig:
    """Return the settings, the same for all: noise of ranges is Cauchy, and no gate."""
    config = filter_config()
    config.range.noise = _core.NoiseKind.CAUCHY
    config.range.gate = 1.0
    return config


def ground_heights(log: Log, seed: int) -> list[_core.Altitude]:
    """Return a height of zero every second, for what drives."""
    stamps = log["ranges"]["stamp_ns"]
    return [
        _core.Altitude(stamp, 0.0, GROUND_SIGMA_M)
        for stamp in range(int(stamps.min()), int(stamps.max()), NANOSECONDS)
    ]


def altimeter(log: Log, seed: int) -> list[_core.Altitude]:
    """Return five altitudes a second of a simulated altimeter: true heights with white noise."""
    stamps = log["ranges"]["stamp_ns"]
    ticks = np.arange(stamps.min(), stamps.max(), NANOSECONDS // 5)
    place, _, inside = true_at(log, ticks)
    noise = ALTIMETER_SIGMA_M * np.random.default_rng(seed).standard_normal(len(place))
    return [
        _core.Altitude(int(stamp), float(height), ALTIMETER_SIGMA_M)
        for stamp, height in zip(ticks[inside], place[:, 2] + noise, strict=True)
    ]


def _cases() -> dict[str, Case]:
    """Return what flies or is carried, drones once more with an altimeter, and what drives."""
    cases = {
        name: Case(recording, observable=name not in ("drone seq1", "drone seq5"))
        for name, recording in RECORDINGS.items()
    }
    for name in ("drone seq1", "drone seq3", "drone seq5"):
        recording = RECORDINGS[name]
        cases[f"{name} with altimeter"] = Case(recording, altimeter, drawn=True)
    for name in ("los_a1", "los_b3", "nlos_a1", "nlos_b3"):
        recording = Recording("hanyang_outdoor", "hanyang-outdoor", name, (0.0, 0.0))
        cases[f"yard {name}"] = Case(recording, ground_heights, lost_m=YARD_M)
    return cases


CASES = _cases()


def outlier_claims(seeds: int, progress: Progress, configs: Path | None) -> list[Claim]:
    """Return all rows; recordings lie beside the project, whose ready configurations are given."""
    flights = [partial(_rows, configs, name, seeds) for name in CASES]
    return claims_of([*flights, partial(_office, configs)], progress)


def range_errors(log: Log) -> FloatArray:
    """Return range minus distance in space, less the median over its anchor.

    Returns
    -------
    float64 array, shape (ranges,)
        Metres; NaN where truth is not known.
    """
    ranges, anchors = log["ranges"], log["anchors"]
    stamps, which = np.unique(ranges["stamp_ns"], return_inverse=True)
    place, heading, inside = true_at(log, stamps)
    pose = np.full((len(stamps), 4), np.nan)
    pose[inside] = np.column_stack([place, heading])
    x, y, z, turned = pose[which].T
    forward, left, up = np.array([log.tags[str(tag)] for tag in ranges["tag"]]).T
    c, s = np.cos(turned), np.sin(turned)
    tag = np.column_stack([x + c * forward - s * left, y + s * forward + c * left, z + up])
    off: FloatArray = np.full(len(tag), np.nan)
    for row, name in enumerate(anchors["anchor"]):
        its = ranges["anchor"] == name
        anchor = [anchors[f"{axis}_m"][row] for axis in "xyz"]
        off[its] = ranges["range_m"][its] - np.linalg.norm(tag[its] - anchor, axis=1)
        off[its] -= np.nanmedian(off[its])
    return off


def fly(
    case: Case, log: Log, seed: int, config: _core.AirEkfConfig, outlier_m: float = OUTLIER_M
) -> Flights:
    """Localize by all ranges, and by those that are less than `outlier_m` off their median."""
    off = range_errors(log)
    good: NDArray[np.bool_] = ~(np.abs(off) > outlier_m)
    offset, heights = float(np.mean(case.recording.long)), case.heights(log, seed)
    return Flights(
        off,
        localize(log, offset, config, heights),
        localize(log, offset, config, heights, kept=good),
        localize(log, offset, filter_config(), heights),
    )


def distances(flight: Flight, log: Log) -> FloatArray:
    """Return how far a flight is from truth, where that is known [m]."""
    lengths: FloatArray = np.linalg.norm(errors_of(flight, log)[0], axis=1)
    return lengths


def _rows(configs: Path | None, name: str, seeds: int) -> Iterator[Claim]:
    case = CASES[name]
    key, what = f"outliers_{name.replace(' ', '_')}", f"{name} (real): "
    try:
        log = load_flight(configs, case.recording)
    except LogError as missing:
        yield absent(key, f"{what}RMSE, all ranges / without outliers", str(missing))
        return
    drawn = range(seeds if case.drawn else 1)
    flown = [fly(case, log, seed, robust_config()) for seed in drawn]
    fine = [fly(case, log, seed, robust_config(), FINE_M).clean for seed in drawn]
    whole, clean, sharp, gated = (
        np.array([rms(errors_of(flight, log)[0]) for flight in flights])
        for flights in (
            [f.whole for f in flown],
            [f.clean for f in flown],
            fine,
            [f.gated for f in flown],
        )
    )
    share = 100.0 * float(np.mean(np.abs(flown[0].off) > OUTLIER_M))
    largest = [float(distances(f.whole, log).max()) for f in flown]
    yield claim_of(f"{key}_share", f"{what}outliers", "%", None, [share], "-", _any)
    yield claim_of(f"{key}_rmse", f"{what}RMSE, all ranges", "m", None, whole, "-", _any)
    yield claim_of(f"{key}_clean", f"{what}RMSE, no outliers", "m", None, clean, "-", _any)
    yield claim_of(f"{key}_ratio", f"{what}RMSE, all / no outliers", "1", None, whole / clean,
                   f"<= {LARGEST_RATIO:g}", lambda v: v <= LARGEST_RATIO)  # fmt: skip
    yield claim_of(f"{key}_fine", f"{what}the same, outliers from {FINE_M:g} m", "1", None,
                   whole / sharp, "-", _any)  # fmt: skip
    yield claim_of(f"{key}_gate", f"{what}RMSE, all, a gate instead", "m", None, gated, "-", _any)
    yield claim_of(f"{key}_largest", f"{what}largest error", "m", None, largest,
                   f"<= {case.lost_m:g}" if case.observable else "-",
                   lambda v: v <= case.lost_m or not case.observable,
                   "" if case.observable else "its ranges do not determine it")  # fmt: skip


def _office(configs: Path | None) -> Iterator[Claim]:
    """Return the row of a robot on wheels among beacons of which one is wrong for long."""
    key, what = "outliers_office", "office (real), a beacon wrong for long: RMSE"
    try:
        if configs is None:
            raise LogError("no examples/configs here")
        log = Dataset(dataset="mrpt_office", path=f"{DATA}/mrpt-uwb-lidar")
        config = load_config(configs / "mrpt_office.yaml").model_copy(update={"log": log})
        result = run(config, base=configs)
    except (ConfigError, LogError) as missing:
        yield absent(key, what, str(missing))
        return
    yield claim_of(key, what, "m", None, [result.metrics["position_rmse_m"]],
                   f"<= {OFFICE_M:g}", lambda v: v <= OFFICE_M)  # fmt: skip


def _any(value: float) -> bool:
    return True
