# SPDX-License-Identifier: Apache-2.0
"""What `tune` has found."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from locfuse.config.base import given_keys
from locfuse.config.schema import RunConfig
from locfuse.tune.drive import Driven
from locfuse.tune.held_out import HeldOut, Outliers
from locfuse.tune.judge import Judged
from locfuse.types import nearest


@dataclass(frozen=True)
class TuneResult:
    """Quantities in order of their keys, and how well measurements are predicted.

    Measurements of one anchor, landmark or tag that are `spacing_s` apart are independent; 0: all
    are. `driven` has each recording before and after. `findings` are sentences on the recordings,
    `comparisons` on how they are driven. `changes` is the part of the configuration that changes,
    `config` the whole with it.
    """

    quantities: tuple[Judged, ...]
    spacing_s: float
    outliers: tuple[Outliers, ...]
    held_out: tuple[HeldOut, ...]
    driven: tuple[tuple[Driven, Driven], ...]
    findings: tuple[str, ...]
    comparisons: tuple[str, ...]
    changes: dict[str, Any]
    config: RunConfig

    def __getitem__(self, key: str) -> Judged:
        """Return what was found of a key."""
        for one in self.quantities:
            if one.quantity.key == key:
                return one
        keys = [one.quantity.key for one in self.quantities]
        raise KeyError(f"no quantity {key!r}; {nearest(key, keys)}")

    @property
    def yaml(self) -> str:
        """The changes as in a configuration."""
        return str(yaml.safe_dump(self.changes, sort_keys=False, default_flow_style=None))

    @staticmethod
    def whole_yaml(config: RunConfig, base: Path) -> str:
        """Return a configuration as a file of any folder; its paths are relative to `base`."""
        written = given_keys(config)
        for parents, key in (((), "log"), (("log",), "path"), (("ros",), "world")):
            node = written
            for parent in parents:
                node = node.get(parent) or {}
                node = node if isinstance(node, dict) else {}
            if isinstance(node.get(key), str):
                node[key] = str((base / node[key]).resolve())
        return str(yaml.safe_dump(written, sort_keys=False, default_flow_style=None))
