"""Figures as files of their own are what their names say, and have something in them."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pypdfium2 as pdfium
import pytest

from taskcal.report.chart import Axis, Figure, Panel, Series
from taskcal.report.content import Chart, Section, Viewer
from taskcal.report.page import Report, draw_figures, find_browser
from tests.pages.printed import share_drawn

pytestmark = [pytest.mark.browser, pytest.mark.long]

PAGE = Report(
    title="figures",
    sections=(
        Section(
            "both kinds",
            Chart(
                "a chart",
                Figure(panels=(Panel(x=Axis(), y=Axis(), series=(Series(kind="line", x=[1, 2, 3], y=[1, 4, 9]),)),)),
            ),
            Viewer(
                title="in space",
                layers=(
                    {
                        "kind": "strokes",
                        "label": "edges",
                        "colour": "#000",
                        "width": 8,
                        "at": [[[0, 0, 0], [100, 50, 80]]],
                    },
                ),
            ),
        ),
    ),
)


def _is_svg(content: bytes) -> bool:
    root = ElementTree.fromstring(content)
    return root.tag.endswith("svg") and any(part.tag.endswith(("path", "image")) for part in root.iter())


def _is_pdf(content: bytes) -> bool:
    document = pdfium.PdfDocument(content)
    return len(document) == 1 and share_drawn(document[0].render(scale=1.0).to_numpy()) > 0.001


@pytest.mark.parametrize(("kind", "holds"), [("svg", _is_svg), ("pdf", _is_pdf)])
def test_every_figure_is_a_file_of_its_kind(kind: str, holds: Callable[[bytes], bool], tmp_path: Path) -> None:
    assert find_browser()
    drawn = draw_figures(PAGE, kind)  # pyright: ignore[reportArgumentType]
    assert list(drawn) == ["a chart", "in space"]
    assert [title for title, content in drawn.items() if not holds(content)] == []
