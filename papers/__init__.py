# SPDX-License-Identifier: Apache-2.0
"""The experiments of five papers and of public recordings, run from a checkout."""
