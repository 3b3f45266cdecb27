# SPDX-License-Identifier: Apache-2.0
"""Files in and out: log folders, trajectories, published recordings."""
