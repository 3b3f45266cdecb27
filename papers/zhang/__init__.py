# SPDX-License-Identifier: Apache-2.0
"""Zhang Hong et al., MCL combined with EKF: standard MCL, the paper's and ours side by side."""

from __future__ import annotations

from papers.claims import Claim, Progress
from papers.zhang.comparison import claims_of, compare, spreads
from papers.zhang.pictures import draw_pictures

__all__ = ["draw_pictures", "zhang_claims"]


def zhang_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return the rows of the comparison; a tenth of the seeds also tracks from a known start."""
    return list(claims_of(compare(seeds, progress), spreads(max(2, seeds // 10))))
