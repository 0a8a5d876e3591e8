"""A sample of what `python -m tests.faults.kills` does."""

import random

import pytest

from tests.cli.interruptions import COMMANDS, prepare
from tests.faults.kills import check, faults, is_whole


@pytest.mark.parametrize(
    ("name", "whole", "half"),
    [
        ("a.json", b'{"a": 1}', b'{"a": '), ("a.csv", b"a,b\n1,2\n", b"a,b\n1,"), ("a.toml", b"a = 1", b"a ="),
        ("a.html", b"<html></html>\n", b"<html>"), ("a.urdf", b"<robot/>", b"<robot"), ("a.csv", b"\n", b""),
    ],
)  # fmt: skip
def test_half_a_file_and_a_changed_input_are_found(name, whole, half, tmp_path):
    path, read = tmp_path / name, tmp_path / "read.csv"
    read.write_text("1\n")
    before = {read: "another digest"}
    path.write_bytes(whole)
    assert is_whole(path)
    assert faults(tmp_path, before, [path]) == ["changed ['read.csv']"]
    path.write_bytes(half)
    assert faults(tmp_path, {}, [path]) == [f"not whole: ['{name}']"]


@pytest.mark.long
@pytest.mark.parametrize("command", ["import", "convert", "identify", "plan", "fleet"])
def test_killed_command_leaves_no_partial_file(command, tmp_path, monkeypatch):
    """A killed command leaves no partial file, and the next run succeeds."""
    monkeypatch.setenv("TASKCAL_STATE_DIR", str(tmp_path / "state"))
    folder = tmp_path / "folder"
    folder.mkdir()
    prepare(folder)
    killed, wrong = check(folder, COMMANDS[command], 6, random.Random(0))
    assert not wrong
    assert killed >= 1
