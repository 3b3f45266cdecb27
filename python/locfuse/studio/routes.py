# SPDX-License-Identifier: Apache-2.0
"""What the page fetches beside itself: coverage, map and way, runs, downloads, uploads."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, JSONResponse, Response
from starlette.concurrency import run_in_threadpool

from locfuse.report.player import player_css, player_js
from locfuse.studio.coverage import packed
from locfuse.studio.ground import TROUBLE
from locfuse.studio.guard import MAX_BODY
from locfuse.studio.studio import Studio
from locfuse.studio.view import coverage_of, replaying
from locfuse.studio.work import PLAY, spawned, write_bag_of
from locfuse.studio.workspace import MAX_BYTES
from locfuse.types import ConfigError, LogError

FILES = ("report.html", "config.yaml", "scene.yaml", "estimate.tum", "truth.tum", "estimate.csv",
         "outcomes.csv", "metrics.json")  # fmt: skip
BAG = "drive.mcap"
STATIC = ("editor.js", "coverage.js", "studio.js", "studio.css")
# Only a log is not held in memory.
_MAX_UPLOAD = {"log": MAX_BYTES, "map": 64_000_000, "scene": MAX_BODY}
# A report may come from elsewhere: its script must not be one of the studio's page.
_ALONE = ("sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; "
          "style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'")  # fmt: skip
_ODD_PLACES = 1e9  # metres: no mouse means that


def routes(studio: Studio) -> APIRouter:
    """Return the addresses below ``/studio/``."""
    router = APIRouter(prefix="/studio")
    _static(router)
    _world(router, studio)
    _runs(router, studio)
    _robots(router, studio)
    _uploads(router, studio)
    return router


def _static(router: APIRouter) -> None:
    made: dict[str, Callable[[], str]] = {"player.js": player_js, "player.css": player_css}

    @router.get("/static/{name}")
    def static(name: str) -> Response:
        if name in made:
            text = made[name]()
        elif name in STATIC:
            text = resources.files("locfuse.studio").joinpath("static", name).read_text("utf-8")
        else:
            return _not_there(name)
        kind = "text/css" if name.endswith(".css") else "text/javascript"
        return Response(text, media_type=kind, headers={"Cache-Control": "no-cache"})


def _world(router: APIRouter, studio: Studio) -> None:
    @router.post("/coverage")
    async def coverage(request: Request) -> Response:
        try:
            moved = {str(name): (float(x), float(y))
                     for name, (x, y) in (await request.json())["moved"].items()
                     if abs(float(x)) < _ODD_PLACES and abs(float(y)) < _ODD_PLACES}  # fmt: skip
            found = coverage_of(studio.scene, moved, studio.base)
        except (ValueError, TypeError, KeyError, AttributeError, OSError,
                RecursionError) as error:  # fmt: skip
            return _wrong(error)
        content = b"" if found is None else packed(found)
        return Response(content, media_type="application/octet-stream")

    @router.get("/ground")
    def ground() -> Response:
        found = studio.grounds.of(studio.scene.config, studio.base)
        if found is None:
            return JSONResponse({"error": "another scene was asked for meanwhile"}, status_code=409)
        return JSONResponse(found)

    @router.get("/scene.yaml")
    def scene() -> Response:
        return Response(studio.scene.good_text, media_type="application/yaml", headers={
            "Content-Disposition": 'attachment; filename="scene.yaml"'})  # fmt: skip


def _runs(router: APIRouter, studio: Studio) -> None:
    @router.get("/runs/{number}/{key}/{name}")
    def file(number: int, key: str, name: str) -> Response:
        found = [(run, part.state) for run in studio.runner.runs
                 for part in run.parts if (run.number, part.key) == (number, key)]  # fmt: skip
        if not found:
            return _not_there(f"run {number}")
        run, state = found[0]
        if name == "play.json" and (play := run.file_of(key, PLAY)):
            # Read at once: another takes its place while its run computes.
            return Response(play.read_bytes(), media_type="application/json", headers={
                "Content-Encoding": "gzip", "Cache-Control": "no-store"})  # fmt: skip
        if state != "done" and name != "scene.yaml":
            return _not_there(f"{name} of a run that is {state}")
        if name == BAG:
            try:
                _make_bag(run.folder_of(key))
            except TROUBLE as error:
                return _wrong(error)
        path = run.file_of(key, name) if name in (*FILES, BAG) else None
        return _file(path, name, f"{key}-{name}")


def _robots(router: APIRouter, studio: Studio) -> None:
    @router.get("/robots/{robot}/{name:path}")
    def file(robot: str, name: str) -> Response:
        path = studio.setups.file_of(robot, name)
        return _file(path, name, None if name.endswith(".png") else f"{robot}-{Path(name).name}")


def _file(path: Path | None, name: str, download: str | None) -> Response:
    """Return a file, a report for itself, or that it is not there."""
    if path is None:
        return _not_there(name)
    if path.name == "report.html":
        return FileResponse(path, media_type="text/html", headers={
            "Content-Security-Policy": _ALONE})  # fmt: skip
    return FileResponse(path, filename=download)


def _make_bag(folder: Path) -> None:
    """Write the bag of a run, by a process of its own: the run is made again, bit for bit."""
    if (folder / BAG).exists():
        return
    receiver, process = spawned(write_bag_of, str(folder), BAG)
    try:
        wrong = receiver.recv()
    except EOFError:
        wrong = "the process that makes the bag ended without a word"
    process.join()
    if wrong:
        raise LogError(wrong)


def _uploads(router: APIRouter, studio: Studio) -> None:
    @router.post("/upload")
    async def upload(request: Request, kind: str, name: str) -> Response:
        if kind not in _MAX_UPLOAD:
            return _wrong(f"unknown kind of upload {kind!r}")
        with tempfile.TemporaryDirectory(dir=studio.base, prefix=".upload-") as folder:
            file = Path(folder, "file")
            size = 0
            with file.open("wb") as out:
                async for chunk in request.stream():
                    size += len(chunk)
                    if size > _MAX_UPLOAD[kind]:
                        most = f"{name} is larger than {_MAX_UPLOAD[kind] / 1e6:g} MB"
                        advice = "scale it down" if kind == "map" else "give its path instead"
                        return _wrong(f"{most}; {advice}", 413)
                    out.write(chunk)
            try:
                said = await run_in_threadpool(_take, studio, kind, name, file, request)
            except (*TROUBLE, KeyError) as error:
                return _wrong(error)
        return JSONResponse(said)


def _take(studio: Studio, kind: str, name: str, file: Path, request: Request) -> dict[str, Any]:
    """Keep an uploaded file; return the answer for the page."""
    if kind == "log":
        return {"path": _log(studio, name, file)}
    if kind == "scene":
        try:
            return {"text": file.read_text(encoding="utf-8")}
        except UnicodeDecodeError:
            raise ConfigError(f"{name}: is no text, so no YAML") from None
    query = request.query_params
    numbers = {key: _number(query.get(key, ""), key) for key in ("resolution", "x", "y")}
    if not 0.0 < numbers["resolution"] <= 100.0:
        raise ConfigError(f"resolution is {numbers['resolution']:g} m; expected > 0, at most 100")
    path, grid = studio.workspace.add_map(name, file.read_bytes(), numbers["resolution"],
                                          (numbers["x"], numbers["y"]))  # fmt: skip
    height, width = grid.cells.shape
    return {"path": path, "size": [width * grid.resolution_m, height * grid.resolution_m]}


def _log(studio: Studio, name: str, file: Path) -> str:
    """Keep an uploaded log, if it is one; return its path."""
    path = studio.workspace.add_log(name, file)
    try:
        replaying(studio.scene, path, Path(name).stem, studio.base)
    except TROUBLE as error:
        studio.workspace.remove_log(path)
        raise LogError(str(error).replace(str(studio.base / path), name)) from None
    return path


def _number(text: str, key: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ConfigError(f"{key} is {text!r}; expected a number") from None


def _wrong(error: object, status: int = 400) -> Response:
    return JSONResponse({"error": " ".join(str(error).split())}, status_code=status)


def _not_there(what: str) -> Response:
    return JSONResponse({"error": f"{what}: there is no such thing"}, status_code=404)
