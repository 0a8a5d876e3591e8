"""Pages that were left are let go of: what a browser opened and closed leaves nothing behind in the server."""

import gc
import threading
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

import taskcal_studio.server as server
from taskcal_studio.project import begin_example
from taskcal_studio.runs import Studio
from taskcal_studio.server import ROAD
from tests.taskcal_studio.conftest import open_tab

pytestmark = [pytest.mark.browser, pytest.mark.long]

AWAY_S = 1.0
"""That pages wait for their browser here; half a minute in use, of which the pages of the last half-minute stay in memory."""

MEASURED_ROUNDS = 4
"""Through all pages; the first two fill what is kept on purpose, such as compiled kernels and the catalogue."""

GROWTH_MB = 0.3
"""For each page that is opened. One that stays takes half a megabyte to five."""


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A studio in this very process, so that its objects can be counted; it goes with the process."""
    monkeypatch.setattr(server, "RECONNECT_S", AWAY_S)
    studio, place = Studio(begin_example(tmp_path)), server.Endpoint()
    bound = server.listen(place)
    threading.Thread(target=server.serve, args=(studio, place, bound), daemon=True).start()
    return f"http://127.0.0.1:{bound.getsockname()[1]}/"


def pages_alive() -> int:
    """Of all that were ever opened."""
    from nicegui import Client

    gc.collect()
    return sum(isinstance(thing, Client) for thing in gc.get_objects())


def test_a_page_that_was_left_leaves_nothing_behind(chromium: Any, address: str) -> None:
    sizes: list[float] = []
    with open_tab(chromium, address) as tab:
        for _ in range(MEASURED_ROUNDS):
            for step in ROAD:
                page = tab.open(step.key)
                sliders = page.locator("input[type=range]")
                if sliders.count():
                    sliders.first.focus()
                    for _ in range(10):
                        page.keyboard.press("ArrowRight")
            page.goto("about:blank")
            until = time.monotonic() + 30.0
            while pages_alive() and time.monotonic() < until:
                time.sleep(0.5)
            assert pages_alive() == 0
            sizes.append(psutil.Process().memory_info().rss / 1e6)
        assert tab.complaints == []
    growth = (sizes[-1] - sizes[1]) / ((MEASURED_ROUNDS - 2) * len(ROAD))
    print(f"{growth:.3f} MB for each page; after each round:", [round(size, 1) for size in sizes])
    assert growth < GROWTH_MB
