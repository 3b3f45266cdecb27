# SPDX-License-Identifier: Apache-2.0
"""A live run: messages arrive one by one, as on a robot."""

from locfuse.live.run import LiveHealth, LivePose, LiveRun, LiveSource

__all__ = ["LiveHealth", "LivePose", "LiveRun", "LiveSource"]
