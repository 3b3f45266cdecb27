# SPDX-License-Identifier: Apache-2.0
"""Before anything moves: what is wrong with a configuration and its log, in words."""

from __future__ import annotations

from locfuse.check.finding import SEVERITIES, Finding
from locfuse.check.layout import Layout
from locfuse.check.registry import RULES, CheckResult, check

__all__ = ["RULES", "SEVERITIES", "CheckResult", "Finding", "Layout", "check"]
