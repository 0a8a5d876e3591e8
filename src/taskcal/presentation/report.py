"""A report as one self-contained page: nothing is fetched when it is opened."""

from collections.abc import Sequence
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from taskcal.presentation.content import Chart, Section


def report_html(title: str, sections: Sequence[Section], *, lead: str = "", footer: str = "") -> str:
    """The page of a report, with its figures and, once, the library that draws them (about 5 MB).

    Args:
        title: of the page.
        sections: in order; each gets an entry in the table of contents.
        lead: a sentence or two under the title.
        footer: where the numbers come from.
    """
    charts = any(isinstance(block, Chart) for section in sections for block in section.blocks)
    return _template().render(
        title=title,
        lead=lead,
        footer=footer,
        sections=sections,
        chart_json=_as_json,
        plotly=Markup(get_plotlyjs()) if charts else "",
    )


def _as_json(chart: Chart) -> Markup:
    """The figure's data for a script element, which only a closing tag could end."""
    return Markup(str(chart.figure.to_json()).replace("<", "\\u003c"))


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
