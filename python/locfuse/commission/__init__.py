# SPDX-License-Identifier: Apache-2.0
"""Everything that a new robot needs, from one drive (docs/commission.md)."""
