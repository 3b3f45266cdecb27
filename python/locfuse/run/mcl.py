# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo localization along a log: scans on its map, odometry, and what else is used."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.build import (
    build_health_config,
    build_mcl_config,
    build_recovering_config,
    build_switching_config,
)
from locfuse.config.schema import RunConfig
from locfuse.run.health import health_of, watched_of
from locfuse.run.messages import Messages, cut_off, landmarks_of, radios_of, to_messages, truth_of
from locfuse.run.missing_inputs import how_to_add
from locfuse.run.start import grid_of, hypotheses_of, scans_of, start_of
from locfuse.types import (
    NANOSECONDS,
    Columns,
    Frame,
    Health,
    Hypothesis,
    Log,
    LogError,
    Start,
    Trajectory,
    Watched,
)

_MAX_FRAMES = 700  # of a run, so that a long one stays small: a minute at ten scans a second
_MAX_PARTICLES = 2000  # of a frame
LIKELY = 0.01  # probability from which a pose is reported as a hypothesis


def columns_of(record: _core.RunLog | _core.LocalizeRun) -> Columns:
    """Return what became of each message, and why, as the core says it."""
    names = ("verdict", "reason", "nis", "dof", "residual", "limit", "log_likelihood")
    return {name: getattr(record, name) for name in names}


@dataclass(frozen=True)
class Localization:
    """How an `Mcl` went along a log.

    Attributes
    ----------
    messages : Messages
        What it was given beside scans.
    begin_ns, end_ns : int
        When it started, and the last stamp of a message or scan.
    outcomes, scan_outcomes : dicts of arrays, shapes (m,) and (s,)
        Columns of `columns_of`, in the order of the messages and of the log's scans.
    estimate : Trajectory
        After each scan, n rows; with heading and covariance.
    ready : bool array, shape (n,)
    particles : int64 array, shape (n,)
    searched : bool
        Whether it had to find its pose.
    start : Start or None
        How it found it, if it did.
    wall_s : float
        That it took.
    health : Health
        How far the estimates may be trusted, a row for each.
    watched : Watched or None
        How far watched poses may be, with ``watch_poses``.
    injections : tuple of Injection
        When UWB took over, where ``mcl`` has a switch.
    reports : tuple of LocalizeReport
        The pose after each scan, as a robot has it, where they are poses of another estimator.
    frames : tuple of Frame
        Particles on the way, evenly chosen of a long log.
    """

    messages: Messages
    begin_ns: int
    end_ns: int
    outcomes: Columns
    scan_outcomes: Columns
    estimate: Trajectory
    ready: NDArray[np.bool_]
    particles: NDArray[np.int64]
    searched: bool
    start: Start | None
    wall_s: float
    health: Health
    watched: Watched | None = None
    injections: tuple[_core.Injection, ...] = ()
    reports: tuple[_core.LocalizeReport, ...] = ()
    frames: tuple[Frame, ...] = ()


def messages_for(config: RunConfig, log: Log) -> Messages:
    """Return the messages that the `Mcl` takes: odometry alone where the pose EKF has the others.

    Raises LogError where the log has no scans or no map, or has none of these messages.
    """
    if config.mcl is None:
        raise ValueError("the config has no mcl")
    scans = "scans" in log and len(log["scans"]["stamp_ns"]) > 0
    for what, missing in (("scans", not scans), ("map", log.grid is None)):
        if missing:
            called = "a map" if what == "map" else what
            raise LogError(f"mcl needs {called}, but the log has none; {how_to_add(log, what)}, "
                           "or remove mcl")  # fmt: skip
    if config.mcl.poses_hz is not None:
        config = config.model_copy(update={"use": [s for s in config.use if s == "odometry"]})
    return to_messages(log, config)


def mcl_of(
    config: RunConfig, log: Log, messages: Messages, start: _core.PoseEstimate | None = None
) -> _core.Mcl | _core.SwitchingMcl:
    """Return the estimator at its start: at a pose, or anywhere in free space (``start: auto``).

    With ``mcl.switch`` a filter of ranges and positions runs in parallel, from the same start.
    Raises ConfigError where the start is ``truth`` and the log has none, or none with a heading,
    and ValueError where the map has no free or no occupied cell.
    """
    assert config.mcl is not None
    grid = grid_of(log)
    assert grid is not None
    anchors, tags = radios_of(log, messages, config)
    begin = min(messages.begin_ns, int(log["scans"]["stamp_ns"].min()))
    if start is None and config.start != "auto":
        start = start_of(config, truth_of(log), messages)
    return mcl_on(config, grid, begin, (anchors, tags), landmarks_of(log, messages), start)


def mcl_on(
    config: RunConfig,
    grid: _core.OccupancyGrid,
    begin_ns: int,
    radios: tuple[_core.AnchorMap, list[_core.Tag]],
    landmarks: _core.LandmarkSensor | None,
    start: _core.PoseEstimate | None,
) -> _core.Mcl | _core.SwitchingMcl:
    """Return the estimator of ``mcl`` on a map, at a pose or, without one, anywhere in free space.

    Raises ValueError where the map has no free or no occupied cell.
    """
    assert config.mcl is not None
    settings = build_mcl_config(config.mcl, config.estimator, config.seed, config.watch_poses)
    settings.health = build_health_config(config.health)
    mcl = _core.Mcl(settings, _core.World(*radios, landmarks, grid), begin_ns)
    if start is not None:
        mcl.start_at([_core.PoseHypothesis(start)])
    if config.mcl.switch is None:
        return mcl
    uwb = _core.RecoveringEkf(build_recovering_config(config), _core.World(*radios))
    if start is not None:
        uwb.start_at(start)
    return _core.SwitchingMcl(build_switching_config(config.mcl.switch), mcl, uwb)


def live_mcl(config: RunConfig, mcl: _core.Mcl | _core.SwitchingMcl) -> _core.LiveMcl:
    """Return the estimator as messages and scans arrive, late ones up to ``history_s``."""
    return _core.LiveMcl(mcl, round(config.history_s * NANOSECONDS),
                         _core.ClockJump[config.clock_jump.upper()],
                         config.history_messages)  # fmt: skip


def localize(
    config: RunConfig,
    log: Log,
    *,
    start: _core.PoseEstimate | None = None,
    progress: Callable[[int, int], None] | None = None,
    watch: Callable[[Callable[[], tuple[Log, Localization]]], None] | None = None,
) -> Localization:
    """Localize on the map of a log, as ``mcl`` of a configuration says.

    Parameters
    ----------
    config : RunConfig
    log : Log
    start : PoseEstimate, optional
        Instead of what the configuration says.
    progress : callable, optional
        Called with (messages and scans done, in all).
    watch : callable, optional
        Called after each scan with what returns, while it is called, the log up to there and how
        it went so far.

    Raises
    ------
    ConfigError, LogError
        As `messages_for` and `mcl_of`.
    """
    messages = messages_for(config, log)
    mcl = live_mcl(config, mcl_of(config, log, messages, start))
    scans = scans_of(log)
    begin = mcl.estimate().stamp
    search = _Search(mcl) if start is None and config.start == "auto" else None
    total = len(messages.log) + len(scans)
    film = _Frames(mcl)
    scans_done = 0

    def localization_of(run: _core.LocalizeRun) -> Localization:
        wall_s = clock.seconds
        poses = run.poses
        return Localization(
            messages=messages,
            begin_ns=begin,
            end_ns=max(messages.end_ns, int(log["scans"]["stamp_ns"].max())),
            outcomes=columns_of(run),
            scan_outcomes={"verdict": run.scan_verdict, "reason": run.scan_reason},
            estimate=Trajectory(run.stamp_ns, poses[:, :2].copy(), poses[:, 2].copy(),
                                run.covariances),
            ready=run.ready,
            particles=run.particles,
            searched=search is not None,
            start=None if search is None else search.start(begin),
            wall_s=wall_s,
            health=health_of(run, messages, config),
            watched=watched_of(run, config),
            injections=tuple(mcl.injections),
            reports=tuple(run.reports) if config.mcl and config.mcl.poses_hz is not None else (),
            frames=tuple(film.frames),
        )  # fmt: skip

    def look(done: int, run: Callable[[], _core.LocalizeRun]) -> None:
        nonlocal scans_done
        scans_done += 1
        with clock.stopped():
            film.look()
            if search is not None:
                search.look()
            if progress is not None:
                progress(done, total)
            if watch is not None:
                watch(lambda: _part(log, localization_of(run()), done - scans_done, scans_done))

    clock = Stopwatch()
    arrivals = scan_arrivals_of(log)
    return localization_of(_core.localize(mcl, messages.log, scans, arrivals, look))


def scan_arrivals_of(log: Log) -> list[int]:
    """Return when each scan of a log arrives; none where they arrive at their stamps."""
    return log["scans"]["arrival_ns"].tolist() if "arrival_ns" in log["scans"] else []


def _part(
    log: Log, localization: Localization, messages_done: int, scans_done: int
) -> tuple[Log, Localization]:
    """Return a log and its localization up to what is done, in the order in which it was used."""
    stamp = log["scans"]["stamp_ns"]
    received = np.zeros(len(localization.outcomes["verdict"]), np.bool_)
    seen = np.zeros(len(stamp), np.bool_)
    order = np.argsort(localization.messages.effective_ns, kind="stable")
    received[order[:messages_done]] = True
    seen[np.argsort(stamp, kind="stable")[:scans_done]] = True
    until = int(stamp[seen].max())
    log, messages = cut_off(log, localization.messages, until, received, seen)
    return log, replace(
        localization,
        messages=messages,
        end_ns=until,
        outcomes={name: column[received] for name, column in localization.outcomes.items()},
        scan_outcomes={name: column[seen] for name, column in localization.scan_outcomes.items()},
    )


class Stopwatch:
    """Time that a computation takes, without what is done aside."""

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self._aside = 0.0

    @property
    def seconds(self) -> float:
        """Time so far."""
        return time.perf_counter() - self._began - self._aside

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """Do something aside."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self._aside += time.perf_counter() - began


def frame_of(mcl: _core.LiveMcl) -> Frame:
    """Return the present estimate, with a copy of at most 2000 particles."""
    now = mcl.estimate()
    particles = mcl.particles
    step = -(-len(particles) // _MAX_PARTICLES)
    pose = np.array([now.pose.x, now.pose.y, now.pose.heading])
    return Frame(now.stamp, particles[::step].copy(), pose, mcl.ready)


class _Frames:
    """Looks at an `Mcl` after each scan; of many scans, after every second, fourth and so on."""

    def __init__(self, mcl: _core.LiveMcl) -> None:
        self.frames: list[Frame] = []
        self._mcl = mcl
        self._scans = 0
        self._each = 1

    def look(self) -> None:
        if self._scans % self._each == 0:
            self.frames.append(frame_of(self._mcl))
        self._scans += 1
        if len(self.frames) > _MAX_FRAMES:
            self.frames = self.frames[::2]
            self._each *= 2


class _Search:
    """Looks at an `Mcl` after each scan until it is ready."""

    def __init__(self, mcl: _core.LiveMcl) -> None:
        self._mcl = mcl
        self._steps: list[tuple[int, tuple[Hypothesis, ...]]] = []
        self._found = False

    def look(self) -> None:
        if not self._found:
            found = self._mcl.hypotheses
            likely = [h for h in found if h.probability >= LIKELY] or found[:1]
            self._steps.append((found[0].estimate.stamp, hypotheses_of(likely)))
            self._found = self._mcl.ready

    def start(self, begin_ns: int) -> Start | None:
        if not self._found:
            return None
        stamp, hypotheses = self._steps[-1]
        return Start(
            stamp_ns=stamp,
            seconds=(stamp - begin_ns) / NANOSECONDS,
            pose=hypotheses[0].pose,
            covariance=hypotheses[0].covariance,
            steps=tuple(self._steps),
            used_scans=True,
        )


def with_poses_of(localization: Localization, log: Log, rate_hz: float) -> Log:
    """Return the log with the estimates of an `Mcl` in place of its poses.

    Estimates are poses while they are ready, and at most one in each tick of the rate. They arrive
    when a robot has them; those of scans that still wait when the log ends do not.
    """
    ticks = PoseTicks(localization.begin_ns, rate_hz)
    kept = [report for report in localization.reports
            if report.arrival is not None and report.ready and ticks.take(report.estimate.stamp)
            ]  # fmt: skip
    estimates = [report.estimate for report in kept]
    variance = np.array([np.diag(e.covariance) for e in estimates]).reshape(-1, 3)
    poses: Columns = {
        "stamp_ns": np.array([e.stamp for e in estimates], np.int64),
        "x_m": np.array([e.pose.x for e in estimates]),
        "y_m": np.array([e.pose.y for e in estimates]),
        "heading_rad": np.array([e.pose.heading for e in estimates]),
        "sigma_xy_m": np.sqrt(variance[:, :2].mean(axis=1)),
        "sigma_heading_rad": np.sqrt(variance[:, 2]),
        "arrival_ns": np.array([report.arrival for report in kept], np.int64),
    }
    return replace(log, tables={**log.tables, "poses": poses})


class PoseTicks:
    """Lets one estimate of each tick of ``mcl.poses_hz`` pass."""

    def __init__(self, begin_ns: int, rate_hz: float) -> None:
        self._begin_ns = begin_ns
        self._rate_hz = rate_hz
        self._tick: int | None = None

    def take(self, stamp_ns: int) -> bool:
        """Return whether an estimate is the first of its tick."""
        # A tick that falls on a stamp is that stamp's, however the division was rounded.
        seconds = (stamp_ns - self._begin_ns) / NANOSECONDS
        tick = int(np.floor(seconds * self._rate_hz + 1e-6))
        is_first = tick != self._tick
        self._tick = tick
        return is_first
