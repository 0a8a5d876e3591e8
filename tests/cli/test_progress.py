"""The word and the bars that show progress."""

import io
import re
import sys
import time

import pytest

from taskcal.cli.app import _takes_time
from taskcal.cli.output import info, tell
from taskcal.cli.progress import bar_by_parts, bar_over, working


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")


def counted(text: str) -> list[str]:
    """Fractions shown, each once in a row."""
    shown = re.findall(r"\d+/\d+", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text))
    return [one for i, one in enumerate(shown) if i == 0 or one != shown[i - 1]]


def test_bar_counts_named_steps_and_passes_over_some(terminal, capsys):
    with bar_over(["one", "two", "two", "three", "four"]) as begin:
        for step in ("one", "two", "two", "something else", "four"):
            begin(step)
    error = capsys.readouterr().err
    assert counted(error) == ["0/5", "1/5", "2/5", "4/5", "5/5"]
    assert "something else" in error


def test_no_bar_without_a_terminal(capsys):
    with bar_over(["one", "two"]) as begin:
        begin("one")
    assert capsys.readouterr().err == ""


def test_bar_counts_steps_without_names(terminal, capsys):
    with bar_over(["one"], 4) as begin:
        for step in ("one", "two", "three"):
            begin(step)
    error = capsys.readouterr().err
    assert counted(error) == ["0/4", "1/4", "2/4", "4/4"]
    assert "0:00:0" in error


def test_bar_does_not_pass_its_end(terminal, capsys):
    with bar_over(["one"], 2) as begin:
        for step in "abcdef":
            begin(step)
    assert counted(capsys.readouterr().err) == ["0/2", "1/2", "2/2"]


def test_bar_by_parts_starts_at_zero_for_each_part(terminal, capsys):
    with bar_by_parts("reading") as show:
        for part, of in (("single ones", 3), ("pairs", 2)):
            for done in range(of):
                show(part, done, of)
    error = capsys.readouterr().err
    assert counted(error) == ["0/1", "0/3", "1/3", "2/3", "0/2", "1/2"]
    assert "single ones" in error


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def as_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Standard error as a terminal; in the test itself, since what captures output puts its own in before."""
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_word_goes_before_anything_is_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal = as_terminal(monkeypatch)
    with working():
        assert terminal.getvalue() == "working …"
        tell("result")
        assert terminal.getvalue() == "working …\r\x1b[K"
        info("a message")
    assert terminal.getvalue() == "working …\r\x1b[Ka message\n"
    assert capsys.readouterr().out == "result\n"


def test_word_goes_at_the_end_and_needs_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = as_terminal(monkeypatch)
    with pytest.raises(KeyError), working():
        raise KeyError
    assert terminal.getvalue() == "working …\r\x1b[K"
    plain = io.StringIO()
    monkeypatch.setattr(sys, "stderr", plain)
    with working():
        info("a message")
    assert plain.getvalue() == "a message\n"


def test_help_and_completion_show_no_word(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _takes_time(["--import", "x", "identify", "a.csv"])
    for arguments in (["identify", "--help"], ["--version"], [], ["nothing"], ["--show-completion"]):
        assert not _takes_time(arguments)
    monkeypatch.setenv("_TASKCAL_COMPLETE", "complete_bash")
    assert not _takes_time(["identify"])


def test_word_counts_the_seconds(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys.modules["taskcal.cli.progress"], "TICK_S", 0.01)
    terminal = as_terminal(monkeypatch)
    with working():
        until = time.monotonic() + 20.0
        while terminal.getvalue().count("\rworking … 0 s") < 2 and time.monotonic() < until:
            time.sleep(0.01)
        tell("result")
        said = terminal.getvalue()
        time.sleep(0.05)
    assert said.startswith("working …\rworking … 0 s\rworking … 0 s")
    assert terminal.getvalue() == said
    assert said.endswith("\r\x1b[K")
    assert capsys.readouterr().out == "result\n"
