# SPDX-License-Identifier: Apache-2.0
from setuptools import setup

NAME = "locfuse_ros"

setup(
    name=NAME,
    version="0.1.0",
    description="Nodes of locfuse for ROS 2",
    license="Apache-2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", ["config/localize.yaml"]),
        (f"share/{NAME}/rviz", ["rviz/locfuse.rviz"]),
    ],
    install_requires=["setuptools"],  # and locfuse by pip: rosdep does not list it
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "localize = locfuse_ros.localize:main",
            "replay_log = locfuse_ros.replay_log:main",
            "simulate_uwb = locfuse_ros.simulate_uwb:main",
        ]
    },
)
