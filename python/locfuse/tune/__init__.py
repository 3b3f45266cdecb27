# SPDX-License-Identifier: Apache-2.0
"""Noise and calibration that recordings show (docs/tune.md)."""
