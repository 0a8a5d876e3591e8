"""Every page of the documents in a real browser: no complaints, nothing that keeps people out, none wider than the screen."""

import re
import subprocess
import sys
from collections.abc import Generator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from tests.pages.test_pages import SIZES
from tests.taskcal_studio.conftest import keep_picture
from tests.taskcal_studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long]

DOCS = Path(__file__).parents[2] / "docs"

LOOKED_AT = (
    "index.html",
    "how-to/with-a-tracker.html",
    "reference/commands/identify.html",
    "reference/api/taskcal.identify.html",
)
"""Pages of which screenshots are kept."""

KIND = re.compile(r'<(\w+)(?:[^>]*? class="([^"]*)")?')
"""Element and class, on which the style sheets decide its colours."""

FEWEST = 40
"""Pages; fewer, and something was not built."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("docs")
    subprocess.run([sys.executable, "-m", "sphinx", "-q", "-b", "html", str(DOCS), str(out)], check=True)
    return out


@pytest.fixture
def address(built: Path) -> Generator[str, None, None]:
    """Where the documents are served: as files, browsers would not let axe read their style sheets."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(built))) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@pytest.fixture
def reader(tab: Any) -> Any:
    """A tab without a network: formulas are set by a script from there; no page has an icon of its own."""
    tab.route(re.compile(r"https://.*|.*/favicon\.ico"), lambda route: route.fulfill(status=200, body=""))
    return tab


def test_search_for_option_finds_page_of_command(address: str, reader: Any) -> None:
    for words in ("--target-within-mm", "target-within-mm"):
        reader.goto(f"{address}/search.html?q={words}")
        first = reader.locator("#search-results li a").first
        first.wait_for(timeout=20_000)
        assert "reference/commands/" in (first.get_attribute("href") or "")


def test_every_page_opens_without_complaint(built: Path, address: str, reader: Any) -> None:
    pages = [page for page in sorted(built.rglob("*.html")) if not {"_static", "_modules"} & set(page.parts)]
    assert len(pages) >= FEWEST
    found, seen = list[str](), set[tuple[str, str]]()
    for page in pages:
        name = page.relative_to(built).as_posix()
        reader.goto(f"{address}/{name}")
        for size, (width, height) in SIZES.items():
            reader.set_viewport_size({"width": width, "height": height})
            if reader.evaluate("document.documentElement.scrollWidth") > width:
                found.append(f"{name}: wider than {width}")
            if name in LOOKED_AT:
                keep_picture(reader, f"docs-{name.replace('/', '-')}-{size}")
        kinds = set(KIND.findall(page.read_text("utf-8")))
        # contrast takes longest, and colours are the same wherever an element of the same kind is
        found += [f"{name}: {one}" for one in serious(reader, **{"color-contrast": {"enabled": not kinds <= seen}})]
        seen |= kinds
    assert found == []
