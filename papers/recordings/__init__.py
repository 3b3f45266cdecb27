# SPDX-License-Identifier: Apache-2.0
"""Experiments on public recordings."""

from papers.recordings.figures import draw_drives, draw_outliers, draw_trees
from papers.recordings.landmark_localization import landmark_claims
from papers.recordings.map_localization import map_claims
from papers.recordings.uwb_3d import air_claims
from papers.recordings.uwb_outliers import outlier_claims

__all__ = [
    "air_claims",
    "draw_drives",
    "draw_outliers",
    "draw_trees",
    "landmark_claims",
    "map_claims",
    "outlier_claims",
]
