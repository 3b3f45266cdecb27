# SPDX-License-Identifier: Apache-2.0
"""What is fetched and sent beside the page: files of runs as they are, bodies that are bounded."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any, TypeAlias

import httpx
import pytest
from fastapi import FastAPI

from locfuse.studio.guard import MAX_BODY, Guard
from locfuse.studio.routes import routes
from locfuse.studio.studio import Studio

TOKEN = "a long secret"
MEGABYTE = bytes(1_000_000)
Ask: TypeAlias = Callable[..., httpx.Response]


@pytest.fixture
def ask(tmp_path: Path) -> Ask:
    """Return what asks a studio that has run something, whose folder is ``studio``."""
    folder = tmp_path / "studio/runs/001/as_set"
    folder.mkdir(parents=True)
    (folder / "report.html").write_text("<script>hacked = true</script>")
    (folder / "metrics.json").symlink_to(tmp_path / "secret")
    (tmp_path / "secret").write_text("secret")
    part = {"key": "as_set", "name": "x", "state": "done"}
    (folder.parent / "run.json").write_text(json.dumps({"name": "x", "began": 0, "parts": [part]}))
    app = FastAPI()
    app.include_router(routes(Studio(tmp_path / "studio")))
    guard = Guard(app, TOKEN, 2_000_000_000, "/studio/upload")

    async def answer(method: str, path: str, content: Any) -> httpx.Response:
        known = {"Authorization": f"Bearer {TOKEN}"}
        async with httpx.AsyncClient(transport=httpx.ASGITransport(guard), headers=known) as client:
            return await client.request(method, f"http://127.0.0.1/studio/{path}", content=content)

    return lambda method, path, content=None: asyncio.run(answer(method, path, content))


def test_a_report_has_no_access_to_the_studio(ask: Ask) -> None:
    answer = ask("GET", "runs/1/as_set/report.html")

    policy = answer.headers["content-security-policy"]
    assert policy.startswith("sandbox allow-scripts;")
    assert "allow-same-origin" not in policy


def test_a_link_in_a_run_is_not_followed(ask: Ask) -> None:
    answer = ask("GET", "runs/1/as_set/metrics.json")

    assert answer.status_code == 404
    assert "secret" not in answer.text


async def chunks() -> AsyncIterator[bytes]:
    for _ in range(70):
        yield MEGABYTE


@pytest.mark.parametrize(
    "path", ["coverage", "upload?kind=scene&name=a.yaml", "upload?kind=map&name=a.png"]
)
def test_a_body_without_a_length_is_refused_once_it_is_too_large(
    ask: Ask, tmp_path: Path, path: str
) -> None:
    answer = ask("POST", path, chunks())

    assert answer.status_code == 413
    assert "larger than" in answer.text
    assert list((tmp_path / "studio").glob(".upload-*")) == []


def test_a_body_of_any_depth_is_one_sentence(ask: Ask) -> None:
    answer = ask("POST", "coverage", b"[" * (MAX_BODY // 2))

    assert answer.status_code == 400
    assert answer.json()["error"]


def test_an_unknown_kind_of_upload_is_refused(ask: Ask) -> None:
    answer = ask("POST", "upload?kind=<b>&name=a", b"")

    assert (answer.status_code, answer.json()["error"]) == (400, "unknown kind of upload '<b>'")
