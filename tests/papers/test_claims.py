# SPDX-License-Identifier: Apache-2.0
"""Rows of a comparison can be written, whatever they were counted with."""

import json

import numpy as np
import pytest

from papers.claims import absent, share


@pytest.mark.parametrize("required", [0.5, None])
def test_a_share_of_numpy_counts_can_be_written(required: float | None) -> None:
    part = np.array([True, True, False, True]).sum()
    row = json.loads(json.dumps(share("id", "claim", part, 4, required).row()))
    assert (row["ours_median"], row["met"]) == (75.0, True)
    assert row["required"] == ("-" if required is None else ">= 50")


@pytest.mark.parametrize("at_most", [False, True])
def test_a_share_meets_what_is_required_from_its_side(at_most: bool) -> None:
    met = [share("id", "claim", part, 4, 0.5, at_most).met for part in (1, 2, 3)]
    assert met == ([True, True, False] if at_most else [False, True, True])


def test_what_could_not_be_run_can_be_written() -> None:
    row = json.loads(json.dumps(absent("id", "claim", "why").row()))
    assert (row["met"], row["ours_median"], row["note"]) == (None, None, "why")
