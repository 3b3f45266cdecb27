# SPDX-License-Identifier: Apache-2.0
"""Honesty on recordings: errors as large as the run says, and a health that knows of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from locfuse.config.load import load_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import errors_against
from locfuse.eval.verdicts import series_of
from locfuse.run.run import load_log, run
from locfuse.types import NANOSECONDS, Log, LogError, RunResult
from papers.claims import Claim, Progress, absent, claims_of
from papers.recorded import load_recording
from papers.recordings import landmark_localization, map_localization

NEES_BAND = (2.0, 5.0)  # of 3; of 2 without headings two thirds of it
MAX_BEYOND = 1.5  # % of the time beyond the protection level, whose risk is 1 %
MAX_SURE = 1.0  # % of the time `ok` with an error beyond 3 sigma
MAX_SURE_S = 3.0  # of it in one piece
MAX_RATIO = 1.02  # of the error of fused particles to theirs alone
GAP_NS = 2 * NANOSECONDS  # a pose does not stand for longer
READY = ("ieu_gazebo", "mrpt_office", "plaza", "tuc_labyrinth", "lias_triangle", "starloc_rig")
IN_SPACE = {  # dataset and folder
    "yard": ("hanyang_outdoor", "hanyang-outdoor"),
    "drone 1": ("rcv_uwb_drone", "rcv-uwb-drone"),
    "inrol": ("inrol_uwb_imu", "inrol-uwb-imu"),
}


@dataclass(frozen=True)
class Honesty:
    """How honest a run was.

    Attributes
    ----------
    nees : float
        Mean over the run of `dof` components.
    dof : int
        3, or 2 where the reference has no headings.
    beyond, sure : float
        Share of the time in which an error exceeds its protection level, and in which health says
        ``ok`` while an error exceeds 3 sigma, %.
    longest_s : float
        The longest that the latter lasts.
    """

    nees: float
    dof: int
    beyond: float
    sure: float
    longest_s: float


def honesty(result: RunResult) -> Honesty:
    """Compare a run with its reference."""
    assert result.truth is not None
    assert result.health is not None
    errors = errors_against(result.estimate, result.truth)
    assert errors.nees is not None
    assert errors.sigma is not None
    parts = [errors.position] if errors.heading is None else [errors.position,
                                                              errors.heading[:, None]]  # fmt: skip
    off = np.abs(np.hstack(parts))
    dof = off.shape[1]
    row = np.searchsorted(result.health.stamp_ns, errors.stamp_ns, side="right") - 1
    row = np.maximum(row, 0)
    lasts = np.minimum(np.diff(errors.stamp_ns, append=errors.stamp_ns[-1]), GAP_NS) / NANOSECONDS
    beyond = (off > result.health.protection[row, :dof]).any(axis=1)
    is_ok = result.health.state[row] == "ok"
    sure = (off > 3.0 * errors.sigma[:, :dof]).any(axis=1) & is_ok
    longest = max((float(lasts[a:b].sum()) for a, b in series_of(sure)), default=0.0)
    total = float(lasts.sum())
    return Honesty(float(np.mean(errors.nees)), dof, 100.0 * float(lasts @ beyond) / total,
                   100.0 * float(lasts @ sure) / total, longest)  # fmt: skip


def recorded_claims(progress: Progress, configs: Path | None) -> list[Claim]:
    """Return four rows for each recording: with its own settings, and with the defaults.

    A fifth compares particles whose poses the EKF fuses with the same particles alone.
    """
    if configs is None:
        return []
    parts = [partial(_rows, name, load) for name, load in _runs(configs).items()]
    parts += [partial(_ratio, configs, name) for name in map_localization.RECORDINGS]
    return claims_of(parts, progress)


def _runs(configs: Path) -> Mapping[str, Callable[[], tuple[RunConfig, Log]]]:
    landmarks, maps = landmark_localization.RECORDINGS, map_localization.RECORDINGS
    return {
        **{name: partial(_ready, configs, name) for name in READY},
        **{f"{name}, defaults": partial(_with_defaults, configs, name) for name in READY},
        **{f"{name}, in space, defaults":
           partial(load_recording, configs, *origin, estimator={"kind": "air"})
           for name, origin in IN_SPACE.items()},
        **{f"{name}, named landmarks": partial(landmark_localization.recorded, configs, name)
           for name in landmarks},
        **{f"{name}, mapping": partial(landmark_localization.mapped, configs, name)
           for name in landmarks},
        **{f"{name}, defaults": partial(load_recording, configs, *landmarks[name][:3])
           for name in landmarks},
        **{f"{name}, particles": partial(on_map, configs, name) for name in maps},
        **{f"{name}, particles, defaults": partial(on_map, configs, name, estimator={}, mcl={})
           for name in maps},
        **{f"{name}, particles in the EKF":
           partial(on_map, configs, name, estimator={}, mcl={"poses_hz": 2},
                   use=["odometry", "poses"])
           for name in maps},
    }  # fmt: skip


def _ready(configs: Path, name: str) -> tuple[RunConfig, Log]:
    config = load_config(configs / f"{name}.yaml")
    return config, load_log(config, configs, config.seed)


def _with_defaults(configs: Path, name: str) -> tuple[RunConfig, Log]:
    """Return the same without what it says of the estimator, but its kind."""
    config, log = _ready(configs, name)
    kind = type(config.estimator)(kind=config.estimator.kind)
    return config.model_copy(update={"estimator": kind}), log


def on_map(configs: Path, name: str, **keys: Any) -> tuple[RunConfig, Log]:
    """Return a run by particles, with a reference that lies where the map does."""
    config, log = map_localization.recorded(configs, name, **keys)
    moved = map_localization.ON_ITS_MAP.get(name)
    return config, moved(log) if moved else log


def _rows(name: str, load: Callable[[], tuple[RunConfig, Log]]) -> Iterator[Claim]:
    key = name.lower().replace(",", "").replace(" ", "_")
    try:
        config, log = load()
    except LogError as error:
        yield absent(f"{key}_nees", f"{name}: NEES", str(error))
        return
    found = honesty(run(config, log))
    low, high = (limit * found.dof / 3.0 for limit in NEES_BAND)
    for which, what, unit, value, most in (
        ("beyond", "time beyond the protection level of risk 1 %", "%", found.beyond, MAX_BEYOND),
        ("sure", "time ok while beyond 3 sigma", "%", found.sure, MAX_SURE),
        ("longest", "longest time ok while beyond 3 sigma", "s", found.longest_s, MAX_SURE_S),
    ):
        yield Claim(f"{key}_{which}", f"{name}: {what}", unit, None, value, value, value,
                    f"<= {most:g}", value <= most)  # fmt: skip
    nees = found.nees
    yield Claim(f"{key}_nees", f"{name}: mean NEES of {found.dof}", "1", None, nees, nees, nees,
                f"{low:.2g}..{high:.2g}", low <= nees <= high)  # fmt: skip


def _ratio(configs: Path, name: str) -> Iterator[Claim]:
    what, key = f"{name}: error in the EKF / of particles alone", name.lower().replace(" ", "_")
    try:
        alone = run(*on_map(configs, name, estimator={}, mcl={}))
        fused = run(*on_map(configs, name, estimator={}, mcl={"poses_hz": 2},
                             use=["odometry", "poses"]))  # fmt: skip
    except LogError as error:
        yield absent(f"{key}_fused", what, str(error))
        return
    assert alone.truth is not None
    one, other = (errors_against(result.estimate, alone.truth) for result in (alone, fused))
    at = np.intersect1d(one.stamp_ns, other.stamp_ns)
    rms = [float(np.sqrt(np.mean(e.position[np.isin(e.stamp_ns, at)] ** 2))) for e in (one, other)]
    ratio = rms[1] / rms[0]
    yield Claim(f"{key}_fused", what, "x", None, ratio, ratio, ratio, f"<= {MAX_RATIO:g}",
                ratio <= MAX_RATIO)  # fmt: skip
