# SPDX-License-Identifier: Apache-2.0
"""Three tags on a recorded trolley without wheels: 12 states of celan2017, one rigid body."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.eval.errors import interpolate
from locfuse.io.log_folder import read_log
from locfuse.run.messages import truth_of
from locfuse.types import FloatArray, Log, LogError, StampArray, Trajectory
from papers.celan2017.methods import Antennas, Rolling, learn
from papers.datasets import convert

FOLDER = Path("../../../shared/data/lias-planar")  # from examples/configs
MOVING, SESSION = "fast", "session 8.14"
RATE_HZ = 100  # of the recording
RATES_HZ = (RATE_HZ, 10, 1)  # as recorded, and decimated
# Tags are read turned by this against the body's heading: it minimizes the scatter at rest.
TURNS_RAD = np.arange(0.0, 0.21, 0.02)
NOISE = 2.0  # sigma of a range over its scatter at rest: successive errors are correlated
# Its motion is not measured, at 0.4 m/s and up to 1 rad/s: a random walk as far and as much.
WALK_M, WALK_RAD = 0.4, 0.5  # per root of a second
SIGMA_START = (0.3, 0.3, 0.3)
SETTLED_S = 5.0


MEMORY = 40  # epochs that the best linear filter looks back


@dataclass(frozen=True)
class Trolley:
    """A drive, and what is known of its radios.

    Attributes
    ----------
    epochs : list of lists of Range
        All links of one row of the recording; their constant errors taken off.
    truth : Trajectory
        At the epochs.
    anchors, places : AnchorMap, and positions by id
    tags : list of Tag
    sigma_m : float
        Of a range.
    antennas : Antennas
        What ranges still read long by, and how far they scatter once that is known.
    """

    epochs: list[list[_core.Range]]
    truth: Trajectory
    anchors: _core.AnchorMap
    places: dict[int, FloatArray]
    tags: list[_core.Tag]
    sigma_m: float
    antennas: Antennas


def trolley(folder: Path) -> Trolley:
    """Return the drive of the recording.

    The constant error of each link, the turn of the tags against the body and what antennas add are
    those of the same radios at rest, 18 poses of a recording of their own.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    with tempfile.TemporaryDirectory() as out:
        logs = [read_log(path) for path in convert("lias", folder, Path(out) / "log")]
    of_session = [log for log in logs if SESSION in log.description]
    moving = next(log for log in of_session if MOVING in log.description)
    rest = [log for log in of_session if log is not moving]
    links = [_links(log) for log in rest]
    found = [_constants(rest, np.concatenate(links), turn) for turn in TURNS_RAD.tolist()]
    best = int(np.argmin([scatter for _, scatter in found]))
    constant, scatter = found[best]
    turned = _core.Pose2(0.0, 0.0, float(TURNS_RAD[best]))
    tags = [_core.Tag(k, [*turned.act(at[:2]), at[2]])
            for k, at in enumerate(moving.tags.values())]  # fmt: skip
    places = dict(enumerate(_places(moving).values()))
    epochs, stamps = _epochs(moving, constant, NOISE * scatter)
    at, inside = interpolate(truth_of_moving(moving), stamps)
    kept = [epoch for epoch, is_in in zip(epochs, inside.tolist(), strict=True) if is_in]
    anchors = _core.AnchorMap([_core.Anchor(k, at_.tolist()) for k, at_ in places.items()])
    return Trolley(kept, at, anchors, places, tags, NOISE * scatter,
                   _antennas(rest, links, constant, float(TURNS_RAD[best])))  # fmt: skip


def truth_of_moving(log: Log) -> Trajectory:
    """Return the reference; a recording without one is refused."""
    truth = truth_of(log)
    if truth is None:
        raise LogError("the recording has no truth")
    return truth


def _places(log: Log) -> dict[str, FloatArray]:
    table = log["anchors"]
    rows = zip(table["anchor"].tolist(), table["x_m"], table["y_m"], table["z_m"], strict=True)
    return {name: np.array(at, dtype=np.float64) for name, *at in rows}


def _constants(logs: list[Log], links: NDArray[np.int64], turn: float) -> tuple[FloatArray, float]:
    """Return the median error of each link [m], tag by tag, and the scatter about it."""
    errors = np.concatenate([_errors(log, turn) for log in logs])
    constant = np.array([np.median(errors[links == k]) for k in range(int(links.max()) + 1)])
    return constant, float(np.std(errors - constant[links]))


def _links(log: Log) -> NDArray[np.int64]:
    tags, anchors = list(log.tags), log["anchors"]["anchor"].tolist()
    table = log["ranges"]
    pairs = zip(table["tag"].tolist(), table["anchor"].tolist(), strict=True)
    return np.array([tags.index(t) * len(anchors) + anchors.index(a) for t, a in pairs], np.int64)


def _errors(log: Log, turn: float) -> FloatArray:
    """Return range minus distance where the body rests."""
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    body, places = _core.Pose2(x, y, heading + turn), _places(log)
    tag = {name: np.array([*body.act(at[:2]), at[2]]) for name, at in log.tags.items()}
    table = log["ranges"]
    off = [tag[t] - places[a] for t, a in zip(table["tag"].tolist(), table["anchor"].tolist(),
                                              strict=True)]  # fmt: skip
    return np.asarray(table["range_m"] - np.linalg.norm(off, axis=1))


def _antennas(
    rest: list[Log], links: list[NDArray[np.int64]], constant: FloatArray, turn: float
) -> Antennas:
    """Return what is left of the errors at rest; a link counts once a pose, as it does not vary."""
    rows = []
    for log, of_row in zip(rest, links, strict=True):
        errors = _errors(log, turn) - constant[of_row]
        for link, first in zip(*np.unique(of_row, return_index=True), strict=True):
            rows.append((float(np.median(errors[of_row == link])), *_sight(log, first, turn)))
    error, distance, beta, tag, anchor = np.array(rows).T
    return learn(error, distance, beta, (tag, anchor))


def _sight(log: Log, row: int, turn: float) -> tuple[float, float, int, int]:
    """Return distance, direction to the anchor in body, tag and anchor of a range at rest."""
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    body = _core.Pose2(x, y, heading + turn)
    names = log["ranges"]["tag"][row], log["ranges"]["anchor"][row]
    tag, anchor = log.tags[names[0]], _places(log)[names[1]]
    dx, dy, dz = anchor - [*body.act(tag[:2]), tag[2]]
    ids = list(log.tags).index(names[0]), log["anchors"]["anchor"].tolist().index(names[1])
    return float(np.hypot(np.hypot(dx, dy), dz)), float(np.arctan2(dy, dx)) - body.heading, *ids


def _epochs(
    log: Log, constant: FloatArray, sigma_m: float
) -> tuple[list[list[_core.Range]], StampArray]:
    """Return the rows of the recording as messages."""
    table, links = log["ranges"], _links(log)
    count = len(log["anchors"]["anchor"])
    ranges = np.maximum(table["range_m"] - constant[links], 0.0)
    rows = zip(table["stamp_ns"].tolist(), links.tolist(), ranges.tolist(), strict=True)
    epochs = [[_core.Range(stamp, k // count, k % count, range_m, sigma_m)
               for _, k, range_m in together]
              for stamp, together in groupby(rows, key=lambda row: row[0])]  # fmt: skip
    return epochs, np.array([epoch[0].stamp for epoch in epochs], np.int64)


# Messages of an epoch: its ranges, or positions of tags made of them ----------------------


def by_ranges(of: Trolley, epoch: list[_core.Range]) -> list[_core.Range | _core.PositionFix]:
    """Return the ranges."""
    return list(epoch)


def by_antennas(of: Trolley, epoch: list[_core.Range]) -> list[_core.Range | _core.PositionFix]:
    """Return the ranges, with the noise that is left once what antennas add is known."""
    sigma_m = NOISE * of.antennas.sigma_m
    return [_core.Range(z.stamp, z.tag, z.anchor, z.range, sigma_m) for z in epoch]


def by_fixes(of: Trolley, epoch: list[_core.Range]) -> list[_core.Range | _core.PositionFix]:
    """Return the position of each tag by its ranges alone, as an RTLS does."""
    fixes: list[_core.Range | _core.PositionFix] = []
    for tag in of.tags:
        received = [z for z in epoch if z.tag == tag.id]
        if len(received) < 3:
            continue
        found = _core.locate(np.array([of.places[z.anchor] for z in received]),
                             np.array([z.range for z in received]), of.sigma_m,
                             height=float(tag.position[2]), loss="cauchy")  # fmt: skip
        if found.position is not None and found.covariance is not None:
            fixes.append(_core.PositionFix(epoch[0].stamp, found.position, found.covariance,
                                           tag.id))  # fmt: skip
    return fixes


def _rigid(of: Trolley, start: _core.PoseEstimate) -> _core.PoseEkf:
    config = _core.PoseEkfConfig()
    config.sigma_lost_xy_per_sqrt_s = config.odometry.sigma_xy_per_sqrt_s = WALK_M
    config.sigma_lost_heading_per_sqrt_s = config.odometry.sigma_heading_per_sqrt_s = WALK_RAD
    ekf = _core.PoseEkf(config, _core.World(of.anchors, of.tags), start)
    ekf.on(_core.Velocity(start.stamp, 0.0, 0.0))  # the walk is its motion: nobody pushes faster
    return ekf


def _twelve(of: Trolley, start: _core.PoseEstimate) -> _core.TagTriangleEkf:
    return _core.TagTriangleEkf(
        _core.TagTriangleEkfConfig(), _core.World(of.anchors, of.tags), start
    )


def _rolling(of: Trolley, start: _core.PoseEstimate) -> Rolling:
    return Rolling(start, of.places, of.tags)


def _rolling_antennas(of: Trolley, start: _core.PoseEstimate) -> Rolling:
    return Rolling(start, of.places, of.tags, of.antennas)


FILTERS: Mapping[str, Callable[[Trolley, _core.PoseEstimate],
                               _core.PoseEkf | _core.TagTriangleEkf | Rolling]] = {
    "rigid": _rigid,
    "twelve": _twelve,
    "rolling": _rolling,
    "rolling_antennas": _rolling_antennas,
}  # fmt: skip
MESSAGES: Mapping[str, Callable[[Trolley, list[_core.Range]],
                            list[_core.Range | _core.PositionFix]]] = {
    "ranges": by_ranges,
    "fixes": by_fixes,
    "antennas": by_antennas,
}  # fmt: skip


FILTER_NAMES = {"rigid": "PoseEkf", "twelve": "12 states", "rolling": "rolling body",
         "rolling_antennas": "rolling body, antennas known"}  # fmt: skip
WAYS = (("ranges", "rigid"), ("ranges", "twelve"), ("ranges", "rolling"),
        ("antennas", "rolling_antennas"), ("fixes", "rigid"), ("fixes", "twelve"))  # fmt: skip
ASKED = (("ranges", "rigid"), ("antennas", "rolling_antennas"))


def follow(of: Trolley, by: str, given: str, rate_hz: int) -> tuple[FloatArray, FloatArray]:
    """Return errors (n, 3) of x, y [m] and heading [rad], and NEES, of every epoch once settled."""
    step = RATE_HZ // rate_hz
    assert of.truth.heading is not None
    errors, nees, ekf = [], [], None
    first_ns = of.epochs[0][0].stamp
    for k in range(0, len(of.epochs), step):
        epoch = of.epochs[k]
        stamp = epoch[0].stamp
        x, y = of.truth.position[k].tolist()
        truth = _core.Pose2(x, y, float(of.truth.heading[k]))
        if ekf is None:
            ekf = FILTERS[by](of, _core.PoseEstimate(stamp, truth, np.diag(SIGMA_START) ** 2))
        for message in MESSAGES[given](of, epoch):
            ekf.on(message)  # type: ignore[arg-type]  # only two of them take positions
        ekf.advance_to(stamp)
        if isinstance(ekf, _core.TagTriangleEkf):
            ekf.hold_sides()
        now = ekf.estimate(stamp)
        if stamp - first_ns >= SETTLED_S * 1e9:
            off = _core.local(now.pose, truth)
            errors.append(off)
            nees.append(float(off @ np.linalg.solve(now.covariance, off)))
    return np.array(errors), np.array(nees)


def headings(of: Trolley, step: int) -> tuple[FloatArray, FloatArray]:
    """Return the true heading, unwrapped, and that of all three tags by their ranges alone."""
    assert of.truth.heading is not None
    arms = np.array([tag.position[:2] for tag in of.tags])
    truth, found = [], []
    for k in range(0, len(of.epochs), step):
        fixes = [z for z in by_fixes(of, of.epochs[k]) if isinstance(z, _core.PositionFix)]
        if len(fixes) == len(arms):
            fit = _core.rigid_fit(arms, np.array([z.position for z in fixes]),
                                  np.array([z.covariance for z in fixes]))  # fmt: skip
            truth.append(of.truth.heading[k])
            found.append(fit.pose.heading)
    return np.unwrap(truth), np.array(found)
