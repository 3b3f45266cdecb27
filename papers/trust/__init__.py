# SPDX-License-Identifier: Apache-2.0
"""How far a filter's word may be trusted: alarms, protection levels and blackouts, counted."""

from __future__ import annotations

from papers.trust.comparison import trust_claims
from papers.trust.pictures import draw_pictures

__all__ = ["draw_pictures", "trust_claims"]
