# SPDX-License-Identifier: Apache-2.0
"""Draw a world in the browser, run estimators in it, watch and compare what they say."""
