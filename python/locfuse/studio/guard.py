# SPDX-License-Identifier: Apache-2.0
"""Who may talk to the studio: who knows the token, and nobody from another site."""

from __future__ import annotations

import hmac
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, quote, urlencode, urlsplit

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from locfuse.types import ConfigError

COOKIE = "locfuse_studio"
MIN_TOKEN = 8
MAX_BODY = 16_000_000  # bytes that a request may hold in memory
# Nothing is loaded from elsewhere, whatever stands in a file that is shown.
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self'; frame-ancestors 'none'; form-action 'self'; base-uri 'self'"
)


def check_token(token: str) -> None:
    """Refuse a token that could be guessed. Raises ConfigError."""
    if len(token) < MIN_TOKEN:
        raise ConfigError(f"--token: {len(token)} characters; expected at least {MIN_TOKEN}")


class Guard:
    """Refuses requests before anything else sees them, those of websockets included.

    The token comes as ``?token=...``, which is kept as a cookie of the browser, or as
    ``Authorization: Bearer ...``. A request that another site's page makes is refused in any case,
    and so is one larger than `MAX_BODY`, or `max_upload` bytes to the path `upload`, whose body is
    not held in memory.
    """

    def __init__(self, app: ASGIApp, token: str, max_upload: int, upload: str) -> None:
        self.app = app
        self._token = token
        self._max_upload = max_upload
        self._upload = upload

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
        if scope["type"] == "http" and "token" in query:
            await self._let_in(scope, headers, query, send)
            return
        await self.app(scope, self._limited(scope, receive), _with_policy(send))

    def _max_bytes(self, scope: Scope) -> int:
        return self._max_upload if scope["path"] == self._upload else MAX_BODY

    def _limited(self, scope: Scope, receive: Receive) -> Receive:
        """Limit a body as it arrives, which need not say its length."""
        size = 0

        async def limited() -> Message:
            nonlocal size
            message = await receive()
            size += len(message.get("body", b"")) if message["type"] == "http.request" else 0
            if size > self._max_bytes(scope):
                raise HTTPException(413, _too_large(self._max_bytes(scope)))
            return message

        return limited

    def _wrong(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != host:
            return 403, "this request was made by another site's page"
        if not self._knows_token(scope, headers):
            return 401, "the token is missing or wrong; open the address that the studio printed"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > self._max_bytes(scope):
            return 413, _too_large(self._max_bytes(scope))
        return None

    def _knows_token(self, scope: Scope, headers: dict[str, str]) -> bool:
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [])
        given.append(headers.get("authorization", "").removeprefix("Bearer "))
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(_cookie_of(headers))
        except CookieError:
            cookie = None
        if cookie is not None:
            given.append(cookie.value)
        return any(hmac.compare_digest(g.encode(), self._token.encode()) for g in given)

    async def _let_in(
        self, scope: Scope, headers: dict[str, str], query: dict[str, list[str]], send: Send
    ) -> None:
        """Keep the token as a cookie, and show the page without it in its address."""
        rest = urlencode({k: v for k, v in query.items() if k != "token"}, doseq=True)
        # One slash in front: two would name another site.
        where = "/" + quote(scope["path"].lstrip("/\\")) + (f"?{rest}" if rest else "")
        name = _cookie_of(headers)
        cookie = SimpleCookie({name: self._token})
        for key, value in (("httponly", "true"), ("samesite", "Strict"), ("path", "/")):
            cookie[name][key] = value
        await send({"type": "http.response.start", "status": 303, "headers": [
            (b"location", where.encode()), (b"set-cookie", cookie[name].OutputString().encode()),
            (b"referrer-policy", b"no-referrer")]})  # fmt: skip
        await send({"type": "http.response.body", "body": b""})


def _cookie_of(headers: dict[str, str]) -> str:
    """Return the name of a studio's cookie: browsers share cookies between ports of a host."""
    try:
        port = urlsplit(f"//{headers.get('host', '')}").port
    except ValueError:
        port = None
    return COOKIE if port is None else f"{COOKIE}_{port}"


def _too_large(max_bytes: int) -> str:
    return f"the request is larger than {max_bytes / 1e6:g} MB"


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
