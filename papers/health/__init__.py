# SPDX-License-Identifier: Apache-2.0
"""Health monitoring: alarms, protection levels and blackouts, counted."""

from papers.health.claims import health_claims
from papers.health.figures import draw_figures
from papers.health.watched import watch_claims

__all__ = ["draw_figures", "health_claims", "watch_claims"]
