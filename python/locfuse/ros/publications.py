# SPDX-License-Identifier: Apache-2.0
"""What a live run publishes: pose, path, map -> odom, the start, diagnostics."""

from __future__ import annotations

from collections import deque

from locfuse import _core
from locfuse.config.ros import Ros, plain
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.decode import OdometryRow
from locfuse.io.rosbag.encode import Publication
from locfuse.live import LiveHealth, LivePose, LiveSource
from locfuse.types import NANOSECONDS, FloatArray, MappedLandmarks

KEPT_NS = 5 * NANOSECONDS  # of odometry
PATH_POSES = 4000
PATH_STEP_M = 0.05


class Odometry:
    """Poses of odometry of the last seconds, as it gave them."""

    def __init__(self) -> None:
        self._rows: deque[tuple[int, _core.Pose2]] = deque()

    def add(self, row: OdometryRow) -> None:
        """Take a pose; one that is not newer, as after a clock jumped, replaces what follows."""
        while self._rows and self._rows[-1][0] >= row.stamp_ns:
            self._rows.pop()
        self._rows.append((row.stamp_ns, _core.Pose2(row.x, row.y, row.heading)))
        while self._rows[0][0] < row.stamp_ns - KEPT_NS:
            self._rows.popleft()

    def at(self, stamp_ns: int) -> _core.Pose2 | None:
        """Return the pose at a stamp, on an arc between two; None outside of what is kept."""
        t1, after = 0, None
        for t0, before in reversed(self._rows):  # what is asked for is nearly always the newest
            if t0 == stamp_ns:
                return before
            if t0 < stamp_ns:
                break
            t1, after = t0, before
        else:
            return None
        if after is None:
            return None
        share = (stamp_ns - t0) / (t1 - t0)
        moved = before.inverse() * after
        part = _core.Pose2(share * moved.x, share * moved.y, share * moved.heading)
        return before * part


class PublicationBuilder:
    """Builds publications, and remembers what was published."""

    def __init__(self, ros: Ros) -> None:
        self._ros = ros
        self._map, self._odom = plain(ros.frames.map), plain(ros.frames.odom)
        self.forget()

    def forget(self) -> None:
        """Begin a new path; nothing has been published."""
        self._last: LivePose | None = None
        self._path: deque[tuple[int, FloatArray]] = deque(maxlen=PATH_POSES)
        self._path_ns: int | None = None
        self._map_to_odom: tuple[float, float, float] | None = None
        self._transform_ns: int | None = None
        self._fallback_ns: int | None = None
        self._start_pose: LivePose | None = None

    def mapped(self, landmarks: MappedLandmarks | None, now_ns: int) -> list[Publication]:
        """Publish the landmarks that were mapped; nothing if there is none yet."""
        topic = self._ros.topics.mapped
        if topic is None or landmarks is None or len(landmarks) == 0:
            return []
        return [encode.mapped_landmarks(plain(topic), landmarks, self._map, now_ns)]

    def pose(self, pose: LivePose) -> list[Publication]:
        """Publish a pose, and now and then the path; nothing if it was the last one.

        One that is carried to the end of odometry is published once for each stamp: what is
        fused on top of it is in the next one, or in `pose_again`.
        """
        published = self._last is not None and self._last.stamp_ns == pose.stamp_ns
        if published and self._ros.estimate_at == "odometry":
            return []
        return self.pose_again(pose)

    def pose_again(self, pose: LivePose) -> list[Publication]:
        """Publish a pose whose stamp may be known; nothing if it was the last one."""
        if self._last is not None and _same(self._last, pose):
            return []
        self._last = pose
        published = []
        topics = self._ros.topics
        if topics.estimate is not None:
            published.append(self._pose_on(topics.estimate, pose))
        if topics.path is not None:
            published += self._grow_path(pose, topics.path)
        return published

    def _grow_path(self, pose: LivePose, topic: str) -> list[Publication]:
        if self._path:
            stamp, last = self._path[-1]
            if pose.stamp_ns <= stamp or abs(pose.pose[:2] - last[:2]).max() < PATH_STEP_M:
                return []
        self._path.append((pose.stamp_ns, pose.pose))
        due = round(NANOSECONDS / self._ros.path_hz)
        if self._path_ns is not None and pose.stamp_ns - self._path_ns < due:
            return []
        self._path_ns = pose.stamp_ns
        stamps, poses = zip(*self._path, strict=True)
        return [encode.path(topic, self._map, stamps, [one.tolist() for one in poses])]

    def transform(self, pose: LivePose, odometry: Odometry) -> list[Publication]:
        """Publish where odom is in map, if odometry has been received at the stamp of the pose."""
        at = odometry.at(pose.stamp_ns)
        if at is None or not self._ros.publish_transform:
            return []
        in_map = pose.pose.tolist()
        self._map_to_odom = encode.map_to_odom(in_map, (at.x, at.y, at.heading))
        return self.transform_again(pose.stamp_ns)

    def transform_again(self, now_ns: int) -> list[Publication]:
        """Publish the last map -> odom at a later stamp; nothing where that is not later."""
        if self._map_to_odom is None:
            return []
        stamp = now_ns + round(self._ros.transform_ahead_s * NANOSECONDS)
        if self._transform_ns is not None and stamp <= self._transform_ns:
            return []
        self._transform_ns = stamp
        return [encode.transforms([encode.transform(stamp, self._map, self._odom,
                                                    self._map_to_odom)])]  # fmt: skip

    def clock_went_back(self) -> None:
        """Forget the published stamps: they are of another time."""
        self._transform_ns = self._path_ns = self._fallback_ns = None
        self._path.clear()

    def start(self, pose: LivePose) -> list[Publication]:
        """Publish where another localizer starts, latched; once for each start."""
        if self._ros.topics.start is None or self._start_pose is not None:
            return []
        self._start_pose = pose
        return [self._pose_on(self._ros.topics.start, pose, latched=True)]

    def _pose_on(self, topic: str, pose: LivePose, latched: bool = False) -> Publication:
        height = None
        if pose.height is not None and pose.height_variance is not None:
            height = pose.height, pose.height_variance
        attitude = None
        if pose.orientation is not None and pose.orientation_covariance is not None:
            attitude = pose.orientation, pose.orientation_covariance
        return encode.pose_with_covariance(topic, pose.stamp_ns, pose.pose.tolist(),
                                           pose.covariance, self._map, latched, height,
                                           attitude)  # fmt: skip

    def fallback(self, pose: LivePose) -> list[Publication]:
        """Publish the safe choice between a watched pose and the estimate; later ones only."""
        topic = self._ros.topics.fallback
        if topic is None or (self._fallback_ns is not None and pose.stamp_ns <= self._fallback_ns):
            return []
        self._fallback_ns = pose.stamp_ns
        return [self._pose_on(topic, pose)]

    def start_is_open(self) -> None:
        """Publish the next start, too."""
        self._start_pose = None

    def is_own_start(self, stamp_ns: int) -> bool:
        """Return whether a start of this stamp was published from here."""
        return self._start_pose is not None and self._start_pose.stamp_ns == stamp_ns


def health_status(health: LiveHealth, of: str = "localization") -> encode.Fields:
    """Return the status of the localization as a whole, or of watched poses."""
    return encode.health_status(health.state, health.reason, health.within, health.wrong,
                                health.protection.tolist(), of)  # fmt: skip


def source_status(source: LiveSource, now_ns: int) -> encode.Fields:
    """Return the status of one source: how much of it is fused, and since when it is silent."""
    level, message = encode.OK, "fused"
    if source.faulty > 0.85:
        level, message = encode.WARN, "likely wrong as a whole"
    elif source.accepted < 0.5:
        level, message = encode.WARN, f"{100.0 * source.accepted:.0f} % of the last were fused"
    fused = None if source.fused_ns is None else (now_ns - source.fused_ns) / NANOSECONDS
    values = {
        "last_innovation": source.residual,
        "sigma": source.sigma,
        "test_ratio": source.test_ratio,
        "accepted_share": source.accepted,
        "probability_faulty": source.faulty,
        "heard_s_ago": (now_ns - source.received_ns) / NANOSECONDS,
        "fused_s_ago": "never" if fused is None else fused,
    }
    return encode.diagnostic_status(f"locfuse: {source.name}", level, message, values)


def _same(one: LivePose, other: LivePose) -> bool:
    return (
        one.stamp_ns == other.stamp_ns
        and bool((one.pose == other.pose).all())
        and bool((one.covariance == other.covariance).all())
    )
