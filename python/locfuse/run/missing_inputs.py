# SPDX-License-Identifier: Apache-2.0
"""Remedies for missing inputs: add a file, a topic, or a key of the simulation."""

from __future__ import annotations

from locfuse.config.schema import Estimator
from locfuse.types import Log

_FOLDER = "the folder that ros.world names"
_HOW = {
    "folder": {
        "ranges": "add ranges.csv",
        "anchors": "add anchors.csv",
        "tags": "add 'tags: {NAME: [x, y, z]}' to log.yaml",
        "landmarks": "add landmarks.csv",
        "map": "add 'map: FILE.yaml' to log.yaml (`locfuse map` draws one)",
        "scans": "add scans.csv, and 'laser' to log.yaml",
        "imu": "add imu.csv, with forces",
    },
    "bag": {
        "ranges": "record ranges, whose topic ros.topics.ranges names",
        "anchors": f"add anchors.csv to {_FOLDER}, or record ros.topics.anchors",
        "tags": "record tf_static with a frame of each tag's name, or add "
                f"'tags: {{NAME: [x, y, z]}}' to log.yaml in {_FOLDER}",
        "landmarks": f"add landmarks.csv to {_FOLDER}, or record ros.topics.landmarks",
        "map": f"record ros.topics.map, or add 'map: FILE.yaml' to log.yaml in {_FOLDER} (`locfuse "
               "map` draws one)",
        "scans": "record scans, whose topic ros.topics.scans names, and tf_static, or add 'laser' "
                 f"to log.yaml in {_FOLDER}",
        "imu": "record an IMU with an accelerometer, whose topic ros.topics.imu names",
    },
    "simulation": {
        "ranges": "add simulation.ranges",
        "anchors": "add simulation.anchors",
        "tags": "add simulation.tags",
        "landmarks": "add simulation.landmarks",
        "map": "add simulation.map",
        "scans": "add simulation.laser",
        "imu": "add simulation.imu",
    },
}  # fmt: skip
_FILES = {"anchors": "anchors.csv", "tags": "log.yaml", "landmarks": "landmarks.csv"}


def how_to_add(log: Log, what: str) -> str:
    """Return how a log like this gets ``anchors``, ``map``, ``scans`` and so on.

    Examples
    --------
    >>> how_to_add(Log({}), "anchors")
    'add anchors.csv'
    >>> how_to_add(Log({}, origin="simulation"), "map")
    'add simulation.map'
    """
    return _HOW[log.origin][what]


def where_named(log: Log, what: str) -> str:
    """Return where ``anchors``, ``tags`` or ``landmarks`` of a log have their names.

    Examples
    --------
    >>> where_named(Log({}), "tags")
    'log.yaml'
    """
    return _FILES[what] if log.origin == "folder" else f"the {log.origin}"


def sigma_key(source: str, estimator: Estimator) -> str:
    """Return the key that gives messages of a source a sigma where they bring none, if it is 0."""
    if source == "positions" and estimator.position.sigma_m == 0.0:
        return "estimator.position.sigma_m"
    if source == "poses" and estimator.pose.sigma_m == 0.0:
        return "estimator.pose.sigma_m"
    return ""
