# SPDX-License-Identifier: Apache-2.0
"""Graphs of poses like the public ones: streets of Manhattan, and loops that are wrong."""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import pytest

import locfuse.core as lf
from locfuse.types import FloatArray

POSES = 3500
SIGMA = np.array([0.03, 0.03, 0.01])  # m, m, rad
EXTENT = 30  # of the city to each side [m]
BLOCK = 4  # between two streets [m]


@dataclass
class City:
    """A walk through streets, the relations of it, and wrong ones."""

    truth: FloatArray
    guess: list[lf.Pose2]
    motions: list[lf.PoseRelation]
    loops: list[lf.PoseRelation]
    wrong: list[lf.PoseRelation]


def city(seed: int, wrong_share: float = 0.2) -> City:
    rng = np.random.default_rng(seed)
    along = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    at, heading = np.zeros(2, np.int64), 0
    rows = [(0.0, 0.0, 0.0)]
    while len(rows) < POSES:
        if len(rows) % BLOCK == 0:
            heading = (heading + int(rng.integers(-1, 2))) % 4
        while np.abs(at + along[heading]).max() > EXTENT:
            heading = (heading + 1) % 4
        at = at + along[heading]
        rows.append((float(at[0]), float(at[1]), heading * np.pi / 2))
    truth = np.array(rows)
    exact = [lf.Pose2(*row) for row in rows]
    known = np.diag(SIGMA**-2.0)

    def relation(a: int, b: int, motion: lf.Pose2, *, loop: bool) -> lf.PoseRelation:
        off = rng.normal(size=3) * SIGMA
        noisy = lf.Pose2(motion.x + off[0], motion.y + off[1], motion.heading + off[2])
        return lf.PoseRelation(a, b, noisy, known, loop)

    def between(a: int, b: int) -> lf.Pose2:
        return exact[a].inverse() * exact[b]

    motions = [relation(i, i + 1, between(i, i + 1), loop=False) for i in range(POSES - 1)]
    guess = [exact[0]]
    for one in motions:
        guess.append(guess[-1] * one.motion)
    seen: defaultdict[tuple[float, float], list[int]] = defaultdict(list)
    loops = []
    for i, row in enumerate(rows):
        before = [k for k in seen[row[0], row[1]] if i - k > 20]
        if before and rng.random() < 0.6:
            k = int(rng.choice(before))
            loops.append(relation(k, i, between(k, i), loop=True))
        seen[row[0], row[1]].append(i)
    wrong: list[lf.PoseRelation] = []
    while len(wrong) < wrong_share / (1.0 - wrong_share) * len(loops):
        a, b = sorted(rng.integers(0, POSES, 2).tolist())
        if np.hypot(*(truth[a] - truth[b])[:2]) > 5.0:
            turn = float(rng.choice([0.0, np.pi / 2, np.pi, -np.pi / 2]))
            x, y = rng.uniform(-2.0, 2.0, 2).tolist()
            motion = lf.Pose2(x, y, turn)
            wrong.append(relation(a, b, motion, loop=True))
    return City(truth, guess, motions, loops, wrong)


def cost_of(poses: list[lf.Pose2], relations: list[lf.PoseRelation]) -> float:
    """Return half the sum of squared errors in sigmas."""
    total = 0.0
    for one in relations:
        off = lf.local(poses[one.from_pose].inverse() * poses[one.to_pose], one.motion)
        total += 0.5 * float(((off / SIGMA) ** 2).sum())
    return total


@pytest.mark.parametrize("seed", [0, 1])
def test_among_wrong_loops_the_optimum_is_that_of_the_clean_graph(seed: int) -> None:
    """Printed with pytest -s, as in results/components.md."""
    made = city(seed)
    right = [*made.motions, *made.loops]
    clean = lf.solve_pose_graph(made.guess, right)
    begin = time.perf_counter()
    found = lf.solve_pose_graph(made.guess, [*right, *made.wrong])
    seconds = time.perf_counter() - begin
    kept = np.array(found.kept)
    off = max(np.hypot(a.x - b.x, a.y - b.y) for a, b in zip(found.poses, clean.poses, strict=True))
    last = made.guess[-1]
    print(f"seed {seed}: {len(made.loops)} loops, {len(made.wrong)} wrong ones, {seconds:.1f} s, "
          f"off {off:.1g} m, odometry off "
          f"{np.hypot(last.x - made.truth[-1, 0], last.y - made.truth[-1, 1]):.1f} m")  # fmt: skip
    assert kept[: len(right)].all()
    assert not kept[len(right) :].any()
    assert found.cost == pytest.approx(clean.cost, rel=1e-6)
    assert clean.cost == pytest.approx(cost_of(clean.poses, right), rel=1e-9)
    assert off < 1e-3
    dof = 3 * len(made.loops)
    assert abs(2.0 * clean.cost / dof - 1.0) < 4.0 * np.sqrt(2.0 / dof)


def test_the_optimum_is_that_of_gtsam() -> None:
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed (extra bench)")
    made = city(0)
    relations = [*made.motions, *made.loops]
    begin = time.process_time()
    ours = lf.solve_pose_graph(made.guess, relations)
    seconds = time.process_time() - begin
    graph, guess = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Diagonal.Sigmas(SIGMA)
    first = gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(0, 0, 0), first))
    for one in relations:
        motion = gtsam.Pose2(one.motion.x, one.motion.y, one.motion.heading)
        graph.add(gtsam.BetweenFactorPose2(one.from_pose, one.to_pose, motion, noise))
    for i, pose in enumerate(made.guess):
        guess.insert(i, gtsam.Pose2(pose.x, pose.y, pose.heading))
    tight = gtsam.LevenbergMarquardtParams()
    tight.setRelativeErrorTol(1e-12)
    begin = time.process_time()
    theirs = gtsam.LevenbergMarquardtOptimizer(graph, guess, tight).optimize()
    print(f"ours {seconds:.2f} s of CPU, gtsam {time.process_time() - begin:.2f} s")
    poses = [lf.Pose2(at.x(), at.y(), at.theta())
             for at in (theirs.atPose2(i) for i in range(POSES))]  # fmt: skip
    # By our sum for both: gtsam has its errors in the axes of the second pose.
    assert ours.cost == pytest.approx(cost_of(poses, relations), rel=1e-6)
    assert max(np.hypot(a.x - b.x, a.y - b.y)
               for a, b in zip(ours.poses, poses, strict=True)) < 1e-3  # fmt: skip
