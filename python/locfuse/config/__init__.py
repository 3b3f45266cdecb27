# SPDX-License-Identifier: Apache-2.0
"""Configurations: YAML files, their schema, and the C++ objects built from them."""
