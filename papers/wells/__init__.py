# SPDX-License-Identifier: Apache-2.0
"""wells: an EKF on cylinders that a laser sees; the paper's method beside ours.

The paper trusts the heading of the odometry and takes one beam a scan: the closest, plus the radius
of the cylinder (its eq. 8 to 14). Ours fits every arc, associates the cylinders of a scan with the
map jointly, and estimates the heading.
"""

from papers.wells.claims import wells_claims
from papers.wells.cylinder_detector import cylinder_claims
from papers.wells.figures import draw_figures

__all__ = ["cylinder_claims", "draw_figures", "wells_claims"]
