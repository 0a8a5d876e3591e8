"""A report as one self-contained page: nothing is fetched when it is opened."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from taskcal.presentation.content import Chart, Scene, Section
from taskcal.presentation.figure_json import figure_json


@dataclass(frozen=True, eq=False, kw_only=True)
class Page:
    """A report, before it is written as a page or as text."""

    title: str
    sections: tuple[Section, ...]
    """In order; each gets an entry in the table of contents."""
    lead: str = ""
    """A sentence or two under the title."""
    footer: str = ""
    """Where the numbers come from."""
    header: tuple[tuple[str, str], ...] = ()
    """Whom and what it is for: labels and what belongs to them."""

    def html(self) -> str:
        """The page, with its figures and, once, the library that draws them (about 5 MB)."""
        kinds = {block.kind for section in self.sections for block in section.blocks}
        return _template().render(
            page=self,
            chart_json=_chart_json,
            scene_json=_scene_json,
            plotly=Markup(get_plotlyjs()) if Chart.kind in kinds else "",  # noqa: S704 - a library's own text
            scenes=Markup(_script("scene.js")) if Scene.kind in kinds else "",  # noqa: S704 - ours
            behaviour=Markup(_script("page.js")),  # noqa: S704 - ours
        )


def report_html(title: str, sections: Sequence[Section], *, lead: str = "", footer: str = "") -> str:
    """A report as a page.

    Args:
        title: of the page.
        sections: in order.
        lead: a sentence or two under the title.
        footer: where the numbers come from.
    """
    return Page(title=title, sections=tuple(sections), lead=lead, footer=footer).html()


def _chart_json(chart: Chart) -> Markup:
    return _for_script(figure_json(chart.figure))


def _scene_json(scene: Scene) -> Markup:
    return _for_script(json.dumps(scene.content(), ensure_ascii=False, allow_nan=False, separators=(",", ":")))


def _for_script(text: str) -> Markup:
    """Data for a script element, which only a closing tag could end."""
    return Markup(text.replace("<", "\\u003c"))  # noqa: S704 - escaped here


@cache
def _script(name: str) -> str:
    return (files("taskcal.presentation") / name).read_text(encoding="utf-8")


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("taskcal", "presentation"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.j2")
