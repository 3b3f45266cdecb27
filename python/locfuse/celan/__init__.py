# SPDX-License-Identifier: Apache-2.0
"""celan2017: a floor scrubber on a lap of an office floor, with half of its LiDAR covered, and UWB."""
