# SPDX-License-Identifier: Apache-2.0
"""Zhang Hong et al., MCL combined with EKF: standard MCL, the paper's and ours side by side."""
