"""Pages of every kind, made once, for a real browser to open."""

import os
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from taskcal.cli import main
from tests.pages.made_pages import PAGES


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where pages and what they are made of lie."""
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="session")
def made(folder: Path) -> Callable[[str], Path]:
    """Makes a page by its name, once."""
    pages: dict[str, Path] = {}

    def call(*arguments: object, status: int = 0) -> None:
        words = [str(argument) for argument in arguments]
        assert main(words) == status, words

    def make(name: str) -> Path:
        if name not in pages:
            before = os.getcwd()
            os.chdir(folder)
            try:
                pages[name] = folder / PAGES[name](call, folder)
            finally:
                os.chdir(before)
        return pages[name]

    return make


@pytest.fixture
def tab(chromium: Any) -> Any:
    """A tab; the test fails if a page in it complained."""
    with quiet_tab(chromium) as page:
        yield page


@contextmanager
def quiet_tab(chromium: Any) -> Generator[Any, None, None]:
    """A tab as wide as on a desk, in which no page may complain."""
    complaints = list[str]()
    with chromium.window() as window:
        page = window.new_page()
        page.set_default_timeout(120_000)
        page.on("console", lambda said: complaints.append(said.text) if _is_a_complaint(said) else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        yield page
    assert complaints == []


def _is_a_complaint(said: Any) -> bool:
    """Whether a page is to blame for a message; tests read canvases back, and drivers of displays that are not there complain."""
    ours = ("willReadFrequently", "GL Driver Message")
    return said.type in ("error", "warning") and not any(words in said.text for words in ours)
