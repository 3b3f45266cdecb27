# SPDX-License-Identifier: Apache-2.0
"""Arguments and options that several commands share, and how a named log is read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from locfuse.cli.terminal import progress
from locfuse.config.schema import RunConfig, places_antennas
from locfuse.io.recording import read_recording
from locfuse.types import Log

ConfigFile: TypeAlias = Annotated[
    Path, typer.Argument(help="YAML file, see docs/configuration.md.")
]
LogPath: TypeAlias = Annotated[
    Path | None, typer.Option(help="Log folder or bag to use instead of the configuration's.")
]
Seed: TypeAlias = Annotated[
    int | None, typer.Option(help="Override the seed of simulation and particle filter.", min=0)
]


def read_log(log: Path, config: RunConfig, base: Path) -> Log:
    """Return the log folder or bag of `--log`."""
    with progress("bytes") as moved:
        return read_recording(log, config.ros, base, moved,
                              antennas=places_antennas(config.estimator))  # fmt: skip


def with_log(config: RunConfig, log: Path, base: Path) -> RunConfig:
    """Return the configuration with another log; its other paths stay relative to `base`."""
    ros = config.ros
    if ros.world is not None:
        ros = ros.model_copy(update={"world": str((base / ros.world).resolve())})
    return config.model_copy(update={"log": str(log.resolve()), "simulation": None, "ros": ros})
