# SPDX-License-Identifier: Apache-2.0
"""The animation of docs/localize.md: global initialization of a robot on a map."""

from __future__ import annotations

import sys
from pathlib import Path

from locfuse.config.load import load_config
from locfuse.report.plot import write_film
from locfuse.run.run import run

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "rooms_mcl.yaml"
OUT = Path("out/global_localization.gif")
SEED = 1


def main() -> int:
    """Run, draw the animation, print its path."""
    result = run(load_config(CONFIG), base=CONFIG.parent, seed=SEED)
    print(f"ready after {result.metrics['mcl']['ready_s']:.1f} s")
    print(f"film: {write_film(result, OUT).resolve()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
