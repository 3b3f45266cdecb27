# SPDX-License-Identifier: Apache-2.0
"""``locfuse config``."""

from __future__ import annotations

import typer
import yaml

from locfuse.cli.inputs import ConfigFile
from locfuse.config.load import load_config

app = typer.Typer(add_completion=False, no_args_is_help=True)


@app.callback()
def config() -> None:
    """Inspect configurations."""


@app.command()
def dump(config: ConfigFile) -> None:
    """Print the effective configuration: every key with its value."""
    text = yaml.safe_dump(load_config(config).model_dump(mode="json"), sort_keys=False)
    print(text, end="")
