# SPDX-License-Identifier: Apache-2.0
"""Writes figures of experiments as PNG files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from matplotlib.figure import Figure

from locfuse.report.plot.style import save


def save_figures(figures: Iterable[tuple[str, Figure]], folder: Path) -> list[Path]:
    """Write each figure to NAME.png in a folder, made if absent; return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in figures:
        paths.append(folder / f"{name}.png")
        save(figure, paths[-1])
    return paths
