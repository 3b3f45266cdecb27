# SPDX-License-Identifier: Apache-2.0
"""A run whose messages arrive one by one: what `run` does with a log, on a robot."""

from locfuse.live.run import LiveHealth, LivePose, LiveRun, LiveSource

__all__ = ["LiveHealth", "LivePose", "LiveRun", "LiveSource"]
