# SPDX-License-Identifier: Apache-2.0
"""Write the descriptions of the configuration keys from their documentation page."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests" / "python")]

from test_documents import CONFIGURATION, SECTIONS, table_under  # noqa: E402

TARGET = ROOT / "python" / "locfuse" / "config" / "meanings.yaml"


def meanings() -> dict[str, str]:
    """Return the description of each key by ``Model.key``, without links and markup."""
    found = {}
    for heading, model in SECTIONS.items():
        for key, _, unit, _, meaning in table_under(CONFIGURATION, heading):
            text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", meaning).replace("`", "")
            unit = "" if unit in ("-", "") else f" [{unit}]"
            found[f"{model.__name__}.{key.strip('`')}"] = text + unit
    return found


def text() -> str:
    """Return the contents of the packaged file."""
    head = "# SPDX-License-Identifier: Apache-2.0\n# Made by scripts/meanings.py.\n"
    return head + yaml.safe_dump(meanings(), sort_keys=False, allow_unicode=True, width=1000)


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
