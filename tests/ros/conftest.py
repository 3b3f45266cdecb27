# SPDX-License-Identifier: Apache-2.0
"""These tests start a real ROS; `./dev test-ros` installs it and runs them where nobody hears."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from namespace import is_isolated

# Each by its own ./dev test-ros: one Python has rospy, another rclpy.
collect_ignore_glob = [] if find_spec("rclpy") else ["test_ros2_*.py"]


def pytest_configure(config: pytest.Config) -> None:
    """Let rospy use what newer Python does not like, and leave sockets to the collector."""
    config.addinivalue_line("filterwarnings", r"ignore::DeprecationWarning:ros.*")
    config.addinivalue_line("filterwarnings", "ignore::pytest.PytestUnraisableExceptionWarning")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip everything outside a network namespace of its own."""
    if not is_isolated():
        reason = "needs ROS and a network namespace of its own; run ./dev test-ros"
        for item in items:
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def ros1(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Start a roscore, and make this process the node ``/peer`` beside it."""
    from ros1_peer import roscore

    pytest.importorskip("rospy", reason="no rospy; run ./dev test-ros")
    with roscore(tmp_path_factory.mktemp("ros1")):
        yield
