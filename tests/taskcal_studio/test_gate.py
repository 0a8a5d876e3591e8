"""The gate: its own pages come through, others do not, whatever they send."""

import asyncio
from typing import Any

import pytest

from taskcal_studio.server import Gate, cookie_name

HERE = {"host": "127.0.0.1:8421"}
WITH_COOKIE = {"host": "lab:1", "cookie": f"{cookie_name('secret')}=secret"}
LOOPBACK = {"hosts": frozenset({"127.0.0.1:8421", "localhost:8421"})}
HTTP, SOCKET = {"type": "http"}, {"type": "websocket"}


async def count_bytes(scope: Any, receive: Any, send: Any) -> None:
    """The application behind the gate: it answers 200 with the size of the body."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    size, more = 0, True
    while more:
        message = await receive()
        size += len(message["body"])
        more = message["more_body"]
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": str(size).encode()})


def answer(gate: dict[str, Any], scope: dict[str, Any], headers: dict[str, str], body: bytes = b"") -> list[Any]:
    """What the gate sends for a request."""
    parts = [body[i : i + 10] for i in range(0, len(body), 10)] or [b""]
    sent: list[Any] = []

    async def receive() -> Any:
        if scope["type"] == "websocket":
            return {"type": "websocket.connect"}
        part = parts.pop(0)
        return {"type": "http.request", "body": part, "more_body": bool(parts)}

    async def send(message: Any) -> None:
        sent.append(message)

    raw = [(name.encode(), value.encode()) for name, value in headers.items()]
    whole = {"method": "GET", "raw_path": b"/robot", "query_string": b"", **scope, "headers": raw}
    asyncio.run(Gate(**{"app": count_bytes, **gate})(whole, receive, send))
    return sent


def status(gate: dict[str, Any], scope: dict[str, Any], headers: dict[str, str], body: bytes = b"") -> int:
    first = answer(gate, scope, headers, body)[0]
    return first["status"] if first["type"] == "http.response.start" else first.get("code", 101)


def test_gate_serves_own_pages_with_security_headers() -> None:
    """Own pages are served with headers that prevent framing and foreign content."""
    sent = answer(LOOPBACK, HTTP, HERE)
    assert sent[0]["status"] == 200
    names = dict(sent[0]["headers"])
    assert names[b"x-frame-options"] == b"DENY"
    assert b"frame-ancestors 'none'" in names[b"content-security-policy"]
    assert status(LOOPBACK, {**HTTP, "method": "POST"}, {**HERE, "origin": "http://127.0.0.1:8421"}) == 200
    assert status(LOOPBACK, SOCKET, {**HERE, "origin": "http://127.0.0.1:8421"}) == 101


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:8422", "null", "https://127.0.0.1", "file://"]
)
def test_other_origins_are_refused_sockets_too(origin: str) -> None:
    assert status(LOOPBACK, {**HTTP, "method": "POST"}, {**HERE, "origin": origin}) == 403
    assert status(LOOPBACK, SOCKET, {**HERE, "origin": origin}) == 1008


def test_a_socket_without_an_origin_is_refused() -> None:
    assert status(LOOPBACK, SOCKET, HERE) == 1008


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:8421", "127.0.0.1:1", ""])
def test_other_names_for_this_machine_are_refused(host: str) -> None:
    assert status(LOOPBACK, HTTP, {"host": host}) == 421
    assert status(LOOPBACK, SOCKET, {"host": host, "origin": f"http://{host}"}) == 1008


def test_a_page_elsewhere_may_link_here_but_not_fetch_from_here() -> None:
    link = {**HERE, "sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    assert status(LOOPBACK, HTTP, link) == 200
    assert status(LOOPBACK, HTTP, {**link, "sec-fetch-mode": "no-cors"}) == 403
    assert status(LOOPBACK, {**HTTP, "method": "POST"}, link) == 403


def test_gate_bounds_body_by_stated_and_actual_length() -> None:
    """Bodies are bounded by their stated and by their actual length."""
    gate = {**LOOPBACK, "max_body": 100}
    assert status(gate, HTTP, {**HERE, "content-length": "101"}) == 413
    assert status(gate, HTTP, {**HERE, "content-length": "-1"}) == 400
    assert status(gate, HTTP, HERE, body=b"x" * 101) == 413
    assert answer(gate, HTTP, HERE, body=b"x" * 100)[1]["body"] == b"100"


async def fail_as_libraries_do(scope: Any, receive: Any, send: Any) -> None:
    """An application that answers every failure of its own by itself, and then raises it."""
    try:
        await count_bytes(scope, receive, send)
    except Exception:
        await send({"type": "http.response.start", "status": 500, "headers": []})
        await send({"type": "http.response.body", "body": b"Internal Server Error"})
        raise


def test_gate_answers_413_whatever_the_application_raises() -> None:
    """A body that is too long is answered with 413, whatever the application raises."""
    gate = {**LOOPBACK, "app": fail_as_libraries_do, "max_body": 100}
    sent = answer(gate, HTTP, HERE, body=b"x" * 101)
    assert [message.get("status") for message in sent] == [413, None]


def test_a_body_that_comes_too_slowly_is_refused() -> None:
    async def ask(*pauses: float) -> list[Any]:
        sent: list[Any] = []
        left = list(pauses)

        async def receive() -> Any:
            await asyncio.sleep(left.pop(0))
            return {"type": "http.request", "body": b"x", "more_body": bool(left)}

        async def send(message: Any) -> None:
            sent.append(message)

        scope = {**HTTP, "method": "POST", "raw_path": b"/", "headers": [(b"host", b"127.0.0.1:8421")]}
        await Gate(app=count_bytes, body_s=0.2, **LOOPBACK)(scope, receive, send)
        return sent

    assert asyncio.run(ask(0.0, 5.0))[0]["status"] == 408
    assert asyncio.run(ask(0.0, 0.15, 0.15))[0]["status"] == 408
    assert asyncio.run(ask(0.0, 0.01))[0]["status"] == 200


def test_where_others_reach_it_a_token_is_asked_for_once() -> None:
    gate = {"hosts": None, "token": "secret"}
    assert status(gate, HTTP, {"host": "lab:1"}) == 401
    assert status(gate, {**HTTP, "query_string": b"token=guess"}, {"host": "lab:1"}) == 401
    assert status(gate, SOCKET, {"host": "lab:1", "origin": "http://lab:1"}) == 1008
    assert status(gate, HTTP, WITH_COOKIE) == 200
    assert status(gate, HTTP, {"host": "lab:1", "cookie": f"{cookie_name('secret')}=guess"}) == 401
    assert status(gate, SOCKET, {**WITH_COOKIE, "origin": "http://lab:1"}) == 101
    assert status(gate, SOCKET, {**WITH_COOKIE, "origin": "http://evil.example"}) == 1008
    sent = answer(gate, {**HTTP, "query_string": b"token=secret&a=b"}, {"host": "lab:1"})[0]
    headers = dict(sent["headers"])
    assert (sent["status"], headers[b"location"]) == (303, b"/robot?a=b")
    assert b"HttpOnly" in headers[b"set-cookie"]


def test_the_way_back_after_the_token_stays_here() -> None:
    scope = {**HTTP, "query_string": b"token=secret", "raw_path": b"//evil.example/x"}
    sent = answer({"hosts": None, "token": "secret"}, scope, {"host": "lab:1"})[0]
    assert dict(sent["headers"])[b"location"] == b"/evil.example/x"


def test_two_studios_of_one_host_keep_their_tokens_apart() -> None:
    names = [cookie_name(token) for token in ("secret", "other")]
    both = {"host": "lab:1", "cookie": f"{names[0]}=secret; {names[1]}=other"}
    for token in ("secret", "other"):
        assert status({"hosts": None, "token": token}, HTTP, both) == 200
    assert status({"hosts": None, "token": "secret"}, HTTP, {"host": "lab:1", "cookie": f"{names[1]}=secret"}) == 401
