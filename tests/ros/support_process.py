# SPDX-License-Identifier: Apache-2.0
"""Memory of a process from the kernel."""

from __future__ import annotations

from pathlib import Path


def memory_mb(pid: int) -> float:
    """Return the resident memory of a process."""
    status = Path(f"/proc/{pid}/status").read_text()
    line = next(one for one in status.splitlines() if one.startswith("VmRSS"))
    return float(line.split()[1]) / 1024.0
