# SPDX-License-Identifier: Apache-2.0
"""The room, recordings and range-only layouts of ekim2020, sections 2.2, 3.1 and 3.2."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from locfuse import _core
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import Dataset, RunConfig
from locfuse.io.log_folder import read_log
from locfuse.run.messages import truth_of
from locfuse.run.run import load_log
from locfuse.types import FloatArray, Log
from papers.datasets import convert

PATHS = ("circle", "eight", "square", "star", "waypoints")
RECORDINGS = {
    "ieu run3": ("ieu_gazebo.yaml", "run3", 0.010),
    "ieu straight": ("ieu_gazebo.yaml", "straight", 0.010),
    "ieu home": ("ieu_gazebo.yaml", "home", 0.010),
    "office (real)": ("mrpt_office.yaml", None, 0.13),
    "labyrinth (real)": ("tuc_labyrinth.yaml", None, 0.08),
    "Plaza1 (real)": ("plaza.yaml", None, 0.40),
}


def room_config(path: str, duration_s: float = 120.0) -> RunConfig:
    """Return the paper's room with a filter that knows the noise of its sensors.

    The pose source's 6 cm and the range's 1.5 % are the paper's; what the odometry adds per metre
    and radian is the simulator's.
    """
    odometry = {
        "sigma_longitudinal_per_sqrt_m": 0.03,
        "sigma_lateral_per_sqrt_m": 0.0,
        "sigma_heading_per_sqrt_m": 0.02,
        "sigma_heading_per_sqrt_rad": 0.03,
    }
    return parse_config(
        {
            "name": f"room, {path}",
            "simulation": {"path": {"shape": path}, "duration_s": duration_s},
            "start_sigma": {"xy_m": 0.1, "heading_deg": 3.0},
            "estimator": {
                "odometry": odometry,
                "range": {"sigma_m": 0.0, "sigma_relative": 0.015, "gate": 1.0},
                "pose": {"gate": 1.0},
                "correlation_s": 0,  # simulated errors are independent
            },
        }
    )


def square_room() -> RunConfig:
    """Return a robot in the middle of a square room: its scan fits four headings."""
    return parse_config(
        {
            "name": "square room",
            "simulation": {
                "path": {"shape": "eight"},
                "duration_s": 20.0,
                "poses": None,
                "laser": {"range_max_m": 12.0},
                "map": {},
            },
            "start": "auto",
            "estimator": {"range": {"sigma_m": 0.02, "sigma_relative": 0.015}},
        }
    )


TRIALS = 10_000
SIGMA_M = 0.1
LAYOUTS: Mapping[str, FloatArray] = {
    "2D, 5 anchors": np.array([[0, 0], [10, 0], [10, 10], [0, 10], [5, 0]], float),
    "2D, 8 anchors": np.array([[0, 0], [10, 0], [10, 10], [0, 10], [5, 0], [10, 5], [5, 10],
                               [0, 5]], float),
    "3D, 5 anchors": np.array([[0, 0, 0], [10, 0, 10], [10, 10, 0], [0, 10, 10], [5, 5, 10]],
                              float),
    "3D, 8 anchors": np.array([[i, j, k] for i in (0, 10) for j in (0, 10) for k in (0, 10)],
                              float),
}  # fmt: skip
# RMSE / bound of the unweighted method on these layouts, as measured for it elsewhere with 10,000
# trials; required is to stay within 3 %.
PUBLISHED_SRLS = {"2D, 5 anchors": 1.124, "2D, 8 anchors": 1.172, "3D, 5 anchors": 1.064,
                  "3D, 8 anchors": 1.083}  # fmt: skip


@dataclass(frozen=True)
class Trials:
    """Points, their ranges to the anchors, and the Cramer-Rao bound of each position."""

    anchors: FloatArray
    points: FloatArray
    ranges: FloatArray
    bound: FloatArray


def trials(anchors: FloatArray, sigma: float, seed: int, count: int = TRIALS) -> Trials:
    """Draw points in a 10 m box and noisy ranges."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 10.0, (count, anchors.shape[1]))
    distance = np.linalg.norm(points[:, None] - anchors[None], axis=2)
    ranges = np.abs(distance + sigma * rng.standard_normal(distance.shape))
    return Trials(anchors, points, ranges, _core.cramer_rao(anchors, points, sigma))


def recording(configs: Path, file: str, of_dataset: str | None = None) -> tuple[RunConfig, Log]:
    """Return a ready configuration with its log.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    config = load_config(configs / file)
    if of_dataset is not None:
        assert isinstance(config.log, Dataset)
        dataset = config.log.model_copy(update={"run": of_dataset})
        config = config.model_copy(update={"log": dataset})
    return config, load_log(config, configs, config.seed)


def site_logs(configs: Path, dataset: str, folder: str) -> Iterator[Log]:
    source = (configs / "../../../shared/data" / folder).resolve()
    with tempfile.TemporaryDirectory() as out:
        for log in convert(dataset, source, Path(out) / "log"):
            yield read_log(log)


def epochs(log: Log, tag: str) -> tuple[FloatArray, FloatArray, float]:
    """Return anchors (m, 3), ranges (epochs, m) with NaN where one is missing, and tag height."""
    table, anchors = log["ranges"], log["anchors"]
    names = {str(name): column for column, name in enumerate(anchors["anchor"])}
    rows = table["tag"] == tag
    _, epoch = np.unique(table["stamp_ns"][rows], return_inverse=True)
    ranges = np.full((int(epoch.max()) + 1, len(names)), np.nan)
    columns = [names[str(name)] for name in table["anchor"][rows]]
    ranges[epoch, columns] = table["range_m"][rows]
    at = np.column_stack([anchors["x_m"], anchors["y_m"], anchors["z_m"]]).astype(float)
    return at, ranges, float(log.tags[tag][2])


def tag_place(log: Log, tag: str) -> FloatArray:
    """Return where a tag at rest is in truth: x, y, z in world."""
    truth = truth_of(log)
    assert truth is not None
    heading = 0.0 if truth.heading is None else float(truth.heading[0])
    forward, left, up = log.tags[tag]
    x, y = truth.position[0]
    c, s = np.cos(heading), np.sin(heading)
    return np.array([x + c * forward - s * left, y + s * forward + c * left, up])


def same_room(a: Log, b: Log) -> bool:
    return all(np.array_equal(a["anchors"][key], b["anchors"][key]) for key in a["anchors"])
