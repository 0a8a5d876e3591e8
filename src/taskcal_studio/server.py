"""The studio's server: the pages, how they look, and who may reach them."""

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable, Generator, Mapping, MutableMapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from hashlib import sha256
from hmac import compare_digest
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlencode

import uvicorn
from fastapi import FastAPI
from nicegui import app as pages
from nicegui import ui
from nicegui.element import Element
from nicegui.elements.mixins.text_element import TextElement
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response

from taskcal.errors import TaskcalError, printable
from taskcal.report import chart
from taskcal_studio.controls import button, text
from taskcal_studio.files import giver, mesh_giver, receiver
from taskcal_studio.pages import (
    identify_page,
    live_page,
    measurements_page,
    plan_page,
    program_page,
    report_page,
    result_page,
    robot_page,
    task_page,
    weight_page,
)
from taskcal_studio.pages.robot_page import warm_up
from taskcal_studio.project import MAX_FILE_BYTES, Change
from taskcal_studio.results import Step, StepStatus, examined, next_step, steps_of
from taskcal_studio.runs import ASKS, CommandRun, Status, Studio
from taskcal_studio.steps import is_running, link, show_error
from taskcal_studio.texts import LANGUAGES, LIBRARY_LANGUAGE, Texts, preferred

# What is let through to the studio: its own pages' requests, to its own address, of bounded size.

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

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
    max_body: int = MAX_FILE_BYTES
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
    """Name of the cookie that holds a token: another one for every token."""
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


# What surrounds every page: the road on the left, the project's name, language and colours, and a place for the page.

LANGUAGE_COOKIE = "taskcal-language"
THEME_COOKIE = "taskcal-theme"

THEMES: Mapping[str, bool | None] = {"auto": None, "light": False, "dark": True}


@dataclass(frozen=True)
class Page:
    """A page of the road."""

    key: str
    """Its path without the slash, and where its texts stand."""
    build: "Callable[[Studio, Texts], Awaitable[None]]"
    """Fills it, once the browser shows what surrounds it; a `TaskcalError` ends it, and is shown."""
    kind: str = ""
    """Of the run that makes its result."""
    again: "Callable[[Studio], Awaitable[None] | None] | None" = None
    """Makes its result once more."""
    at_once: bool = False
    """Whether "Next" makes its result the first time, too: what it takes is chosen, or has a default that is seen there."""
    early: bool = False
    """Whether it has something to show before its step is possible."""


def add_page(page: Page, road: tuple[Page, ...], studio: Studio) -> None:
    """Make a page of the server."""

    async def show() -> None:
        client = ui.context.client
        cookies, headers = client.request.cookies, client.request.headers
        chosen = cookies.get(LANGUAGE_COOKIE, "")
        language = chosen if chosen in LANGUAGES else preferred(headers.get("accept-language", ""))
        theme = cookies.get(THEME_COOKIE, "auto")
        texts = Texts(language)
        ui.page_title(f"{texts(f'{page.key}.title')} – {studio.project.choices.name} – Taskcal")
        ui.dark_mode(THEMES.get(theme))
        whole = client.content.parent_slot
        assert whole is not None
        client.content.move(client.page_container)  # out of what Quasar makes a second main landmark of
        whole.parent.delete()
        seen = len(studio.project.log), studio.running(), studio.unread
        steps = await _steps(road, studio)
        with _surroundings(page, road, studio, texts, theme if theme in THEMES else "auto") as stands:
            _fill(stands, page, road, steps, studio, texts)
            place = ui.element("div").classes("page")
            with place:
                waiting = text("p", texts("frame.loading")).props("role=status").classes("quiet")
        await client.connected(timeout=30)
        with place:
            try:
                if page.early or steps[page.key].state is not StepStatus.impossible:
                    await page.build(studio, texts)
            except TaskcalError as error:  # of a file: what was shown before it stays
                show_error(studio.project, error)
            waiting.delete()
            place.props("data-ready=1")
        with place:  # the places of the steps are filled again and again
            _watch(stands, page, road, studio, texts, seen)

    ui.page(f"/{page.key}", response_timeout=30)(show)


@contextmanager
def _surroundings(
    page: Page, road: tuple[Page, ...], studio: Studio, texts: Texts, theme: str
) -> Generator[tuple[Element, Element], None, None]:
    here = Path(__file__).parent
    ui.add_css(here / "studio.css")
    ui.add_css(chart.STYLE + chart.dark_style("body.body--dark"))
    ui.add_head_html(f"<script>document.documentElement.lang = '{texts.language}';</script>")
    for script in ("drop.js", "scene.js"):
        ui.add_head_html(f"<script>{(here / script).read_text(encoding='utf-8')}</script>")
    text("a", texts("frame.skip")).props("href=#content").classes("skip")
    with ui.element("header").classes("top"):
        text("span", "Taskcal").classes("brand")
        text("span", studio.project.choices.name).classes("project")
        with ui.element("div").classes("settings"):
            for code, name in LANGUAGES.items():
                _setting(page, "language", code, name, on=code == texts.language).props(f"lang={code}")
            for name in THEMES:
                _setting(page, "theme", name, texts(f"frame.{name}"), on=name == theme)
    with ui.element("div").classes("body"):
        with ui.element("nav").classes("road").props(f'aria-label="{texts("frame.road")}"'):
            listed = ui.element("ol")
        with ui.element("main").props("id=content tabindex=-1"):
            text("h1", texts(f"{page.key}.title"))
            text("p", texts(f"{page.key}.purpose")).classes("quiet")
            yield listed, ui.element("div").classes("next").props("role=status")
            if texts.language != LIBRARY_LANGUAGE:
                text("p", texts("frame.library_language")).classes("quiet")


ROLES: Mapping[str, str] = {
    "campaign": "measurements.title",
    "station": "choose.station",
    "camera": "choose.camera",
    "calibration": "choose.calibration",
    "cell": "choose.cell",
    "corrected": "program.correction",
    "header": "report.head",
}
"""Texts of choices whose page has another name."""

COLOURS: Mapping[StepStatus, str] = {StepStatus.done: "good", StepStatus.needed: "bad", StepStatus.outdated: "bad"}


async def _steps(road: tuple[Page, ...], studio: Studio) -> Mapping[str, Step]:
    """Every step as the files are, and as it runs."""
    steps = dict(await asyncio.to_thread(steps_of, studio.project))
    if await asyncio.to_thread(_has_findings, studio):
        steps["measurements"] = replace(steps["measurements"], state=StepStatus.needed)
    correction = studio.run_of("correct")
    if correction is not None and correction.status is Status.refused:  # one goes on without the program, or mends it
        steps["program"] = replace(steps["program"], waits=False)
    return {one.key: _as_it_runs(steps[one.key], studio.run_of(one.kind)) for one in road}


def _has_findings(studio: Studio) -> bool:
    """Whether what is chosen now is not read, or the doctor found something in it that the user has not accepted."""
    now = examined(studio.project)
    if now and studio.unread == now:
        return True
    return (
        bool(now)
        and studio.examined == now != studio.project.choices.accepted
        and any(map(measurements_page.is_in_the_way, studio.findings()))
    )


def _as_it_runs(step: Step, run: CommandRun | None) -> Step:
    return replace(step, state=StepStatus.running) if is_running(run) else step


def _stand(step: Step, texts: Texts) -> Element:
    """Where a step stands, and why."""
    names = ", ".join(texts(ROLES.get(name, f"{name}.title")) for name in step.because)
    whys = {StepStatus.impossible: "state.first", StepStatus.outdated: "state.since" if names else "state.unknown"}
    with ui.element("span").classes("stand") as stand:
        text("span", texts(f"state.{step.state}")).classes(COLOURS.get(step.state, "quiet"))
        if step.state in whys:
            text("span", texts(whys[step.state], names=names)).classes("why")
    return stand


def _next(page: Page, road: tuple[Page, ...], steps: Mapping[str, Step], studio: Studio, texts: Texts) -> None:
    """Where this page's step stands, and the step to do next."""
    key = next_step(steps, page.key)
    _stand(steps[page.key], texts)
    if not key:
        if page.again is not None and steps[page.key].state is StepStatus.optional:
            button(texts("next.next", what=texts(f"next.{page.key}")), lambda: page.again and page.again(studio))
        return
    to, step = next(one for one in road if one.key == key), steps[key]
    at_once = to.at_once and to is not page and step.state is StepStatus.needed
    again = to.again if at_once or step.state is StepStatus.outdated else None
    todo = {StepStatus.needed: f"next.{key}", StepStatus.outdated: f"next.{key}_again"}
    what = texts(todo[step.state] if step.open and step.state in todo else f"{key}.title")
    if key == "measurements" and step.state is StepStatus.needed and studio.project.choices.campaign:
        what = texts("next.findings")
    if again is not None:
        button(texts("next.next", what=what), lambda: again(studio))
    elif to is not page:
        link(texts("next.next", what=what), f"/{key}").classes("act")
    elif step.state is StepStatus.needed:
        text("span", texts("next.here", what=what))


def _fill(
    stands: tuple[Element, Element],
    page: Page,
    road: tuple[Page, ...],
    steps: Mapping[str, Step],
    studio: Studio,
    texts: Texts,
) -> None:
    """Show where the steps stand, what is next, and what can be undone."""
    listed, bar = stands
    listed.clear()
    with listed:
        for step in road:
            with ui.element("li"):
                to = text("a", texts(f"{step.key}.title")).props(f"href=/{step.key} aria-describedby=at-{step.key}")
                if step is page:
                    to.props("aria-current=page")
                _stand(steps[step.key], texts).props(f"id=at-{step.key}")
    bar.clear()
    with bar:
        _next(page, road, steps, studio, texts)
        history = studio.project.history()
        if history:
            button(texts("history.undo", what=_change(history[-1], texts)), lambda: _undo(studio), plain=True)
        for kind, line in studio.interrupted().items():
            again = next((one.again for one in road if one.kind == kind), None)
            with ui.element("div").classes("message"):
                text("p", texts("run.interrupted", line=line))
                if again is not None:
                    button(texts("run.go_on"), lambda again=again: again(studio), plain=True)
                button(texts("run.drop"), lambda kind=kind: _drop(studio, kind), plain=True)


def _change(change: Change, texts: Texts) -> str:
    """A change in words."""
    name, value = change.named
    return texts(f"history.{change.what}", name=texts.named("choose", texts.named("option", name)), value=value)


def _undo(studio: Studio) -> None:
    try:
        studio.project.undo()
    except TaskcalError as error:
        show_error(studio.project, error)
    else:
        ui.navigate.reload()


def _drop(studio: Studio, kind: str) -> None:
    studio.forget(kind)
    ui.navigate.reload()


WATCH_S = 1.0
"""Between two looks for changes of the project by others."""


def _watch(
    stands: tuple[Element, Element],
    page: Page,
    road: tuple[Page, ...],
    studio: Studio,
    texts: Texts,
    seen: tuple[int, set[str], str],
) -> None:
    """Follow the project: what this window changed is shown beside the steps; of what others changed a line tells.

    Args:
        stands: places of the steps and of what is next.
        page: that is shown.
        road: all pages.
        studio: whose project it is.
        texts: of the page.
        seen: number of changes, kinds of runs, and what could not be read as the page was begun.
    """
    log, own = studio.project.log, ui.context.client.id
    count, running, unread = seen
    others: list[Change] = []

    async def look() -> None:
        nonlocal count, running, unread
        if (count, running, unread) == (len(log), studio.running(), studio.unread):
            return
        others.extend(change for author, change in log[count:] if author != own)
        count, running, unread = len(log), studio.running(), studio.unread
        _fill(stands, page, road, await _steps(road, studio), studio, texts)
        if others:
            with stands[1], ui.element("div").classes("message").props("role=alert"):
                text("p", texts("history.elsewhere", what=", ".join(_change(change, texts) for change in others)))
                button(texts("history.reload"), ui.navigate.reload, plain=True)

    ui.timer(WATCH_S, look)


def _author() -> str:
    """The window whose event is being handled; empty behind a run or a request."""
    try:
        return ui.context.client.id
    except RuntimeError:
        return ""


def _setting(page: Page, name: str, value: str, shown: str, *, on: bool) -> TextElement:
    link = text("a", shown).props(f"href=/settings?{name}={value}&page={page.key}")
    return link.props("aria-current=true") if on else link


# The road: the pages in the order in which a user needs them. A page that is not there is not on it.

ROAD = (
    Page("robot", robot_page.build),
    Page("measurements", measurements_page.build, "doctor"),
    Page("task", task_page.build, again=task_page.begin_task, at_once=True),
    Page("weight", weight_page.build),
    Page("plan", plan_page.build, "plan", plan_page.begin_plan),
    Page("live", live_page.build, ASKS, live_page.go_on),
    Page("identify", identify_page.build, "identify", identify_page.begin_fit, at_once=True),
    Page("result", result_page.build),
    Page("program", program_page.build, "correct", program_page.begin_correction, at_once=True, early=True),
    Page("report", report_page.build, "report", report_page.begin_report),
)


YEAR_S = 31_536_000

RECONNECT_S = 30.0
"""That a page may be out of touch, on a machine that computes on all its cores, before it is made anew."""

NAMES_HERE = ("127.0.0.1", "localhost", "[::1]")

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Endpoint:
    """Address of the studio."""

    host: str = "127.0.0.1"
    port: int = 0
    """0 for any that is free."""
    token: str = ""
    """Asked for before anything is shown; empty for none, where nobody else can reach the host."""

    def __post_init__(self) -> None:
        if not is_loopback(self.host) and not self.token:
            raise TaskcalError(f"'{self.host}' can be reached by others; a token is needed there")


def is_loopback(host: str) -> bool:
    """Whether a host is this machine alone."""
    with suppress(ValueError):
        return ip_address(host.strip("[]")).is_loopback
    return host == "localhost"


def listen(address: Endpoint) -> socket.socket:
    """The socket of an address, which takes connections before they are served.

    Raises:
        TaskcalError: the address is taken, or not one of this machine.
    """
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((address.host.strip("[]"), address.port))
        bound.listen(64)  # from here on a browser waits instead of being turned away
    except (OSError, OverflowError) as error:
        bound.close()
        reason = getattr(error, "strerror", None) or error
        raise TaskcalError(
            f"cannot listen on {address.host}:{address.port}: {reason}; choose another --port"
        ) from error
    return bound


def application(studio: Studio, address: Endpoint, port: int) -> Gate:
    """The whole server, as an ASGI application.

    Args:
        studio: the project and what runs for it.
        address: where it listens.
        port: the one that it got.
    """
    outer = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    outer.get("/settings")(_settings)
    outer.get("/alive")(_alive)
    outer.post("/drop/{kind}")(receiver(studio))
    outer.get("/file/{folder}/{name}")(giver(studio))
    outer.get("/mesh/{robot}/{number}")(mesh_giver(studio))
    ui.page("/")(lambda: RedirectResponse(f"/{ROAD[0].key}"))
    for page in ROAD:
        add_page(page, ROAD, studio)
    pages.on_page_exception(_broken)
    pages.on_exception(lambda error: log.error("a page failed", exc_info=error))
    studio.project.author = _author
    pages.on_startup(lambda: asyncio.get_running_loop().run_in_executor(None, warm_up, studio.project))
    pages.on_shutdown(studio.close)
    ui.run_with(
        outer,
        title="Taskcal",
        favicon="📐",
        dark=None,
        tailwind=False,
        show_welcome_message=False,
        reconnect_timeout=RECONNECT_S,
    )
    hosts = {f"{name}:{port}" for name in NAMES_HERE} | {name for name in NAMES_HERE if port == 80}
    return Gate(app=outer, hosts=frozenset(hosts) if is_loopback(address.host) else None, token=address.token)


def serve(studio: Studio, address: Endpoint, bound: socket.socket) -> None:
    """Serve until the process is told to end."""
    show_log()
    port = bound.getsockname()[1]
    config = uvicorn.Config(
        application(studio, address, port),
        log_config=None,
        log_level="error",
        access_log=False,
        server_header=False,
        ws_max_size=2_000_000,
        timeout_graceful_shutdown=2,
    )
    asyncio.run(uvicorn.Server(config).serve(sockets=[bound]))


class _Plain(logging.Formatter):
    """What is logged, with names from files that are no commands to a terminal."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record), keep="\n\t")


def show_log() -> None:
    """Show errors on standard error, where whoever started the studio sees them."""
    shown = logging.StreamHandler()
    shown.setFormatter(_Plain())
    logging.basicConfig(handlers=[shown], level=logging.WARNING)


async def _alive() -> JSONResponse:
    return JSONResponse({"taskcal": "studio"})


async def _settings(request: Request) -> Response:
    """Keep a language or a theme in a cookie, and go back to the page."""
    asked = request.query_params
    page = next((page.key for page in ROAD if page.key == asked.get("page")), ROAD[0].key)
    answer = RedirectResponse(f"/{page}", status_code=303)
    for name, cookie, known in (("language", LANGUAGE_COOKIE, LANGUAGES), ("theme", THEME_COOKIE, THEMES)):
        if asked.get(name) in known:
            answer.set_cookie(cookie, str(asked[name]), max_age=YEAR_S, samesite="strict", httponly=True)
    return answer


def _broken(error: Exception) -> None:
    """Page shown in place of one that failed: what a user can do, and nothing of the code."""
    log.error("a page failed", exc_info=error)
    known: Any = (
        str(error) if isinstance(error, TaskcalError) else "Taskcal itself failed; the server's terminal says where."
    )
    text("p", str(known))
    text("a", "Taskcal").props("href=/")
