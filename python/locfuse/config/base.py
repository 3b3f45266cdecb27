# SPDX-License-Identifier: Apache-2.0
"""What every configuration model has in common."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Strict(BaseModel):
    """A configuration that refuses unknown keys, NaN and infinity, and never changes once made."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
