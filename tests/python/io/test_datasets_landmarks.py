# SPDX-License-Identifier: Apache-2.0
"""Recordings of landmarks as log folders: the figures of their notes, from the converted logs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from locfuse.eval.errors import errors_against, interpolate
from locfuse.io.datasets import convert
from locfuse.io.datasets.source import ackermann, arc
from locfuse.io.log_folder import read_log
from locfuse.messages import truth_of
from locfuse.types import NANOSECONDS, FloatArray, Log, Trajectory, wrap_angle
from support_runs import recording

Logs = dict[str, Log]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Logs]:
    """Return the logs that were asked for by `logs_of`, so that each is converted once."""
    return {}


@pytest.fixture
def logs_of(logs: dict[str, Logs], tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    def converted(name: str) -> Logs:
        if name not in logs:
            out = tmp_path_factory.mktemp("converted") / name
            folders = convert(name, recording(name.replace("_", "-")), out)
            logs[name] = {path.name: read_log(path) for path in folders}
        return logs[name]

    return converted
