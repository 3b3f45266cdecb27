# SPDX-License-Identifier: Apache-2.0
"""The picture of docs/simulation.md: a world of each kind with a roaming drive."""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib.axes import Axes

from locfuse.config.load import parse_config
from locfuse.report.plot.style import ESTIMATE, INK, dress, new_figure, save, title
from locfuse.report.plot.world import draw_map
from locfuse.run.run import load_log

OUT = Path("out/worlds.png")
SIZES_M = {"hallways": (40, 20), "rooms": (16, 12), "warehouse": (30, 20), "zhang": (10, 10),
           "floor": (50, 21)}  # fmt: skip
MAP_SEED = 2
DRIVE_SEED = 1
DRIVE_S = {"hallways": 120.0, "rooms": 120.0, "warehouse": 120.0, "zhang": 60.0, "floor": 300.0}
DRAWN_M = 0.1  # cell size of the drawing; smaller cells would vanish between pixels


def draw(axes: Axes, world: str) -> None:
    """Draw the map of a world and the true path of a drive on it."""
    config = parse_config({
        "simulation": {
            "room_m": SIZES_M[world],
            "map": {"generate": world, "seed": MAP_SEED},
            "path": {"shape": "roam", "speed_mps": 1.0},
            "duration_s": DRIVE_S[world],
        },
    })  # fmt: skip
    log = load_log(config, None, DRIVE_SEED)
    assert log.grid is not None
    width, depth = SIZES_M[world]
    dress(axes)
    axes.set(xlim=(-DRAWN_M, width + DRAWN_M), ylim=(-DRAWN_M, depth + DRAWN_M))
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    draw_map(axes, log.grid.resampled(DRAWN_M), ("white", "#cccccc", INK), zorder=1)
    axes.plot(log["truth"]["x_m"], log["truth"]["y_m"], color=ESTIMATE, lw=1.5)
    title(axes, world)


def main() -> int:
    """Draw all worlds, print the path of the picture."""
    figure = new_figure(12.0)
    cells = figure.add_gridspec(3, 2, width_ratios=(1.6, 1.0))
    for number, world in enumerate(SIZES_M):
        row, column = divmod(number, 2)
        draw(figure.add_subplot(cells[row, :] if row == 2 else cells[row, column]), world)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    save(figure, OUT)
    print(f"picture: {OUT.resolve()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
