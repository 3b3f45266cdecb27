# SPDX-License-Identifier: Apache-2.0
"""What a bag has said while it is read, and which messages were left out."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from locfuse.config.ros import Ros
from locfuse.io.rosbag.bag_settings import Settings
from locfuse.io.rosbag.columns import Blocks
from locfuse.io.rosbag.decode import Mount
from locfuse.io.rosbag.fixes import Fixes
from locfuse.io.rosbag.frames import FrameTree
from locfuse.types import GridMap, Log

logger = logging.getLogger(__name__)

LONGEST = 300  # letters of a reason


class Laser(NamedTuple):
    """Geometry of the scans in a frame [m, rad]: of the first one, its reach that of all."""

    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    time_increment: float
    mount: Mount | None  # where the frame does not say it


@dataclass
class SkippedMessages:
    """Messages of a topic that were left out, and why the first was."""

    count: int
    first: str


@dataclass
class BagContents:
    """What has been read from a bag so far.

    `tables` are rows as they came, with stamps and record times of the bag; `world` is known
    besides and counts more. By topic, `skipped` is what was left out, `counts` how many messages
    were used.
    """

    path: Path
    ros: Ros
    world: Log
    tree: FrameTree = field(init=False)
    fixes: Fixes = field(init=False)
    tables: dict[str, Blocks] = field(default_factory=dict)
    skipped: dict[str, SkippedMessages] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    settings: Settings | None = None
    grid: GridMap | None = None
    lasers: dict[str, Laser] = field(default_factory=dict)  # by frame
    bright: bool | None = None  # whether the first scan has intensities
    saturated: set[float] = field(default_factory=set)  # readings taken for no return [m]
    tag_frames: dict[str, str] = field(default_factory=dict)
    sight_frame: str | None = None
    antennas: set[str] = field(default_factory=set)  # frames of fixes
    places_antennas: bool = True
    bodies: set[str] = field(default_factory=set)  # frames that odometry is of

    def __post_init__(self) -> None:
        self.tree = FrameTree(self.ros.frames.base)
        self.fixes = Fixes(self.ros.gps_origin)

    def odometry_from(self) -> str:
        """Return which half of odometry counts: ``pose`` or ``twist``."""
        if self.settings is not None and "odometry" in self.settings.columns:
            return "twist" if "v_mps" in self.settings.columns["odometry"] else "pose"
        return self.ros.odometry_from

    def had_column(self, stem: str, column: str) -> bool:
        """Return whether the log that the bag was written from has a column."""
        return self.settings is not None and column in self.settings.columns.get(stem, ())

    def warn(self, sentence: str) -> None:
        """Log a warning about the bag."""
        logger.warning("%s: %s", self.path, " ".join(sentence.split()))

    def count(self, topic: str, used: int) -> None:
        """Count messages that were used."""
        self.counts[topic] = self.counts.get(topic, 0) + used

    def skip(self, topic: str, reason: str, count: int = 1) -> None:
        """Count messages that are left out, and keep the reason of the first."""
        if topic in self.skipped:
            self.skipped[topic].count += count
        else:
            reason = " ".join(reason.split())  # what others raise may be a page
            self.skipped[topic] = SkippedMessages(
                count, reason if len(reason) < LONGEST else f"{reason[:LONGEST]}..."
            )

    def skip_all(self, key: str, why: str) -> None:
        """Leave out all messages of a topic after all."""
        for topic in self.ros.topics.of(key) or (key,):
            self.skip(topic, why, self.counts.pop(topic, 1))
