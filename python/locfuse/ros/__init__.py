# SPDX-License-Identifier: Apache-2.0
"""Messages of either ROS and what they mean here; no part of ROS is needed."""
