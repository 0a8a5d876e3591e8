"""A report as text has its words, its tables and its figures' files, and nothing of a name acts as markup."""

import plotly.graph_objects as go

from taskcal.report.content import Chart, Commands, Numbers, Points, Scene, Section, Table, Text
from taskcal.report.page import Page, as_markdown, figures_of


def _page(words: str) -> Page:
    table = Table(title=words, header=("a", words), groups=((words, ((words, "1"),)),), note=words)
    blocks = (
        Text((words,)),
        Points((words,)),
        Numbers(((words, "mm", words),)),
        Commands("taskcal"),
        table,
        Chart(title=words, figure=go.Figure(), note=words),
        Scene(title="in space", note=words),
    )
    return Page(
        title=words, sections=(Section(title=words, blocks=blocks),), lead=words, footer=words, header=((words, words),)
    )


def test_every_block_is_there() -> None:
    page = _page("words")
    text = as_markdown(page, {"words": "figures/01-words.png"})
    assert text.startswith("# words\n")
    assert "## 1. words\n" in text
    assert "| a | words |\n|:--|--:|\n| words |  |\n| words | 1 |\n" in text
    assert "![words](figures/01-words.png)" in text
    assert "**Figure: in space**" in text
    assert text.count("words") >= 14
    assert list(figures_of(page).values()) == ["01-words", "02-in-space"]


def test_nothing_becomes_markup() -> None:
    hostile = "<b>|`*_[a](b)\n# c"
    text = as_markdown(_page(hostile))
    assert "<b>" not in text.replace("\\<b\\>", "")
    assert "\n# c" not in text
    assert all(line.count("|") - line.count("\\|") in (0, 3) for line in text.splitlines())
