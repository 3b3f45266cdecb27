# SPDX-License-Identifier: Apache-2.0
"""Sweeps: many trials of a configuration with varied keys, on this machine or a cluster."""

from __future__ import annotations

from locfuse.sweep.runner import run_trials
from locfuse.sweep.summary import summarize
from locfuse.sweep.table import Trials
from locfuse.sweep.vary import Axis
from locfuse.sweep.workers import dask_cluster

__all__ = ["Axis", "Trials", "dask_cluster", "run_trials", "summarize"]
