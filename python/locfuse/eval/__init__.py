# SPDX-License-Identifier: Apache-2.0
"""Quality of an estimate: errors against truth, consistency, and outcomes of messages."""
