"""Sections as the studio shows them, in the page's language: those of reports and of the command line."""

from collections.abc import Callable, Iterable, Mapping

from nicegui import ui

from taskcal.report.chart import Figure
from taskcal.report.content import Block, Bullets, Chart, Facts, NextStep, Numbers, Section, Text, TextTable, Viewer
from taskcal_studio.controls import facts, tabulated, text
from taskcal_studio.steps import link
from taskcal_studio.texts import Texts
from taskcal_studio.views import figure

MANY = 1_000_000


def show_sections(
    sections: Iterable[Section], texts: Texts, *, folded: int = MANY, scene: Callable[[Viewer], object] | None = None
) -> None:
    """Sections one below the other.

    Args:
        sections: as reports and the command line have them.
        texts: of the page.
        folded: from which on they are shown on demand; none by default.
        scene: shows a scene of them, in place of a report's own.
    """
    for number, section in enumerate(sections):
        with ui.element("details" if number >= folded else "section"):
            text("summary" if number >= folded else "h2", texts.said(section.title))
            for block in section.blocks:
                show_block(block, texts, scene=scene)


def show_block(
    block: Block,
    texts: Texts,
    *,
    links: Mapping[str, tuple[str, str]] | None = None,
    scene: Callable[[Viewer], object] | None = None,
    classes: Mapping[str, str] | None = None,
) -> None:
    """A block of a section.

    Args:
        block: as reports and the command line have it.
        texts: of the page.
        links: label and page where something is done, by what a step is about.
        scene: shows a scene, in place of a report's own.
        classes: of a table's cells, by what stands in them.

    Raises:
        TypeError: the page cannot show it.
    """
    if isinstance(block, TextTable):
        with ui.element("details" if block.folded else "div"):
            if block.folded:
                text("summary", texts.said(block.title))
            tabulated(block, texts=texts, classes=classes)
    elif isinstance(block, Chart):
        _chart(block, texts)
    elif isinstance(block, Text):
        text("p", texts.said(block.words))
    elif isinstance(block, Bullets):
        with ui.element("ul"):
            for item in block.items:
                text("li", texts.said(item))
    elif isinstance(block, Numbers):
        facts((texts.said(what), f"{texts.said(value)} {unit}".strip()) for value, unit, what in block.items)
    elif isinstance(block, Facts):
        facts((texts.said(label), texts.said(words)) for label, words in block.items)
    elif isinstance(block, NextStep):
        with ui.element("p"):
            text("span", f"{texts('next.next', what=texts.said(block.words))} ")
            if block.about in (links or {}):
                link(*(links or {})[block.about])
    elif isinstance(block, Viewer) and scene is not None:
        scene(block)
    else:
        raise TypeError(f"a page shows no {block.kind} here")


def _chart(block: Chart, texts: Texts) -> None:
    """A chart, the first of its views at once; marks that stand for rows select them where the page does."""
    views = {"": block.figure} if isinstance(block.figure, Figure) else block.figure
    title = texts.said(block.title)
    for number, (name, drawn) in enumerate(views.items()):
        caption = f"{title}: {texts.said(name)}" if name else title
        selects = any(len(one.rows) for panel in drawn.panels for one in panel.series)
        with ui.element("details" if number else "div"):
            if number:
                text("summary", texts.said(name))
            figure(caption, drawn, texts, "" if number else texts.said(block.note), selects=selects)
