"""Several files of one command: all old or all new to whoever reads them next, wherever the process was killed."""

import os
import zipfile
from functools import partial
from itertools import count
from pathlib import Path

import pytest

from robot_programs.backup import lay_backup, open_backup
from taskcal.errors import FileError
from taskcal.io.files import finish_writing, write_all
from taskcal_groundwork import writing
from taskcal_groundwork.files import read_bytes
from tests.faults.points import KILLED, REFUSED, SURVIVED, WROTE, at_point

MODULE = (
    "MODULE Part\nPROC main()\n"
    "MoveJ [[500,0,500],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v5,fine,tool0;\nENDPROC\nENDMODULE\n"
)
OLD = {"a.csv": b"old", "pages/b.html": b"old page"}
NEW = {"a.csv": b"new", "pages/b.html": b"new page", "pages/c.md": b"more", "d.json": b"{}"}


def lay_out(folder: Path, kind: str) -> partial:
    """The old files, and what writes the new ones."""
    (folder / "pages").mkdir(parents=True)
    for name, content in OLD.items():
        (folder / name).write_bytes(content)
    contents = {folder / name: content for name, content in NEW.items()}
    if kind == "files":
        return partial(write_all, contents)
    backup = folder / ("in.zip" if kind == "zip" else "in")
    if kind == "zip":
        with zipfile.ZipFile(backup, "w") as made:
            made.writestr("Part.mod", MODULE)
    else:
        backup.mkdir()
        (backup / "Part.mod").write_text(MODULE)
        (folder / "out").mkdir()  # an empty one may be named
    found, sources = open_backup(backup)
    return partial(write_all, contents, partial(lay_backup, found, folder / f"out{backup.suffix}", sources))


def seen(folder: Path, kind: str) -> str:
    """What a reader finds: old, new, or a mixture."""
    content = {}
    for name in NEW:
        try:
            content[name] = read_bytes(folder / name)
        except FileError:
            continue
    if kind != "files":
        out = folder / ("out.zip" if kind == "zip" else "out")
        there = out.is_file() or (out / "Part.mod").exists()
        if there != (content == NEW):
            return f"a mixture: {content}, {out.name} {'is' if there else 'is not'} there"
    return {repr(OLD): "old", repr(NEW): "new"}.get(repr(content), f"a mixture: {content}")


def left(folder: Path) -> list[str]:
    return [path.name for path in folder.rglob("*.part")]


@pytest.fixture(scope="module")
def calls(tmp_path_factory):
    """How many calls that write the files take."""
    folder = tmp_path_factory.mktemp("calls")
    return next(k for k in count() if at_point(lay_out(folder / str(k), "files"), k) == WROTE)


@pytest.mark.parametrize("kind", ["files", "zip", "folder"])
def test_kill_at_any_call_leaves_all_old_or_all_new(kind, tmp_path):
    """Also to who finds the folder elsewhere: what is left of a command names its files from where it lies."""
    found = []
    for point in count():
        folder = tmp_path / str(point)
        write = lay_out(folder, kind)
        ended = at_point(write, point)
        found.append(seen(folder.rename(tmp_path / "moved"), kind))
        (tmp_path / "moved").rename(folder)
        if ended == WROTE:
            break
        assert ended == KILLED
        if found[-1] == "new":
            continue
        write()  # the next run ends well, and takes away what was left
        assert (seen(folder, kind), left(folder)) == ("new", [])
    assert found == sorted(found, reverse=True), "first old, from some call on new"
    assert set(found) == {"old", "new"}
    assert len(found) > 30
    assert left(folder) == []


@pytest.mark.parametrize("kind", ["files", "zip", "folder"])
def test_full_disk_at_any_call_leaves_all_old(kind, tmp_path):
    """From some call on, whatever it was, nothing more can be created."""
    for point in count():
        folder = tmp_path / str(point)
        ended = at_point(lay_out(folder, kind), point, full=True)
        if ended == WROTE:
            break
        state = seen(folder, kind)
        assert (ended, state) in ((REFUSED, "old"), (SURVIVED, "new")), point
        if ended == SURVIVED:  # in taking the journal away: the next that writes does that
            write_all({folder / name: b"" for name in NEW})
        assert left(folder) == []
    assert point > 15
    assert seen(folder, kind) == "new"


@pytest.mark.parametrize(("after", "state"), [(0.5, "old"), (0.7, "new"), (0.8, "new")])
def test_reader_that_is_killed_leaves_it_to_the_next(after, state, calls, tmp_path):
    """A kill while a killed command's journal is finished, at every call of that."""
    for point in count():
        folder = tmp_path / str(point)
        assert at_point(lay_out(folder, "files"), int(after * calls)) == KILLED
        ended = at_point(partial(finish_writing, folder), point)
        assert seen(folder, "files") == state, point
        if ended == WROTE:
            break
    assert seen(folder, "files") == state


def test_everything_is_on_the_disk_before_the_mark_that_decides(tmp_path, monkeypatch):
    """And new names are before journals go: a power failure loses what was not asked onto the disk."""
    synced, replaced = [], []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(
        writing.os, "fsync", lambda handle: (synced.append(os.readlink(f"/proc/self/fd/{handle}")), fsync(handle))
    )
    monkeypatch.setattr(
        writing.os, "replace", lambda part, path: (replaced.append((len(synced), str(part))), replace(part, path))
    )
    lay_out(tmp_path / "x", "files")()
    (mark,) = [k for k, name in enumerate(synced) if Path(name).name.startswith(".mark.")]
    folder = str(tmp_path / "x")
    assert len(replaced) == len(NEW)
    assert {part for _, part in replaced} <= set(synced[:mark])
    assert {folder, f"{folder}/pages"} <= set(synced[:mark])
    assert synced[mark + 1] == folder
    assert all(before == mark + 2 for before, _ in replaced)
    assert {folder, f"{folder}/pages"} <= set(synced[mark + 2 : mark + 4])


def test_journal_that_cannot_be_finished_is_an_error(calls, tmp_path, monkeypatch):
    """Half of the files would be taken for all of them."""
    folder = tmp_path / "x"
    assert at_point(lay_out(folder, "files"), int(0.65 * calls)) == KILLED

    def denied(*_):
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(writing.os, "replace", denied)
        with pytest.raises(FileError, match=r"\.journal\..* is left of an interrupted command.* Permission denied"):
            read_bytes(folder / "a.csv")
    assert seen(folder, "files") == "new"
