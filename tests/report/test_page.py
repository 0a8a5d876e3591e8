"""A report as a page."""

import re
from html.parser import HTMLParser

from taskcal.identification.calibration import package_version
from taskcal.report.chart import Axis, Figure, Panel, Series
from taskcal.report.content import Bullets, Chart, Commands, Numbers, Section, TextTable, Viewer
from taskcal.report.page import Report, figures_of

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Outline(HTMLParser):
    """Checks that elements are closed in order, and collects the visible text and every address."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.addresses: list[str] = []
        self.scripts = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        self.scripts += tag == "script"
        self.addresses += [value for name, value in attrs if name in ("src", "href") and value]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "script" not in self.open and "style" not in self.open:
            self.text.append(data)


def outline(page: str) -> Outline:
    out = Outline()
    out.feed(page)
    out.close()
    assert out.open == []
    return out


def _figure(text: str) -> Figure:
    one = Series(x=[1, 2], y=[3, 4], name=text)
    return Figure(panels=(Panel(x=Axis(title=text), y=Axis(), title=text, series=(one, one)),))


def sections_of_everything(text: str) -> list[Section]:
    table = TextTable.of_rows(text, (text, "b"), [(text, "1"), ("y", "2")], note=text)
    folded = TextTable(title=text, header=("a",), groups=((text, ((text,),)),), folded=True)
    chart = Chart(title=text, figure=_figure(text), note=text)
    return [Section(text, text, Bullets(text), Numbers((text, "µm", text)), Commands(text), table, folded, chart)] * 3


def html_of(words: str, sections: list[Section]) -> str:
    return Report(title=words, sections=sections, lead=words, source=words).html()


def test_page_is_well_formed_and_self_contained() -> None:
    page = Report(title="A report", sections=sections_of_everything("words"), lead="Lead.", source="seed 3")
    read = outline(page.html())
    assert read.addresses == ["#part-1", "#part-2", "#part-3"]
    assert {"A report", "Lead.", f"Taskcal {package_version()}; seed 3.", "words"} <= {t.strip() for t in read.text}


def test_page_escapes_markup() -> None:
    hostile = "</script><b onclick='x'>&amp;<!--"
    page, harmless = (html_of(words, sections_of_everything(words)) for words in (hostile, "words"))
    assert outline(page).scripts == outline(harmless).scripts
    assert "<b " not in page
    assert hostile in outline(page).text


def test_page_shows_its_figures_without_scripts() -> None:
    """Every chart is an image for wide and one for narrow screens; of several views the first is open."""
    views = Section("a", Chart("c", {"one": _figure("a"), "two": _figure("b")}))
    page = html_of("words", [*sections_of_everything("words"), views])
    body = page[page.index("<body>") : page.index("<script>")]
    assert body.count('class="chart-wide"') == body.count('class="chart-narrow"') == 5
    assert re.findall(r'<details class="view"( open)?><summary>(\w+)', body) == [(" open", "one"), ("", "two")]
    assert len(page) < 60_000


def test_page_is_reproducible() -> None:
    assert html_of("a", sections_of_everything("b")) == html_of("a", sections_of_everything("b"))


def test_figures_are_named_in_order_by_their_titles() -> None:
    section = Section("a", Chart("words", _figure("words")), Viewer(title="in space"))
    assert list(figures_of(Report(title="a", sections=(section,))).values()) == ["01-words", "02-in-space"]
