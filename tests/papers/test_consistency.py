# SPDX-License-Identifier: Apache-2.0
"""The gate of consistency: every estimator is in, and who is too sure or too timid is not."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from scipy.stats import binom

import locfuse.core
from locfuse.eval.consistency import PROBABILITY, band
from papers.consistency.claims import MCL_BAND, SCENARIOS, each_probability, figures, max_outside
from papers.consistency.planar_estimators import mcl
from papers.consistency.sample import Sample

SEEDS = 50


@pytest.mark.parametrize("name", SCENARIOS)
def test_errors_and_innovations_are_as_large_as_it_believes(name: str) -> None:
    for figure in figures(SCENARIOS[name], SEEDS):
        assert figure.inside(each_probability()), figure


@pytest.mark.parametrize(("factor", "below"), [(0.7, False), (1.4, True)])
@pytest.mark.parametrize("name", SCENARIOS)
def test_one_that_is_too_sure_and_one_that_is_too_timid_fail(
    name: str, factor: float, below: bool
) -> None:
    found = {f.what: f for f in figures(SCENARIOS[name], SEEDS, factor)}
    for what, figure in found.items():
        if what.startswith("NIS") or what == "NEES of all":
            assert not figure.inside(each_probability()), figure
            assert (figure.mean < 1.0) == below, figure


def test_particles_keep_a_band_of_their_own() -> None:
    (everything,) = (f for f in figures(mcl, SEEDS) if f.what == "NEES of all")
    low, high = MCL_BAND
    assert low <= everything.mean <= high


def test_every_estimator_is_in_the_gate() -> None:
    names = locfuse.core.__all__
    estimators = {n for n in names if is_estimator(n) and inspect.isclass(getattr(locfuse.core, n))}
    covered = {name.split(":")[0] for name in SCENARIOS} | {"Mcl"}
    # These are an Mcl as long as nothing is wrong, and an injected pose is that of a PoseEkf.
    assert estimators - covered == {"SwitchingMcl", "LiveMcl"}


def is_estimator(name: str) -> bool:
    return name.endswith("Ekf") or name.endswith("Mcl") or name == "Initializer"


def test_all_figures_of_consistent_filters_are_inside_together_as_often_as_stated() -> None:
    """Half the tail of each is left out, as a figure cannot be on both sides."""
    family = round((1.0 - PROBABILITY) / (1.0 - each_probability()))
    rng = np.random.default_rng(3)
    means = rng.chisquare(100, (4000, family)) / 100.0
    low, high = band(1, 100, each_probability())
    all_inside = np.mean(np.all((means >= low) & (means <= high), axis=1))
    assert all_inside == pytest.approx(0.951, abs=0.012)
    assert max_outside(family) == binom.ppf(0.999, family, 1.0 - PROBABILITY)


def test_only_what_was_fused_counts() -> None:
    ekf = locfuse.PoseEkf(
        locfuse.PoseEkfConfig(),
        locfuse.World(
            locfuse.AnchorMap([locfuse.Anchor(0, [0, 0, 0])]), [locfuse.Tag(0, [0, 0, 0])]
        ),
        locfuse.PoseEstimate(0, locfuse.Pose2(3, 4, 0), np.diag([0.01, 0.01, 0.01])),
    )
    sample = Sample()
    sample.add("ranges", ekf.on(locfuse.Range(0, 0, 0, 5.0)))
    sample.add("ranges", ekf.on(locfuse.Range(0, 0, 0, 50.0)))
    sample.add("ranges", ekf.on(locfuse.Range(0, 0, 7, 5.0)))
    assert sample.nis["ranges"][1] == 1
