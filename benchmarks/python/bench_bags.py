# SPDX-License-Identifier: Apache-2.0
"""Reading bags as logs and writing logs as bags, compared to rosbags that only unpacks messages.

In time of the processor, so that disks and what else runs do not count.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.io.rosbag.bags import read_bag, write_bag
from locfuse.types import Log

SECONDS = 60
RATES = {"odometry": 100, "ranges": 50, "scans": 40}  # messages per second
MESSAGES = SECONDS * sum(RATES.values())
ANCHORS, BEAMS = 4, 360
OF_THE_PROCESSOR = pytest.mark.benchmark(timer=time.process_time)
TOPICS = ("/odom", "/uwb", "/scan")


def drive() -> Log:
    """Return a drive with odometry, four ranges at once, and scans of 360 beams."""
    rng = np.random.default_rng(5)
    n = {stem: SECONDS * rate for stem, rate in RATES.items()}
    stamp = {stem: 1_700_000_000_000_000_000 + np.arange(n[stem]) * (1_000_000_000 // rate)
             for stem, rate in RATES.items()}  # fmt: skip
    names = [f"A{k}" for k in range(ANCHORS)]
    tables: dict[str, Any] = {
        "odometry": {"stamp_ns": stamp["odometry"], "dx_m": rng.normal(0.01, 0.001, n["odometry"]),
                     "dy_m": np.zeros(n["odometry"]),
                     "dheading_rad": rng.normal(0.0, 0.01, n["odometry"])},
        "ranges": {"stamp_ns": np.repeat(stamp["ranges"], ANCHORS),
                   "tag": np.full(n["ranges"] * ANCHORS, "tag"),
                   "anchor": np.array(names * n["ranges"]),
                   "range_m": rng.uniform(1.0, 20.0, n["ranges"] * ANCHORS)},
        "scans": {"stamp_ns": stamp["scans"],
                  "ranges_m": np.round(rng.uniform(0.5, 20.0, (n["scans"], BEAMS)), 3)},
    }  # fmt: skip
    laser = {"pose_in_body": [0.2, 0.0, 0.0], "angle_min_rad": -3.14, "range_min_m": 0.1,
             "angle_increment_rad": 0.0174, "range_max_m": 30.0}  # fmt: skip
    return Log(tables=tables, tags={"tag": (0.0, 0.0, 1.0)}, laser=laser)


@pytest.fixture(scope="session")
def bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the drive as a bag of ROS 1 and of ROS 2."""
    folder = tmp_path_factory.mktemp("bags")
    for kind in ("bag", "mcap"):
        write_bag(drive(), folder / f"drive.{kind}")
    return {kind: folder / f"drive.{kind}" for kind in ("bag", "mcap")}


@OF_THE_PROCESSOR
@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_read_bag(benchmark: Any, kind: str, bags: dict[str, Path]) -> None:
    log = benchmark.pedantic(read_bag, (bags[kind],), rounds=5, warmup_rounds=1)
    assert sum(len(np.unique(log[stem]["stamp_ns"])) for stem in RATES) == MESSAGES
    benchmark.extra_info["items"] = MESSAGES


@OF_THE_PROCESSOR
@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_unpack_bag(benchmark: Any, kind: str, bags: dict[str, Path]) -> None:
    count = benchmark.pedantic(unpack, (bags[kind],), rounds=5, warmup_rounds=1)
    assert count == MESSAGES
    benchmark.extra_info["items"] = MESSAGES


def unpack(path: Path) -> int:
    """Return the number of messages of the topics that rosbags unpacks, by its index."""
    from rosbags.highlevel import AnyReader

    count = 0
    with AnyReader([path]) as reader:
        chosen = [c for c in reader.connections if c.topic in TOPICS]
        for connection, _, data in reader.messages(connections=chosen):
            reader.deserialize(data, connection.msgtype)
            count += 1
    return count


@OF_THE_PROCESSOR
@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_write_bag(benchmark: Any, kind: str, tmp_path: Path) -> None:
    benchmark.pedantic(write_bag, (drive(), tmp_path / f"d.{kind}"), rounds=5, warmup_rounds=1)
    benchmark.extra_info["items"] = MESSAGES
