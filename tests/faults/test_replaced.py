"""Files that are replaced while they are read, two processes at one file, and a clock that goes backwards."""

import itertools
import os
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest

from robot_programs.backup import lay_backup, open_backup
from taskcal.cli import main
from taskcal.errors import FileError
from taskcal.io.files import write_all, write_whole
from taskcal.reading import chunked as chunked_campaign
from taskcal.reading.chunked import campaign_in_chunks
from taskcal.robot.catalogue import load_robot
from taskcal.tables.parquet import parquet_of
from taskcal_groundwork import writing
from taskcal_groundwork.writing import put_in_place
from tests.faults.kills import digests
from tests.reading.known_campaign import ROBOT

TABLE = "joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n"
MODULE = (
    "MODULE Part\nPROC main()\n"
    "MoveJ [[500,0,500],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v5,fine,tool0;\nENDPROC\nENDMODULE\n"
)


def packed(path, parts):
    with zipfile.ZipFile(path, "w") as made:
        for name, text in parts.items():
            made.writestr(name, text)


def test_campaign_changed_during_chunked_read_is_rejected(tmp_path, monkeypatch):
    """A campaign that changes while it is read in chunks is rejected."""
    header = ["id", *(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    path = tmp_path / "large.parquet"
    rng = np.random.default_rng(0)
    rows = [[str(k), *map(repr, rng.uniform(-90, 90, 6).tolist()), "500.5", "1.5", repr(300.0 + k)] for k in range(60)]
    path.write_bytes(parquet_of(header, rows[:40]))
    with campaign_in_chunks(path, ROBOT) as campaign:
        assert campaign.rows == 40
    sample = chunked_campaign.every_row

    def replaced(*arguments):
        out = sample(*arguments)
        write_whole(path, parquet_of(header, rows))
        return out

    monkeypatch.setattr(chunked_campaign, "every_row", replaced)
    with (
        pytest.raises(FileError, match=r"large\.parquet: was changed while it was read"),
        campaign_in_chunks(path, ROBOT),
    ):
        pass


@pytest.mark.parametrize("kind", ["zip", "folder"])
def test_backup_is_not_written_if_its_program_disappeared(kind, tmp_path):
    """A backup whose program has disappeared since it was opened is not written."""
    path, out = (tmp_path / name for name in (("b.zip", "c.zip") if kind == "zip" else ("b", "c")))
    if kind == "zip":
        packed(path, {"Part.mod": MODULE, "notes.txt": "1"})
    else:
        path.mkdir()
        (path / "Part.mod").write_text(MODULE)
        (path / "notes.txt").write_text("1")
    backup, sources = open_backup(path)
    if kind == "zip":
        packed(path, {"notes.txt": "2"})
    else:
        (path / "Part.mod").unlink()
    with pytest.raises(FileError, match=r"was replaced while it was read: Part\.mod is not in it any more"):
        put_in_place([lay_backup(backup, out, sources)])
    assert sorted(p.name for p in tmp_path.iterdir()) == [path.name]


@pytest.mark.parametrize("kind", ["zip", "folder"])
def test_next_backup_removes_remains_of_killed_process(kind, tmp_path):
    """The next backup removes the temporary files of a killed process."""
    path, out = (tmp_path / name for name in (("b.zip", "c.zip") if kind == "zip" else ("b", "c")))
    if kind == "zip":
        packed(path, {"Part.mod": MODULE})
    else:
        path.mkdir()
        (path / "Part.mod").write_text(MODULE)
    code = (
        "import os, sys, signal; from robot_programs import backup\n"
        "os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "found, sources = backup.open_backup(sys.argv[1]); from taskcal_groundwork.writing import put_in_place\n"
        "put_in_place([backup.lay_backup(found, sys.argv[2], sources)])"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(path), str(out)], check=False)
    assert ended.returncode < 0
    assert len(list(tmp_path.iterdir())) == 2
    backup, sources = open_backup(path)
    put_in_place([lay_backup(backup, out, sources)])
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([path.name, out.name])


def test_write_accepts_longest_file_name_and_rejects_longer(tmp_path):
    """A file name may be as long as the disk allows; the error for a longer one names it."""
    path = tmp_path / ("ä" * 125 + ".csv")
    write_whole(path, "1")
    assert path.read_text() == "1"
    with pytest.raises(FileError, match="cannot be written: File name too long"):
        write_whole(tmp_path / ("a" * 300), "1")


def test_a_clock_that_goes_backwards_changes_nothing(tmp_path, monkeypatch):
    (tmp_path / "table.csv").write_text(TABLE)
    back = itertools.count()
    monkeypatch.setattr(time, "time", lambda: 1e9 - 1e5 * next(back))
    monkeypatch.chdir(tmp_path)
    # of another machine, as on a shared disk: it may still be at it
    (tmp_path / ".new.toml.1-elsewhere.x.part").write_text("half")
    for _ in range(2):
        assert main(["robots", "import", "table.csv", "--convention", "dh", "-o", "new.toml"]) == 0
        os.utime("new.toml", (4e9, 4e9))
    assert len(load_robot(tmp_path / "new.toml").joints) == 1
    assert (tmp_path / ".new.toml.1-elsewhere.x.part").exists()


WRITES = (
    "import sys; from taskcal.io.files import write_all\n"
    "for k in range(300): write_all({name: sys.argv[1] * 20_000 for name in sys.argv[2:]})"
)


def test_concurrent_writes_leave_one_complete_set_of_files(tmp_path):
    """Two processes that write the same files leave those of one of them."""
    names = [str(tmp_path / name) for name in "ab"]
    both = [subprocess.Popen([sys.executable, "-c", WRITES, letter, *names]) for letter in "xy"]
    seen = set()
    while any(process.poll() is None for process in both):
        for name in names:
            if os.path.exists(name):
                with open(name) as stream:
                    seen.add(stream.read())
    assert [process.returncode for process in both] == [0, 0]
    assert seen <= {"x" * 20_000, "y" * 20_000}
    assert set(os.listdir(tmp_path)) == {"a", "b"}
    assert digests(tmp_path).keys() == {tmp_path / "a", tmp_path / "b"}


def test_removes_stale_temp_file_with_future_mtime(tmp_path):
    """A temporary file of a dead process is removed although its modification time is in the future."""
    path = tmp_path / "a.csv"
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    stray = tmp_path / writing.beside(path).replace(str(os.getpid()), str(gone.pid))
    stray = stray.with_name(f"{stray.name}x{writing.PART}")
    stray.write_text("half")
    os.utime(stray, (4e9, 4e9))
    write_all({path: "whole"})
    assert list(tmp_path.iterdir()) == [path]
