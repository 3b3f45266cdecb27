# SPDX-License-Identifier: Apache-2.0
"""Nobody without the token gets in, nobody from another site, and nothing that is too large."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from starlette.exceptions import HTTPException

from locfuse.studio.guard import COOKIE, MAX_BODY, Guard, check_token
from locfuse.types import ConfigError

TOKEN = "a long secret"
KNOWN: dict[str, Any] = {"authorization": f"Bearer {TOKEN}"}
CHUNK = bytes(1_000_000)


def ask(kind: str = "http", query: str = "", path: str = "/", body: int = 0,
        **headers: Any) -> list[dict[str, Any]]:  # fmt: skip
    """Return what is sent for a request."""
    sent: list[dict[str, Any]] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.accept"})
            return
        try:
            while (await receive()).get("more_body"):
                pass
        except HTTPException as error:
            await send({"type": "http.response.start", "status": error.status_code, "headers": []})
            return
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"inside"})

    chunks = iter([CHUNK] * (body // len(CHUNK)))

    async def receive() -> Any:
        if kind == "websocket":
            return {"type": "websocket.connect"}
        chunk = next(chunks, b"")
        return {"type": "http.request", "body": chunk, "more_body": bool(chunk)}

    async def send(message: Any) -> None:
        sent.append(message)

    given = {"host": "127.0.0.1:8642", **{k.replace("_", "-"): v for k, v in headers.items()}}
    scope = {
        "type": kind,
        "path": path,
        "query_string": query.encode(),
        "headers": [(k.encode(), v.encode()) for k, v in given.items() if v],
    }
    asyncio.run(Guard(app, TOKEN, 2 * MAX_BODY, "/upload")(scope, receive, send))
    return sent


def status(*arguments: Any, **headers: Any) -> int:
    code: int = ask(*arguments, **headers)[0]["status"]
    return code


def test_a_token_that_is_guessed_soon_is_refused() -> None:
    with pytest.raises(ConfigError, match="at least 8"):
        check_token("1234")


def test_pages_of_other_sites_are_not_answered() -> None:
    assert status(origin="http://evil.example", **KNOWN) == 403
    assert status(origin="null", **KNOWN) == 403
    assert status(origin="http://[", **KNOWN) == 403
    assert status(origin="http://127.0.0.1:9999", **KNOWN) == 403
    assert status(origin="http://127.0.0.1:8642", **KNOWN) == 200


def test_every_request_needs_the_token() -> None:
    assert status() == 401
    assert status(host="localhost:8642") == 401
    assert status(authorization="Bearer wrong") == 401
    assert status(authorization="") == 401
    assert status(**KNOWN) == 200
    assert status(cookie=f"{COOKIE}_8642=wrong") == 401
    assert status("http", "token=wrong") == 401
    assert status(cookie='bad"; ;=') == 401
    assert status(host="[") == 401
    assert status("http", "", "/_nicegui_ws/socket.io/") == 401


def test_the_token_of_an_address_becomes_a_cookie_that_opens() -> None:
    answer = ask("http", "a=1&token=a+long+secret", "/x")
    headers = dict(answer[0]["headers"])

    assert answer[0]["status"] == 303
    assert headers[b"location"] == b"/x?a=1"
    cookie = headers[b"set-cookie"].decode()
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert status(cookie=cookie.split(";")[0]) == 200
    assert status(cookie=cookie.split(";")[0], host="127.0.0.1:9999") == 401, "another studio"


@pytest.mark.parametrize(
    ("path", "where"),
    [("//evil.test/x", b"/evil.test/x"), ("/\\evil.test", b"/evil.test"),
     ("/\r\nX-Evil: 1", b"/%0D%0AX-Evil%3A%201")],
)  # fmt: skip
def test_the_address_without_the_token_is_one_of_this_server(path: str, where: bytes) -> None:
    headers = dict(ask("http", "token=a+long+secret", path)[0]["headers"])
    assert headers[b"location"] == where


def test_websockets_are_guarded_as_well() -> None:
    assert ask("websocket", **KNOWN)[0]["type"] == "websocket.accept"
    for wrong in (ask("websocket"), ask("websocket", origin="http://evil.example", **KNOWN)):
        assert wrong[0]["type"] == "websocket.close"


def test_what_is_too_large_is_refused_before_it_is_read() -> None:
    assert status(content_length=str(MAX_BODY), **KNOWN) == 200
    assert status(content_length=str(MAX_BODY + 1), **KNOWN) == 413
    assert status("http", "", "/upload", content_length=str(MAX_BODY + 1), **KNOWN) == 200
    assert status("http", "", "/upload", content_length=str(3 * MAX_BODY), **KNOWN) == 413
    assert status(content_length="-1", **KNOWN) == 413
    assert b"larger than 16 MB" in ask(content_length="50000000", **KNOWN)[1]["body"]


def test_a_body_of_unstated_length_is_refused_once_it_is_too_large() -> None:
    assert status("http", "", "/", MAX_BODY, **KNOWN) == 200
    assert status("http", "", "/", MAX_BODY + len(CHUNK), **KNOWN) == 413
    assert status("http", "", "/upload", 2 * MAX_BODY, **KNOWN) == 200
    assert status("http", "", "/upload", 3 * MAX_BODY, **KNOWN) == 413


def test_answers_forbid_the_browser_to_load_anything_from_elsewhere() -> None:
    headers = dict(ask(**KNOWN)[0]["headers"])

    policy = headers[b"content-security-policy"].decode()
    assert "default-src 'self'" in policy
    assert "http" not in policy
    assert headers[b"x-content-type-options"] == b"nosniff"
