"""A studio's pages without a browser: its own application behind its gate, and NiceGUI's simulated user before it."""

import asyncio
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
from nicegui import ui
from nicegui.element import Element
from nicegui.elements.mixins.text_element import TextElement
from nicegui.testing.general import nicegui_reset_globals
from nicegui.testing.user import User

from taskcal_studio.project import Project
from taskcal_studio.runs import Status, Studio
from taskcal_studio.server import Endpoint, application

PORT = 8080
PATIENCE_S = 60.0


class Visitor:
    """Who sees the pages of one studio, and works their controls."""

    def __init__(self, studio: Studio, user: User) -> None:
        self.studio, self._user = studio, user
        self.http = user.http_client

    async def open(self, key: str) -> None:
        """Go to a page, and wait for its content."""
        await self._user.open(f"/{key}")
        await self.until(lambda: any("data-ready" in e.props for e in self.elements("div")))

    async def again(self, act: Callable[[], object]) -> None:
        """Do something that shows the page anew, and wait for that."""
        before = self._user.client
        act()
        await self.until(lambda: self._user.client is not before)
        await self.until(lambda: any("data-ready" in e.props for e in self.elements("div")))

    async def until(self, happened: Callable[[], bool]) -> None:
        """Wait for something."""
        async with asyncio.timeout(PATIENCE_S):
            while not happened():
                await asyncio.sleep(0.01)

    async def ended(self, kind: str) -> None:
        """Wait until a run has ended, and the page shows it."""
        run = self.studio.run_of(kind)
        assert run is not None
        before = self._user.client
        await self.until(lambda: run.status is not Status.running)
        await self.until(lambda: self._user.client is not before)
        await self.until(lambda: any("data-ready" in e.props for e in self.elements("div")))

    def all(self) -> list[Any]:
        """Every element, in their order on the page."""
        return list(self._user.current_layout.descendants())

    def elements(self, *tags: str, within: Element | None = None) -> list[Any]:
        """Elements in their order on the page."""
        return [e for e in (within or self._user.current_layout).descendants() if e.tag in tags]

    def said(self, tag: str, style: str = "", within: Element | None = None) -> list[str]:
        """What elements with a tag, and a style, say."""
        found = self.elements(tag, within=within)
        return [e.text for e in found if isinstance(e, TextElement) and (not style or style in e.classes)]

    def facts(self) -> dict[str, str]:
        """Labelled lines."""
        return dict(zip(self.said("dt"), self.said("dd"), strict=True))

    def tables(self) -> dict[str, list[list[str]]]:
        """Header and rows of every table, by its title."""
        return {
            next(iter(self.said("caption", within=table)), ""): [
                [getattr(e, "text", "") for e in self.elements("th", "td", within=row)]
                for row in self.elements("tr", within=table)
            ]
            for table in self.elements("table")
        }

    def named(self, label: str, **props: str) -> Any:
        """The element that a screen reader names so."""
        (found,) = (
            e for e in self.all() if e.props.get("aria-label") == label and props.items() <= dict(e.props).items()
        )
        return found

    def press(self, label: str) -> None:
        """Press a button."""
        (button,) = (e for e in self.elements("button") if e.text == label)
        self.tell(button, "click")

    def choose(self, group: str, value: str) -> None:
        """Choose from a list."""
        (chosen,) = (e for e in self.elements("select") if e.props["data-name"] == group)
        self.tell(chosen, "change", value)

    def leave(self, label: str, value: object, **props: str) -> None:
        """Settle on a value of an input."""
        self.tell(self.named(label, **props), "left", {"value": value, "said": 1})

    def click_in(self, scene: ui.scene, x: float, y: float, z: float) -> None:
        """Click the points of a scene."""
        (cloud,) = (one for one in scene.objects.values() if isinstance(one, ui.scene.point_cloud))
        keys = dict.fromkeys(("alt_key", "ctrl_key", "meta_key", "shift_key"), False)
        hit = {"object_id": cloud.id, "object_name": "", "point": {"x": x, "y": y, "z": z}}
        self.tell(scene, "click3d", {"click_type": "click", "button": 0, "hits": [hit], **keys})

    def tell(self, element: Element, event: str, args: object = None) -> None:
        """What a browser tells of an element."""
        listeners = [one for one in element._event_listeners.values() if one.type == event]
        assert listeners, event
        for one in listeners:
            element._handle_event({"listener_id": one.id, "args": args})


@asynccontextmanager
async def visiting(folder: Path, **headers: str) -> AsyncIterator[Visitor]:
    """A visitor of a studio on a folder, whose requests have some headers."""
    studio = Studio(Project(folder))
    modules = dict(sys.modules)
    address = f"http://127.0.0.1:{PORT}"
    kept = (ui.navigate, ui.notify, ui.download)
    try:
        with nicegui_reset_globals(), patch.dict("os.environ", {"NICEGUI_USER_SIMULATION": "true"}):
            gate = application(studio, Endpoint(), PORT)
            transport = httpx.ASGITransport(gate)
            async with (
                gate.app.router.lifespan_context(gate.app),
                httpx.AsyncClient(transport=transport, base_url=address, headers=headers) as client,
            ):
                yield Visitor(studio, User(client))
    finally:
        ui.navigate, ui.notify, ui.download = kept
        sys.modules.update(modules)  # the pages' own are forgotten there, and would be imported a second time


def visit(folder: Path, do: Callable[[Visitor], Awaitable[None]], **headers: str) -> None:
    """Do something on a studio's pages."""

    async def visited() -> None:
        failed: list[BaseException] = []
        async with visiting(folder, **headers) as visitor:
            try:
                await do(visitor)
            except BaseException as error:  # the server ends first, or the next could not begin
                failed.append(error)
        if failed:
            raise failed[0]

    asyncio.run(visited())
