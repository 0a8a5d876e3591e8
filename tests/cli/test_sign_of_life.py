"""A word on the terminal before anything heavy is imported, gone before anything else is said."""

import io
import sys
import time

import pytest

from taskcal.cli import _takes_time
from taskcal.cli.output import info, sign_of_life, tell


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def as_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Standard error as a terminal; in the test itself, since what captures output puts its own in before."""
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_it_stands_there_until_something_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal = as_terminal(monkeypatch)
    with sign_of_life():
        assert terminal.getvalue() == "working …"
        tell("result")
        assert terminal.getvalue() == "working …\r\x1b[K"
        info("a message")
    assert terminal.getvalue() == "working …\r\x1b[Ka message\n"
    assert capsys.readouterr().out == "result\n"


def test_it_goes_at_the_end_and_is_not_written_where_nobody_watches(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = as_terminal(monkeypatch)
    with pytest.raises(KeyError), sign_of_life():
        raise KeyError
    assert terminal.getvalue() == "working …\r\x1b[K"
    plain = io.StringIO()
    monkeypatch.setattr(sys, "stderr", plain)
    with sign_of_life():
        info("a message")
    assert plain.getvalue() == "a message\n"


def test_help_and_completion_have_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _takes_time(["--import", "x", "identify", "a.csv"])
    for arguments in (["identify", "--help"], ["--version"], [], ["nothing"], ["--show-completion"]):
        assert not _takes_time(arguments)
    monkeypatch.setenv("_TASKCAL_COMPLETE", "complete_bash")
    assert not _takes_time(["identify"])


def test_it_says_for_how_long_until_something_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.modules["taskcal.cli.output"], "TICK", 0.01)
    terminal = as_terminal(monkeypatch)
    with sign_of_life():
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
