"""A report as Markdown text: the same words, numbers and tables, with the figures beside it, if they were written."""

import re
from collections.abc import Mapping

from taskcal.errors import printable
from taskcal.presentation.content import Chart, Commands, Numbers, Points, Scene, Section, Table, Text
from taskcal.presentation.report import Page


def as_markdown(page: Page, figures: Mapping[str, str] | None = None) -> str:
    """The text.

    Args:
        page: the report.
        figures: file of each figure by its title; without, a figure is its title and what to see in it.
    """
    out = [f"# {_plain(page.title)}"]
    out += [_plain(page.lead)] if page.lead else []
    out += ["\n".join(f"- {_plain(label)}: {_plain(text)}" for label, text in page.header)] if page.header else []
    for number, section in enumerate(page.sections, start=1):
        out.append(f"## {number}. {_plain(section.title)}")
        out += _blocks(section, figures or {})
    out += [f"*{_plain(page.footer)}*"] if page.footer else []
    return "\n\n".join(out) + "\n"


def _blocks(section: Section, figures: Mapping[str, str]) -> list[str]:
    out: list[str] = []
    for block in section.blocks:
        match block:
            case Text(paragraphs):
                out += [_plain(paragraph) for paragraph in paragraphs]
            case Points(items):
                out.append("\n".join(f"- {_plain(item)}" for item in items))
            case Numbers(items):
                out.append(
                    "\n".join(
                        f"- **{_plain(f'{value} {unit}'.strip())}** {_plain(said)}" for value, unit, said in items
                    )
                )
            case Commands(lines):
                out.append(_fenced(lines))
            case Table():
                out += _table(block)
            case Chart() | Scene():
                out += _figure(block, figures)
    return out


def _figure(block: Chart | Scene, figures: Mapping[str, str]) -> list[str]:
    title, file = _plain(block.title), figures.get(block.title)
    shown = f"![{title}]({file})" if file else f"**Figure: {title}**"
    return [shown, _plain(block.note)] if block.note else [shown]


def _table(table: Table) -> list[str]:
    if not len(table):
        return []
    marks = [":--" if k in table.text_columns else "--:" for k in range(len(table.header))]
    lines = [_row(table.header), "|".join(["", *marks, ""])]
    for heading, rows in table.groups:
        lines += [_row((heading, *([""] * (len(table.header) - 1))))] if heading else []
        lines += [_row(row) for row in rows]
    out = [f"**{_plain(table.title)}**", "\n".join(lines)]
    return [*out, _plain(table.note)] if table.note else out


def _row(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(_plain(cell) for cell in cells)} |"


def _fenced(lines: str) -> str:
    """Lines as they are, between fences longer than any that a name in them could be."""
    fence = "`" * (1 + max([2, *map(len, re.findall("`+", lines))]))
    shown = printable(lines, keep="\n")
    return f"{fence}\n{shown}\n{fence}"


def _plain(text: str) -> str:
    """Text on one line in which nothing of a file's names acts as Markdown or HTML, or commands a terminal that shows it."""
    return re.sub(r"([\\`*_~\[\]<>|#]|&(?=#?\w+;))", r"\\\1", printable(" ".join(text.split())))
