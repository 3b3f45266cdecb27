# SPDX-License-Identifier: Apache-2.0
"""How good an estimate is: errors against truth, consistency, and what became of the messages."""
