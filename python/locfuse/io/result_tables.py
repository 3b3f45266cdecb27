# SPDX-License-Identifier: Apache-2.0
"""The tables of a result, every bit of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.csv_table import column_texts, write_table
from locfuse.io.geodesy import Origin
from locfuse.io.georeference import on_earth
from locfuse.types import Health, Table, Trajectory


def write_columns(path: Path, table: Table) -> None:
    """Write a table of a result; NaN is empty."""
    _write(path, table.columns())


def write_estimate(
    path: Path, estimate: Trajectory, health: Health | None = None, origin: Origin | None = None
) -> None:
    """Write ``estimate.csv``: poses with covariance, where on the Earth, the state of health."""
    columns = estimate.columns()
    if origin is not None:
        columns |= on_earth(estimate.position, origin)
    if health is not None and len(health):
        last = np.searchsorted(health.stamp_ns, estimate.stamp_ns, side="right") - 1
        columns["state"] = health.state[np.maximum(last, 0)]
    _write(path, columns)


def _write(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    header = ["stamp_s" if name == "stamp_ns" else name for name in columns]
    write_table(path, header, [column_texts(name, values) for name, values in columns.items()])
