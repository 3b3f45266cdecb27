# SPDX-License-Identifier: Apache-2.0
"""A live run: messages arrive one by one, as on a robot."""

from locfuse.live.rows import Row
from locfuse.live.run import MAX_KEPT, LiveHealth, LivePose, LiveRun, LiveSource, LiveWatched

__all__ = ["MAX_KEPT", "LiveHealth", "LivePose", "LiveRun", "LiveSource", "LiveWatched", "Row"]
