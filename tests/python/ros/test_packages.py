# SPDX-License-Identifier: Apache-2.0
"""What the packages for ROS hold is the same as what the Python package holds."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from locfuse.config.load import load_config

ROOT = Path(__file__).resolve().parents[3]
OURS = ROOT / "python" / "locfuse" / "io" / "rosbag" / "msg"
DISTRIBUTIONS = ["ros1", "ros2"]
# ROS 1 has names of its own for two types.
OF_ROS1 = {"Header": "std_msgs/Header", "time": "builtin_interfaces/Time"}


def fields(path: Path) -> list[tuple[str, str]]:
    """Return type and name of each field of a definition, in the words of ROS 2."""
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.split("#")[0].split()
        if words:
            kind = re.sub(r"\w+", lambda w: OF_ROS1.get(w[0], w[0]), words[0], count=1)
            kind = words[0] if "/" in words[0] else kind
            found.append((kind, words[1]))
    return found


@pytest.mark.parametrize("ros", DISTRIBUTIONS)
@pytest.mark.parametrize("name", sorted(path.name for path in OURS.glob("*.msg")))
def test_messages_have_the_same_fields_everywhere(ros: str, name: str) -> None:
    package = ROOT / ros / "locfuse_msgs"
    assert name in (package / "CMakeLists.txt").read_text(encoding="utf-8")
    assert fields(package / "msg" / name) == fields(OURS / name)


def test_packages_have_the_version_of_the_project() -> None:
    project = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    found = re.search(r"VERSION (\d+\.\d+\.\d+)", project)
    assert found is not None
    packages = [
        path for ros in DISTRIBUTIONS for path in (ROOT / ros).glob("locfuse_*/package.xml")
    ]
    assert packages
    for path in packages:
        assert ElementTree.parse(path).findtext("version") == found[1], path


@pytest.mark.parametrize("name", ["robot", "ekim2020", "demo"])
def test_configurations_that_are_shipped_are_valid(name: str) -> None:
    config = load_config(ROOT / "ros1" / "locfuse_ros" / "config" / f"{name}.yaml")
    assert config.start == "auto"


def test_the_system_of_ekim2020_is_the_same_for_bags_and_beside_amcl() -> None:
    bags = load_config(ROOT / "examples" / "configs" / "ros_ekim2020.yaml")
    node = load_config(ROOT / "ros1" / "locfuse_ros" / "config" / "ekim2020.yaml")
    assert node.ros.topics == bags.ros.topics
    assert node.estimator == bags.estimator
    assert node.use == bags.use
    assert not node.ros.publish_transform  # AMCL does
