# SPDX-License-Identifier: Apache-2.0
"""Results as files, pictures and one HTML page."""
