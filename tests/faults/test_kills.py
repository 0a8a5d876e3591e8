"""A sample of what `python -m tests.faults.kills` does."""

import random
import zipfile
from functools import partial
from itertools import count
from pathlib import Path

import pytest

from taskcal.cli import main, output
from taskcal.io.files import finish_writing
from tests.cli.interruptions import COMMANDS, prepare
from tests.faults.kills import check, faults, is_whole
from tests.faults.points import WROTE, at_point
from tests.faults.test_replaced import MODULE


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


@pytest.mark.long
@pytest.mark.parametrize("command", ["simulate", "plan", "correct", "zip"])
def test_command_killed_at_any_call_wrote_all_or_none(command, tmp_path, monkeypatch):
    """All files of a command that writes several, at every call by which it writes them."""
    prepare(tmp_path)
    monkeypatch.chdir(tmp_path)
    if command == "zip":
        with zipfile.ZipFile("in.zip", "w") as made:
            made.writestr("Part.mod", MODULE)
    line = {"zip": "correct -c cal.json in.zip -o out.zip --accept-uncertain --report new.html"} | COMMANDS
    written, write = [], output.write_all

    def keep(*arguments):
        written.append(arguments)

    monkeypatch.setattr(output, "write_all", keep)
    main(line[command].split())
    ((contents, *lay),) = written
    own = [*contents, *([Path("out.zip")] if command == "zip" else [])]
    assert len(own) > 1
    found = []
    for point in count():
        ended = at_point(partial(write, contents, *lay), point)
        finish_writing(tmp_path)
        there = [path.exists() for path in own]
        assert len(set(there)) == 1, (point, there)
        found.append(there[0])
        for path in own:
            path.unlink(missing_ok=True)
        if ended == WROTE:
            break
    assert found == sorted(found)
    assert len(found) > 20
