# SPDX-License-Identifier: Apache-2.0
"""Tests with a real ROS; `./dev test-ros` installs it and runs them in an isolated network."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from namespace import is_isolated

# ROS 1 and ROS 2 use different Pythons: one has rospy, the other rclpy.
collect_ignore_glob = [] if find_spec("rclpy") else ["test_ros2_*.py"]


def pytest_configure(config: pytest.Config) -> None:
    """Ignore deprecations in rospy and sockets that it does not close."""
    config.addinivalue_line("filterwarnings", r"ignore::DeprecationWarning:ros.*")
    config.addinivalue_line("filterwarnings", "ignore::pytest.PytestUnraisableExceptionWarning")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip all tests outside a separate network namespace."""
    if not is_isolated():
        reason = "needs ROS and a separate network namespace; run ./dev test-ros"
        for item in items:
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def ros1(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Start a roscore and make this process the node ``/peer``."""
    from ros1_peer import roscore

    pytest.importorskip("rospy", reason="no rospy; run ./dev test-ros")
    with roscore(tmp_path_factory.mktemp("ros1")):
        yield
