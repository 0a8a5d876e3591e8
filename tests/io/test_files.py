import os
import subprocess
import sys
import time
from unittest.mock import Mock

import pytest

from taskcal.errors import FileError
from taskcal.io.files import write_all, write_whole
from taskcal_groundwork import writing


@pytest.mark.parametrize("content", ["σ = 15 µm\n", b"\x00\xff"])
def test_what_is_written_is_what_was_given(tmp_path, content):
    path = tmp_path / "out"
    write_whole(path, content)
    assert path.read_bytes() == (content.encode("utf-8") if isinstance(content, str) else content)
    assert list(tmp_path.iterdir()) == [path]


def test_new_file_has_default_mode_and_old_file_keeps_mode(tmp_path):
    """A new file has the default mode, and an existing one keeps its mode."""
    write_whole(tmp_path / "new", "")
    (tmp_path / "other").write_text("")
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "other").stat().st_mode
    (tmp_path / "old").write_text("")
    (tmp_path / "old").chmod(0o640)
    write_whole(tmp_path / "old", "more")
    assert (tmp_path / "old").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_interrupted_write_keeps_old_file_and_no_temp_file(tmp_path, monkeypatch, failure):
    """An interrupted write keeps the old file and leaves no temporary file."""
    path = tmp_path / "out"
    path.write_text("old")

    def fail(*_):
        raise failure

    monkeypatch.setattr(writing.os, "replace", fail)
    with pytest.raises((FileError, KeyboardInterrupt)) as caught:
        write_whole(path, "new")
    if isinstance(failure, OSError):
        assert "cannot be written: No space left on device" in str(caught.value)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(FileError, match=r"none.out: cannot be written: .*; name a folder that exists"):
        write_whole(tmp_path / "none" / "out", "")


def test_a_folder_in_the_way_is_named(tmp_path):
    (tmp_path / "out").mkdir()
    with pytest.raises(FileError, match=r"out: cannot be written"):
        write_whole(tmp_path / "out", "")
    assert os.listdir(tmp_path) == ["out"]


def test_files_that_belong_together_are_written_all_or_none(tmp_path):
    first, second = tmp_path / "a.mod", tmp_path / "folder"
    first.write_text("old")
    second.mkdir()
    with pytest.raises(FileError, match="folder"):
        write_all({first: "new", second: "new"})
    assert first.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mod", "folder"]
    write_all({first: "new", tmp_path / "b.mod": b"more"})
    assert (first.read_text(), (tmp_path / "b.mod").read_bytes()) == ("new", b"more")


def test_cleanup_removes_only_temp_files_of_dead_processes(tmp_path):
    """Temporary files of a killed process are removed by the next write; those of a running one are kept."""
    path, other = tmp_path / "a.csv", tmp_path / "b.csv"
    code = (
        "import os, sys, signal; from taskcal.io import files; os.fsync = lambda *_: os.kill(os.getpid(), signal.SIGKILL); "
        "files.write_all({path: 'half' for path in sys.argv[1:]})"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(path), str(other)], check=False)
    assert ended.returncode != 0
    assert [stray.name[:7] for stray in tmp_path.iterdir()] == [".a.csv."]
    running = writing.lay_file(path, b"of this process").part
    write_all({path: "whole", other: "whole"})
    assert sorted(tmp_path.iterdir()) == sorted([path, other, running])


def test_files_of_processes_that_are_not_ours_are_kept(tmp_path, monkeypatch):
    """Another user's, whom no signal reaches; those of another machine for an hour."""
    monkeypatch.setattr(writing.os, "kill", Mock(side_effect=PermissionError))
    theirs = writing.lay_file(tmp_path / "a.csv", b"of another user").part
    now, before = (tmp_path / f".a.csv.1-elsewhere.{name}.part" for name in ("now", "before"))
    for stray, age in ((now, 0.9), (before, 1.1)):
        stray.touch()
        os.utime(stray, (time.time() - age * 3600.0,) * 2)
    write_all({tmp_path / "a.csv": "whole"})
    assert sorted(tmp_path.iterdir()) == sorted([theirs, now, tmp_path / "a.csv"])


def test_interrupt_between_files_leaves_consistent_set(tmp_path, monkeypatch):
    """An interrupt between two files does not leave an old file next to a new one."""
    paths = [tmp_path / name for name in "abc"]
    for path in paths:
        path.write_text("old")
    replace, calls = os.replace, []

    def interrupted(source, target):
        replace(source, target)
        calls.append(target)
        if len(calls) == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(writing.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_all(dict.fromkeys(paths, "new"))
    assert [path.read_text() for path in paths] == ["new"] * 3
    assert sorted(tmp_path.iterdir()) == paths
