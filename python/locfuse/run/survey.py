# SPDX-License-Identifier: Apache-2.0
"""Where anchors and landmarks are, from one drive among them (docs/survey.md)."""

from __future__ import annotations

import csv
import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.build import build_anchors, build_estimator_config
from locfuse.config.schema import RunConfig
from locfuse.io.csv_table import number_texts, read_bytes, write_table
from locfuse.run.cylinders import with_cylinders
from locfuse.run.mcl import localize, with_poses_of
from locfuse.run.messages import Messages, landmark_sensor_of, to_messages, truth_of
from locfuse.run.odometry import with_odometry
from locfuse.run.run import load_log
from locfuse.run.start import given_start, start_from_nothing, start_of
from locfuse.run.survey_frame import Framed, Wanted, differences, stands_for
from locfuse.types import (
    NANOSECONDS,
    Columns,
    ConfigError,
    FloatArray,
    Log,
    LogError,
    MappedLandmarks,
    Trajectory,
    nearest,
    shown,
    wrap_angle,
)

_logger = logging.getLogger(__name__)
Progress = Callable[[float], None]

# How much the ranges of an anchor may all be off, where `calibration` does not say.
SIGMA_OFFSET_M = 0.2
# An anchor whose place is known to this share of the sigma of a range makes a range 12 % less sure.
GOOD_SHARE = 0.5
_OPEN_SIDE = ("without odometry one tag does not show whether all is mirrored: compare the side of "
              "one anchor")  # fmt: skip
_FOUND = ("sigma_anchor_offset_m", "sigma_anchor_scale")
_SAME_M = 0.05  # nearer than this a mirrored place is no other one
_TOO_MANY = 0.3  # of all ranges rejected: the drive is in doubt
_FARTHEST_M = 1e7
_EXACT = 1e-6  # sigma of the pose that is the frame [m] and [rad]
_AXES = ("x_m", "y_m", "z_m")


@dataclass(frozen=True)
class SurveyedAnchor:
    """An anchor that ranges name.

    Attributes
    ----------
    name : str
    position : float64 array, shape (3,)
        In the frame of the survey, metres; NaN where it is not placed.
    covariance : float64 array, shape (3, 3)
        Of the position, square metres; 0 along what was given.
    offset_m, sigma_offset_m : float
        What its ranges read more than the distance.
    ranges, rejected : int
        From the start on, and of those how many were judged wrong.
    word : str
        ``good``, ``weak`` (its place adds more than an eighth to the variance of a range),
        ``doubtful`` (parts of the drive may not fit together), ``two places`` or ``not placed``.
    other : float64 array, shape (3,), or None
        Of ``two places`` the other one.
    """

    name: str
    position: FloatArray
    covariance: FloatArray
    offset_m: float
    sigma_offset_m: float
    ranges: int
    rejected: int
    word: str
    other: FloatArray | None = None

    @property
    def sigma_m(self) -> float:
        """Sigma along the axis in the plane that is known least, metres; NaN if not placed."""
        if self.word == "not placed":
            return float("nan")
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))


@dataclass(frozen=True)
class SurveyedTag:
    """A tag whose place on the robot was found.

    `position` has shape (2,): forward and left, metres; `sigma_m` is along the axis that is known
    least.
    """

    name: str
    position: FloatArray
    sigma_m: float


@dataclass(frozen=True)
class SurveyResult:
    """Where anchors and landmarks are.

    Attributes
    ----------
    anchors : tuple of SurveyedAnchor
    landmarks : MappedLandmarks
        Those that sightings name.
    estimate : Trajectory
        The drive, with the covariance in the frame of the start.
    frame : str
        What the axes are, a sentence.
    findings : tuple of str
        What is wrong: ids that are swapped, anchors that moved.
    advice : str
        Which further drive would help; empty where all is good.
    stop : float64 array, shape (2,), or None
        The place of that drive.
    tags : tuple of SurveyedTag
        With `sigma_tag_m`.
    """

    anchors: tuple[SurveyedAnchor, ...]
    landmarks: MappedLandmarks
    estimate: Trajectory
    frame: str
    findings: tuple[str, ...] = ()
    advice: str = ""
    stop: FloatArray | None = None
    tags: tuple[SurveyedTag, ...] = ()


def survey(
    config: RunConfig,
    log: Log | None = None,
    *,
    base: Path | None = None,
    measured: Columns | None = None,
    height_m: float | None = None,
    frame: tuple[str, str] | None = None,
    sigma_tag_m: float = 0.0,
    progress: Progress | None = None,
) -> SurveyResult:
    """Find where the anchors and the named landmarks of a log are.

    Parameters
    ----------
    config : RunConfig
        Noise of odometry and ranges, tags, known offsets and scales of ``anchors``. Its ``start``
        is the frame, unless `measured`, `frame`, positions or poses give one.
    log : Log, optional
        Overrides the log that the configuration names. Anchors that it has are compared with those
        found, and give heights.
    base : Path, optional
        Folder that the configuration's paths are relative to.
    measured : dict of arrays, optional
        Columns ``anchor``, ``x_m``, ``y_m``, ``z_m`` of what is known, NaN where it is not. With x
        and y of two anchors it gives the frame.
    height_m : float, optional
        Of all other anchors; None: that of the log's, or found.
    frame : (str, str), optional
        Anchors that are the origin and on the positive x axis.
    sigma_tag_m : float
        How well the places of tags on the robot are known, forward and left; 0: exactly.
    progress : callable, optional
        Called with the share that is done, 0 to 1.

    Raises
    ------
    ConfigError, LogError
        If the configuration or the log cannot be used as they are.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> drive = {"path": {"shape": "waypoints", "speed_mps": 0.5}, "poses": None}
    >>> found = survey(parse_config({"simulation": drive, "start": "truth"}))
    >>> len(found.anchors), found.findings
    (5, ())
    """
    log = load_log(config, base, config.seed) if log is None else log
    log = with_odometry(with_cylinders(log, config), config)
    if config.estimator.kind == "air":
        raise ConfigError(f"survey is for estimator.kind pose, not {config.estimator.kind}")
    log, listed = _with_names(log, config)
    if config.mcl is not None:
        log = with_poses_of(localize(config, log), log, config.mcl.poses_hz or 2.0)
    messages = to_messages(log, config)
    names = messages.anchor_names
    if measured is not None and frame is not None:
        raise LogError("measured places and two anchors both give a frame; leave one of them out")
    _check_names(measured, frame, names)
    heights = _heights(names, listed, measured, height_m)
    anchors = build_anchors(log.tables.get("anchors"), names, config.anchors)
    tags = [_core.Tag(i, list(log.tags[name])) for i, name in enumerate(messages.tag_names)
            if name in log.tags]  # fmt: skip
    start, of_start = _start(config, log, messages, tags)
    settings = _settings(config)
    sensor = _core.LandmarkSensor(_core.LandmarkMap([]), landmark_sensor_of(log))
    world = _core.World(anchors, tags, sensor)
    if not 0.0 <= sigma_tag_m < np.inf:
        raise ConfigError(f"the sigma of tags is {sigma_tag_m:g}; expected metres, 0 or more")
    arms = [_core.UncertainPlace(tag.id, tag.position, [sigma_tag_m, sigma_tag_m, 0.0], sigma_tag_m)
            for tag in tags if sigma_tag_m > 0.0]  # fmt: skip

    by_ranges = not (_has_places(messages) or np.isin(["odometry", "landmark_sightings"],
                                                      messages.source).any())  # fmt: skip
    wanted = Wanted(measured, frame, listed, of_start, _has_places(messages),
                    is_side_open=by_ranges and len(tags) < 2)  # fmt: skip

    def found_with(heights: Mapping[int, float]) -> tuple[_core.Survey, Framed]:
        found = _core.survey(settings, world, start, messages.log,
                             [_core.KnownHeight(i, z) for i, z in heights.items()], arms,
                             progress)  # fmt: skip
        open_ones = frozenset(names[one.anchor.id] for one in found.anchors
                              if one.status.name == "TWO_PLACES")  # fmt: skip
        asked = wanted if wanted.is_side_open else replace(wanted, two_places=open_ones)
        return found, _framed(found, names, asked)

    found, framed = found_with(heights)
    if by_ranges and not framed.names:
        raise LogError("the log has no odometry, positions or poses that the configuration uses, "
                       "and ranges alone place anchors where three or more are received together "
                       "along a way that is no line")  # fmt: skip
    is_open = any(one.other is not None for one in found.anchors) and framed.side != -1
    elsewhere = stands_for(framed, listed) if height_m is None and not is_open else {}
    theirs = {names.index(a): heights[names.index(b)] for a, b in elsewhere.items()
              if b in names and names.index(b) in heights}  # fmt: skip
    if any(heights.get(anchor) != height for anchor, height in theirs.items()):
        found, framed = found_with({**heights, **theirs})
    surveyed = _surveyed(found, names, framed, settings, _others(found, names, framed, wanted))
    apart = _apart(found, messages, log, framed, names)
    if apart:
        surveyed = tuple(replace(a, word="doubtful") if a.word in ("good", "weak") else a
                         for a in surveyed)  # fmt: skip
    is_open = any(a.other is not None for a in surveyed)
    result = SurveyResult(
        anchors=surveyed,
        landmarks=_landmarks(found.smoothed, messages, framed),
        estimate=_track(found.smoothed, framed),
        frame=framed.sentence,
        findings=(
            *apart,
            *(() if is_open or apart else differences(framed, listed)),
            *(() if apart else _moved(found, messages, log, framed, names).values()),
            *([_OPEN_SIDE] if framed.side == 0 else []),
            *(() if apart else _rejected(surveyed)),
            *_long_ranges(surveyed, settings),
        ),
        tags=_tags(found.smoothed, messages.tag_names) if arms else (),
    )
    return _advised(result, _sigma_of_ranges(settings))


def _framed(
    found: _core.Survey, names: list[str], wanted: Wanted, *, other: bool = False
) -> Framed:
    """Return what is placed in the frame that is wanted, or what it is if all is mirrored."""
    placed = [one for one in found.anchors if one.status.name != "NOT_PLACED"]
    order = {one.id: row for row, one in enumerate(found.smoothed.anchors)}
    rows = [3 * order[one.anchor.id] + axis for one in placed for axis in range(3)]
    at = [one.other if other and one.other is not None else one.anchor.position for one in placed]
    return wanted.of([names[one.anchor.id] for one in placed], np.array(at).reshape(-1, 3),
                     np.asarray(found.smoothed.places_covariance)[np.ix_(rows, rows)])  # fmt: skip


def _others(
    found: _core.Survey, names: list[str], framed: Framed, wanted: Wanted
) -> dict[int, FloatArray]:
    """Return the other place of each anchor that has one, in the frame."""
    alone = {one.anchor.id: np.asarray(one.other) for one in found.anchors
             if one.other is not None}  # fmt: skip
    if not wanted.is_side_open:
        return {i: framed.moved(at[None])[0] for i, at in alone.items()}
    if framed.side != 0:
        return {}
    whole = _framed(found, names, wanted, other=True)
    ids = [names.index(name) for name in framed.names]
    return {i: at for i, at, here in zip(ids, whole.position, framed.position, strict=True)
            if np.hypot(*(at - here)[:2]) > _SAME_M}  # fmt: skip


def _with_names(log: Log, config: RunConfig) -> tuple[Log, Columns | None]:
    """Return a log whose anchors and landmarks are those that messages name, and its own list."""
    tables: dict[str, Any] = dict(log.tables)
    listed = tables.pop("anchors", None)
    if "ranges" in config.use and len(log.tables.get("ranges", {}).get("stamp_ns", ())):
        heard = sorted(set(log["ranges"]["anchor"].tolist()))
        named = [] if listed is None else [str(name) for name in listed["anchor"]]
        order = [name for name in named if name in heard]
        order += [name for name in heard if name not in order]
        nothing = np.zeros(len(order))
        tables["anchors"] = {"anchor": np.array(order), **dict.fromkeys(_AXES, nothing)}
    sightings = log.tables.get("landmark_sightings", {})
    if "landmark_sightings" in config.use and len(sightings.get("stamp_ns", ())):
        seen = sorted(set(sightings["landmark"].tolist()) - {""})
        nothing = np.zeros(len(seen))
        tables["landmarks"] = {"landmark": np.array(seen), "x_m": nothing, "y_m": nothing}
    if "anchors" not in tables and not len(tables.get("landmarks", {}).get("landmark", ())):
        raise LogError("nothing to survey: the log has no ranges, and no sightings by name, that "
                       "the configuration uses")  # fmt: skip
    return replace(log, tables=tables), listed


def _check_names(measured: Columns | None, frame: tuple[str, str] | None, names: list[str]) -> None:
    named = [] if measured is None else [str(name) for name in measured["anchor"]]
    for name in (*named, *(frame or ())):
        if name not in names:
            raise LogError(f"no range names an anchor {name!r}; {nearest(name, names)}")
    if frame is not None and frame[0] == frame[1]:
        raise LogError("frame names one anchor twice; expected the origin and one on the x axis")


def _heights(
    names: list[str], listed: Columns | None, measured: Columns | None, height_m: float | None
) -> dict[int, float]:
    heights = {} if height_m is None else dict.fromkeys(range(len(names)), height_m)
    for table in (listed if height_m is None else None, measured):
        if table is not None:
            for name, z in zip(table["anchor"].tolist(), table["z_m"].tolist(), strict=True):
                if name in names and np.isfinite(z):
                    heights[names.index(name)] = z
    return heights


def _start(
    config: RunConfig, log: Log, messages: Messages, tags: list[_core.Tag]
) -> tuple[_core.PoseEstimate, str]:
    """Return the pose that begins the drive, and the sentence of the frame that it makes."""
    if _has_places(messages):
        what = "positions" if "positions" in messages.source else "poses"
        sentence = f"the frame is that of the {what}"
        if config.searches_start:
            initializer, _, _ = start_from_nothing(config, log, messages.log, messages.begin_ns,
                                                   _core.AnchorMap([]), tags)  # fmt: skip
            return initializer.state().hypotheses[0].estimate, sentence
        return start_of(config, truth_of(log), messages), sentence
    exact = np.diag([_EXACT**2] * 3)
    if isinstance(config.start, tuple):
        given = given_start(config.start, config.start_sigma, messages.begin_ns)
        sentence = "the frame is that of `start`"
    elif config.start == "truth" and (truth := truth_of(log)) is not None:
        given, sentence = start_of(config, truth, messages), "the frame is that of truth.csv"
    else:
        given = given_start((0.0, 0.0, 0.0), config.start_sigma, messages.begin_ns)
        sentence = "the origin is where the robot starts, x is its heading there"
    return _core.PoseEstimate(given.stamp, given.pose, exact), sentence


def _settings(config: RunConfig) -> _core.PoseEkfConfig:
    """Return the models of a configuration, with no errors but those that a survey finds."""
    calibration = config.estimator.calibration
    left = [key for key, value in calibration.model_dump().items()
            if key.startswith("sigma_") and key not in _FOUND and "heading_offset" not in key
            and value]  # fmt: skip
    if left:
        _logger.warning("survey takes as right what calibration doubts: %s", ", ".join(left))
    estimator = config.estimator.model_copy(update={
        "calibration": calibration.model_copy(update=dict.fromkeys(left, 0.0)),
        "adaptive": config.estimator.adaptive.model_copy(update={"messages": 0.0}),
    })  # fmt: skip
    settings = build_estimator_config(estimator)
    if settings.calibration.sigma_anchor_offset_m == 0.0:
        settings.calibration.sigma_anchor_offset_m = SIGMA_OFFSET_M
    return settings


def _has_places(messages: Messages) -> bool:
    return bool(set(messages.source.tolist()) & {"positions", "poses"})


def _surveyed(
    found: _core.Survey,
    names: list[str],
    framed: Framed,
    settings: _core.PoseEkfConfig,
    others: dict[int, FloatArray],
) -> tuple[SurveyedAnchor, ...]:
    sigma_range = _sigma_of_ranges(settings)
    offsets = {e.anchor: e for e in found.smoothed.errors if e.name == "anchor_offset_m"}
    surveyed = []
    for one in found.anchors:
        name = names[one.anchor.id]
        error = offsets.get(one.anchor.id)
        if name not in framed.names:
            nowhere = np.full(3, np.nan), np.full((3, 3), np.nan)
            surveyed.append(SurveyedAnchor(name, *nowhere, np.nan, np.nan, one.ranges,
                                           one.rejected, "not placed"))  # fmt: skip
            continue
        row = framed.names.index(name)
        P = framed.covariance[3 * row : 3 * row + 3, 3 * row : 3 * row + 3]
        other = others.get(one.anchor.id)
        sigma = np.sqrt(np.linalg.eigvalsh(P[:2, :2])[-1])
        word = "good" if sigma <= GOOD_SHARE * sigma_range else "weak"
        surveyed.append(SurveyedAnchor(
            name, framed.position[row], P,
            one.anchor.offset, error.sigma if error is not None else 0.0,
            one.ranges, one.rejected, "two places" if other is not None else word, other,
        ))  # fmt: skip
    return tuple(surveyed)


def _sigma_of_ranges(settings: _core.PoseEkfConfig) -> float:
    middling_m = 10.0
    wanders = settings.calibration.anchor_offset_correlation_s > 0.0
    return float(np.sqrt(settings.range.sigma_m**2
                         + (settings.range.sigma_relative * middling_m)**2
                         + wanders * settings.calibration.sigma_anchor_offset_m**2))  # fmt: skip


def _track(smoothed: _core.Smoothed, framed: Framed) -> Trajectory:
    poses = np.asarray(smoothed.poses)
    at = framed.moved(np.column_stack([poses[:, :2], np.zeros(len(poses))]))[:, :2]
    heading = wrap_angle(framed.sign * poses[:, 2] + framed.turn)
    c, s = np.cos(framed.turn), np.sin(framed.turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) * [1.0, framed.sign, framed.sign]
    return Trajectory(smoothed.stamp_ns, at, heading, R @ smoothed.covariances @ R.T)


def _landmarks(smoothed: _core.Smoothed, messages: Messages, framed: Framed) -> MappedLandmarks:
    """Return the landmarks, whose rows of the covariance follow those of all anchors."""
    first = 3 * len(smoothed.anchors)
    names, count = messages.landmark_names, len(smoothed.landmarks)
    at = np.array([one.position for one in smoothed.landmarks]).reshape(-1, 2)
    at = framed.moved(np.column_stack([at, np.zeros(count)]))[:, :2]
    P = np.asarray(smoothed.places_covariance)
    c, s = np.cos(framed.turn), np.sin(framed.turn)
    R = np.array([[c, -s], [s, c]]) * [1.0, framed.sign]
    rows = [slice(first + 2 * i, first + 2 * i + 2) for i in range(count)]
    blocks = [R @ P[r, r] @ R.T for r in rows]
    called = np.array([names[one.id] for one in smoothed.landmarks], dtype=str)
    verdict = np.asarray(smoothed.verdict)
    counted = (messages.source == "landmark_sightings") & (verdict == int(_core.Verdict.FUSED))
    sightings = np.array([np.sum(counted & (messages.anchor == name)) for name in called.tolist()],
                         dtype=np.int64)  # fmt: skip
    return MappedLandmarks(called, at, np.array(blocks).reshape(-1, 2, 2), sightings)


def _tags(smoothed: _core.Smoothed, names: list[str]) -> tuple[SurveyedTag, ...]:
    P = np.asarray(smoothed.places_covariance)
    first = len(P) - 2 * len(smoothed.tags)
    found = []
    for row, tag in enumerate(smoothed.tags):
        at = slice(first + 2 * row, first + 2 * row + 2)
        sigma = float(np.sqrt(np.linalg.eigvalsh(P[at, at])[-1]))
        found.append(SurveyedTag(names[tag.id], np.array(tag.position[:2]), sigma))
    return tuple(found)


def _moved(
    found: _core.Survey, messages: Messages, log: Log, framed: Framed, names: list[str]
) -> dict[str, str]:
    """Return a sentence for each anchor whose ranges are wrong from one time on, or until then."""
    least, share = 20, 0.8
    verdict = np.asarray(found.smoothed.verdict)
    wrong = verdict == int(_core.Verdict.GATED)
    poses = np.asarray(found.smoothed.poses)
    stamps = np.asarray(found.smoothed.stamp_ns)
    sentences = {}
    for name in framed.names:
        mine = np.flatnonzero((messages.source == "ranges") & (messages.anchor == name)
                              & (messages.stamp_ns >= stamps[0]))  # fmt: skip
        bad = wrong[mine]
        if bad.sum() < least:
            continue
        cuts = np.cumsum(bad) / np.maximum(bad.sum(), 1) - np.cumsum(~bad) / max((~bad).sum(), 1)
        at = int(np.argmax(np.abs(cuts)))
        if abs(cuts[at]) < share:
            continue  # here and there
        rows = mine[bad]
        arms = np.array([log.tags.get(tag, (0.0, 0.0, 0.0)) for tag in messages.tag[rows]])
        heading = np.interp(messages.stamp_ns[rows], stamps, np.unwrap(poses[:, 2]))
        x, y = (np.interp(messages.stamp_ns[rows], stamps, poses[:, k]) for k in (0, 1))
        c, s = np.cos(heading), np.sin(heading)
        tags = np.column_stack([x + c * arms[:, 0] - s * arms[:, 1],
                                y + s * arms[:, 0] + c * arms[:, 1], arms[:, 2]])  # fmt: skip
        some = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), 60)).astype(int))
        radio = next(a.anchor for a in found.anchors if names[a.anchor.id] == name)
        ranges = (log["ranges"]["range_m"][messages.row[rows]] - radio.offset) / radio.scale
        z = float(framed.position[framed.names.index(name), 2])
        there = _core.locate(tags[some], ranges[some], 0.3, height=z, loss="cauchy")
        when = (messages.stamp_ns[mine[at]] - stamps[0]) / 1e9
        ends = "from" if cuts[at] < 0.0 else "until"
        text = (f"ranges of {name} are wrong {ends} {when:.0f} s on: was it moved?"
                if ends == "from" else f"ranges of {name} are wrong until {when:.0f} s: was it "
                "moved then?")  # fmt: skip
        spots = [np.append(one.position, z) for one in there.hypotheses[:2]]
        if spots:
            at_xy = (f"({x:.1f}, {y:.1f})" for x, y, _ in framed.moved(np.array(spots)).tolist())
            text += f" They fit a place near {' or '.join(at_xy)}"
        sentences[name] = text
    return sentences


def _apart(
    found: _core.Survey, messages: Messages, log: Log, framed: Framed, names: list[str]
) -> tuple[str, ...]:
    """Say why the parts of a drive may not fit together, if they may not."""
    longest_s = 1.0
    begin = int(np.asarray(found.smoothed.stamp_ns)[0])
    stamps = messages.stamp_ns[(messages.source == "odometry") & (messages.stamp_ns >= begin)]
    if len(stamps) > 1:
        gaps = np.diff(np.sort(stamps)) / NANOSECONDS
        at = int(np.argmax(gaps))
        if gaps[at] > max(longest_s, 20.0 * float(np.median(gaps))):
            when = (np.sort(stamps)[at] - begin) / NANOSECONDS
            return (f"odometry is missing for {gaps[at]:.1f} s from {when:.0f} s on: what is found "
                    "before and after may not fit together; cut the log there",)  # fmt: skip
    count = sum(one.ranges for one in found.anchors)
    share = sum(one.rejected for one in found.anchors) / max(count, 1)
    if share > _TOO_MANY:
        return (f"{share:.0%} of all ranges are rejected: they do not fit the odometry; is that in "
                "metres and radians?",)  # fmt: skip
    moved = _moved(found, messages, log, framed, names)
    if len(moved) > 1:
        return (f"ranges of {', '.join(moved)} are wrong in one part of the drive: its parts do "
                "not fit together; is odometry right all the time?",)  # fmt: skip
    return ()


def _rejected(anchors: tuple[SurveyedAnchor, ...]) -> Iterator[str]:
    """Name anchors most of whose ranges fit no place."""
    if bad := [a.name for a in anchors if 2 * a.rejected > a.ranges > 0]:
        yield f"most ranges of {', '.join(bad)} fit no place"


def _long_ranges(
    anchors: tuple[SurveyedAnchor, ...], settings: _core.PoseEkfConfig
) -> Iterator[str]:
    """Name anchors whose ranges are off by far more than any radio's."""
    most = 4.0 * settings.calibration.sigma_anchor_offset_m
    for a in anchors:
        if abs(a.offset_m) > max(most, 3.0 * a.sigma_offset_m):
            way = "long" if a.offset_m > 0.0 else "short"
            yield (f"ranges of {a.name} read {abs(a.offset_m):.2f} m too {way}: is its height, or "
                   "that of the tag, right?")  # fmt: skip


def _advised(result: SurveyResult, sigma_range: float) -> SurveyResult:
    """Return the result with the stop that would make the worst anchors surest."""
    words = ("weak",) if _OPEN_SIDE in result.findings else ("weak", "two places")
    unsure = [a for a in result.anchors if a.word in words]
    missing = [a.name for a in result.anchors
               if a.word == "not placed" and 2 * a.rejected <= a.ranges]  # fmt: skip
    way = result.estimate.position
    if len(way) and float(np.ptp(way, axis=0).max()) < 0.5 and (unsure or missing):
        return replace(result, advice="the robot hardly moved: drive some metres, with turns")
    advice = ""
    if missing:
        advice = (f"{', '.join(missing)}: too few ranges, or all from one spot; drive where they "
                  "are received. ")  # fmt: skip
    if not unsure:
        return replace(result, advice=advice.strip())
    points = np.vstack([way, [a.position[:2] for a in unsure]])
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (np.linspace(low[k], high[k], 25) for k in (0, 1))
    grid = np.column_stack([v.ravel() for v in np.meshgrid(x, y)])
    sigma = max(sigma_range, 0.05)
    left = np.zeros(len(grid))
    for anchor in unsure:
        ways = anchor.position[:2] - grid
        far = np.maximum(np.hypot(*ways.T), 1e-6)
        u = ways / far[:, None]
        P = anchor.covariance[:2, :2] + 1e-9 * np.eye(2)
        gain = 10.0 / sigma**2 * u[:, :, None] * u[:, None, :]
        then = np.linalg.inv(np.linalg.inv(P) + gain)
        left += np.sqrt(np.linalg.eigvalsh(then)[:, -1])
        if anchor.other is not None:
            apart = np.abs(far - np.hypot(*(anchor.other[:2] - grid).T))
            left += np.where(apart < 5.0 * sigma, 100.0 / (1.0 + apart), 0.0)
    best = grid[int(np.argmin(left))]
    names = ", ".join(a.name for a in unsure)
    advice += (f"drive by ({best[0]:.1f}, {best[1]:.1f}) for {names}: ranges from there tell most "
               "of where they are")  # fmt: skip
    return replace(result, advice=advice, stop=best)


def read_measured(path: Path) -> Columns:
    """Read what was measured by hand: as ``anchors.csv``, with empty cells where it is not known.

    Raises LogError where the file is no such table.
    """
    header = ("anchor", *_AXES)
    rows = list(csv.reader(read_bytes(path).decode("utf-8-sig", "replace").splitlines()))
    if not rows or tuple(cell.strip() for cell in rows[0]) != header:
        raise LogError(f"{path}, line 1: expected the header {','.join(header)}")
    names: list[str] = []
    at: list[list[float]] = []
    for line, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        if len(row) != len(header) or not row[0].strip():
            raise LogError(f"{path}, line {line}: expected an anchor and three numbers, which may "
                           "be empty")  # fmt: skip
        if row[0].strip() in names:
            raise LogError(f"{path}, line {line}: anchor {row[0].strip()} is listed twice")
        names.append(row[0].strip())
        at.append([])
        for cell in row[1:]:
            try:
                at[-1].append(float(cell) if cell.strip() else np.nan)
            except ValueError:
                raise LogError(f"{path}, line {line}: {shown(cell)} is not a number") from None
            if cell.strip() and not abs(at[-1][-1]) <= _FARTHEST_M:
                raise LogError(f"{path}, line {line}: {shown(cell)} is no place in metres")
    table = np.array(at).reshape(-1, 3)
    return {"anchor": np.array(names, dtype=str),
            **{axis: table[:, k].copy() for k, axis in enumerate(_AXES)}}  # fmt: skip


def write_survey(result: SurveyResult, folder: Path) -> list[Path]:
    """Write ``anchors.csv``, and ``landmarks.csv`` if there are any, as of a log folder.

    What is not placed is left out. Columns of covariances are beyond those of the format.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    placed = [a for a in result.anchors if a.word != "not placed"]
    if placed:
        at = np.array([a.position for a in placed])
        columns = [[a.name for a in placed], *(number_texts(at[:, k]) for k in range(3))]
        written.append(folder / "anchors.csv")
        write_table(written[-1], ("anchor", *_AXES), columns)
    found = result.landmarks
    if len(found):
        P = found.covariance
        numbers = (*found.position.T, P[:, 0, 0], P[:, 0, 1], P[:, 1, 1])
        written.append(folder / "landmarks.csv")
        write_table(written[-1], ("landmark", "x_m", "y_m", "cov_x_x", "cov_x_y", "cov_y_y"),
                    [found.name.tolist(), *map(number_texts, numbers)])  # fmt: skip
    return written


def yaml_of(result: SurveyResult) -> Mapping[str, Mapping[str, float]]:
    """Return the section ``anchors`` of a configuration: offsets that stand out of their sigma."""
    return {a.name: {"offset_m": round(a.offset_m, 3)} for a in result.anchors
            if a.word != "not placed" and abs(a.offset_m) > 2.0 * a.sigma_offset_m}  # fmt: skip
