# SPDX-License-Identifier: Apache-2.0
"""Simulated drives in plain numpy: paths, sensors, and faults that are asked for."""
