# SPDX-License-Identifier: Apache-2.0
"""ekim2020: a filter on ranges, odometry and poses, and its start from ranges and one scan."""

from papers.ekim2020.claims import ekim2020_claims
from papers.ekim2020.figures import draw_figures

__all__ = ["draw_figures", "ekim2020_claims"]
