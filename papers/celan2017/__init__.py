# SPDX-License-Identifier: Apache-2.0
"""celan2017: a floor scrubber on a lap of an office floor, its LiDAR covered, and UWB."""

from papers.celan2017.claims import celan_claims
from papers.celan2017.figures import draw_figures

__all__ = ["celan_claims", "draw_figures"]
