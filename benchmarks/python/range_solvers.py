# SPDX-License-Identifier: Apache-2.0
"""Range-only solvers over layouts and noise: error, failures and time, as in docs/localize.md."""

from __future__ import annotations

import time

import numpy as np

import locfuse.core as lf

EPOCHS = 4000
SOLVERS = ("srls", "srwls", "newton", "ceres")
REPEATED = 9  # batches whose time is taken
REACH_SIGMAS = 6.0  # of the Cramer-Rao bound: an error beyond counts as a failure
ROOM = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
LAYOUTS = {
    "room, 4 corners": ROOM,
    "room, 8 around": np.vstack([ROOM, [[5, 0], [10, 5], [5, 10], [0, 5]]]),
    "4 along a wall": np.array([[0, 0], [3, 0.5], [7, 0], [10, 0.5]], float),
    "cube, 8 corners": 10.0 * np.indices((2, 2, 2)).reshape(3, -1).T,
    "6 at 2.5 to 4 m": np.array(
        [[0, 0, 4], [10, 0, 2.5], [10, 10, 4], [0, 10, 2.5], [5, 0, 3], [5, 10, 3.5]]
    ),
}


def best_us(anchors: np.ndarray, ranges: np.ndarray, sigma: float, solver: str) -> float:
    """Return the time of an epoch, the least of several batches."""
    times = []
    for _ in range(REPEATED):
        begin = time.perf_counter()
        lf.locate_batch(anchors, ranges, sigma, solver=solver)
        times.append(time.perf_counter() - begin)
    return 1e6 * min(times) / len(ranges)


def main() -> None:
    """Print one row per layout and noise, and how far Newton and Ceres are apart."""
    print(f"| layout | sigma | RMSE / bound: {', '.join(SOLVERS)} | "
          "beyond 6 sigma [%] | not unique [%] | time [us] |")  # fmt: skip
    print("|---|---|---|---|---|---|")
    apart = 0.0
    for seed, (name, anchors) in enumerate(LAYOUTS.items()):
        for sigma in (0.05, 0.3, 1.0):
            rng = np.random.default_rng(seed)
            points = rng.uniform(0.5, 9.5, (EPOCHS, anchors.shape[1]))
            points[:, 2:] *= 0.2  # a tag below 2 m
            clean = np.linalg.norm(points[:, None] - anchors, axis=2)
            ranges = np.abs(clean + sigma * rng.standard_normal(clean.shape))
            variance = np.trace(lf.cramer_rao(anchors, points, sigma), axis1=1, axis2=2)
            found = [lf.locate_batch(anchors, ranges, sigma, solver=each) for each in SOLVERS]
            error = [np.linalg.norm(each.position - points, axis=1) for each in found]
            far = [~(each <= REACH_SIGMAS * np.sqrt(variance)) for each in error]
            ratio = [np.sqrt(np.mean(e[~f] ** 2) / np.mean(variance[~f]))
                     for e, f in zip(error, far, strict=True)]  # fmt: skip
            unsure = [each.status != lf.PositionStatus.UNIQUE for each in found]
            took = [f"{best_us(anchors, ranges, sigma, each):.2g}" for each in SOLVERS]
            cells = [
                ", ".join(f"{each:.3f}" for each in ratio),
                ", ".join(f"{100.0 * np.mean(each):.1f}" for each in far),
                ", ".join(f"{100.0 * np.mean(each):.1f}" for each in unsure),
                ", ".join(took),
            ]
            print(f"| {name} | {sigma} m | {' | '.join(cells)} |")
            newton, ceres = (found[SOLVERS.index(each)].position for each in ("newton", "ceres"))
            both = ~unsure[SOLVERS.index("newton")] & ~unsure[SOLVERS.index("ceres")]
            off = np.linalg.norm((newton - ceres)[both], axis=1)
            apart = max(apart, float(np.max(off, initial=0.0)) / sigma)
    print(f"Newton and Ceres end at most {apart:.1g} sigma of a range apart where both are unique.")


if __name__ == "__main__":
    main()
