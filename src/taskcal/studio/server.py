"""The studio's server: the pages, how they look, and who may reach them."""

import asyncio
import logging
import socket
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any

import uvicorn
from fastapi import FastAPI
from nicegui import app as pages
from nicegui import ui
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response

from taskcal.errors import TaskcalError, printable
from taskcal.studio.controls import text
from taskcal.studio.dropped_files import receiver
from taskcal.studio.gate import Gate
from taskcal.studio.given_files import giver, mesh_giver
from taskcal.studio.page_frame import LANGUAGE_COOKIE, THEME_COOKIE, THEMES, add_page
from taskcal.studio.pages.robot_page import warm_up
from taskcal.studio.road import ROAD
from taskcal.studio.studio import Studio
from taskcal.studio.texts import LANGUAGES

YEAR_S = 31_536_000

RECONNECT_S = 30.0
"""That a page may be out of touch, on a machine that computes on all its cores, before it is made anew."""

NAMES_HERE = ("127.0.0.1", "localhost", "[::1]")

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Address:
    """Where the studio listens."""

    host: str = "127.0.0.1"
    port: int = 0
    """0 for any that is free."""
    token: str = ""
    """Asked for before anything is shown; always where others can reach the host."""

    def __post_init__(self) -> None:
        if not is_loopback(self.host) and not self.token:
            raise TaskcalError(f"'{self.host}' can be reached by others; a token is needed there")


def is_loopback(host: str) -> bool:
    """Whether a host is this machine alone."""
    with suppress(ValueError):
        return ip_address(host.strip("[]")).is_loopback
    return host == "localhost"


def listen(address: Address) -> socket.socket:
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


def application(studio: Studio, address: Address, port: int) -> Gate:
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
    ui.page("/")(_begin)
    for page in ROAD:
        add_page(page, ROAD, studio)
    pages.on_page_exception(_broken)
    pages.on_exception(lambda error: log.error("a page failed", exc_info=error))
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


def serve(studio: Studio, address: Address, bound: socket.socket) -> None:
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
    """What goes wrong is said on standard error, where whoever started the studio sees it."""
    shown = logging.StreamHandler()
    shown.setFormatter(_Plain())
    logging.basicConfig(handlers=[shown], level=logging.WARNING)


def _begin() -> RedirectResponse:
    return RedirectResponse(f"/{ROAD[0].key}")


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
    """What a page shows that failed: what a user can do, and nothing of the code."""
    log.error("a page failed", exc_info=error)
    known: Any = (
        str(error) if isinstance(error, TaskcalError) else "Taskcal itself failed; the server's terminal says where."
    )
    text("p", str(known))
    text("a", "Taskcal").props("href=/")
