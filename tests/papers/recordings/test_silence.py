# SPDX-License-Identifier: Apache-2.0
"""What a body in space knows after seconds without ranges: drives in the yard."""

from __future__ import annotations

from pathlib import Path

import pytest

from locfuse.types import LogError
from papers.recorded import load_recording
from papers.recordings.silence import silence, silence_claims
from support_runs import CONFIGS


@pytest.mark.parametrize("drive", ["los_a1", "nlos_b3"])
def test_a_drive_is_found_again_and_never_sure_and_wrong(drive: str) -> None:
    try:
        config, log = load_recording(CONFIGS, "hanyang_outdoor", "hanyang-outdoor", drive,
                                     estimator={"kind": "air"})  # fmt: skip
    except LogError as error:
        pytest.skip(str(error))
    found = silence(config, log, places=7)
    assert (found.back, found.sure) == (7, 0)
    assert found.after_s < 2.0
    assert found.apart_m < 0.5


def test_a_drive_that_is_not_there_has_a_row_that_says_so(tmp_path: Path) -> None:
    (row,) = silence_claims(tmp_path, "los_a1")
    assert row.met is None
