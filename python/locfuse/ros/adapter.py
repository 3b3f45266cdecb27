# SPDX-License-Identifier: Apache-2.0
"""A live run between topics, without ROS: what the nodes of ROS 1 and ROS 2 hand messages to."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from locfuse.config.ros import POSE, TYPES, Ros, plain, types_of
from locfuse.config.schema import SOURCES, RunConfig, ignored_by, places_antennas
from locfuse.io.geodesy import Origin, distance, to_degrees, to_plane
from locfuse.io.georeference import FARTHEST_M
from locfuse.io.recording import world_of
from locfuse.io.rosbag import clouds, decode, encode, rows
from locfuse.io.rosbag.decode import MessageError
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.fields import OtherMessages
from locfuse.io.rosbag.fixes import Fixes, is_beside, overridden, unplaced
from locfuse.io.rosbag.frames import check_frame
from locfuse.live import MAX_KEPT, LiveHealth, LivePose, LiveRun, Row
from locfuse.ros.future_stamps import FUTURE_NS, LASTING, PATIENCE_NS, EarlyMessage, EarlyMessages
from locfuse.ros.publications import Odometry, PublicationBuilder, health_status, source_status
from locfuse.ros.world import World
from locfuse.run.missing_inputs import sigma_key
from locfuse.run.start import given_start
from locfuse.run.tracker import TRIANGLE
from locfuse.types import NANOSECONDS, ConfigError, Log, nearest

BACK_NS = NANOSECONDS  # a clock that goes back that far has jumped
MAX_WATCHED = 100  # poses that wait to be judged
SILENT_NS = 5 * NANOSECONDS  # after which a silent topic is reported
TRANSFORMS_NS = NANOSECONDS // 2  # within which static transforms come
CLOCKS = "are both machines' clocks set, and use_sim_time the same for all nodes?"
SIMILAR = 3  # problems of one kind, each reported once

LATCHED = ("map", "anchors", "landmarks", "transforms")
QUEUES = {"odometry": 500, "imu": 2000, "ranges": 500, "scans": 50}


@dataclass(frozen=True)
class Subscription:
    """A topic to listen to.

    `topic` has no leading slash where it is relative to the node's namespace; `source` goes to
    `Adapter.on`. The first of `types`, as ``nav_msgs/Odometry``, is the usual one; none of them is
    any type, that of its publisher. If `latched`,
    what was published before counts: ``transient_local`` in ROS 2. `queue` messages may wait.
    """

    topic: str
    source: str
    types: tuple[str, ...]
    latched: bool = False
    queue: int = 100


class Adapter:
    """Turns messages of either ROS into those of a `LiveRun`, and says what to publish.

    It never raises for what a message says: that is a problem, reported once in a sentence. In
    `config`, as `locfuse run` takes it, ``ros`` names topics and frames; ``ros.world`` is relative
    to `base`. `announced` is what it may ask to publish: (topic, type, latched). Raises ConfigError
    or LogError if the configuration cannot be used on a robot, or the world cannot be read.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> adapter = Adapter(parse_config({"start": "auto", "use": ["odometry", "ranges"]}))
    >>> [s.topic for s in adapter.subscriptions if s.source == "ranges"]
    ['uwb']
    >>> [p.fields["status"][0]["message"] for p in adapter.tick(10**9)]
    ['nothing has been received yet']
    """

    def __init__(self, config: RunConfig, *, base: Path | None = None) -> None:
        if config.watch_poses:  # whose localizer publishes map -> odom
            ros = config.ros.model_copy(update={"publish_transform": False})
            config = config.model_copy(update={"ros": ros})
        world, ros = world_of(config.ros, base)
        published = Log(tables={}) if world is None else world
        self._config = config = config.model_copy(update={"ros": ros})
        self._origin_is_given = ros.gps_origin is not None
        self._world = World(published, ros.frames.base)
        self._live = LiveRun(config, published) if self._is_enough(published) else None
        self._publications = PublicationBuilder(ros)
        self._of: dict[str, Callable[[Any, str], None]] = {
            "odometry": self._odometry,
            "imu": self._imu,
            "scans": self._scan,
            "ranges": self._ranges,
            "poses": self._pose,
            "positions": self._position,
            "landmark_sightings": self._sightings,
            "altitudes": self._altitude,
            "headings": self._heading,
            "courses": self._course,
            "map": self._map,
            "anchors": self._points("anchors"),
            "landmarks": self._points("landmarks"),
            "initial_pose": self._initial_pose,
            "transforms": self._transforms,
        }
        self._others = OtherMessages(ros)
        self._range_topics = {plain(topic): name for topic, name in ros.range_topics.items()}
        self.subscriptions = tuple(self._listens())
        self.announced = tuple(self._announces())
        self._problems: list[str] = []
        self._reported: set[str] = set()
        self._kinds: Counter[tuple[str, str]] = Counter()
        self.refused: Counter[str] = Counter()
        self._off: set[str] = set()
        self._bodies: set[str] = set()  # frames of odometry that were looked at
        self._clear()

    def _clear(self) -> None:
        self._wheels = self._new_wheels()
        self._driven = Odometry()
        self._watched: dict[int, LivePose] = {}  # the last poses that are watched, by stamp
        self._fixes = Fixes(self._config.ros.gps_origin)
        self._fixes_wait = False  # for transforms
        self._imu_from_ns: int | None = None  # first sample
        self._antennas: set[str] = set()  # frames of fixes that nothing placed
        self._first_ns: int | None = None  # of the clock
        self._now_ns: int | None = None
        self._received_ns: dict[str, int] = {}  # by the clock, per source
        self._diagnosed_ns: int | None = None
        self._jumps = 0
        self._restarts = 0
        self._early = EarlyMessages()
        self._takes_early = False
        self._behind: Counter[str] = Counter()  # messages in a row that are too old, by topic
        self._waiting: deque[tuple[str, Row]] = deque(maxlen=MAX_KEPT)

    def _listens(self) -> list[Subscription]:
        config = self._config
        wanted = set(config.use) | {"map", "anchors", "landmarks", "initial_pose"}
        if config.estimator.kind != "air":
            wanted.discard("altitudes")
        if "headings" in wanted:
            wanted.add("courses")
        makers = config.mcl, config.cylinders, config.scan_odometry
        if config.searches_start or any(part is not None for part in makers):
            wanted.add("scans")
        listens = [
            Subscription(
                topic,
                source,
                () if source in config.ros.fields else types_of(source),
                source in LATCHED,
                QUEUES.get(source, 100),
            )
            for source in TYPES
            if source in wanted
            for topic in config.ros.topics.of(source)
        ]
        if "ranges" in config.use:
            listens += [
                Subscription(topic, "ranges", ("sensor_msgs/Range",))
                for topic in self._range_topics
            ]
        listens.append(Subscription("/tf_static", "transforms", TYPES["transforms"], True))
        return listens

    def _announces(self) -> list[tuple[str, str, bool]]:
        topics = self._config.ros.topics
        published = [("diagnostics", "diagnostic_msgs/DiagnosticArray", False)]
        if self._config.ros.publish_transform:
            published.append(("tf", "tf2_msgs/TFMessage", False))
        for topic, kind, latched in (
            (topics.estimate, POSE, False),
            (topics.path, "nav_msgs/Path", False),
            (topics.start, POSE, True),
            (topics.fallback if self._config.watch_poses else None, POSE, False),
            (topics.mapped if self._maps else None, "locfuse_msgs/NamedPoints", True),
        ):
            if topic is not None:
                published.append((topic, kind, latched))
        return published

    # Receiving -----------------------------------------------------------------------------------

    def on(self, source: str, topic: str, message: Any, now_ns: int) -> list[Publication]:
        """Take a message of one of the `subscriptions`.

        Parameters
        ----------
        source, topic : str
            Of the subscription.
        message : message of ROS 1 or ROS 2
        now_ns : int
            The clock of the node, simulated or not; 0 where that has not begun.

        Returns
        -------
        list of Publication
        """
        published = self._keep_time(now_ns)
        self._received_ns[source] = max(now_ns, self._received_ns.get(source, 0))
        return published + self._take(source, topic, message)

    def _take(self, source: str, topic: str, message: Any) -> list[Publication]:
        try:
            shaped = message  # what comes too early is kept as it came
            if plain(topic) not in self._range_topics:
                shaped = self._others.shaped(
                    source,
                    message,
                    _type_of(message),
                    self._now_ns or 0,
                    lambda error: self._refuse(source, f"{topic}: {error}"),
                )
            if shaped is not None:
                self._of[source](shaped, plain(topic))
        except EarlyMessage as early:
            if not self._early.keep(early, source, topic, message):
                self._refuse(source, f"{topic}: too many messages wait for the clock")
        except ValueError as error:  # all that a message can do wrong
            self._refuse(source, f"{topic}: {error}")
        return self._say(source)

    def tick(self, now_ns: int) -> list[Publication]:
        """Say what is due by the clock: the transform, and once a second diagnostics.

        Call it about ten times a second, with `now_ns` as for `on`.
        """
        published = self._keep_time(now_ns)
        self._look_for_silence(now_ns)
        self._look_for_early()
        self._look_for_antennas(now_ns)
        if self._live is not None and (pose := self._live.pose()) is not None:
            if self._config.ros.estimate_at == "odometry":
                published += self._publications.pose_again(pose)
            published += self._publications.transform_again(now_ns)
        if self._diagnosed_ns is None or now_ns - self._diagnosed_ns >= NANOSECONDS:
            self._diagnosed_ns = now_ns
            published.append(self._diagnostics(now_ns))
            if self._maps and self._live is not None:
                published += self._publications.mapped(self._live.landmarks(), now_ns)
        return published

    def _keep_time(self, now_ns: int) -> list[Publication]:
        """Take what waited for this time, and notice a clock that goes back.

        That of a simulation does which begins again.
        """
        if self._now_ns is not None and now_ns < self._now_ns - BACK_NS:
            back = (self._now_ns - now_ns) / NANOSECONDS
            self._problem("clock", f"the clock went back by {back:.3g} s; clock_jump is "
                          f"{self._config.clock_jump!r}")  # fmt: skip
            self._publications.clock_went_back()
            for source, count in self._early.clear().items():
                self.refused[source] += count
                self._problem("early", f"{count} messages of {source} waited for a time that the "
                              "clock went back from, and are left out")  # fmt: skip
            self._received_ns = dict.fromkeys(self._received_ns, now_ns)
            self._first_ns = self._diagnosed_ns = None
            if self._config.clock_jump == "reset":
                self.reset()
        self._now_ns = now_ns
        if self._first_ns is None and now_ns > 0:  # simulated time has begun
            self._first_ns = now_ns
        self._takes_early = True  # which waited, so that they say nothing of a clock that is behind
        due = self._early.due(now_ns)
        published = [given for one in due for given in self._take(*one[1:])]
        self._takes_early = False
        return published

    def _odometry(self, message: Any, topic: str) -> None:
        use = self._config.ros.odometry_from
        row = decode.odometry(message, use)
        self._check_body(row.child_frame)
        self._in_time(row.stamp_ns, topic)
        self._driven.add(row)
        self._feed("odometry", self._wheels.row(row))
        if self._live is not None and self._live.jumps > self._jumps:
            self._jumps = self._live.jumps
            self._wheels = self._new_wheels()

    def _new_wheels(self) -> rows.Wheels:
        return rows.Wheels(self._config.ros.odometry_from, partial(self._problem, "odometry"))

    def _check_body(self, frame: str) -> None:
        """Look once at a frame that odometry is of, and again when there are new transforms."""
        if frame not in self._bodies:
            if published := self._world.tree.same_body(frame):
                self._problem("body", published)
            self._bodies.add(frame)

    def _imu(self, message: Any, topic: str) -> None:
        row, frame = decode.imu(message), plain(decode.frame_of(message))
        self._in_time(row.stamp_ns, topic)
        self._imu_from_ns = min(row.stamp_ns, self._imu_from_ns or row.stamp_ns)
        waits = row.stamp_ns - self._imu_from_ns < TRANSFORMS_NS
        if self._config.is_inertial and waits and frame and frame not in self._world.tree:
            return  # its transform is latched, but may come later
        self._feed("imu", rows.imu_row(row, self._world.tree.turn(frame)))

    def _scan(self, message: Any, topic: str) -> None:
        if clouds.is_cloud(message):
            pose = self._world.sensor_pose(plain(decode.frame_of(message)))
            row = clouds.scan_of(message, pose, self._config.ros.cloud_heights_m)
        else:
            row = decode.scan(message)
        self._in_time(row.stamp_ns, topic)
        mount, upside_down = row.mount, False
        if mount is None:
            mount, upside_down = self._world.laser_mount(row.frame, row.angle_increment)
        if row.saturated is not None:
            self._problem("saturated", decode.saturated_readings([row.saturated]))
        if self._live is not None:
            laser = rows.laser_of(row, mount, upside_down)
            self._live.on("scans", rows.scan_row(row, laser))

    def _ranges(self, message: Any, topic: str) -> None:
        ros = self._config.ros
        if topic in self._range_topics:
            one = decode.range_of(message, ros.uwb_tag, self._range_topics[topic])
            received = [] if one is None else [one]
        else:
            received = decode.ranges(
                message,
                ros.uwb_unit,
                ros.uwb_tag,
                lambda error: self._refuse("ranges", f"{topic}: {error}"),
            )
        for row in received:
            self._in_time(row.stamp_ns, topic)
        if received and "anchors" not in self._world.log:
            raise MessageError("ranges come, but no anchors are known; give anchors.csv in the "
                               "folder of ros.world, or publish them on "
                               f"{ros.topics.anchors}")  # fmt: skip
        for tag, frame in {row.tag: row.frame for row in received}.items():
            if self._world.add_tag(tag, frame):
                self._rebuild()
        for row in received:
            self._feed("ranges", rows.range_row(row))

    def _pose(self, message: Any, topic: str) -> None:
        row = decode.pose(message)
        check_frame("poses", row.frame, self._config.ros.frames.map)
        self._in_time(row.stamp_ns, topic)
        found = rows.pose_row(row)
        if self._config.watch_poses:
            at = np.array([row.x, row.y, row.heading])
            self._watched[row.stamp_ns] = LivePose(row.stamp_ns, at, row.covariance)
            while len(self._watched) > MAX_WATCHED:
                del self._watched[next(iter(self._watched))]
        else:
            self._look_at_sigma("poses", topic, found["sigma_xy_m"])
        self._feed("poses", found)

    def _position(self, message: Any, topic: str) -> None:
        now = decode.fix(message, self._fixes.origin or (0.0, 0.0, 0.0))
        if now is None:
            return
        self._in_time(now.stamp_ns, topic)
        of_antenna = hasattr(message, "latitude")
        if of_antenna:
            self._wait_for_transforms(now.frame)
        else:
            check_frame("positions", now.frame, self._config.ros.frames.map)
        for row in self._fixes.rows(message):
            if of_antenna and is_beside(row.frame, self._world.tree):
                if places_antennas(self._config.estimator):
                    row = row._replace(tag=row.frame)
                else:
                    self._problem("antenna", overridden(row.frame, self._world.tree))
            elif of_antenna and row.frame:
                self._antennas.add(row.frame)
            if row.tag and self._world.add_tag(row.tag, row.frame):
                self._rebuild()
            self._look_at_sigma("positions", topic, row.sigma_m)
            self._feed("positions", rows.position_row(row))
        if self._fixes.sentence:
            self._problem("origin", self._fixes.sentence)

    def _wait_for_transforms(self, frame: str) -> None:
        """Keep what came before the transforms, which are latched, but come in any order."""
        if self._first_ns is None or self._now_ns is None or not frame:
            return
        is_early = self._now_ns < self._first_ns + TRANSFORMS_NS and not self._takes_early
        if is_early and (self._fixes_wait or frame not in self._world.tree):
            self._fixes_wait = True  # so that those after it do not come before
            raise EarlyMessage(self._first_ns + TRANSFORMS_NS + FUTURE_NS)

    def _look_at_sigma(self, source: str, topic: str, sigma: float) -> None:
        key = sigma_key(source, self._config.estimator)
        if sigma <= 0.0 and key:
            self._problem(
                "sigma", f"messages on {topic} bring no sigma and are not used; set {key}"
            )

    def _sightings(self, message: Any, topic: str) -> None:
        seen = decode.sightings(message)
        for row in seen:
            self._in_time(row.stamp_ns, topic)
        if seen and self._world.add_landmark_sensor(seen[0].frame):
            self._rebuild()
        for row in seen:
            self._feed("landmark_sightings", rows.sighting_row(row))

    def _altitude(self, message: Any, topic: str) -> None:
        row = decode.altitude(message)
        if row is None:
            return
        check_frame("altitudes", row.frame, self._config.ros.frames.map)
        self._in_time(row.stamp_ns, topic)
        self._feed("altitudes", rows.altitude_row(row))

    def _heading(self, message: Any, topic: str) -> None:
        self._feed_heading(decode.heading(message, self._config.ros.gps_origin), topic)

    def _course(self, message: Any, topic: str) -> None:
        row = decode.course(message, self._config.ros.gps_origin)
        if row is not None:
            self._feed_heading(row, topic)

    def _feed_heading(self, row: decode.HeadingRow, topic: str) -> None:
        self._in_time(row.stamp_ns, topic)
        self._feed("headings", rows.heading_row(row))

    def _map(self, message: Any, topic: str) -> None:
        check_frame("the map", message.header.frame_id, self._config.ros.frames.map)
        if self._world.add_map(decode.grid(message)):
            self._rebuild()

    def _points(self, table: str) -> Callable[[Any, str], None]:
        def received(message: Any, topic: str) -> None:
            check_frame(table, message.header.frame_id, self._config.ros.frames.map)
            if self._world.add_points(table, *decode.points(message)):
                self._rebuild()

        return received

    def _transforms(self, message: Any, topic: str) -> None:
        self._world.add_transforms(decode.transforms(message))
        self._bodies.clear()

    def _initial_pose(self, message: Any, topic: str) -> None:
        row = decode.pose(message, is_stamped=False)
        if self._publications.is_own_start(row.stamp_ns):
            return  # our own
        check_frame("the initial pose", row.frame, self._config.ros.frames.map)
        if self._live is None:
            raise MessageError(f"a pose was set, but {self._missing()}")
        stamp = self._live.received_ns or row.stamp_ns or self._now_ns or 0
        variance, covariance = np.diag(row.covariance), row.covariance
        if not covariance.any() or variance[0] == -1.0:
            self._problem("initial pose", f"the pose on {topic} has no covariance; start_sigma of "
                          "the configuration is taken for it")  # fmt: skip
            start = row.x, row.y, float(np.degrees(row.heading))
            covariance = given_start(start, self._config.start_sigma, stamp).covariance
        elif not (variance > 0.0).all():
            raise MessageError("the variances of x, y and heading are not positive; expected > 0, "
                               "or all 0 where they are not known")  # fmt: skip
        self._live.start_at(LivePose(stamp, np.array([row.x, row.y, row.heading]), covariance))

    def _in_time(self, stamp_ns: int, topic: str) -> None:
        if not self._now_ns:
            return
        ahead_ns = stamp_ns - self._now_ns
        if ahead_ns > PATIENCE_NS:
            raise MessageError(f"the stamp is {ahead_ns / NANOSECONDS:.3g} s ahead of the clock; "
                               f"{CLOCKS}")  # fmt: skip
        if ahead_ns > FUTURE_NS:
            raise EarlyMessage(stamp_ns)
        behind_s = -ahead_ns / NANOSECONDS
        limit_s = max(self._config.history_s, FUTURE_NS / NANOSECONDS)
        too_old = behind_s > limit_s and not self._takes_early
        self._behind[topic] = self._behind[topic] + 1 if too_old else 0
        if self._behind[topic] == LASTING:
            self._problem("behind", f"messages on {topic} are stamped {behind_s:.6g} s before the "
                          f"clock, and come too late to be used; {CLOCKS}")  # fmt: skip

    # The run -------------------------------------------------------------------------------------

    @property
    def _maps(self) -> bool:
        return self._config.estimator.kind == "landmark_slam"

    def _feed(self, source: str, row: Row) -> None:
        """Give a row to the run; without one it waits, unless that is for a map."""
        if self._live is not None:
            self._live.on(source, row)
        elif self._config.mcl is None:
            self._waiting.append((source, row))

    def _is_enough(self, world: Log) -> bool:
        if self._config.mcl is not None:
            return world.grid is not None
        return self._config.estimator.kind != "tag_triangle" or len(world.tags) >= TRIANGLE

    def _missing(self) -> str:
        if self._config.mcl is not None:
            return (f"mcl waits for a map on {self._config.ros.topics.map}, or in the folder "
                    "ros.world")  # fmt: skip
        known = list(self._world.log.tags)
        return f"tag_triangle waits for positions or ranges of {TRIANGLE} tags, it knows {known}"

    def _rebuild(self) -> None:
        """Go on with a run that knows the world as it is now, from where the last one was."""
        if not self._is_enough(self._world.log):
            return
        before = self._live
        try:
            self._live = self._anew()
        except ValueError:
            if before is not None:
                self._world.log = before.world  # goes on as it was
            raise
        if before is not None:
            self._live.go_on_from(before)
        while self._waiting:
            self._live.on(*self._waiting.popleft())

    def _anew(self) -> LiveRun:
        """Return a run that has received nothing, with the sources off that are."""
        live = LiveRun(self._config, self._world.log)
        for source in self._off:
            live.enable(source, False)
        return live

    def reset(self) -> None:
        """Forget everything received but the world: as at the start."""
        if self._live is not None:
            self._live = self._anew()
        self._publications.forget()
        self._clear()

    def relocalize(self) -> None:
        """Forget the pose and search it anew."""
        if self._live is not None:
            self._live.relocalize()
        self._publications.start_is_open()

    @property
    def is_on_earth(self) -> bool:
        """Whether fixes or ``ros.gps_origin`` say where on the Earth the map begins."""
        return (self._config.ros.gps_origin is not None
                or any(one.source == "positions" for one in self.subscriptions))  # fmt: skip

    def set_datum(self, at: Any) -> None:
        """Let the map begin at a geographic_msgs/GeoPose, and forget all but the world, as `reset`.

        An orientation of zeros leaves the x axis eastwards. Raises ConfigError for what is no place
        on the Earth, or where ``ros.gps_origin`` says where ``ros.world`` is.
        """
        ros, turned = self._config.ros, at.orientation
        if ros.world is not None and self._origin_is_given:
            raise ConfigError("ros.gps_origin says where the map of ros.world begins")
        is_set = (turned.x, turned.y, turned.z, turned.w) != (0.0, 0.0, 0.0, 0.0)
        try:
            heading = math.degrees(decode.heading_of(turned)) if is_set else 0.0
            place = at.position.latitude, at.position.longitude, heading
            origin = Ros.model_validate({"gps_origin": place}).gps_origin
        except (MessageError, ValidationError):
            raise ConfigError(f"latitude {at.position.latitude:g}, longitude "
                              f"{at.position.longitude:g} with that orientation is no place on the "
                              "Earth") from None  # fmt: skip
        ros = ros.model_copy(update={"gps_origin": origin})
        self._config = self._config.model_copy(update={"ros": ros})
        self.reset()

    def from_degrees(self, latitude: float, longitude: float) -> tuple[float, float]:
        """Return x and y [m] in the map of a latitude and longitude [deg].

        Raises ConfigError as long as nothing says where on the Earth the map begins, and for what
        is far from there.
        """
        origin = self._origin()
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0
                and distance(latitude, longitude, origin) <= FARTHEST_M):  # fmt: skip
            raise ConfigError(f"latitude {latitude:g}, longitude {longitude:g} is not near the "
                              f"map's origin at {origin[0]:g}, {origin[1]:g}")  # fmt: skip
        return to_plane(latitude, longitude, 0.0, origin)

    def to_degrees(self, x: float, y: float) -> tuple[float, float]:
        """Return latitude and longitude [deg] of a point [m] of the map.

        Raises ConfigError as long as nothing says where on the Earth the map begins, and for what
        is far from there.
        """
        if not math.hypot(x, y) <= FARTHEST_M:
            raise ConfigError(f"({x:g}, {y:g}) m is not near the map's origin")
        return to_degrees(x, y, self._origin())

    def _origin(self) -> Origin:
        if self._fixes.origin is None:
            raise ConfigError("where the map begins is not known yet: no fix has come that the "
                              "next one confirms, and ros.gps_origin is not set")  # fmt: skip
        return self._fixes.origin

    def enable(self, source: str, enabled: bool) -> None:
        """Switch a source off, or on again.

        Raises ConfigError if there is no such source, or the configuration does not use it.
        """
        known = [s for s in (*SOURCES, "scans") if s in {one.source for one in self.subscriptions}]
        if source not in known:
            raise ConfigError(f"there is no source {source!r}; {nearest(source, known)}")
        (self._off.discard if enabled else self._off.add)(source)
        if self._live is not None:
            self._live.enable(source, enabled)

    # Publishing ----------------------------------------------------------------------------------

    def _say(self, source: str) -> list[Publication]:
        if self._live is None:
            return []
        newest = self._live.pose()
        if newest is None:
            return []
        if self._live.restarts > self._restarts:
            self._restarts = self._live.restarts
            self._publications.start_is_open()
        fused = self._config.ros.estimate_at == "fused"
        pose = self._live.fused() if fused else newest
        assert pose is not None
        published = self._publications.pose(pose) + self._publications.start(newest)
        published += self._fallback(pose)
        if source == "odometry":
            published += self._publications.transform(newest, self._driven)
        return published

    def _fallback(self, estimate: LivePose) -> list[Publication]:
        """Publish each watched pose that is not lost, once it is judged, else the estimate."""
        assert self._live is not None
        if self._config.ros.topics.fallback is None:
            return []
        watched = self._live.watched()
        if watched is None:
            return []
        if watched.state != "lost":
            judged = self._watched.get(watched.judged_ns or 0)
            return [] if judged is None else self._publications.fallback(judged)
        trusted = self._live.health().state in ("ok", "degraded")
        return self._publications.fallback(estimate) if trusted else []

    def health(self, now_ns: int) -> LiveHealth:
        """Return how far the pose may be trusted; what has fallen silent is not."""
        nothing = np.full(3, np.inf)
        if self._live is None:
            return LiveHealth("initializing", self._missing(), 0.0, 1.0, nothing)
        watched = {"poses"} if self._config.watch_poses else set()
        received = [self._received_ns[s] for s in (*SOURCES, "scans")
                    if s in self._received_ns and s not in watched]  # fmt: skip
        if not received:
            return LiveHealth("initializing", "nothing has been received yet", 0.0, 1.0, nothing)
        silent = (now_ns - max(received)) / NANOSECONDS
        if silent > self._config.health.aiding_lost_s:
            return LiveHealth("lost", f"nothing has been received for {silent:.3g} s", 0.0, 1.0,
                              nothing)  # fmt: skip
        return self._live.health()

    def _diagnostics(self, now_ns: int) -> Publication:
        health = self.health(now_ns)
        statuses = [health_status(health)]
        if self._live is not None:
            if (watched := self._live.watched()) is not None:
                if health.state == "lost" and self._live.health().state != "lost":  # it is silent
                    watched = replace(watched, state="degraded", reason=health.reason, within=0.0,
                                      wrong=1.0, protection=health.protection)  # fmt: skip
                statuses.append(health_status(watched, "watched poses"))
            stamp = now_ns if self._live.received_ns is None else self._live.received_ns
            statuses += [source_status(source, stamp) for source in self._live.sources()]
            statuses.append(self._counts())
        return encode.diagnostics(now_ns, statuses)

    def _counts(self) -> encode.Fields:
        assert self._live is not None
        values: dict[str, object] = {
            f"{source} {verdict}": count
            for (source, verdict), count in sorted(self._live.counts.items())
        }
        values |= {f"{source} refused": n for source, n in sorted(self.refused.items())}
        values |= {f"{source} switched off": "yes" for source in sorted(self._off)}
        level = encode.WARN if self.refused else encode.OK
        return encode.diagnostic_status("locfuse: messages", level, "messages by what became of "
                                        "them", values)  # fmt: skip

    def _look_for_silence(self, now_ns: int) -> None:
        if self._first_ns is None or now_ns - self._first_ns < SILENT_NS:
            return
        moves = "imu" if self._config.is_inertial else "odometry"
        is_used = moves == "imu" or moves not in ignored_by(self._config.estimator)
        for one in self.subscriptions:
            if is_used and one.source == moves and one.source not in self._received_ns:
                self._silent(one)
        measures = [s for s in self.subscriptions if s.source in (*SOURCES[1:], "scans")]
        if measures and not any(s.source in self._received_ns for s in measures):
            for one in measures:
                self._silent(one)
        if self._live is None:
            self._problem("map", self._missing())
        for sentence in self._others.problems():
            self._problem("fields", sentence)

    def _look_for_antennas(self, now_ns: int) -> None:
        """Say of which frames of fixes no static transform has come, which had time to."""
        if self._first_ns is None or now_ns - self._first_ns < SILENT_NS:
            return
        for frame in sorted(self._antennas):
            if frame not in self._world.tree:
                self._problem("antenna", unplaced(frame, self._config.ros.frames.base))
        self._antennas.clear()

    def _look_for_early(self) -> None:
        topic = self._early.last()
        if topic is not None:
            self._problem("early", f"messages on {topic} are stamped more than "
                          f"{FUTURE_NS / NANOSECONDS:g} s ahead of the clock, and wait for it; "
                          f"{CLOCKS}")  # fmt: skip

    def _silent(self, one: Subscription) -> None:
        of = f" ({' or '.join(one.types[:3])})" if one.types else ""
        self._problem(f"silent {one.topic}",
                      f"nothing comes on {one.topic}{of}; is its driver "
                      f"running, and is ros.topics.{one.source} the right name?")  # fmt: skip

    def _refuse(self, source: str, sentence: str) -> None:
        self.refused[source] += 1
        self._problem(f"refused {source}", sentence)

    def _problem(self, kind: str, sentence: str) -> None:
        """Keep a sentence to report, once; of one kind only the first few."""
        kinds = (kind, "published")
        if sentence in self._reported or self._kinds[kinds] >= SIMILAR:
            return
        self._reported.add(sentence)
        self._kinds[kinds] += 1
        if self._kinds[kinds] == SIMILAR:
            sentence += " (others like it are counted in the diagnostics)"
        self._problems.append(sentence)

    def problems(self) -> list[str]:
        """Return sentences for the log that have not been returned before."""
        published, self._problems = self._problems, []
        return published


def _type_of(message: Any) -> str:
    """Return the type of a message of either ROS, as ``nav_msgs/Odometry``."""
    kind = type(message)
    by_itself = getattr(message, "_type", None) or getattr(message, "__msgtype__", None)
    return str(by_itself or f"{kind.__module__.partition('.')[0]}/{kind.__name__}")
