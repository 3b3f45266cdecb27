# SPDX-License-Identifier: Apache-2.0
"""Colours and ellipse sizes that pictures, player and rerun share; needs no matplotlib."""

# Okabe and Ito's palette: distinguishable with every common colour blindness.
INK = "#222222"
MUTED = "#6b6b6b"
GRID = "#e4e4e4"
ESTIMATE = "#0072B2"
ESTIMATE_PALE = "#cfe3f1"
TRUTH = "#222222"
REJECTED = "#D55E00"
ANCHOR = "#009E73"
MEAN = "#222222"

ELLIPSE_SIGMAS = 3.0
BAND_SIGMAS = 3.0
