"""taskcal identify: files that cannot be read or written."""

import errno
import json
import os
from pathlib import Path

import pytest

from tests.cli.commands.test_identify import identify
from tests.cli.conftest import Run


def test_an_old_calibration_is_replaced_only_by_a_whole_new_one(run: Run, cell: Path, tmp_path: Path) -> None:
    output = tmp_path / "cal.json"
    output.write_text("the old one")
    assert identify(run, cell / "one.csv", output, "--rows", "0:2", "--force").status == 1
    assert output.read_text() == "the old one"
    assert identify(run, cell / "one.csv", output, "--force").status == 0
    assert json.loads(output.read_text())["format"] == "taskcal-calibration"
    assert list(tmp_path.iterdir()) == [output]


def test_where_nothing_can_be_written(run: Run, cell: Path, tmp_path: Path) -> None:
    missing = identify(run, cell / "one.csv", tmp_path / "none" / "a.json")
    folder = identify(run, cell / "one.csv", tmp_path)
    itself = identify(run, cell / "one.csv", cell / "one.csv")
    assert [ended.status for ended in (missing, folder, itself)] == [1, 1, 1]
    assert "there is no folder" in missing.err
    assert "it is a folder" in folder.err
    assert "would overwrite an input file" in itself.err


def test_a_folder_that_is_closed_to_us(run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda _, mode: mode != os.W_OK)
    ended = identify(run, cell / "one.csv", tmp_path / "a.json")
    assert ended.status == 1
    assert "no permission to write in" in ended.err


def test_a_file_that_is_closed_to_us(run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = os.open

    def refuse(path: Path, flags: int, *rest: int, **others: int) -> int:
        if Path(path).name == "one.csv":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return opened(path, flags, *rest, **others)

    monkeypatch.setattr("os.open", refuse)
    monkeypatch.setattr("os.access", lambda _, mode: mode != os.R_OK)
    ended = identify(run, cell / "one.csv", tmp_path / "a.json", robot="ur5")
    assert ended.status == 1
    assert "cannot be read: Permission denied" in ended.err
