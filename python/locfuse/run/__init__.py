# SPDX-License-Identifier: Apache-2.0
"""One run over a log: messages, start, estimator, outcomes and scores."""
