# SPDX-License-Identifier: Apache-2.0
"""Public recordings, which lie beside the project, and the ready configurations of a checkout."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.run.run import load_log
from locfuse.types import Log, LogError

DATA = "../../../shared/data"  # seen from examples/configs


def example_configs() -> Path | None:
    """Return the folder of ready configurations of this checkout; None if it is gone."""
    folder = Path(__file__).resolve().parent.parent / "examples" / "configs"
    return folder if folder.is_dir() else None


def load_recording(
    configs: Path | None, dataset: str, folder: str, run: str | None = None, **keys: Any
) -> tuple[RunConfig, Log]:
    """Return the configuration of a recording, and its log.

    Parameters
    ----------
    configs : Path or None
        Folder of the ready configurations.
    dataset : str
        As in a configuration.
    folder : str
        In `DATA`.
    run : str, optional
        Which run of the dataset.
    **keys
        Further sections of the configuration.

    Raises
    ------
    LogError
        If there are no ready configurations, or the recording is absent.
    """
    if configs is None:
        raise LogError("no examples/configs here")
    origin = {"dataset": dataset, "path": f"{DATA}/{folder}"}
    if run is not None:
        origin["run"] = run
    config = parse_config({"log": origin, **keys})
    return config, load_log(config, configs, 0)
