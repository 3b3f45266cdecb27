# SPDX-License-Identifier: Apache-2.0
"""Localization in the air on recorded ranges, nothing else: rows for docs/air.md."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.eval.errors import interpolate
from locfuse.run.messages import truth_of
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, StampArray, Trajectory
from papers.claims import Claim, Progress, absent, claims_of
from papers.recorded import load_recording, ready_claims
from papers.recordings.silence import DRIVES, silence_claims
from papers.scores import rms


@dataclass(frozen=True)
class Recording:
    """Where a recording is, and how long its ranges read [m], at least and at most.

    The figures are those of the descriptions beside the recordings: one offset for all anchors, in
    the middle between them. Calibrated ranges bring their own sigmas and no offset.
    """

    dataset: str
    folder: str
    run: str
    long: tuple[float, float]


RECORDINGS = {
    "drone seq1": Recording("rcv_uwb_drone", "rcv-uwb-drone", "seq1", (0.16, 0.35)),
    "drone seq3": Recording("rcv_uwb_drone", "rcv-uwb-drone", "seq3", (0.16, 0.35)),
    "drone seq5": Recording("rcv_uwb_drone", "rcv-uwb-drone", "seq5", (0.16, 0.35)),
    "rig s1": Recording("starloc", "starloc", "loop-2d-fast_s1", (0.1, 0.35)),
    "rig s1 calibrated": Recording("starloc", "starloc", "loop-2d-fast_s1_calibrated", (0.0, 0.0)),
    "rig s5": Recording("starloc", "starloc", "loop-2d_s5", (-0.1, -0.1)),
    "head": Recording("inrol_uwb_imu", "inrol-uwb-imu", "filtering_state_estimation1", (0.0, 0.0)),
}
READY = ("air_ranges.yaml", "rcv_drone.yaml", "starloc_rig.yaml")
START_SIGMA = (0.3, 0.3, 0.1, 0.3)  # x, y [m], heading [rad], height [m]


@dataclass(frozen=True)
class Flight:
    """What a filter says of a flight.

    Attributes
    ----------
    stamp_ns : int64 array, shape (n,)
    position : float64 array, shape (n, 3)
        In world [m].
    covariance : float64 array, shape (n, 3, 3)
        Of it [m^2].
    gated : bool array, shape (ranges,)
        Which ranges of the log did not pass the gate.
    """

    stamp_ns: StampArray
    position: FloatArray
    covariance: FloatArray
    gated: NDArray[np.bool_]


def air_claims(progress: Progress, configs: Path | None) -> list[Claim]:
    """Return all rows; recordings lie beside the project, whose ready configurations are given."""
    recorded = [partial(_recorded, configs, name) for name in RECORDINGS]
    cut_out = [partial(silence_claims, configs, drive) for drive in DRIVES]
    return claims_of([*recorded, *cut_out, partial(ready_claims, configs, *READY)], progress)


def load_flight(configs: Path | None, recording: Recording) -> Log:
    """Return the log of a recording.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    return load_recording(configs, recording.dataset, recording.folder, recording.run)[1]


def filter_config() -> _core.AirEkfConfig:
    """Return the settings, the same for all: constant velocity, ranges of 0.1 m, else defaults."""
    config = _core.AirEkfConfig()
    config.range.sigma_m = 0.1
    config.motion = _core.AirMotion.CONSTANT_VELOCITY
    return config


def localize(
    log: Log,
    offset: float,
    config: _core.AirEkfConfig,
    altitudes: Sequence[_core.Altitude] = (),
    kept: NDArray[np.bool_] | None = None,
) -> Flight:
    """Localize by the ranges of a log, and by altitudes.

    It starts at the truth once every anchor has reported within a second: there are long
    gaps before, in which a body may be anywhere.

    Parameters
    ----------
    log : Log
        With ranges, anchors, tags and a truth with headings.
    offset : float
        How long the ranges read [m].
    config : AirEkfConfig
    altitudes : sequence of Altitude
        In order of their stamps.
    kept : bool array, shape (ranges,), optional
        Which ranges the filter fuses, all if None. It estimates at the stamps of the others, too.
    """
    ranges, table = log["ranges"], log["anchors"]
    names = [str(name) for name in table["anchor"]]
    places = np.stack([table[f"{axis}_m"] for axis in "xyz"], axis=1)
    anchors = _core.AnchorMap([_core.Anchor(i, place, offset) for i, place in enumerate(places)])
    tags, start = list(log.tags), _start(log)
    ekf = _core.AirEkf(
        config,
        _core.World(anchors, [_core.Tag(i, np.array(log.tags[tag])) for i, tag in enumerate(tags)]),
        start,
    )
    sigmas = ranges.get("sigma_m")
    estimates: dict[int, _core.AirEstimate] = {}  # by stamp: the last of each
    gated = np.zeros(len(ranges["stamp_ns"]), dtype=np.bool_)
    waiting = deque(altitudes)
    for row, stamp in enumerate(ranges["stamp_ns"].tolist()):
        if stamp < start.stamp:
            continue
        while waiting and waiting[0].stamp <= stamp:
            ekf.on(waiting.popleft())
        if kept is None or kept[row]:
            z = _core.Range(stamp, tags.index(str(ranges["tag"][row])),
                            names.index(str(ranges["anchor"][row])), float(ranges["range_m"][row]),
                            None if sigmas is None else float(sigmas[row]))  # fmt: skip
            gated[row] = ekf.on(z).verdict == _core.Verdict.GATED
        estimates[stamp] = ekf.estimate(stamp)
    found = list(estimates.values())
    return Flight(
        np.array(list(estimates)),
        np.array([[e.pose.x, e.pose.y, e.height] for e in found]),
        np.array([e.covariance[np.ix_([0, 1, 3], [0, 1, 3])] for e in found]),
        gated,
    )


def _start(log: Log) -> _core.AirEstimate:
    stamps = _all_received(log)
    place, heading, inside = true_at(log, stamps)
    if len(place) == 0:
        raise LogError("there is no second in which all anchors reported and the truth is known")
    pose = _core.Pose2(float(place[0, 0]), float(place[0, 1]), float(heading[0]))
    return _core.AirEstimate(int(stamps[inside][0]), pose, float(place[0, 2]),
                             np.diag(np.square(START_SIGMA)))  # fmt: skip


def _all_received(log: Log) -> StampArray:
    """Return the stamps of ranges before which each anchor reported within a second."""
    ranges, count = log["ranges"], len(log["anchors"]["anchor"])
    last: dict[str, int] = {}
    stamps = []
    for stamp, anchor in zip(ranges["stamp_ns"].tolist(), ranges["anchor"].tolist(), strict=True):
        last[anchor] = stamp
        if len(last) == count and stamp - min(last.values()) <= NANOSECONDS:
            stamps.append(stamp)
    return np.unique(np.array(stamps, dtype=np.int64))


def true_at(log: Log, stamp_ns: StampArray) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return true positions (m, 3) and headings (m,), and for which stamps (n,) they are known.

    A truth without heights is on the ground.
    """
    truth = truth_of(log)
    assert truth is not None
    at, inside = interpolate(truth, stamp_ns)
    up_m = log["truth"].get("z_m", np.zeros(len(truth)))
    height = Trajectory(truth.stamp_ns, np.column_stack([up_m] * 2))
    up, _ = interpolate(height, stamp_ns)
    assert at.heading is not None
    return np.column_stack([at.position, up.position[:, 0]]), at.heading, inside


def errors_of(flight: Flight, log: Log) -> tuple[FloatArray, FloatArray]:
    """Return errors (n, 3) [m] and their NEES (n,), where truth is known."""
    true, _, inside = true_at(log, flight.stamp_ns)
    error = flight.position[inside] - true
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(flight.covariance[inside],
                                                        error[..., None])[..., 0])  # fmt: skip
    return error, nees


def _recorded(configs: Path | None, name: str) -> Iterator[Claim]:
    key, what = f"air_{name.replace(' ', '_')}", f"{name} (real): "
    try:
        log = load_flight(configs, RECORDINGS[name])
    except LogError as missing:
        yield absent(key, f"{what}position RMSE", str(missing))
        return
    flight = localize(log, float(np.mean(RECORDINGS[name].long)), filter_config())
    error, nees = errors_of(flight, log)
    used = log["ranges"]["stamp_ns"] >= flight.stamp_ns[0]
    for row, part, unit, value in (
        ("", "position RMSE", "m", rms(error)),
        ("_horizontal", "horizontal RMSE", "m", rms(error[:, :2])),
        ("_height", "height RMSE", "m", rms(error[:, 2:])),
        ("_nees", "NEES of 3", "1", float(np.mean(nees))),
        ("_gated", "ranges gated", "%", 100.0 * float(np.mean(flight.gated[used]))),
    ):
        yield Claim(key + row, what + part, unit, None, value, value, value, "-", True)
