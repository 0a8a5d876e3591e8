"""A studio that is served to a real browser, with everything that its pages complain of."""

import os
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

from taskcal_studio.server import cookie_name

PICTURES = Path(os.environ["TASKCAL_PICTURES"]) if os.environ.get("TASKCAL_PICTURES") else None
"""Where screenshots of every page are kept, for those who want to look at them; no test judges them."""

SIZES = {"desk": (1440, 900), "tablet": (820, 1180)}


@contextmanager
def served(folder: Path, *options: str) -> Iterator[str]:
    """A studio on a folder; gives the address that it prints, with its token."""
    command = [sys.executable, "-m", "taskcal", "studio", str(folder), "--no-browser", "--port", "0", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert line.startswith("Taskcal studio: http://"), line
            yield line.removeprefix("Taskcal studio: ").strip()
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def pass_of(address: str) -> tuple[str, str, str]:
    """Address of the pages without the token; name and value of the cookie that lets in."""
    pages, _, token = address.partition("?token=")
    return pages, cookie_name(token), token


def server_of(folder: Path) -> psutil.Process:
    """The process of a studio."""
    for process in psutil.Process().children(recursive=True):
        if "studio" in process.cmdline() and str(folder) in process.cmdline():
            return process
    raise AssertionError(f"no studio serves {folder}")


@pytest.fixture(scope="session")
def example(tmp_path_factory: pytest.TempPathFactory) -> Generator[tuple[str, Path], None, None]:
    """A studio on the example project, which tests of one session share; its address and its folder."""
    folder = tmp_path_factory.mktemp("studio") / "example"
    with served(folder, "--example") as address:
        yield address, folder


def comes_true(page: Any, happened: Callable[[], bool]) -> bool:
    """Whether something happens behind a page, within a minute: on a busy machine no fixed wait is long enough."""
    for _ in range(600):
        if happened():
            return True
        page.wait_for_timeout(100)
    return False


def keep_picture(page: Any, name: str) -> None:
    """Keep a screenshot of a whole page, if somebody wants to look at it."""
    if PICTURES is not None:
        PICTURES.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=PICTURES / f"{name}.png", full_page=True, timeout=300_000)


class Tab:
    """A page in a browser, and what its console said."""

    def __init__(self, context: Any, address: str) -> None:
        self.page = context.new_page()
        self.page.set_default_timeout(120_000)
        self.address, name, value = pass_of(address)
        if value:
            context.add_cookies([{"name": name, "value": value, "url": self.address}])
        self.complaints: list[str] = []
        self.page.on("console", self._listen)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))

    def _listen(self, said: Any) -> None:
        if said.type in ("error", "warning") and "GL Driver Message" not in said.text:
            self.complaints.append(f"{said.type}: {said.text}")

    def open(self, key: str) -> Any:
        """Go to a page, and wait for its content."""
        self.page.goto(f"{self.address}{key}")
        return self.ready()

    def ready(self) -> Any:
        """Wait until the page is filled."""
        self.page.wait_for_selector("[data-ready]", timeout=300_000)
        return self.page

    def picture(self, name: str) -> None:
        """Keep a screenshot at each size, if they are wanted; what follows is at the last one."""
        for size, (width, height) in SIZES.items():
            self.page.set_viewport_size({"width": width, "height": height})
            if PICTURES is None:
                continue
            self.page.wait_for_timeout(300)
            # a scene is empty from when the page changes its size until it is drawn again: not in the midst of the picture
            whole = max(height, self.page.evaluate("document.documentElement.scrollHeight"))
            self.page.set_viewport_size({"width": width, "height": whole})
            self.page.wait_for_timeout(1000)
            keep_picture(self.page, f"{name}-{size}")


@contextmanager
def open_tab(browser: Any, address: str, **options: Any) -> Iterator[Tab]:
    """A tab in a window of its own, without the cookies of others."""
    with browser.window(**options) as window:
        yield Tab(window, address)


@pytest.fixture
def tab(chromium: Any, example: tuple[str, Path]) -> Generator[Tab, None, None]:
    """A tab on the example; the test fails if the page complained."""
    with open_tab(chromium, example[0]) as opened:
        yield opened
    assert opened.complaints == []
