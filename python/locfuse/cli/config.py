# SPDX-License-Identifier: Apache-2.0
"""``locfuse config``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
import yaml

from locfuse.check.proposal import proposal
from locfuse.check.robot_localization import from_robot_localization as made_of
from locfuse.cli.inputs import ConfigFile
from locfuse.cli.terminal import visible
from locfuse.config.base import changed_keys
from locfuse.config.json_schema import json_schema
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.io.whole import write_whole
from locfuse.types import ConfigError

app = typer.Typer(add_completion=False, no_args_is_help=True)


@app.callback()
def config() -> None:
    """Inspect configurations."""


@app.command()
def dump(
    config: ConfigFile,
    every: Annotated[
        bool, typer.Option("--all", help="Print keys at their defaults, too.")
    ] = False,
) -> None:
    """Print what a configuration changes, or all of its effective values."""
    loaded = load_config(config)
    values = loaded.model_dump(mode="json") if every else changed_keys(loaded)
    text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=100)
    print(text, end="")


@app.command()
def init(
    log: Annotated[Path, typer.Option(help="Log folder or bag.")],
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("config.yaml"),
) -> None:
    """Write a configuration for a recording: the keys that matter, and where values come from."""
    if out.exists():
        raise ConfigError(f"{out}: is there already; name another file with --out")
    world = out.parent / f"{out.stem}_world"
    made = proposal(log, out.parent, world.name)
    if made.world and world.exists():
        raise ConfigError(f"{world}: is there already; name another file with --out")
    for name, text in made.world.items():
        world.mkdir(parents=True, exist_ok=True)
        write_whole(world / name, text)
    write_whole(out, made.text)
    print(made.text, end="")
    files = " and ".join(visible(str(world / name)) for name in made.world)
    gaps = f"fill in {files}, then " if made.world else ""
    print(f"\nwrote {visible(str(out))}; next: {gaps}locfuse run {visible(str(out))} --out out/run")


@app.command()
def from_robot_localization(
    parameters: Annotated[Path, typer.Argument(help="YAML with the parameters of its nodes.")],
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("config.yaml"),
) -> None:
    """Write a configuration that does what one of robot_localization asks for."""
    if out.exists():
        raise ConfigError(f"{out}: is there already; name another file with --out")
    try:
        given = parameters.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{parameters}: cannot be read ({error})") from error
    try:
        text = made_of(given)
    except ConfigError as error:
        raise ConfigError(f"{parameters}: {error}") from error
    parse_config(yaml.safe_load(text))
    write_whole(out, text)
    print(text, end="")
    print(f"\nwrote {visible(str(out))}; next: locfuse check {visible(str(out))} --log BAG")


@app.command()
def schema() -> None:
    """Print the JSON schema of configurations, by which editors complete and check them."""
    print(json.dumps(json_schema(RunConfig), indent=1))
