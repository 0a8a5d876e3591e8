"""What is let through to the studio: its own pages' requests, to its own address, of bounded size."""

import asyncio
from collections.abc import Awaitable, Callable, MutableMapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from hmac import compare_digest
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, urlencode

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

MAX_BODY_BYTES = 52_000_000
"""A little more than Taskcal reads of one file, for what surrounds an upload."""

BODY_S = 300.0
"""Seconds in which a body has to be here; 52 MB in 300 s is a slow wireless network."""

COOKIE = "taskcal-studio"
"""Beginning of a cookie's name; browsers keep cookies by host and not by port, so that two studios need two names."""

HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (
        b"content-security-policy",
        # Vue compiles its templates in the browser, which takes 'unsafe-eval'; NiceGUI starts it by an inline script
        b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
        b"img-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob:; connect-src 'self'; "
        b"object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'none'",
    ),
)


class _Refused(Exception):
    """A body that is too large or too slow: its answer is given, and the application has nothing more to say."""


@dataclass(frozen=True, kw_only=True)
class Gate:
    """An ASGI application before another; `app` is what it lets requests through to."""

    app: Application
    hosts: frozenset[str] | None
    """What a request may call this server (``127.0.0.1:8080``), so that no other name can be made to lead here; None for any,
    where a token is asked for."""
    token: str = ""
    """Asked for once, in the address, and then kept in a cookie; none is asked for where it is empty."""
    max_body: int = MAX_BODY_BYTES
    body_s: float = BODY_S
    """In which a body has to arrive, seconds."""

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Let a request through, or refuse it in a line of text."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await _refuse(scope, receive, send, *refusal)
        elif self.token and not _has_cookie(headers, cookie_name(self.token), self.token):
            await self._ask_for_token(scope, receive, send)
        else:
            await self._let_through(scope, receive, send)

    def _refusal(self, scope: Message, headers: dict[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        if self.hosts is not None and host.lower() not in self.hosts:
            return 421, "This address is not the studio's own."
        origin = headers.get("origin")
        if origin is None and scope["type"] == "websocket":
            return 403, "A connection has to say which page it comes from."
        if origin is not None and origin.lower() not in {f"http://{host.lower()}", f"https://{host.lower()}"}:
            return 403, "Other pages may not speak to the studio."
        site, mode = headers.get("sec-fetch-site", "none"), headers.get("sec-fetch-mode", "navigate")
        if site in ("cross-site", "same-site") and (mode != "navigate" or scope.get("method") != "GET"):
            return 403, "Other pages may not speak to the studio."
        length = headers.get("content-length", "0")
        if not length.isascii() or not length.isdigit():
            return 400, "The length of the request is not a number."
        if int(length) > self.max_body:
            return 413, f"Larger than {self.max_body // 1_000_000} MB."
        return None

    async def _ask_for_token(self, scope: Message, receive: Receive, send: Send) -> None:
        query = parse_qsl(scope.get("query_string", b"").decode("latin-1"), keep_blank_values=True)
        given = dict(query).get("token", "")
        if scope["type"] != "http" or not compare_digest(given.encode(), self.token.encode()):
            await _refuse(scope, receive, send, 401, "Open the address with the token that 'taskcal studio' printed.")
            return
        rest = urlencode([(name, value) for name, value in query if name != "token"])
        path = "/" + scope.get("raw_path", b"/").decode("latin-1").split("?")[0].lstrip("/\\")
        cookie = f"{cookie_name(self.token)}={self.token}; Path=/; HttpOnly; SameSite=Strict"
        answer = [(b"location", (path + (f"?{rest}" if rest else "")).encode()), (b"set-cookie", cookie.encode())]
        await send({"type": "http.response.start", "status": 303, "headers": [*answer, *HEADERS]})
        await send({"type": "http.response.body", "body": b""})

    async def _let_through(self, scope: Message, receive: Receive, send: Send) -> None:
        taken, whole, begun, refused = 0, False, False, False
        latest = asyncio.get_running_loop().time() + self.body_s

        async def refuse(status: int, why: str) -> None:
            nonlocal refused
            refused = True
            if not begun:
                await _refuse(scope, receive, send, status, why)
            raise _Refused

        async def bounded() -> Message:
            nonlocal taken, whole
            if whole:  # what comes now is the end of the connection, whenever that is
                return await receive()
            try:
                async with asyncio.timeout_at(latest):
                    message = await receive()
            except TimeoutError:
                await refuse(408, f"The request was not here after {self.body_s:.0f} seconds.")
                raise
            whole = message["type"] != "http.request" or not message.get("more_body", False)
            taken += len(message.get("body", b"")) if message["type"] == "http.request" else 0
            if taken > self.max_body:
                await refuse(413, f"Larger than {self.max_body // 1_000_000} MB.")
            return message

        async def with_headers(message: Message) -> None:
            nonlocal begun
            if refused:  # the application takes its refused request for a failure of its own, and would say so
                return
            if message["type"] == "http.response.start":
                begun = True
                own = [(name.lower(), value) for name, value in message.get("headers", [])]
                stated = {name for name, _ in own}
                message = {**message, "headers": [*own, *(header for header in HEADERS if header[0] not in stated)]}
            await send(message)

        with suppress(_Refused):
            await self.app(scope, bounded, with_headers)


def cookie_name(token: str) -> str:
    """Of the cookie that holds a token: another one for every token."""
    return f"{COOKIE}-{sha256(token.encode()).hexdigest()[:12]}"


def _has_cookie(headers: dict[str, str], name: str, token: str) -> bool:
    try:
        cookie = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return False
    return cookie is not None and compare_digest(cookie.value.encode(), token.encode())


async def _refuse(scope: Message, receive: Receive, send: Send, status: int, why: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": why})
        return
    kind = (b"content-type", b"text/plain; charset=utf-8")
    await send(
        {"type": "http.response.start", "status": status, "headers": [kind, (b"connection", b"close"), *HEADERS]}
    )
    await send({"type": "http.response.body", "body": f"{why}\n".encode()})
