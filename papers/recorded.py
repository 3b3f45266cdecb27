# SPDX-License-Identifier: Apache-2.0
"""Public recordings, which lie beside the project, and the ready configurations of a checkout."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.run.run import load_log, run
from locfuse.types import Log, LogError, RunResult
from papers.claims import Claim, absent

DATA = "../../../shared/data"  # seen from examples/configs
FIGURES = {  # of metrics.json: name and unit
    "position_rmse_m": ("position RMSE", "m"),
    "height_rmse_m": ("height RMSE", "m"),
    "heading_rmse_deg": ("heading RMSE", "deg"),
    "nees_mean": ("NEES of 3", "1"),
}


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


def ready_run(configs: Path | None, file: str) -> RunResult:
    """Return what `locfuse run` makes of a ready configuration.

    Parameters
    ----------
    configs : Path or None
        Folder of the ready configurations.
    file : str
        In that folder.

    Raises
    ------
    LogError
        If there are no ready configurations, or the recording is absent.
    """
    if configs is None or not (configs / file).is_file():
        raise LogError(f"no examples/configs/{file} here")
    return run(load_config(configs / file), base=configs)


def ready_claims(configs: Path | None, *files: str) -> Iterator[Claim]:
    """Yield the figures of ready configurations, which are those of `locfuse run` to the digit."""
    for file in files:
        key, what = f"ready_{Path(file).stem}", f"`locfuse run {file}`: "
        try:
            metrics = ready_run(configs, file).metrics
        except LogError as missing:
            yield absent(key, f"{what}position RMSE", str(missing))
            continue
        for figure, (name, unit) in FIGURES.items():
            value = metrics.get(figure)
            if value is not None:
                yield Claim(f"{key}_{figure}", f"{what}{name}", unit, None, value, value, value,
                            "-", True)  # fmt: skip
