# SPDX-License-Identifier: Apache-2.0
"""Nobody from another site gets in, nobody without the token, and nothing that is too large."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from locfuse.studio.guard import COOKIE, Guard, check_address, is_loopback
from locfuse.types import ConfigError

TOKEN = "a long secret"


def ask(token: str | None, kind: str = "http", query: str = "", path: str = "/",
        **headers: str) -> list[dict[str, Any]]:  # fmt: skip
    """Return what is sent for a request."""
    sent: list[dict[str, Any]] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.accept"})
            return
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"inside"})

    async def receive() -> Any:
        return {"type": "websocket.connect"}

    async def send(message: Any) -> None:
        sent.append(message)

    given = {"host": "127.0.0.1:8642", **{k.replace("_", "-"): v for k, v in headers.items()}}
    scope = {
        "type": kind,
        "path": path,
        "query_string": query.encode(),
        "headers": [(k.encode(), v.encode()) for k, v in given.items() if v],
    }
    asyncio.run(Guard(app, token, 1000)(scope, receive, send))
    return sent


def status(*arguments: Any, **headers: str) -> int:
    code: int = ask(*arguments, **headers)[0]["status"]
    return code


@pytest.mark.parametrize(
    ("host", "alone"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("[::1]", True), ("127.9.9.9", True),
     ("0.0.0.0", False), ("::", False), ("192.168.1.5", False), ("robot.local", False)],
)  # fmt: skip
def test_only_this_machine_needs_no_token(host: str, alone: bool) -> None:
    assert is_loopback(host) == alone
    check_address(host, TOKEN)
    if alone:
        check_address(host, None)
    else:
        with pytest.raises(ConfigError, match="give a --token"):
            check_address(host, None)


def test_a_token_that_is_guessed_soon_is_refused() -> None:
    with pytest.raises(ConfigError, match="at least 8"):
        check_address("127.0.0.1", "1234")


def test_without_a_token_names_of_this_machine_are_answered() -> None:
    assert status(None) == 200
    assert status(None, host="localhost:8642") == 200
    assert status(None, host="[::1]:8642") == 200


def test_another_name_that_points_here_is_not_answered() -> None:
    assert status(None, host="evil.example:8642") == 403
    assert status(None, host="") == 403


@pytest.mark.parametrize("token", [None, TOKEN])
def test_pages_of_other_sites_are_not_answered(token: str | None) -> None:
    known = {"authorization": f"Bearer {TOKEN}"} if token else {}
    assert status(token, origin="http://evil.example", **known) == 403
    assert status(token, origin="null", **known) == 403
    assert status(token, origin="http://127.0.0.1:9999", **known) == 403
    assert status(token, origin="http://127.0.0.1:8642", **known) == 200


def test_with_a_token_every_request_needs_it() -> None:
    assert status(TOKEN) == 401
    assert status(TOKEN, authorization="Bearer wrong") == 401
    assert status(TOKEN, authorization=f"Bearer {TOKEN}") == 200
    assert status(TOKEN, cookie=f"{COOKIE}=wrong") == 401
    assert status(TOKEN, "http", "token=wrong") == 401
    assert status(TOKEN, cookie='bad"; ;=') == 401
    assert status(TOKEN, "http", "", "/_nicegui_ws/socket.io/") == 401


def test_the_token_of_an_address_becomes_a_cookie_that_opens() -> None:
    answer = ask(TOKEN, "http", "a=1&token=a+long+secret", "/x")
    headers = dict(answer[0]["headers"])

    assert answer[0]["status"] == 303
    assert headers[b"location"] == b"/x?a=1"
    cookie = headers[b"set-cookie"].decode()
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert status(TOKEN, cookie=cookie.split(";")[0]) == 200


def test_websockets_are_guarded_as_well() -> None:
    assert ask(None, "websocket")[0]["type"] == "websocket.accept"
    for wrong in (
        ask(TOKEN, "websocket"),
        ask(None, "websocket", origin="http://evil.example"),
        ask(None, "websocket", host="evil.example"),
    ):
        assert wrong[0]["type"] == "websocket.close"


def test_what_is_too_large_is_refused_before_it_is_read() -> None:
    assert status(None, content_length="1000") == 200
    assert status(None, content_length="1001") == 413
    assert status(None, content_length="-1") == 413
    assert b"which is the most" in ask(None, content_length="5000")[1]["body"]


def test_answers_forbid_the_browser_to_load_anything_from_elsewhere() -> None:
    headers = dict(ask(None)[0]["headers"])

    policy = headers[b"content-security-policy"].decode()
    assert "default-src 'self'" in policy
    assert "http" not in policy
    assert headers[b"x-content-type-options"] == b"nosniff"
