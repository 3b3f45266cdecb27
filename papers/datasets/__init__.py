# SPDX-License-Identifier: Apache-2.0
"""Converters from published recordings, as their archives lay them out, to log folders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from locfuse.types import ConfigError, LogError, nearest, no_folder
from papers.datasets import (
    acfr_carpark,
    ghent,
    hanyang_outdoor,
    ieu_gazebo,
    inrol_uwb_imu,
    intel_lab,
    lego_arena,
    lias,
    mrclam6,
    mrpt_office,
    plaza,
    rcv_uwb_drone,
    starloc,
    tuc_labyrinth,
    turtlebot4_mac,
    utias_tubes,
    victoria_park,
    wean_hall,
)

Converter: TypeAlias = Callable[[Path, Path], list[Path]]

CONVERTERS: dict[str, Converter] = {
    "plaza": plaza.convert,
    "ieu_gazebo": ieu_gazebo.convert,
    "mrpt_office": mrpt_office.convert,
    "tuc_labyrinth": tuc_labyrinth.convert,
    "ghent": ghent.convert,
    "lias": lias.convert,
    "wean_hall": wean_hall.convert,
    "intel_lab": intel_lab.convert,
    "turtlebot4_mac": turtlebot4_mac.convert,
    "utias_tubes": utias_tubes.convert,
    "mrclam6": mrclam6.convert,
    "acfr_carpark": acfr_carpark.convert,
    "lego_arena": lego_arena.convert,
    "victoria_park": victoria_park.convert,
    "rcv_uwb_drone": rcv_uwb_drone.convert,
    "starloc": starloc.convert,
    "hanyang_outdoor": hanyang_outdoor.convert,
    "inrol_uwb_imu": inrol_uwb_imu.convert,
}


def convert(name: str, source: str | Path, out: str | Path) -> list[Path]:
    """Convert a recording to log folders.

    Parameters
    ----------
    name : str
        A key of `CONVERTERS`; ``-`` stands for ``_`` as well.
    source : str or Path
        Folder with the files as published; each converter's docstring lists them.
    out : str or Path
        Becomes the log folder, or holds one folder per run if the recording has several.

    Returns
    -------
    list of Path
        The log folders written.

    Raises
    ------
    ConfigError
        If there is no such converter.
    LogError
        If a file is missing or holds something else, or if `out` holds another log.
    """
    key = name.replace("-", "_")
    if key not in CONVERTERS:
        raise ConfigError(f"unknown data set {name!r}; {nearest(key, CONVERTERS)}")
    if not Path(source).is_dir():
        raise LogError(no_folder(Path(source)))
    return CONVERTERS[key](Path(source), Path(out))
