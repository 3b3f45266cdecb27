# SPDX-License-Identifier: Apache-2.0
"""Configurations: what a YAML file may say, checked, and turned into C++ objects."""
