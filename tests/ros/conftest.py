# SPDX-License-Identifier: Apache-2.0
"""These tests start a real ROS; `./dev test-ros` installs it and runs them where nobody hears."""

from __future__ import annotations

from importlib.util import find_spec

import pytest
from namespace import is_isolated

collect_ignore_glob = [] if find_spec("rclpy") else ["test_ros2_*.py"]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip everything outside a network namespace of its own."""
    if not is_isolated():
        reason = "needs ROS and a network namespace of its own; run ./dev test-ros"
        for item in items:
            item.add_marker(pytest.mark.skip(reason=reason))
