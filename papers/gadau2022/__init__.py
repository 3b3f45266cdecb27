# SPDX-License-Identifier: Apache-2.0
"""gadau2022: an EKF on landmarks by range and bearing; where the authors' filter failed, and why.

Their microsimulator measures every landmark exactly where it is; their second one has 151 rays that
end on discs and walls. Kidnapping, which their filter does not survive, is here as well.
"""

from papers.gadau2022.claims import gadau_claims
from papers.gadau2022.figures import draw_figures

__all__ = ["draw_figures", "gadau_claims"]
