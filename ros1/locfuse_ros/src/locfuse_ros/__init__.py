# SPDX-License-Identifier: Apache-2.0
"""What the nodes of locfuse for ROS 1 share; what is not about ROS 1 is in the package locfuse."""
