# SPDX-License-Identifier: Apache-2.0
"""Python package of this folder, for catkin only."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["locfuse_ros"], package_dir={"": "src"}))
