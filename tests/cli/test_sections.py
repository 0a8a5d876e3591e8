"""Sections are shown alike: whatever a block says stands on the page and, but for figures, on the terminal."""

from typing import get_args

import pytest

from taskcal.cli.output import show_sections
from taskcal.report.chart import Axis, Figure, Panel, Series
from taskcal.report.content import (
    Block,
    Bullets,
    Chart,
    Commands,
    Facts,
    NextStep,
    Numbers,
    Section,
    Text,
    TextTable,
    Viewer,
)
from taskcal.report.page import Report

FIGURE = Figure(panels=(Panel(x=Axis(), y=Axis(), series=(Series(x=[0.0, 1.0], y=[0.0, 1.0]),)),))
SAID: dict[type, tuple[Block, list[str]]] = {
    TextTable: (
        TextTable.of_rows("title here", ("header",), [("cell",), ("other cell",)], note="noted below"),
        ["title here", "header", "cell", "other cell", "noted below"],
    ),
    Text: (Text("a paragraph"), ["a paragraph"]),
    Bullets: (Bullets("one statement", "another"), ["one statement", "another"]),
    Numbers: (Numbers(("0.123", "mm", "of something")), ["0.123 mm", "of something"]),
    Facts: (Facts(("label", "what is stated"), None), ["label", "what is stated"]),
    NextStep: (NextStep("do this"), ["ext", "do this"]),
    Commands: (Commands("taskcal plan"), ["taskcal plan"]),
    Chart: (Chart("a chart", FIGURE), ["a chart"]),
    Viewer: (Viewer(title="a scene"), ["a scene"]),
}


def test_every_kind_of_block_is_among_them() -> None:
    assert set(SAID) == set(get_args(Block))


@pytest.mark.parametrize("kind", SAID, ids=lambda kind: kind.__name__)
def test_what_a_block_says_is_shown(kind: type, capsys: pytest.CaptureFixture[str]) -> None:
    block, words = SAID[kind]
    section = Section("heading", block)
    show_sections([section])
    shown = " ".join(capsys.readouterr().out.split())
    page = Report(title="page", sections=[section])
    html = " ".join(page.html().replace("<small>", "").split())
    for word in words:
        assert (word in shown) == (kind not in (Chart, Viewer)), word
        assert word in html, word


def test_sections_are_apart_and_steps_are_labelled_once(capsys: pytest.CaptureFixture[str]) -> None:
    show_sections(
        [Section("", "first", NextStep("one"), NextStep("two")), Section("", Facts(("a", "b")), "c"), Section("")]
    )
    assert capsys.readouterr().out.splitlines() == ["first", "next  one", "      two", "", "a  b", "c"]


def test_tables_without_rows_are_no_part_of_a_section() -> None:
    assert Section("", TextTable.of_rows("none", ("a",), []), None, "words").blocks == (Text("words"),)
