# SPDX-License-Identifier: Apache-2.0
"""Where anchors and landmarks are, from one drive among them (docs/survey.md)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.build import build_estimator_config
from locfuse.config.schema import RunConfig
from locfuse.run.cylinders import with_cylinders
from locfuse.run.mcl import localize, with_poses_of
from locfuse.run.messages import Messages, landmark_sensor_of, radios_of, to_messages, truth_of
from locfuse.run.odometry import with_odometry
from locfuse.run.run import load_log
from locfuse.run.start import given_start, start_from_nothing, start_of
from locfuse.run.survey_findings import OPEN_SIDE, advised, apart, long_ranges, moved, rejected
from locfuse.run.survey_frame import Framed, Wanted, differences, stands_for
from locfuse.run.survey_result import AXES, SurveyedAnchor, SurveyedTag, SurveyResult
from locfuse.types import (
    Columns,
    ConfigError,
    FloatArray,
    Log,
    LogError,
    MappedLandmarks,
    Trajectory,
    nearest,
    wrap_angle,
)

_logger = logging.getLogger(__name__)
Progress = Callable[[float], None]

# How much the ranges of an anchor may all be off, where `calibration` does not say.
SIGMA_OFFSET_M = 0.2
# An anchor whose place is known to this share of the sigma of a range makes a range 12 % less sure.
GOOD_SHARE = 0.5
_FOUND = ("sigma_anchor_offset_m", "sigma_anchor_scale")
_SAME_M = 0.05  # nearer than this a mirrored place is no other one
_SOUGHT = ("ranges", "landmark_sightings")  # which say nothing of where the robot is, yet
OF_POSES = "the frame is that of the poses"
OF_START = "the frame is that of `start`"
OF_ORIGIN = "the origin is where the robot starts, x is its heading there"
_EXACT = 1e-6  # sigma of the pose that is the frame [m] and [rad]


def survey(
    config: RunConfig,
    log: Log | None = None,
    *,
    base: Path | None = None,
    measured: Columns | None = None,
    height_m: float | None = None,
    frame: tuple[str, str] | None = None,
    sigma_tag_m: float = 0.0,
    uncertain_tags: Sequence[str] | None = None,
    onto_list: bool = False,
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
    uncertain_tags : sequence of str, optional
        The tags that this is of; None: all.
    onto_list : bool
        Whether the log's list of anchors is the frame though poses give one.
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
        kept = [source for source in config.use if source not in _SOUGHT]
        rate_hz = config.mcl.poses_hz or 2.0
        mcl = config.mcl.model_copy(update={"poses_hz": rate_hz})
        placed = localize(config.model_copy(update={"use": kept, "mcl": mcl}), log)
        log = with_poses_of(placed, log, rate_hz)
    messages = to_messages(log, config)
    names = messages.anchor_names
    if measured is not None and frame is not None:
        raise LogError("measured places and two anchors both give a frame; leave one of them out")
    _check_names(measured, frame, names)
    heights = _heights(names, listed, measured, height_m)
    anchors, tags = radios_of(log, messages, config)
    start, of_start = _start(config, log, messages, tags)
    settings = _settings(config)
    sensor = _core.LandmarkSensor(_core.LandmarkMap([]), landmark_sensor_of(log))
    world = _core.World(anchors, tags, sensor)
    if not 0.0 <= sigma_tag_m < np.inf:
        raise ConfigError(f"the sigma of tags is {sigma_tag_m:g}; expected metres, 0 or more")
    doubted = messages.tag_names if uncertain_tags is None else uncertain_tags
    arms = [_core.UncertainPlace(tag.id, tag.position, [sigma_tag_m, sigma_tag_m, 0.0], sigma_tag_m)
            for tag in tags
            if sigma_tag_m > 0.0 and messages.tag_names[tag.id] in doubted]  # fmt: skip

    by_ranges = not (_has_places(messages) or np.isin(["odometry", "landmark_sightings"],
                                                      messages.source).any())  # fmt: skip
    wanted = Wanted(measured, frame, listed, of_start, _has_places(messages) and not onto_list,
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
    others = _others(found, names, framed, wanted)
    elsewhere = stands_for(framed, listed) if height_m is None and not others else {}
    theirs = {names.index(a): heights[names.index(b)] for a, b in elsewhere.items()
              if b in names and names.index(b) in heights}  # fmt: skip
    if any(heights.get(anchor) != height for anchor, height in theirs.items()):
        found, framed = found_with({**heights, **theirs})
        others = _others(found, names, framed, wanted)
    surveyed = _surveyed(found, names, framed, settings, others)
    wrong = moved(found, messages, log, framed, names)
    doubts = apart(found, messages, wrong)
    if doubts:
        surveyed = tuple(replace(a, word="doubtful") if a.word in ("good", "weak") else a
                         for a in surveyed)  # fmt: skip
    result = SurveyResult(
        anchors=surveyed,
        landmarks=_landmarks(found.smoothed, messages, framed),
        estimate=_track(found.smoothed, framed),
        frame=framed.sentence,
        findings=(
            *doubts,
            *(() if others or doubts else differences(framed, listed)),
            *(() if doubts else wrong.values()),
            *([OPEN_SIDE] if framed.side == 0 else []),
            *(() if doubts else rejected(surveyed)),
            *long_ranges(surveyed, settings),
        ),
        tags=_tags(found.smoothed, messages.tag_names, {arm.id for arm in arms}),
    )
    return advised(result, _sigma_of_ranges(settings), is_side_known=framed.side != 0)


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
        received = sorted(set(log["ranges"]["anchor"].tolist()))
        named = [] if listed is None else [str(name) for name in listed["anchor"]]
        order = [name for name in named if name in received]
        order += [name for name in received if name not in order]
        nothing = np.zeros(len(order))
        tables["anchors"] = {"anchor": np.array(order), **dict.fromkeys(AXES, nothing)}
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
        is_fix = "positions" in messages.source
        sentence = "the frame is that of the positions" if is_fix else OF_POSES
        if config.searches_start:
            initializer, _, _ = start_from_nothing(config, log, messages.log, messages.begin_ns,
                                                   _core.AnchorMap([]), tags)  # fmt: skip
            return initializer.state().hypotheses[0].estimate, sentence
        return start_of(config, truth_of(log), messages), sentence
    exact = np.diag([_EXACT**2] * 3)
    if isinstance(config.start, tuple):
        given = given_start(config.start, config.start_sigma, messages.begin_ns)
        sentence = OF_START
    elif config.start == "truth" and (truth := truth_of(log)) is not None:
        given, sentence = start_of(config, truth, messages), "the frame is that of truth.csv"
    else:
        given = given_start((0.0, 0.0, 0.0), config.start_sigma, messages.begin_ns)
        sentence = OF_ORIGIN
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
    sigmas = {(e.name, e.anchor): e.sigma for e in found.smoothed.errors}
    surveyed = []
    for one in found.anchors:
        name = names[one.anchor.id]
        if name not in framed.names:
            nowhere = np.full(3, np.nan), np.full((3, 3), np.nan)
            surveyed.append(SurveyedAnchor(name, *nowhere, np.nan, np.nan, one.ranges,
                                           one.rejected, "not placed"))  # fmt: skip
            continue
        row = framed.names.index(name)
        P = framed.covariance[3 * row : 3 * row + 3, 3 * row : 3 * row + 3]
        other = others.get(one.anchor.id)
        word = "good" if framed.sigma(row) <= GOOD_SHARE * sigma_range else "weak"
        surveyed.append(SurveyedAnchor(
            name, framed.position[row], P,
            one.anchor.offset, sigmas.get(("anchor_offset_m", one.anchor.id), 0.0),
            one.ranges, one.rejected, "two places" if other is not None else word, other,
            one.anchor.scale, sigmas.get(("anchor_scale", one.anchor.id), 0.0),
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
    R = np.diag([0.0, 0.0, framed.sign])
    R[:2, :2] = framed.rotation
    return Trajectory(smoothed.stamp_ns, at, heading, R @ smoothed.covariances @ R.T)


def _landmarks(smoothed: _core.Smoothed, messages: Messages, framed: Framed) -> MappedLandmarks:
    """Return the landmarks, whose rows of the covariance follow those of all anchors."""
    first = 3 * len(smoothed.anchors)
    names, count = messages.landmark_names, len(smoothed.landmarks)
    at = np.array([one.position for one in smoothed.landmarks]).reshape(-1, 2)
    at = framed.moved(np.column_stack([at, np.zeros(count)]))[:, :2]
    P = np.asarray(smoothed.places_covariance)
    R = framed.rotation
    rows = [slice(first + 2 * i, first + 2 * i + 2) for i in range(count)]
    blocks = [R @ P[r, r] @ R.T for r in rows]
    called = np.array([names[one.id] for one in smoothed.landmarks], dtype=str)
    verdict = np.asarray(smoothed.verdict)
    counted = (messages.source == "landmark_sightings") & (verdict == int(_core.Verdict.FUSED))
    sightings = np.array([np.sum(counted & (messages.anchor == name)) for name in called.tolist()],
                         dtype=np.int64)  # fmt: skip
    return MappedLandmarks(called, at, np.array(blocks).reshape(-1, 2, 2), sightings)


def _tags(
    smoothed: _core.Smoothed, names: list[str], sought: Container[int]
) -> tuple[SurveyedTag, ...]:
    P = np.asarray(smoothed.places_covariance)
    first = len(P) - 2 * len(smoothed.tags)
    found = []
    for row, tag in enumerate(smoothed.tags):
        at = slice(first + 2 * row, first + 2 * row + 2)
        sigma = float(np.sqrt(np.linalg.eigvalsh(P[at, at])[-1]))
        if tag.id in sought:
            found.append(SurveyedTag(names[tag.id], np.array(tag.position[:2]), sigma))
    return tuple(found)
