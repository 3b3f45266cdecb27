# SPDX-License-Identifier: Apache-2.0
"""Zhang Hong et al., MCL combined with EKF: standard MCL, the paper's and ours side by side."""

from papers.zhang.claims import zhang_claims
from papers.zhang.figures import draw_figures

__all__ = ["draw_figures", "zhang_claims"]
