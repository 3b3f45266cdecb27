# SPDX-License-Identifier: Apache-2.0
"""The counterpart of `locfuse.run.run` for messages as they arrive."""

from __future__ import annotations

from collections import Counter, deque
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from locfuse import _core
from locfuse.config.build import build_anchors, build_cylinder_detector
from locfuse.config.schema import USABLE, RunConfig
from locfuse.live.rows import Message, Row, Rows, effective_ns, reported_covariance
from locfuse.run.cylinders import ONE_LASER
from locfuse.run.health import name_of, reason_of, watch_reasons
from locfuse.run.mcl import LIKELY, PoseTicks, live_mcl, mcl_on
from locfuse.run.messages import landmark_sight
from locfuse.run.odometry import odometry_timeline, uses_gyro
from locfuse.run.start import given_start, grid_of
from locfuse.run.tracker import mapped_landmarks, recovering_ekf
from locfuse.types import NANOSECONDS, ConfigError, FloatArray, Log, MappedLandmarks, nearest

PATIENCE_NS = 250_000_000
Item = Message | list[_core.MadeMotion]
MAX_KEPT = 5000  # messages that are kept for a run that takes over before there is a pose


@dataclass(frozen=True)
class LivePose:
    """Where the robot is, as known now.

    `pose` is x [m], y [m] and heading [rad] in world, shape (3,); `covariance`, shape (3, 3), is of
    the same, position error in world. Of a body that flies `height` is over z = 0 [m],
    `height_variance` in m^2. With an inertial sensor `orientation` is the unit quaternion
    (w, x, y, z) from body to world, `orientation_covariance`, shape (3, 3), of its error, a
    rotation about the axes of the world [rad^2].
    """

    stamp_ns: int
    pose: FloatArray
    covariance: FloatArray
    height: float | None = None
    height_variance: float | None = None
    orientation: FloatArray | None = None
    orientation_covariance: FloatArray | None = None


@dataclass(frozen=True)
class LiveHealth:
    """How far the pose may be trusted, as known now.

    `state` is ``initializing``, ``ok``, ``degraded``, ``ambiguous``, ``dead_reckoning`` or
    ``lost``; `reason` says why, in a sentence, and is empty where all is well. `within` is the
    probability that the position error is below ``health.limit_m``, `wrong` that the robot is
    somewhere else. |error| in x [m], y [m] and heading [rad] exceeds `protection`, shape (3,), with
    ``health.risk`` at most; infinite where that cannot be said.
    """

    state: str
    reason: str
    within: float
    wrong: float
    protection: FloatArray


@dataclass(frozen=True)
class LiveWatched(LiveHealth):
    """How far the poses of another localizer may be trusted, as known now.

    As `LiveHealth`, of its last pose, carried on by odometry: `error`, shape (3,), is that less the
    estimate, x [m], y [m] and heading [rad]; NaN until there are both. `within` is of position and
    heading, `judged_ns` the stamp of that pose.
    """

    error: FloatArray
    judged_ns: int | None


@dataclass(frozen=True)
class LiveSource:
    """What became of the messages of a source: a sensor, an anchor, a landmark.

    The stamps are of the last message, and of the last fused one (None if none was); `accepted` is
    the share of the last messages that was fused. `residual`, `sigma` and `test_ratio` are of the
    last innovation: its first row, that row's sigma, and its NIS over the gate's limit. `faulty` is
    the probability that the source is wrong as a whole, if the pose is right.
    """

    name: str
    received_ns: int
    fused_ns: int | None
    accepted: float
    residual: float
    sigma: float
    test_ratio: float
    faulty: float


class LiveRun:
    """A run on messages as they arrive.

    With the rows of a log in their order of arrival its estimates are those of `run` at the same
    stamps, bit for bit, if nothing came later than a quarter of a second while it searched its
    start, and the samples of a gyro begin when the wheels do.

    Not used are ``log``, ``simulation`` and ``switched_off`` of `config`, and the messages of
    `world`. `names` holds names in order of id; `counts` how many messages became what, by
    (source, verdict). Raises ConfigError where the start is ``truth``, or the world lacks what
    `config` needs.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> anchors = {"anchor": np.array(["A"]), "x_m": np.zeros(1), "y_m": np.zeros(1),
    ...            "z_m": np.zeros(1)}
    >>> live = LiveRun(parse_config({"start": [3, 4, 0]}),
    ...                Log({"anchors": anchors}, tags={"tag": (0.0, 0.0, 0.0)}))
    >>> for i in range(4):
    ...     _ = live.on("ranges", {"stamp_ns": i * 10**8, "tag": "tag", "anchor": "A",
    ...                            "range_m": 5.1})
    >>> live.pose().stamp_ns
    300000000
    """

    def __init__(self, config: RunConfig, world: Log) -> None:
        if config.start == "truth":
            raise ConfigError("start is 'truth', which a robot does not know; expected 'auto' or "
                              "[x, y, heading_deg]")  # fmt: skip
        if config.smooth:
            raise ConfigError("smooth needs the whole log, and a live run has no end; remove it")
        if config.mcl is not None and world.grid is None:
            raise ConfigError("mcl needs a map, but the world has none; add 'map: FILE.yaml' to "
                              "its log.yaml, or remove mcl")  # fmt: skip
        self.config = config
        self.world = world
        self._cylinders = (
            None if config.cylinders is None else build_cylinder_detector(config.cylinders)
        )
        self._disabled: set[str] = set()
        self._forget()

    def _forget(self) -> None:
        config, world = self.config, self.world
        self.names = Rows(config, world)
        self.counts: Counter[tuple[str, str]] = Counter()
        self._radios = (
            build_anchors(world.tables.get("anchors"), self.names.anchor_names, config.anchors),
            [_core.Tag(i, list(world.tags[name])) for i, name in enumerate(self.names.tag_names)],
        )
        self._given = None if isinstance(config.start, str) else config.start
        # Of scans, or from the first sample of a gyro on.
        self._odometry = None
        if config.scan_odometry is not None:
            self._odometry = odometry_timeline(config, uses_gyro(config))
        self._held: list[Item] = []
        self._driven: Row = {}  # the last odometry
        self._received: deque[tuple[str, Row]] = deque(maxlen=MAX_KEPT)  # while it searches
        self._received_ns: int | None = None
        self._on_map: _core.LiveMcl | None = None
        self._found_on_map = False  # one place was left at some time, or the start was given
        self._map_pose: _core.PoseEstimate | None = None
        self._only_laser: _core.Pose2 | None = None  # by which cylinders are seen
        self._filter: _core.Live | None = None
        if config.mcl is None or config.mcl.poses_hz is not None:
            self._filter = _core.Live(
                recovering_ekf(config, self._world_of_landmarks(), self.names.landmark_names,
                               *self._radios, matches_scans=self._given is None),
                round(config.history_s * NANOSECONDS),
                _core.ClockJump[config.clock_jump.upper()],
                config.history_messages,
                PATIENCE_NS,
            )  # fmt: skip

    def _world_of_landmarks(self) -> Log:
        """Return the world, seen by the laser where cylinders in its scans are landmarks."""
        world = self.world
        if self._cylinders is None or world.laser is None:
            return world
        return replace(world, landmark_sensor={"pose_in_body": world.laser["pose_in_body"]})

    def _landmarks(self) -> _core.LandmarkSensor:
        return landmark_sight(self._world_of_landmarks(), self.names.landmark_names)

    # Received -----------------------------------------------------------------------------------

    def on(self, source: str, row: Row) -> str:
        """Take a row of the table `source` of a log, with the names and units of its columns.

        A scan brings, beside ``stamp_ns`` and ``ranges_m``, its ``laser``: the name of one of
        several in the world, or a mapping as `Log.laser` where its geometry is not the world's.

        Returns
        -------
        str
            What became of it: a verdict as in ``outcomes.csv``; ``ignored`` as well while it
            searches, and of scans that wait for their turn.

        Raises
        ------
        ValueError
            If there is no such source, a column is missing, or a value is not valid; the row is
            forgotten.
        """
        if source not in (*USABLE, "scans"):
            raise ValueError(
                f"there is no source {source!r}; {nearest(source, (*USABLE, 'scans'))}"
            )
        is_searching = not self._is_found
        try:
            stamp = int(row["stamp_ns"])
            if source == "scans":
                verdict = self._on_scan(row)
            elif source not in self.config.use or source in self._disabled:
                verdict = _core.Verdict.IGNORED
            else:
                verdict = self._on_row(source, row)
        except KeyError as error:
            raise ValueError(f"a row of {source} has no {error}; it has {', '.join(row)}") from None
        except TypeError as error:
            raise ValueError(f"a row of {source} has a value of another type: {error}") from None
        if is_searching:
            self._received.append((source, row))
        elif self._received:
            self._received.clear()
        if source == "odometry":
            self._driven = row
        self._received_ns = stamp if self._received_ns is None else max(stamp, self._received_ns)
        word = verdict.name.lower()
        self.counts[source, word] += 1
        return word

    @property
    def _is_found(self) -> bool:
        if self._filter is not None:
            return self._filter.is_tracking
        return self._found_on_map and self._map_pose is not None

    def _is_watched(self, message: Item) -> bool:
        return self.config.watch_poses and isinstance(message, _core.PoseObservation)

    @property
    def _has_begun(self) -> bool:
        """Whether there is an estimator that may judge poses, now or after its start."""
        if self._filter is None:
            return self._on_map is not None
        return self._filter.is_tracking or self._given is not None

    def _on_row(self, source: str, row: Row) -> _core.Verdict:
        if source == "imu":
            if self.config.is_inertial:
                return self._on_message(self.names.imu(row))
            if not uses_gyro(self.config):
                return _core.Verdict.IGNORED
            if self._odometry is None:
                self._odometry = odometry_timeline(self.config, gyro=True)
            return self._drive(self._odometry, self.names.imu(row))
        message = self.names.message(source, row)
        if self._is_watched(message) and not self._has_begun:
            return _core.Verdict.IGNORED
        if self._odometry is not None and isinstance(message, _core.Velocity | _core.Increment):
            return self._drive(self._odometry, message)
        return self._on_message(message)

    def _drive(
        self, odometry: _core.OdometryTimeline, message: Message | _core.Imu | _core.LaserScan
    ) -> _core.Verdict:
        """Take what odometry is made of, and pass on the motions that this changes."""
        motions = odometry.on(message)
        if not motions or "odometry" in self._disabled:
            stale = odometry.outcome.verdict is _core.Verdict.STALE
            return _core.Verdict.STALE if stale else _core.Verdict.IGNORED
        return self._on_message(motions)

    def _on_message(self, message: Item) -> _core.Verdict:
        of_odometry = isinstance(message, _core.Velocity | _core.Increment | list)
        if self.config.mcl is not None and (self._filter is None or of_odometry):
            self._into_map(message)
        return _core.Verdict.IGNORED if self._filter is None else self._into_filter(message)

    def _on_scan(self, row: Row) -> _core.Verdict:
        scan = self.names.scan(row)
        if "scans" in self._disabled:
            return _core.Verdict.IGNORED
        if (self._odometry is not None and self.config.scan_odometry is not None
                and "odometry" in self.config.use):  # fmt: skip
            self._drive(self._odometry, scan)
        if self._cylinders is not None:
            self._only_laser = self._only_laser or scan.geometry.pose_in_body
            if scan.geometry.pose_in_body != self._only_laser:
                raise ValueError("cylinders are seen by one laser, but scans of two come; "
                                 f"{ONE_LASER}")  # fmt: skip
            for one in self._cylinders.detect(scan):
                sigmas = np.sqrt(np.diag(one.covariance)[:2])
                covariance = reported_covariance(sigmas)  # as in a table
                seen = _core.RangeBearing(scan.stamp, None, one.range, one.bearing, covariance)
                self._on_message(seen)
        if self.config.mcl is not None:
            self._into_map(scan)
        elif self._filter is not None and self._given is None:
            self._filter.on(scan)
        return _core.Verdict.IGNORED

    def _into_map(self, item: Item | _core.LaserScan) -> None:
        if self._on_map is None:
            begin = item.stamp if isinstance(item, _core.LaserScan) else _effective_ns(item)
            start = None if self._given is None else self._given_start(begin)
            self._on_map = self._start_on_map(begin, start)
        self._use_estimates(self._on_map.on(item))

    def _start_on_map(self, begin_ns: int, start: _core.PoseEstimate | None) -> _core.LiveMcl:
        grid = grid_of(self.world)
        if grid is None:
            raise ConfigError("mcl needs a map, but the world has none; add 'map: FILE.yaml' to "
                              "its log.yaml, or remove mcl")  # fmt: skip
        self._found_on_map = start is not None
        assert self.config.mcl is not None
        self._ticks = PoseTicks(begin_ns, self.config.mcl.poses_hz or 0.0)
        mcl = mcl_on(self.config, grid, begin_ns, self._radios, self._landmarks(), start)
        return live_mcl(self.config, mcl)

    def _use_estimates(self, estimates: list[_core.PoseEstimate]) -> None:
        """Note the poses after scans whose turn it was."""
        assert self._on_map is not None
        for estimate in estimates:
            self._found_on_map = self._found_on_map or self._on_map.ready
            self._map_pose = estimate
            if self._filter is not None and self._on_map.ready:
                self._feed_filter(estimate)

    def _feed_filter(self, estimate: _core.PoseEstimate) -> None:
        """Pass on a pose of the map, at most one in each tick of ``mcl.poses_hz``."""
        if "poses" in self._disabled or not self._ticks.take(estimate.stamp):
            return
        variance = np.diag(estimate.covariance)
        position = np.sqrt(variance[:2].mean())
        sigmas = [position, position, np.sqrt(variance[2])]
        covariance = reported_covariance(sigmas)  # as in a table
        self._into_filter(_core.PoseObservation(estimate.stamp, estimate.pose, covariance))

    def _into_filter(self, message: Item) -> _core.Verdict:
        assert self._filter is not None
        if self._given is not None and not self._filter.is_tracking:
            return self._into_start(message)
        jumps = self._filter.jumps
        outcome = self._filter.on(message)
        if self._filter.jumps > jumps:
            self.names.forget_odometry()
        return outcome.verdict

    def _into_start(self, message: Item) -> _core.Verdict:
        """Hold messages until the earliest is known: the given start holds at its stamp."""
        assert self._filter is not None
        self._held.append(message)
        used = [_effective_ns(one) for one in self._held if not self._is_watched(one)]
        if len(self._held) > MAX_KEPT and not used:
            self._held.pop(0)
        if self._is_watched(message) or _effective_ns(message) - (begin := min(used)) < PATIENCE_NS:
            return _core.Verdict.IGNORED
        self._filter.start_at(self._given_start(begin))
        verdict = _core.Verdict.IGNORED
        for held in self._held:
            verdict = self._filter.on(held).verdict
        self._held = []
        return verdict

    def _given_start(self, stamp: int) -> _core.PoseEstimate:
        assert self._given is not None
        return given_start(self._given, self.config.start_sigma, stamp)

    # Commands -----------------------------------------------------------------------------------

    def start_at(self, start: LivePose) -> None:
        """Go on from a pose that somebody knows, whatever was known before.

        Raises ValueError where the pose or its covariance is not valid; nothing changes then.
        """
        estimate = _core.PoseEstimate(start.stamp_ns, _core.Pose2(*start.pose.tolist()),
                                      start.covariance)  # fmt: skip
        if self._filter is not None:
            self._filter.start_at(estimate)
        if self.config.mcl is not None:
            self._on_map = self._start_on_map(start.stamp_ns, estimate)
            self._map_pose = estimate
        self._held = []

    def go_on_from(self, before: LiveRun) -> None:
        """Continue from a run of another world: from its pose, or with its latest messages.

        `before` has the same configuration. While it tracks its pose is taken, at the end of its
        odometry; until then this run is fed the latest messages of that one.
        """
        pose = before.pose()
        if pose is None:
            for source, row in before._received:
                self.on(source, row)
        else:
            self.names.go_on_from(before.names)
            self._odometry = copy(before._odometry)
            self.start_at(pose)
            if self._on_map is not None and before._on_map is not None:
                self._use_estimates(self._on_map.go_on_from(before._on_map))
            if "v_mps" in before._driven:  # which is held until the next one
                self.on("odometry", before._driven)

    def relocalize(self) -> None:
        """Forget the pose and search it, though the start was given."""
        self._given, self._held = None, []
        self._on_map = self._map_pose = None
        self._found_on_map = False
        if self._filter is not None:
            self._filter.relocalize()

    def reset(self) -> None:
        """Forget every message: as it was made, but for sources that are switched off."""
        self._forget()

    def enable(self, source: str, enabled: bool) -> None:
        """Switch a source off, or on again; what was fused stays.

        Raises ConfigError where there is no such source, or the configuration does not use it.
        """
        known = [*self.config.use, "scans"]
        if source not in known:
            raise ConfigError(f"there is no source {source!r}; {nearest(source, known)}")
        if enabled:
            self._disabled.discard(source)
        else:
            self._disabled.add(source)

    # State --------------------------------------------------------------------------------------

    def pose(self) -> LivePose | None:
        """Return where the robot is, carried to the end of odometry; None while it searches."""
        if not self._is_found:
            return None
        if self._filter is None:
            return self._pose_on_map()
        return _pose(self._filter.estimate(), self._filter.estimate_in_space())

    def fused(self) -> LivePose | None:
        """Return the pose that `run` records: at the stamp of the newest message that took effect.

        An increment takes effect when its motion begins, so this lags behind `pose` by up to one.
        Where none has changed the estimate for 0.1 s it is carried to the newest one, fused or not.
        """
        if not self._is_found:
            return None
        if self._filter is None:
            return self._pose_on_map()
        return _pose(self._filter.current(), self._filter.current_in_space())

    def _pose_on_map(self) -> LivePose:
        assert self._map_pose is not None
        return _pose(self._map_pose)

    def health(self) -> LiveHealth:
        """Return how far that may be trusted."""
        if self._filter is None:
            return self._health_on_map()
        report = self._filter.health()
        reason = reason_of(report.reason, report.source, self.names, self.config)
        if not self._filter.is_tracking:
            searching = "" if self._given is not None else self._filter.search().reason
            reason = searching or reason
        return LiveHealth(report.state.name.lower(), reason, report.within, report.wrong,
                          report.protection)  # fmt: skip

    def _health_on_map(self) -> LiveHealth:
        if self._on_map is None:
            nothing = np.full(3, np.inf)
            return LiveHealth("initializing", "no scan and no odometry yet", 0.0, 1.0, nothing)
        report = self._on_map.health()
        reason = reason_of(report.reason, report.source, self.names, self.config)
        state = report.state.name.lower()
        if state == "ambiguous" or (state == "initializing" and not self._found_on_map):
            places = sum(h.probability >= LIKELY for h in self._on_map.hypotheses)
            reason = f"{places} places on the map fit"
        return LiveHealth(state, reason, report.within, report.wrong, report.protection)

    def watched(self) -> LiveWatched | None:
        """Return how far watched poses may be trusted; None without ``watch_poses``."""
        if not self.config.watch_poses:
            return None
        of = self._on_map if self._filter is None else self._filter
        report = None if of is None else of.watched()
        if report is None:
            report = _core.WatchReport()
        reason = watch_reasons(self.config.health.aiding_lost_s)[report.reason]
        return LiveWatched(report.state.name.lower(), reason, report.within, report.wrong,
                           report.protection, report.error, report.judged)  # fmt: skip

    def sources(self) -> list[LiveSource]:
        """Return the status of each source that was fused or gated."""
        if self._filter is None:
            statuses = [] if self._on_map is None else self._on_map.sources
        else:
            statuses = self._filter.sources
        return [
            LiveSource(name_of(s.source, self.names), s.last_received, s.fused, s.accepted,
                       s.residual, s.sigma, s.test_ratio, s.faulty)
            for s in statuses
        ]  # fmt: skip

    def landmarks(self) -> MappedLandmarks | None:
        """Return the map of an estimator that maps, as known now; None of any other."""
        found = [] if self._filter is None else self._filter.landmarks
        return mapped_landmarks(self.config, found, self.names.landmark_names)

    @property
    def received_ns(self) -> int | None:
        """Newest stamp received, nanoseconds."""
        return self._received_ns

    @property
    def restarts(self) -> int:
        """How often it was lost and found another place."""
        return 0 if self._filter is None else self._filter.restarts

    @property
    def jumps(self) -> int:
        """How often the clock went back and it started anew or went on."""
        return (0 if self._filter is None else self._filter.jumps) + (
            0 if self._on_map is None else self._on_map.jumps)  # fmt: skip


def _effective_ns(item: Item) -> int:
    return effective_ns(item[0].increment if isinstance(item, list) else item)


def _pose(estimate: _core.PoseEstimate, in_space: _core.AirEstimate | None = None) -> LivePose:
    pose = np.array([estimate.pose.x, estimate.pose.y, estimate.pose.heading])
    if in_space is None:
        return LivePose(estimate.stamp, pose, estimate.covariance)
    attitude = in_space.attitude
    return LivePose(estimate.stamp, pose, estimate.covariance, in_space.height,
                    float(in_space.covariance[3, 3]),
                    None if attitude is None else attitude.quaternion,
                    None if attitude is None else attitude.covariance)  # fmt: skip
