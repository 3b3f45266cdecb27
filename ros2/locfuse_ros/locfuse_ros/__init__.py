# SPDX-License-Identifier: Apache-2.0
"""Nodes of locfuse for ROS 2; all that is not about ROS 2 is in the package locfuse."""
