# SPDX-License-Identifier: Apache-2.0
"""The paper's Figs. 3, 4, 5 and 8, with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from papers.zhang.comparison import METHODS, NEAR_M, compare, localizer
from papers.zhang.world import ITERATIONS, World, world

if TYPE_CHECKING:
    from papers.zhang.plots import Particles

SHOWN = (5, 10, 15)  # iterations of Figs. 3 and 4
AROUND_M = 0.1  # the robot that is tracked, shown
SEED = 0


def draw_pictures(folder: Path, seeds: int) -> list[Path]:
    """Write the pictures as PNG files; return their paths.

    ``zhang_global.png``: Figs. 3 and 4, particles from a uniform start; ``zhang_error.png``: Fig.
    5, errors over iterations; ``zhang_tracking.png``: Fig. 8, particles about a robot whose start
    was known.
    """
    from locfuse.report import plot  # matplotlib loads slowly; rows need none
    from papers.zhang import plots

    folder.mkdir(parents=True, exist_ok=True)
    of = world(SEED)
    runs = compare(seeds)
    figures = {
        "zhang_global": plots.plot_particles(of.grid, list(_sets(of, False, SHOWN))),
        "zhang_error": plots.plot_convergence(
            {text: runs[name].errors[:, :, 0] for name, text in METHODS.items()},
            {text: runs[name].converged() for name, text in METHODS.items()},
            NEAR_M,
        ),
        "zhang_tracking": plots.plot_particles(
            of.grid, [[last for (last,) in _sets(of, True, (ITERATIONS,))]], AROUND_M
        ),
    }
    paths = []
    for name, figure in figures.items():
        paths.append(folder / f"{name}.png")
        plot.save(figure, paths[-1])
    return paths


def _sets(of: World, told: bool, shown: tuple[int, ...]) -> Iterator[list[Particles]]:
    """Yield for each method its particles after some iterations."""
    from papers.zhang.plots import Particles

    for name, text in METHODS.items():
        method = localizer(name, of, SEED, told)
        row = []
        for iteration, step in enumerate(of.steps, 1):
            method.on(step)
            if iteration in shown:
                row.append(Particles(f"{text}, iteration {iteration}", method.particles.copy(),
                                     step.truth))  # fmt: skip
        yield row
