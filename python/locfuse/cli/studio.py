# SPDX-License-Identifier: Apache-2.0
"""``locfuse studio``."""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import Annotated
from urllib.parse import urlencode

import typer

from locfuse.cli.terminal import console
from locfuse.types import ConfigError


def studio(
    config: Annotated[
        Path | None, typer.Argument(help="YAML file of the first scene; it is not changed.")
    ] = None,
    folder: Annotated[Path, typer.Option(help="Folder of scenes and runs.")] = Path("studio"),
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port.", min=1, max=65535)] = 8642,
    token: Annotated[
        str | None,
        typer.Option(help="Access token; default: a random one.", envvar="LOCFUSE_STUDIO_TOKEN"),
    ] = None,
) -> None:
    """Draw a world in the browser and run estimators in it."""
    try:
        from locfuse.studio.server import serve
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"the studio needs the package {error.name!r}; pip install 'locfuse[studio]'"
        ) from None

    name = f"[{host}]" if ":" in host else host
    token = token or secrets.token_urlsafe(24)
    query = urlencode({"token": token})

    def report(notice: str) -> None:
        for line in (notice, f"http://{name}:{port}/?{query}"):
            if line:
                console.print(f"studio: {line}", soft_wrap=True, highlight=False)

    serve(folder, config, host, port, token, report)
