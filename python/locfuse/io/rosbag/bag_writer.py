# SPDX-License-Identifier: Apache-2.0
"""From a log, or a run along it, to a bag that tools of either ROS open."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse.config.ros import Ros, Topics
from locfuse.io.rosbag import bag_settings, encode, publications
from locfuse.io.rosbag.bag_files import bag_sink
from locfuse.io.rosbag.encode import Publication
from locfuse.io.whole import naming
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, RunResult

Progress = Callable[[int, int], None]

END_S = 2**31  # seconds since 1970 at which the time of ROS ends
PROGRESS_EVERY = 1000  # messages between two calls of progress


def write_bag(
    source: Log | RunResult, path: str | Path, ros: Ros | None = None,
    progress: Progress | None = None,
) -> None:  # fmt: skip
    """Write a log, or a run with its log, as a bag that `read_bag` reads back.

    Poses of odometry come back within an ulp, and ranges of scans as float32; what was read from a
    bag comes back bit for bit, as does the rest. A run adds the pose with its covariance, the path,
    the transform from map to odom, health as diagnostics, and the landmarks that it mapped.

    Parameters
    ----------
    source : Log or RunResult
    path : str or Path
        Ends in ``.bag`` (ROS 1) or ``.mcap`` (ROS 2); a file of that name is replaced.
    ros : Ros, optional
        Topics and frames; by default the usual names.
    progress : callable, optional
        Called with (messages written, total messages).

    Raises
    ------
    LogError
        If the path ends in something else, a stamp is beyond the year 2038, or rosbags is missing.
    """
    streams = _BagStreams(source, Ros() if ros is None else ros).all()
    total = sum(len(stream.times) for stream in streams)
    report = progress or (lambda done, total: None)
    with naming(Path(path)), bag_sink(Path(path)) as sink:
        for done, arrival in enumerate(publications.in_order(streams)):
            if done % PROGRESS_EVERY == 0:
                report(done, total)
            sink.write(*arrival)
    report(total, total)


class _BagStreams:
    """The publications of a log, and perhaps of a run on it."""

    def __init__(self, source: Log | RunResult, ros: Ros) -> None:
        self.log = source.log if isinstance(source, RunResult) else source
        self.result = source if isinstance(source, RunResult) else None
        spans = [values for table in self.log.tables.values() for name, values in table.items()
                 if name.endswith("_ns") and len(values)]  # fmt: skip
        if self.result is not None:
            spans.append(self.result.estimate.stamp_ns)
        first = min(int(values.min()) for values in spans)
        last = max(int(values.max()) for values in spans)
        self.shift = 0 if first >= NANOSECONDS else (1 - first // NANOSECONDS) * NANOSECONDS
        if (last + self.shift) // NANOSECONDS >= END_S:
            raise LogError(f"a stamp of {last // NANOSECONDS} s is beyond the time of ROS, which "
                           f"ends {END_S} s after it began")  # fmt: skip
        self.begin = first + self.shift
        given = {key: ros.topics.of(key) for key in Topics.model_fields}
        topics = {key: list(names) if len(names) > 1 else next(iter(names), None)
                  for key, names in given.items()}  # fmt: skip
        self.ros = ros.model_copy(update={"topics": ros.topics.model_copy(update=topics)})
        self.given = publications.LogPublications(self.log, self.ros, self.shift, everything=True)

    def all(self) -> list[publications.Stream]:
        """Return all streams; messages of one time are written in this order."""
        head = list(self._head())
        begin = publications.Stream(np.full(len(head), self.begin), iter(head))
        found = [begin, *self.given.messages()]
        if self.result is not None:
            found += [*self._estimates(self.result), *self._health(self.result)]
        return found

    # At the beginning

    def _head(self) -> Iterator[Publication]:
        yield encode.text(bag_settings.TOPIC, bag_settings.text_of(self.log, self.shift))
        yield from self.given.world(self.begin)
        if "relations" in self.log:
            columns = (values.tolist() for values in self.log["relations"].values())
            for begin, end, *motion in zip(*columns, strict=True):
                yield encode.path(bag_settings.RELATIONS, self.given.map,
                                  (begin + self.shift, end + self.shift),
                                  [(0.0, 0.0, 0.0), motion])  # fmt: skip
        if self.result is not None and self.ros.topics.path is not None:
            yield self._path(self.result, self.ros.topics.path)
        if self.result is not None and self.result.landmarks is not None and self.ros.topics.mapped:
            yield encode.mapped_landmarks(self.ros.topics.mapped, self.result.landmarks,
                                          self.given.map, self.begin)  # fmt: skip

    def _path(self, result: RunResult, topic: str) -> Publication:
        """Return the whole path, so that it is there wherever in the bag somebody looks."""
        track = result.estimate
        rows, last = [], -math.inf
        for row, stamp in enumerate(track.stamp_ns.tolist()):
            if stamp - last >= NANOSECONDS / self.ros.path_hz:
                rows.append(row)
                last = stamp
        poses = np.column_stack([track.position, _headings(result)])[rows]
        stamps = track.stamp_ns[rows] + self.shift
        return encode.path(topic, self.given.map, stamps.tolist(), poses.tolist())

    # What the run made of it

    def _estimates(self, result: RunResult) -> Iterator[publications.Stream]:
        track = result.estimate
        stamp, heading = track.stamp_ns + self.shift, _headings(result)
        poses = np.column_stack([track.position, heading])
        if self.ros.topics.estimate is not None:
            none = np.zeros((len(stamp), 3, 3))
            yield publications.with_covariance(
                self.ros.topics.estimate, self.given.map, stamp, stamp, poses,
                none if track.covariance is None else track.covariance,
                None if track.height is None or track.height_variance is None
                else zip(track.height.tolist(), track.height_variance.tolist(), strict=True),
                None if track.orientation is None or track.orientation_covariance is None
                else zip(track.orientation, track.orientation_covariance, strict=True),
            )  # fmt: skip
        in_odom = self._in_odom(track.stamp_ns)
        moved = np.array(list(map(encode.map_to_odom, poses.tolist(), in_odom))).reshape(-1, 3)
        yield publications.transforms(stamp, stamp, self.given.map, self.given.odom, moved)

    def _in_odom(self, stamps: NDArray[np.int64]) -> list[list[float]]:
        """Return the body's pose in odom at other stamps; without odometry it stays at 0."""
        found = np.zeros((len(stamps), 3))
        if self.given.driven:
            at = self.log["odometry"]["stamp_ns"]
            after = (stamps - at[0]).astype(float), (at - at[0]).astype(float)
            found[:, 0] = np.interp(*after, self.given.driven["x"])
            found[:, 1] = np.interp(*after, self.given.driven["y"])
            found[:, 2] = np.interp(*after, np.unwrap(self.given.driven["heading"]))
        return found.tolist()

    def _health(self, result: RunResult) -> Iterator[publications.Stream]:
        health = result.health
        if health is None:
            return
        stamps = health.stamp_ns + self.shift
        said = {"localization": health}
        if result.watched is not None:  # a row with each of health
            said["watched poses"] = result.watched

        def statuses() -> Iterator[Publication]:
            for row, stamp in enumerate(stamps.tolist()):
                yield encode.diagnostics(stamp, [
                    encode.health_status(str(one.state[row]), str(one.reason[row]),
                                         float(one.within[row]), float(one.wrong[row]),
                                         one.protection[row].tolist(), of)
                    for of, one in said.items()
                ])  # fmt: skip

        yield publications.Stream(stamps, statuses())


def _headings(result: RunResult) -> FloatArray:
    found = result.estimate.heading
    return np.zeros(len(result.estimate)) if found is None else found
