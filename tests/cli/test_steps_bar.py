"""The bar that knows its end."""

import re

import pytest

from taskcal.cli.output import bar_by_parts, bar_over, working


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")


def counted(text: str) -> list[str]:
    """Fractions shown, each once in a row."""
    shown = re.findall(r"\d+/\d+", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text))
    return [one for i, one in enumerate(shown) if i == 0 or one != shown[i - 1]]


def test_the_bar_counts_steps_to_their_end_and_passes_over_some(terminal, capsys):
    with bar_over(["one", "two", "two", "three", "four"]) as begin:
        for step in ("one", "two", "two", "something else", "four"):
            begin(step)
    error = capsys.readouterr().err
    assert counted(error) == ["0/5", "1/5", "2/5", "4/5", "5/5"]
    assert "something else" in error


def test_nothing_is_written_where_nobody_watches(capsys):
    with bar_over(["one", "two"]) as begin:
        begin("one")
    assert capsys.readouterr().err == ""


def test_work_without_names_counts_its_steps_to_the_end(terminal, capsys):
    with working("one", steps=4) as begin:
        for step in ("one", "two", "three"):
            begin(step)
    error = capsys.readouterr().err
    assert counted(error) == ["0/4", "1/4", "2/4", "4/4"]
    assert "0:00:0" in error


def test_more_steps_than_were_foreseen_do_not_pass_the_end(terminal, capsys):
    with working("one", steps=2) as begin:
        for step in "abcdef":
            begin(step)
    assert counted(capsys.readouterr().err) == ["0/2", "1/2", "2/2"]


def test_a_bar_begins_anew_with_each_part_of_the_work(terminal, capsys):
    with bar_by_parts("reading") as show:
        for part, of in (("single ones", 3), ("pairs", 2)):
            for done in range(of):
                show(part, done, of)
    error = capsys.readouterr().err
    assert counted(error) == ["0/1", "0/3", "1/3", "2/3", "0/2", "1/2"]
    assert "single ones" in error
