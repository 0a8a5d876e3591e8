"""Every table and every help of the command line at 80 and at 60 columns."""

from pathlib import Path

import pytest

from taskcal.cli import output
from taskcal.cli.app import SUMMARIES
from taskcal.report import content as layout
from tests.cli.conftest import IRB6660, Run
from tests.laws.fleets import lay_calibrations


def commands(cell: Path, folder: Path) -> list[list[object]]:
    robot = ["--robot", IRB6660]
    return [
        ["robots"],
        ["robots", IRB6660],
        ["identify", *robot, cell / "one.csv", "-o", folder / "a.json", "--holdout", "0.3", "--parameters"],
        ["validate", cell / "cal.json", cell / "one.csv"],
        ["compare", cell / "cal.json", folder / "a.json", "--parameters"],
        ["sensitivity", *robot, "--task", cell / "list.toml"],
        ["fleet", lay_calibrations(folder / "fleet")],
        ["register", *robot, cell / "three.csv", "-o", folder / "reg.json"],
    ]


def test_no_word_of_a_table_is_broken_and_no_line_is_too_wide(
    run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each command runs once; what it shows is laid out at both widths."""
    tables = []
    plain = layout.lay_out_table

    def note(*given: object) -> list[str]:
        tables.append(given)
        return plain(*given)

    monkeypatch.setattr(output, "lay_out_table", note)
    for command in commands(cell, tmp_path):
        ended = run(*command)
        assert ended.status == 0, ended.err
        for line in ended.out.splitlines():
            assert len(line) <= 80 or str(tmp_path) in line, command
    assert len(tables) > 11
    for header, groups, left, _, spare in tables:
        for width in (80, 60):
            lines = plain(header, groups, left, width, spare)
            assert max(map(len, lines)) <= width, lines
            shown = {word for line in lines for word in line.split()}
            kept = [k for k in range(len(header)) if k not in spare]
            assert {word for _, rows in groups for row in rows for k in kept for word in row[k].split()} <= shown


@pytest.mark.parametrize("width", [80, 60])
def test_no_word_of_a_help_is_broken(run: Run, monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    wide: dict[str, set[str]] = {}
    for columns in (2000, width):
        monkeypatch.setenv("COLUMNS", str(columns))
        for name in [*(SUMMARIES.keys() - {"robots"}), "robots import", "robots show"]:
            words = set(run(*name.split(), "--help").out.split())
            missing = wide.setdefault(name, words) - words
            # lists of choices and marks such as "[default:" may stand otherwise, but nothing is cut
            assert not {word for word in missing if word.isalpha()}, name


def test_a_message_is_cut_between_words_for_a_terminal_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal:
        def __init__(self, is_one: bool) -> None:
            self.is_one = is_one

        def isatty(self) -> bool:
            return self.is_one

    monkeypatch.setenv("COLUMNS", "60")
    message = "word " * 40 + "/a/path/that/is/much/longer/than/the/line/and/has/no/space/in/it/at/all.csv"
    folded = output._folded(message, Terminal(True)).split("\n")
    assert all(len(line) <= 60 for line in folded[:-1])
    assert folded[-1].startswith("/a/path")
    assert folded[-1].endswith("all.csv")
    assert output._folded(message, Terminal(False)) == message
