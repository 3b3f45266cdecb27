# SPDX-License-Identifier: Apache-2.0
"""Nodes of locfuse for ROS 1; code independent of ROS 1 is in the package locfuse."""
