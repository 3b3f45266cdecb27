# SPDX-License-Identifier: Apache-2.0
"""Three tags on a recorded trolley: both filters, from ranges and from positions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse import _core
from papers.celan2017 import claims as module
from papers.celan2017.claims import trolley_claims
from papers.celan2017.trolley import FOLDER, Trolley, by_fixes, follow, trolley
from support_runs import CONFIGS

DATA = (CONFIGS / FOLDER).resolve()
recorded = pytest.mark.skipif(not DATA.is_dir(), reason=f"needs {FOLDER.name}")


@pytest.fixture(scope="module")
def of() -> Trolley:
    return trolley(DATA)


class IndependentErrors(_core.PoseEkfConfig):
    """Of a filter that takes errors that last for independent ones."""

    def __init__(self) -> None:
        super().__init__()
        self.correlation_s = 0.0


def rmse(of: Trolley, by: str, given: str = "ranges", rate_hz: int = 10) -> tuple[float, float]:
    off, _ = follow(of, by, given, rate_hz)
    return (float(np.sqrt(np.mean(np.sum(off[:, :2] ** 2, axis=1)))),
            float(np.rad2deg(np.sqrt(np.mean(off[:, 2] ** 2)))))  # fmt: skip


@recorded
def test_one_rigid_body_is_better_than_twelve_states(of: Trolley) -> None:
    for given in ("ranges", "fixes"):
        position, heading = rmse(of, "rigid", given)
        theirs, their_heading = rmse(of, "twelve", given)
        assert position < 0.05
        assert heading < 4.5
        assert position < theirs < 0.06
        assert heading < their_heading < 6.0


@recorded
def test_the_recording_is_shown_at_its_own_rate_too(
    of: Trolley, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fed every epoch, whose errors are correlated, a filter is not surer than fed a tenth."""
    monkeypatch.setattr(module, "WAYS", (("ranges", "rigid"),))
    rows = {claim.id: claim.ours_median for claim in trolley_claims(CONFIGS)}
    for rate_hz in (100, 10, 1):
        assert f"celan_trolley_rigid_ranges_{rate_hz}" in rows
    nees = [rows[f"celan_trolley_rigid_ranges_{rate_hz}_nees"] for rate_hz in (100, 10)]
    assert nees[0] is not None
    assert nees[1] is not None
    assert nees[0] < 1.5 * nees[1]
    assert nees[0] < 3.0
    monkeypatch.setattr(_core, "PoseEkfConfig", IndependentErrors)
    independent = {claim.id: claim.ours_median for claim in trolley_claims(CONFIGS)}
    sure = independent["celan_trolley_rigid_ranges_100_nees"]
    assert sure is not None
    assert sure > 2.0 * nees[0]


@recorded
def test_a_body_that_rolls_with_antennas_known_keeps_its_heading(of: Trolley) -> None:
    position, heading = rmse(of, "rolling_antennas", "antennas")
    assert position < 0.03
    assert heading < 2.9
    sides = of.antennas
    mirrored = replace(of, antennas=replace(sides, cosine_m=-sides.cosine_m, sine_m=-sides.sine_m))
    flat = replace(of, antennas=replace(sides, cosine_m=0.0 * sides.cosine_m,
                                        sine_m=0.0 * sides.sine_m))  # fmt: skip
    headings = [rmse(other, "rolling_antennas", "antennas")[1] for other in (flat, mirrored)]
    assert heading < headings[0] < headings[1]
    assert headings[1] > 4.0


@recorded
def test_tags_swapped_in_body_are_no_heading(of: Trolley) -> None:
    first, second, third = of.tags
    swapped = replace(of, tags=[_core.Tag(first.id, second.position),
                                _core.Tag(second.id, first.position), third])  # fmt: skip
    assert rmse(swapped, "rigid")[1] > 20.0


@recorded
def test_ranges_that_keep_their_constant_errors_cost_position(of: Trolley) -> None:
    long = [[_core.Range(z.stamp, z.tag, z.anchor, z.range + 0.3 * (z.anchor < 3), z.sigma)
             for z in epoch] for epoch in of.epochs[:3000]]  # fmt: skip
    kept = replace(of, epochs=of.epochs[:3000])
    assert rmse(replace(of, epochs=long), "rigid")[0] > 2.0 * rmse(kept, "rigid")[0]


@recorded
def test_a_tag_in_range_of_few_anchors_has_no_position(of: Trolley) -> None:
    epoch = [z for z in of.epochs[0] if z.tag != 1 or z.anchor < 2]
    assert [fix.tag for fix in by_fixes(of, epoch) if isinstance(fix, _core.PositionFix)] == [0, 2]


def test_without_the_recording_a_row_says_so(tmp_path: Path) -> None:
    for configs in (None, tmp_path):
        (claim,) = trolley_claims(configs)
        assert claim.met is None
        assert claim.note
