# SPDX-License-Identifier: Apache-2.0
"""Map, anchors, calibration, noise and a configuration, from one drive (docs/commission.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from locfuse import NumericalError, _core
from locfuse.check import check
from locfuse.check.finding import Finding
from locfuse.check.proposal import GIVEN, Line, flat, proposed, written
from locfuse.commission.advice import advice_of
from locfuse.commission.frame import laid_onto, pose_at, poses_of
from locfuse.commission.result import CONFIGURATION, TUNED, WORLD, Commissioned, says_anything
from locfuse.config.load import parse_config, read_yaml
from locfuse.config.schema import RunConfig
from locfuse.eval.trust import shares
from locfuse.io.log_folder import OF_THE_WORLD, read_world, with_world
from locfuse.run.mapping import MapResult, make_map
from locfuse.run.messages import truth_of
from locfuse.run.run import run
from locfuse.run.survey import OF_ORIGIN, OF_POSES, OF_START, SIGMA_OFFSET_M, survey
from locfuse.run.survey_frame import NOT_LIKE_THE_LIST, OF_LIST, limit_of
from locfuse.run.survey_result import SurveyResult
from locfuse.tune.result import TuneResult
from locfuse.tune.tune import tune
from locfuse.types import Columns, ConfigError, Log, LogError, RunResult, Trajectory

Progress = Callable[[str, float], None]
Made = TypeVar("Made")

_START_SIGMA = {"xy_m": 0.1, "heading_deg": 2.0}  # of a drive that was smoothed
_MOST_SCALE = 0.2  # logarithm of a scale that may be
_OF_MAP = "the frame is that of the map"
_SURE = 0.99  # that errors of anchors are none of chance
_SIGMA_TAG_M = 0.3  # of the place of a tag of which nothing is known
_SIGMA_SCALE = 0.05  # of what a range is times the distance


def commission(
    path: Path,
    *,
    base: Path | None = None,
    config: Mapping[str, Any] | None = None,
    resolution_m: float = 0.05,
    progress: Progress | None = None,
) -> Commissioned:
    """Find what a new robot needs from one drive.

    Parameters
    ----------
    path : Path
        Log folder or bag.
    base : Path, optional
        Folder in which the configuration will be; paths in it and in `config` are relative to it.
    config : dict, optional
        Keys of a configuration that are known; they stay as they are. ``start``, a pose, is where
        this drive begins, in the frame of all that is found.
    resolution_m : float
        Side of a cell of the map, metres.
    progress : callable, optional
        Called with (part, share of it that is done).

    Raises
    ------
    ConfigError, LogError
        If the recording cannot be read, or nothing can be made of it.
    """
    setup = _Setup.of(path, Path() if base is None else base, dict(config or {}),
                      progress or (lambda part, share: None))  # fmt: skip
    setup.assume_tags()
    setup.find_places(resolution_m)
    setup.calibrate()
    setup.tune()
    return setup.finished()


@dataclass
class _Setup:
    """What is known so far."""

    lines: list[Line]
    recorded: Log
    progress: Progress
    world: Log
    map: MapResult | None = None
    survey: SurveyResult | None = None
    tuned: TuneResult | None = None
    missing: list[str] = field(default_factory=list)
    start: list[float] | None = None  # that is given
    begins: Any = "auto"  # where the drive does, for a survey
    is_framed: bool = False  # whether truth, positions or landmarks give the frame
    onto_list: bool = False  # whether the list of anchors is the frame
    untuned: list[Line] = field(default_factory=list)
    assumed_tags: tuple[str, ...] = ()

    @classmethod
    def of(cls, path: Path, base: Path, given: dict[str, Any], progress: Progress) -> _Setup:
        progress("read", 0.0)
        start = given.pop("start", None)
        lines, log = proposed(path, base, given)
        setup = cls(lines, log, progress, Log({}))
        folder = setup.config().ros.world
        # Mounts only as far as they were given: a recording brings those of its own.
        mounts = Log({}) if folder is None else read_world(base / folder)
        setup.world = replace(
            mounts, tables={stem: log[stem] for stem in OF_THE_WORLD if stem in log},
            tags=log.tags, map=log.map, grid=log.grid,
        )  # fmt: skip
        if not isinstance(start, str | None):
            setup.start = [float(part) for part in start]
        setup.lines = [line for line in lines if line[0] != "ros.world"]  # which is in the log now
        return setup

    # -- configuration ------------------------------------------------------------------------

    def config(self, **changes: Any) -> RunConfig:
        """Return the configuration as it is so far, with other sections."""
        values = read_yaml("".join(written(self.lines)), CONFIGURATION)
        return parse_config({**values, **changes})

    @property
    def log(self) -> Log:
        """The recording in the world that was found."""
        return with_world(self.recorded, self.world)

    def put(self, key: str, value: Any, why: str) -> None:
        """Set a key, unless it was given."""
        if not any(line[2] == GIVEN and f"{line[0]}.".startswith(f"{key}.") for line in self.lines):
            self.lines = [line for line in self.lines if line[0] != key] + [(key, value, why)]

    def attempt(self, part: str, make: Callable[[], Made]) -> Made | None:
        """Make a part; say why not where it cannot be."""
        self.progress(part, 0.0)
        try:
            return make()
        except (ConfigError, LogError, NumericalError, ValueError) as problem:
            self.missing.append(f"no {part}: {problem}")
            return None

    # -- places -------------------------------------------------------------------------------

    def assume_tags(self) -> None:
        """Take tags of which nobody knows the place for those of the body's centre, at first."""
        ranges = self.recorded.tables.get("ranges", {})
        named = np.unique(ranges["tag"]).tolist() if len(ranges.get("stamp_ns", ())) else []
        known = self.recorded.tags
        self.assumed_tags = tuple(name for name in named if name not in known)
        up = float(np.mean([place[2] for place in known.values()])) if known else 0.0
        tags = {**known, **dict.fromkeys(self.assumed_tags, (0.0, 0.0, up))}
        self.recorded = replace(self.recorded, tags=tags)

    def find_places(self, resolution_m: float) -> None:
        """Make the map and find anchors, in one frame: a given one, else that of the map."""
        truth = truth_of(self.recorded) if self.start is None else None
        if truth is not None and truth.heading is None:
            truth = None
        reference = truth if self.start or truth is not None else self._in_known_frame()
        self.is_framed = reference is not None
        self.begins = self.start or ("truth" if truth is not None else [0.0, 0.0, 0.0])
        if reference is not None and truth is None:
            self.begins = "auto" if self._has("positions") else _first_of(reference)
        if self._has("scans") and self.recorded.grid is None and not self._flies:
            first = int(self.recorded["scans"]["stamp_ns"].min())
            known = self.start if truth is None else pose_at(truth, first)
            self._make_map(known or [0.0, 0.0, 0.0], resolution_m)
            if known is None and reference is not None:
                self._lay_map_onto(reference, resolution_m)
        seeks = self._has("ranges") or (self._names_landmarks and "landmarks" not in self.recorded)
        if self._flies or not seeks:
            return
        self.onto_list = "anchors" in self.recorded and not (
            self.start or self.is_framed or self._is_on_map
        )
        self.find_anchors()
        if self.onto_list and self.survey is not None:
            self._lay_map_onto(self.survey.estimate, resolution_m)

    def _make_map(self, start: list[float], resolution_m: float) -> None:
        self.map = self.attempt("map", lambda: make_map(
            self.config(start=start), self.recorded, resolution_m=resolution_m,
            progress=lambda share: self.progress("map", share)))  # fmt: skip
        if self.map is not None:
            self.world = replace(self.world, grid=self.map.grid, map="map.yaml")
            # The poses of particles are fused with what is received between them.
            self.put("mcl", {"poses_hz": 2} if self._has("odometry") else {},
                     "a map was made of the scans")  # fmt: skip

    def _lay_map_onto(self, reference: Trajectory, resolution_m: float) -> None:
        """Draw the map again, in the frame of another drive."""
        if self.map is None:
            return
        pose = laid_onto(self.map.estimate, reference)
        if pose is None:
            self.missing.append("the map has a frame of its own: its drive and that by what gives "
                                "the frame are not at the same time")  # fmt: skip
        else:
            self._make_map(pose, resolution_m)

    def _in_known_frame(self) -> Trajectory | None:
        """Return the drive in the frame of positions, or of landmarks that are listed."""
        sources = ["positions"] if self._has("positions") else []
        if "landmarks" in self.recorded and self._has("landmark_sightings"):
            sources.append("landmark_sightings")
        if not sources or self._flies:
            return None
        with suppress(ConfigError, LogError, NumericalError, ValueError):
            config = self.config(start="auto", mcl=None, use=["odometry", *sources])
            return run(config, self.recorded).estimate
        return None

    def find_anchors(self) -> None:
        """Find anchors, landmarks and tags along the drive."""
        log = self._along_map(self.recorded)
        start = self.begins if self.map is None else _first_of(self.map.estimate)
        changes: dict[str, Any] = {"start": start, "mcl": None}
        if self._is_on_map:
            changes = {"start": self.start or "auto"}
        config = self._with_errors_of_anchors(**changes)
        self.survey = self.attempt("survey", lambda: survey(
            config, log, sigma_tag_m=_SIGMA_TAG_M if self.assumed_tags else 0.0,
            uncertain_tags=self.assumed_tags, onto_list=self.onto_list,
            progress=lambda share: self.progress("survey", share)))  # fmt: skip
        if self.survey is None:
            return
        if self.survey.frame == OF_POSES:
            self.survey = replace(self.survey, frame=_OF_MAP)
        elif self.survey.frame == OF_START and self.start is None:
            self.survey = replace(self.survey, frame=OF_ORIGIN)
        if self._is_on_map and self.survey.frame != _OF_MAP:
            self.missing.append("anchors and map are in two frames: particles found no one place "
                                "on the map; set start in --config")  # fmt: skip
        tables = dict(self.world.tables)
        if any(a.word != "not placed" for a in self.survey.anchors):
            tables["anchors"] = self._list_of_anchors(self.survey)
        if len(self.survey.landmarks) and "landmarks" not in tables:
            tables["landmarks"] = self.survey.landmarks.columns()
        tags = dict(self.world.tags)
        for tag in self.survey.tags:
            up = self.recorded.tags[tag.name][2]
            tags[tag.name] = (float(tag.position[0]), float(tag.position[1]), up)
        self.world = replace(self.world, tables=tables, tags=tags)

    def _list_of_anchors(self, found: SurveyResult) -> Columns:
        """Return the anchors found, and of a list in the same frame what is not refuted."""
        listed = self.recorded.tables.get("anchors")
        if listed is not None and NOT_LIKE_THE_LIST in found.findings:
            self.missing.append("no anchors: those of anchors.csv stay, which the drive does not "
                                "fit")  # fmt: skip
            return listed
        if listed is not None and not (self.is_framed or found.frame in (OF_LIST, _OF_MAP)):
            self.missing.append(f"the places of anchors.csv are not used: {found.frame}")
            listed = None
        return _anchors(found, listed)

    # -- noise --------------------------------------------------------------------------------

    def calibrate(self) -> None:
        """Find the errors of anchors where they are, by a smoothed drive."""
        drive = self._drive_so_far
        if not self._has("ranges") or "anchors" not in self.world or drive is None:
            return
        if not self.knows_lengths:
            self.missing.append("no scale of ranges: nothing but wheels says how far the robot "
                                "went; list two anchors whose distance is measured")  # fmt: skip
            return
        config = self._with_errors_of_anchors(
            start=_first_of(drive), start_sigma=_START_SIGMA, mcl=None, smooth=True)  # fmt: skip
        with suppress(ConfigError, LogError, NumericalError, ValueError):
            learnt = run(config, self._along_map(self.log)).metrics["calibration"]
            errors = _errors_of(learnt or {})
            if any(abs(np.log(error.get("scale", 1.0))) > _MOST_SCALE for error in errors.values()):
                self.missing.append("no errors of anchors: ranges are not the distances to these "
                                    "places; are units of anchors.csv metres?")  # fmt: skip
            elif errors:
                self.put("anchors", errors, "found by a smoothed drive among them")

    @property
    def knows_lengths(self) -> bool:
        """Whether something else than wheels says how far the robot went."""
        is_laid = self.survey is not None and self.survey.frame in (OF_LIST, _OF_MAP)
        return self.map is not None or self.is_framed or is_laid

    @property
    def _is_on_map(self) -> bool:
        """Whether the recording has a map, on which particles find the drive."""
        return self.map is None and self.recorded.grid is not None and self.config().mcl is not None

    @property
    def _drive_so_far(self) -> Trajectory | None:
        if self.map is not None:
            return self.map.estimate
        return self.survey.estimate if self.survey is not None else None

    def _along_map(self, log: Log) -> Log:
        """Return a log with the drive by which the map was made, if any was, as poses."""
        if self.map is None:
            return log
        return replace(log, tables={**log.tables, "poses": poses_of(self.map.estimate)})

    def _with_errors_of_anchors(self, **changes: Any) -> RunConfig:
        """Return the configuration with offsets and scales of anchors that are found."""
        config = self.config(**changes)
        calibration = config.estimator.calibration
        errors = {
            "sigma_anchor_scale": calibration.sigma_anchor_scale or _SIGMA_SCALE,
            "sigma_anchor_offset_m": calibration.sigma_anchor_offset_m or SIGMA_OFFSET_M,
        }
        estimator = config.estimator.model_copy(
            update={"calibration": calibration.model_copy(update=errors)}
        )
        return config.model_copy(update={"estimator": estimator})

    def tune(self) -> None:
        """Find noise and calibration along the drive as it is known now."""
        log, drive = self._along_map(self.log), self._drive_so_far
        changes: dict[str, Any] = {"mcl": None}
        if self._is_on_map:
            changes = {"mcl": {"poses_hz": 1.0}}
        if drive is not None:
            changes |= {"start": _first_of(drive), "start_sigma": _START_SIGMA}
        self.tuned = self.attempt("tune", lambda: tune(
            self.config(**changes), [log],
            progress=lambda done, total: self.progress("tune", done / max(total, 1))))  # fmt: skip
        if self.tuned is None:
            return
        self.untuned = self.lines
        values = {one.quantity.key: one for one in self.tuned.quantities}
        for key, value in flat(self.tuned.changes):
            why = TUNED
            if key in values:
                one = values[key]
                why += f": 95 % {one.low:.3g} to {one.high:.3g} {one.quantity.unit}".rstrip()
            self.put(key, value, why)

    # -- the end ------------------------------------------------------------------------------

    def finished(self) -> Commissioned:
        """Drive the recording with what was found, and say what is missing."""
        self._put_last()
        drive = self._drive()
        if self.tuned is not None and drive is not None and _lost(drive) > 0.0:
            tuned, self.lines = self.lines, self.untuned
            self._put_last()
            other = self._drive()
            if other is not None and _lost(other) < _lost(drive):
                drive = other
                self.missing.append("what was tuned is left out: with it the drive is lost longer")
            else:
                self.lines = tuned
        config, log = self.config(), self.log
        findings: list[Finding] = []
        with suppress(ConfigError, LogError):
            findings = check(config, log).findings
        result = Commissioned(
            lines=tuple(self.lines), config=config, world=self.world, checks=tuple(findings),
            map=self.map, survey=self.survey, tuned=self.tuned, drive=drive,
            missing=tuple(self.missing),
        )  # fmt: skip
        return replace(result, advice=tuple(advice_of(result)))

    def _put_last(self) -> None:
        if not self._knows_start:
            self.put("start", [0.0, 0.0, 0.0], "nothing says where the robot is: its first pose")
        else:
            self.put("start", "auto", "found anew by each drive")
        if says_anything(self.world):
            self.put("ros.world", WORLD, "what is known of the world")

    def _drive(self) -> RunResult | None:
        config, log = self.config(), self.log
        return self.attempt(
            "drive",
            lambda: run(
                config,
                log,
                progress=lambda done, total: self.progress("drive", done / max(total, 1)),
            ),
        )

    # -- what the recording has ---------------------------------------------------------------

    def _has(self, source: str) -> bool:
        return len(self.recorded.tables.get(source, {}).get("stamp_ns", ())) > 0

    @property
    def _names_landmarks(self) -> bool:
        return self._has("landmark_sightings") and bool(
            (self.recorded["landmark_sightings"]["landmark"] != "").any())  # fmt: skip

    @property
    def _flies(self) -> bool:
        return self.config().estimator.kind == "air"

    @property
    def _knows_start(self) -> bool:
        log = self.log
        has_places = any(stem in log for stem in OF_THE_WORLD) or log.grid is not None
        return not self._flies and (has_places or self._has("positions") or self._has("poses"))


def _errors_of(learnt: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return the section ``anchors``: the errors of a kind, if together they stand out."""
    errors: dict[str, dict[str, float]] = {}
    for kind, key, right in (("anchor_offset_m", "offset_m", 0.0), ("anchor_scale", "scale", 1.0)):
        found = {name.removeprefix(kind).strip(): error for name, error in learnt.items()
                 if name.startswith(kind)}  # fmt: skip
        squares = sum((error["value"] / error["sigma"]) ** 2 for error in found.values())
        if found and squares > _core.chi_squared_quantile(len(found), _SURE):
            for name, error in found.items():
                errors.setdefault(name, {})[key] = round(right + error["value"], 4)
    return errors


def _first_of(drive: Trajectory) -> list[float]:
    """Return the first pose of a drive [x, y, heading_deg]."""
    assert drive.heading is not None
    x, y = map(float, drive.position[0])
    return [x, y, float(np.rad2deg(drive.heading[0]))]


def _lost(drive: RunResult) -> float:
    """Return the share of the time that a robot was lost."""
    return 0.0 if drive.health is None else shares(drive.health).get("lost", 0.0)


def _anchors(found: SurveyResult, listed: Columns | None) -> Columns:
    """Return the list of anchors: places that a list has and the drive does not contradict stay."""
    old = {} if listed is None else {
        str(name): np.array([listed[axis][row] for axis in ("x_m", "y_m", "z_m")])
        for row, name in enumerate(listed["anchor"].tolist())}  # fmt: skip
    places = {a.name: a.position for a in found.anchors if a.word != "not placed"}
    sigmas = {a.name: a.sigma_m for a in found.anchors}
    for name, at in old.items():
        new = places.get(name)
        if new is None or np.hypot(*(new - at)[:2]) <= limit_of(sigmas[name]):
            places[name] = at
    if not places:
        return {}
    at = np.array(list(places.values()))
    return {"anchor": np.array(list(places), dtype=str), "x_m": at[:, 0].copy(),
            "y_m": at[:, 1].copy(), "z_m": at[:, 2].copy()}  # fmt: skip
