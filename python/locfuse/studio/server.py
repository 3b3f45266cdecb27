# SPDX-License-Identifier: Apache-2.0
"""The server of the studio: its routes and pages, behind the guard."""

from __future__ import annotations

import fcntl
import logging
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from locfuse.studio.guard import Guard, check_token
from locfuse.studio.workspace import MAX_BYTES, Workspace
from locfuse.types import ConfigError


def make_app(folder: Path, config: Path | None, token: str) -> tuple[Any, Any]:
    """Return the ASGI application of a studio, and the `Studio` that it shows.

    The folder must be nobody else's: the scene that is kept there may be another one after this.
    Raises ConfigError if the extra is not installed, the folder cannot be used, or the
    configuration is none.
    """
    # NiceGUI would keep a folder of its own where the command was called.
    os.environ.setdefault("NICEGUI_STORAGE_PATH", str(folder.absolute() / ".nicegui"))
    try:
        from fastapi import FastAPI
        from nicegui import ui
    except ImportError as error:
        raise ConfigError(
            f"the studio needs the package {error.name!r}; pip install 'locfuse[studio]'"
        ) from None
    from locfuse.studio.page import StudioPage
    from locfuse.studio.routes import routes
    from locfuse.studio.studio import Studio

    studio = Studio(folder, config)
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    app.include_router(routes(studio))

    @ui.page("/", title="locfuse studio", response_timeout=30.0)
    def index() -> None:
        StudioPage(studio).build()

    ui.run_with(app, title="locfuse studio", dark=None, tailwind=False, reconnect_timeout=30.0,
                show_welcome_message=False)  # fmt: skip
    return Guard(app, token, MAX_BYTES + 1_000_000, "/studio/upload"), studio


def serve(
    folder: Path,
    config: Path | None,
    host: str,
    port: int,
    token: str,
    ready: Callable[[str], None] = lambda notice: None,
) -> None:
    """Serve the studio until it is interrupted.

    `folder` keeps everything; `config` is the scene to begin with, instead of the one that was
    left. `ready` is called with what should be known of the scene, or "", once nothing stands
    against serving any more. Raises ConfigError as `make_app`, if folder or port are in use, or if
    the token is short.
    """
    check_token(token)
    # What is kept in the folder is touched only once nobody else can be using it, and nothing
    # is left that could keep this server from serving it.
    with _alone_in(Workspace(folder).folder), _listening(host, port) as sock:
        app, studio = make_app(folder, config, token)
        import uvicorn

        logging.getLogger("nicegui").setLevel(logging.WARNING)
        try:
            studio.grounds.begin()
            ready(studio.notice)
            settings = uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=2)
            uvicorn.Server(settings).run([sock])
        except KeyboardInterrupt:
            pass
        finally:
            studio.close()


def _alone_in(folder: Path) -> IO[str]:
    """Keep the folder from being used by two servers, of which the last would win."""
    try:
        # Neither emptied nor followed: the folder may come from elsewhere.
        lock = os.fdopen(os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644))
    except OSError as error:
        raise ConfigError(
            f"--folder {folder}: its .lock cannot be opened ({error.strerror}); remove it"
        ) from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise ConfigError(f"--folder {folder}: another studio is using it") from None
    return lock


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    sock = socket.socket(family, socket.SOCK_STREAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        sock.bind((host, port))
        sock.listen(128)  # who comes before the server runs waits
    except OSError as error:
        sock.close()
        raise ConfigError(
            f"--host {host} --port {port}: cannot be served there ({error.strerror})"
        ) from None
    return sock
