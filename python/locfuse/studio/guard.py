# SPDX-License-Identifier: Apache-2.0
"""Who may talk to the studio: nobody from another site, and with a token only who knows it."""

from __future__ import annotations

import hmac
import ipaddress
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlencode, urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from locfuse.types import ConfigError

COOKIE = "locfuse_studio"
LEAST_TOKEN = 8
# Nothing is loaded from elsewhere, whatever stands in a file that is shown.
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self'; frame-ancestors 'none'; form-action 'self'; base-uri 'self'"
)


def is_loopback(host: str) -> bool:
    """Return whether a host is this machine, which nobody else can reach."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def check_address(host: str, token: str | None) -> None:
    """Refuse to be open to others without a token.

    Raises ConfigError if the host is not this machine alone and there is no token, or a token is
    short.
    """
    if token is not None and len(token) < LEAST_TOKEN:
        raise ConfigError(f"--token: {len(token)} characters; expected at least {LEAST_TOKEN}")
    if not is_loopback(host) and token is None:
        raise ConfigError(
            f"--host {host}: others could use this machine's files; give a --token, or stay on "
            "127.0.0.1"
        )


class Guard:
    """Refuses requests before anything else sees them, those of websockets included.

    A token may come as ``?token=...``, which is kept as a cookie of the browser, or as
    ``Authorization: Bearer ...``. Without a token only names of this machine are answered: else
    another site could make its own name point here. A request that another site's page makes is
    refused in any case, and so is one larger than `max_bytes`.
    """

    def __init__(self, app: ASGIApp, token: str | None, max_bytes: int) -> None:
        self.app = app
        self._token = token
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it with what is wrong."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        wrong = self._wrong(scope, headers)
        if wrong is not None:
            await _refuse(scope, receive, send, *wrong)
            return
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        if scope["type"] == "http" and self._token is not None and "token" in query:
            await self._let_in(scope, query, send)
            return
        await self.app(scope, receive, _with_policy(send))

    def _wrong(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return 403, "this request was made by another site's page"
        if self._token is None:
            if not is_loopback(urlsplit(f"//{host}").hostname or ""):
                return 403, f"{host} is no name of this machine; use 127.0.0.1"
        elif not self._knows_token(scope, headers):
            return 401, "the token is missing or wrong; open the address that the studio printed"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > self._max_bytes:
            return 413, f"larger than {self._max_bytes / 1e9:g} GB, which is the most there can be"
        return None

    def _knows_token(self, scope: Scope, headers: dict[str, str]) -> bool:
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [])
        given.append(headers.get("authorization", "").removeprefix("Bearer "))
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            cookie = None
        if cookie is not None:
            given.append(cookie.value)
        assert self._token is not None
        return any(hmac.compare_digest(g.encode(), self._token.encode()) for g in given)

    async def _let_in(self, scope: Scope, query: dict[str, list[str]], send: Send) -> None:
        """Keep the token as a cookie, and show the page without it in its address."""
        rest = urlencode({k: v for k, v in query.items() if k != "token"}, doseq=True)
        where = scope["path"] + (f"?{rest}" if rest else "")
        cookie = SimpleCookie({COOKIE: self._token or ""})
        for key, value in (("httponly", "true"), ("samesite", "Strict"), ("path", "/")):
            cookie[COOKIE][key] = value
        await send({"type": "http.response.start", "status": 303, "headers": [
            (b"location", where.encode()), (b"set-cookie", cookie[COOKIE].OutputString().encode()),
            (b"referrer-policy", b"no-referrer")]})  # fmt: skip
        await send({"type": "http.response.body", "body": b""})


def _with_policy(send: Send) -> Send:
    async def answer(message: Message) -> None:
        if message["type"] == "http.response.start":
            given = {name.lower() for name, _ in message["headers"]}
            extra = [(b"x-content-type-options", b"nosniff"), (b"referrer-policy", b"no-referrer")]
            if b"content-security-policy" not in given:
                extra.append((b"content-security-policy", POLICY.encode()))
            message = {**message, "headers": [*message["headers"], *extra]}
        await send(message)

    return answer


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 4000 + status, "reason": text[:120]})
        return
    await send({"type": "http.response.start", "status": status,
                "headers": [(b"content-type", b"text/plain; charset=utf-8")]})  # fmt: skip
    await send({"type": "http.response.body", "body": f"locfuse studio: {text}\n".encode()})
