# SPDX-License-Identifier: Apache-2.0
"""What was heard of a bag on its way to a log, and what of it was left out."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from locfuse.config.ros import Ros, plain
from locfuse.io.rosbag.bag_settings import Settings
from locfuse.io.rosbag.columns import Blocks
from locfuse.io.rosbag.decode_many import Laser
from locfuse.io.rosbag.frames import FrameTree
from locfuse.io.rosbag.geodesy import Origin
from locfuse.types import GridMap, Log

logger = logging.getLogger(__name__)

LONGEST = 300  # letters of a reason


@dataclass
class Trouble:
    """Messages of a topic that were left out, and why the first was."""

    count: int
    first: str


@dataclass
class Heard:
    """What a bag said so far.

    Attributes
    ----------
    tables : dict of Blocks
        Rows as they came, with stamps and record times of the bag.
    trouble, counts : dict
        What was left out and how many messages were used, by topic.
    world : Log
        What is known besides, which counts more.
    """

    path: Path
    ros: Ros
    world: Log
    tree: FrameTree = field(init=False)
    origin: Origin | None = field(init=False)
    tables: dict[str, Blocks] = field(default_factory=dict)
    trouble: dict[str, Trouble] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    settings: Settings | None = None
    grid: GridMap | None = None
    laser: Laser | None = None
    tag_frames: dict[str, str] = field(default_factory=dict)
    sight_frame: str | None = None
    bodies: set[str] = field(default_factory=set)  # frames that odometry is of

    def __post_init__(self) -> None:
        self.tree = FrameTree(self.ros.frames.base)
        self.origin = self.ros.gps_origin

    def odometry_from(self) -> str:
        """Return which half of odometry counts: ``pose`` or ``twist``."""
        if self.settings is not None and "odometry" in self.settings.columns:
            return "twist" if "v_mps" in self.settings.columns["odometry"] else "pose"
        return self.ros.odometry_from

    def told(self, stem: str, column: str) -> bool:
        """Return whether the log that the bag was written from has a column."""
        return self.settings is not None and column in self.settings.columns.get(stem, ())

    def tell(self, sentence: str) -> None:
        """Say something about the bag."""
        logger.warning("%s: %s", self.path, " ".join(sentence.split()))

    def count(self, topic: str, used: int) -> None:
        """Count messages that were used."""
        self.counts[topic] = self.counts.get(topic, 0) + used

    def left_out(self, topic: str, why: Callable[[], str], count: int = 1) -> None:
        """Count messages that are left out; only of the first it is asked why."""
        if topic in self.trouble:
            self.trouble[topic].count += count
        else:
            said = " ".join(why().split())  # what others raise may be a page
            self.trouble[topic] = Trouble(
                count, said if len(said) < LONGEST else f"{said[:LONGEST]}..."
            )

    def lost(self, key: str, why: str) -> None:
        """Leave out all messages of a topic after all."""
        topic = plain(getattr(self.ros.topics, key) or key)
        self.left_out(topic, lambda: why, self.counts.pop(topic, 1))
