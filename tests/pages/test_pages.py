"""Every kind of page in a real browser: no complaints, nothing that keeps people out, every figure drawn, all of it on paper."""

from collections.abc import Callable, Generator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from taskcal.report.chart import Axis, Figure, Panel
from taskcal.report.content import Chart, Section, Viewer
from taskcal.report.page import Report
from tests.pages.conftest import quiet_tab
from tests.pages.made_pages import PAGES
from tests.pages.printed import Printed, squeezed
from tests.taskcal_studio.conftest import PICTURES, keep_picture
from tests.taskcal_studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long]

SIZES = {"desk": (1440, 900), "phone": (390, 844)}

MARKS = ".chart svg g path"
"""What a chart draws of its data."""

DRAWN = """() => [...document.querySelectorAll("figure")].map((figure) => {
  const title = figure.querySelector("figcaption").textContent, canvas = figure.querySelector(".scene canvas");
  if (canvas) {
    const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let inked = 0;
    for (let k = 0; k < data.length; k += 4) inked += Math.min(data[k], data[k + 1], data[k + 2]) < 200;
    return [title, inked / (data.length / 4) > 0.0005];
  }
  const marks = [...figure.querySelectorAll(MARKS)];
  return [title, marks.filter((mark) => { const b = mark.getBoundingClientRect(); return b.width + b.height > 3; }).length > 0];
})""".replace("MARKS", repr(MARKS))
"""Title of every figure, and whether there is anything in it."""


def opened(tab: Any, page: Path) -> None:
    tab.goto(page.as_uri(), timeout=120_000)
    tab.wait_for_timeout(200)


@pytest.fixture(scope="module", params=PAGES)
def shown(request: Any, made: Callable[[str], Path], chromium: Any) -> Generator[tuple[str, Any], None, None]:
    """The name of a page and the tab in which it is open, for all tests of that page: to draw it takes longest."""
    with quiet_tab(chromium) as tab:
        opened(tab, made(request.param))
        yield request.param.replace(" ", "-"), tab


def test_a_page_on_screens(shown: tuple[str, Any]) -> None:
    name, tab = shown
    for size, (width, height) in SIZES.items():
        tab.set_viewport_size({"width": width, "height": height})
        tab.wait_for_timeout(400)
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        assert serious(tab) == []
        drawn = tab.evaluate(DRAWN)
        assert drawn
        assert [title for title, there in drawn if not there] == []
        keep_picture(tab, f"{name}-{size}")


def test_a_page_on_paper(shown: tuple[str, Any], tmp_path: Path) -> None:
    name, tab = shown
    sheet = (PICTURES or tmp_path) / f"{name}.pdf"
    sheet.parent.mkdir(parents=True, exist_ok=True)
    width, height = SIZES["desk"]
    tab.set_viewport_size({"width": width, "height": height})
    tab.wait_for_timeout(400)
    captions = tab.eval_on_selector_all("figcaption", "all => all.map(one => one.textContent)")
    tables = tab.eval_on_selector_all(
        "table", "all => all.map(t => [...t.tBodies[0].rows].map(r => r.cells[0].textContent))"
    )
    titles = tab.eval_on_selector_all(
        "h2, h3, details:not(.view) > summary, .view[open] > summary", "all => all.map(one => one.textContent)"
    )
    tab.pdf(path=sheet, prefer_css_page_size=True, print_background=True)
    paper = Printed(sheet)
    assert [title for title in titles if squeezed(title) not in paper.text] == []
    assert [cell for rows in tables for cell in rows if squeezed(cell) not in paper.text] == []
    for caption in captions:
        found = paper.caption(caption[: caption.index(".") + 1])
        assert found is not None, caption
        assert found.height > 150.0, f"{caption} is left alone at the foot of a sheet"
        assert found.drawn > 0.002, f"nothing is drawn under {caption}"


def test_controls_are_left_off_paper_and_folds_opened(made: Callable[[str], Path], tab: Any) -> None:
    opened(tab, made("calibration of a loop"))
    tab.emulate_media(media="print")
    for control in (".scene .controls", "nav", "details.view:not([open])"):
        assert tab.locator(control).count() > 0
        assert not any(one.is_visible() for one in tab.locator(control).all())
    assert all(one.is_visible() for one in tab.locator("details table").all())


def test_an_empty_figure_is_seen_to_be_empty(tmp_path: Path, tab: Any) -> None:
    """The test above would be worth nothing if it called everything drawn."""
    blocks = (
        Chart(title="nothing", figure=Figure(panels=(Panel(x=Axis(), y=Axis()),))),
        Viewer(title="nowhere", layers=()),
    )
    page = tmp_path / "empty.html"
    page.write_text(Report(title="empty", sections=[Section("none", *blocks)]).html(), "utf-8")
    opened(tab, page)
    assert [there for _, there in tab.evaluate(DRAWN)] == [False, False]


def test_the_robot_turns_and_its_errors_grow(made: Callable[[str], Path], tab: Any) -> None:
    opened(tab, made("calibration of a loop"))
    canvas = tab.locator(".scene canvas").first
    canvas.scroll_into_view_if_needed()
    views = [canvas.screenshot()]
    box = canvas.bounding_box()
    tab.mouse.move(box["x"] + 200, box["y"] + 200)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 320, box["y"] + 230)
    tab.mouse.up()
    views.append(canvas.screenshot())
    canvas.press("ArrowLeft")
    views.append(canvas.screenshot())
    for slider in ("scale", "pose"):
        tab.locator(f".scene input[name={slider}]").press("Home")
        views.append(canvas.screenshot())
    tab.get_by_label("robot", exact=True).uncheck()
    views.append(canvas.screenshot())
    assert all(one != other for one, other in pairwise(views))
    assert tab.locator(".scene output[name=scale]").inner_text() == "× 1"
