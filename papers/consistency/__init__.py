# SPDX-License-Identifier: Apache-2.0
"""Consistency of every estimator: errors and innovations as large as their covariance says."""

from papers.consistency.claims import consistency_claims

__all__ = ["consistency_claims"]
