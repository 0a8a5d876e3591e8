"""What Windows and macOS do otherwise, imitated on Linux: nothing here has run on either.

Names in other letter case that are one file are held in tests/cli, encodings of terminals and tables in tests/cli and tests/tables.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from robot_programs.backup import lay_backup
from robot_programs.core.source import Backup
from taskcal.cli import main
from taskcal.errors import FileError
from taskcal.io import files
from taskcal.io.files import write_all, write_whole
from taskcal_groundwork import writing
from taskcal_groundwork.files import elsewhere_on_windows
from taskcal_groundwork.writing import put_in_place
from taskcal_studio import project

POSIX_ONLY = {
    "os": [
        "fork", "forkpty", "getppid", "geteuid", "getuid", "getgid", "killpg", "getpgid", "setsid", "sync", "fdatasync",
        "register_at_fork", "mkfifo", "sched_getaffinity", "O_NONBLOCK", "O_DIRECTORY", "O_CLOEXEC", "WNOHANG", "uname",
    ],
    "signal": ["SIGKILL", "SIGHUP", "SIGALRM", "SIGUSR1", "alarm", "setitimer", "pthread_sigmask", "pthread_kill"],
    "time": ["tzset"],
    "socket": ["AF_UNIX"],
}  # fmt: skip
"""Of Python's modules, what it documents as not available on Windows, and Taskcal might be tempted to use."""

NO_MODULES = ["fcntl", "grp", "pwd", "resource", "termios", "tty"]

WITHOUT_POSIX = f"""
import asyncio, importlib, joblib, multiprocessing, numba, pkgutil, platformdirs, sys, tempfile
import rich.console, rich.progress, rich.table, scipy.optimize, typer
import pyarrow.parquet, pandas, nicegui, distributed, xacrodoc, trimesh, openpyxl
from numba.core.caching import FunctionCache
for module, names in {POSIX_ONLY!r}.items():
    for name in names:
        if hasattr(sys.modules[module], name):
            delattr(sys.modules[module], name)
sys.modules |= dict.fromkeys({NO_MODULES!r})  # whoever imports one of them fails
sys.platform = "win32"
msvcrt = type(sys)("msvcrt")
sys.modules["msvcrt"] = msvcrt
import robot_programs, taskcal
count = 0
for package in (robot_programs, taskcal):
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not found.name.endswith("__main__"):
            importlib.import_module(found.name)
            count += 1
sys.platform = "linux"  # other packages, which are loaded meanwhile, would look for the system's own libraries
from taskcal.cli import main
assert main(["demo", "--count", "30", "--json"]) == 0
assert main(["doctor"]) == 0
print(count, "modules", file=sys.stderr)
"""


@pytest.mark.long
def test_all_modules_load_and_work_without_what_posix_alone_has(tmp_path: Path) -> None:
    """The demonstration reads, fits and writes where calls, signals and modules of POSIX are missing."""
    ended = subprocess.run(
        [sys.executable, "-c", WITHOUT_POSIX], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert ended.returncode == 0, ended.stderr
    assert int(ended.stderr.split()[-2]) > 200
    assert (tmp_path / "taskcal-demo" / "report.html").is_file()


LOST = ["nul", "NUL.csv", "con.tar.gz", "Com1.csv", "lpt¹.mod", "cal.json.", "cal.json ", "a:b.csv", "cal.json::$DATA"]
"""Names to which Windows writes without an error, and no such file is there."""


@pytest.mark.parametrize("name", LOST)
def test_names_that_are_no_files_on_windows_are_known(name: str) -> None:
    assert elsewhere_on_windows(name)


@pytest.mark.parametrize("name", ["nul.toml", "con.x.toml", "a:b.toml"])
def test_command_on_windows_refuses_a_name_that_is_no_file(name, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("taskcal.cli.run.sys", SimpleNamespace(**vars(sys) | {"platform": "win32"}))
    monkeypatch.chdir(tmp_path)
    Path("table.csv").write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n", encoding="utf-8")
    command = ["robots", "import", "table.csv", "--convention", "dh", "--name", "new", "-o"]
    assert main([*command, name]) == 1
    assert "name another file" in capsys.readouterr().err
    assert os.listdir() == ["table.csv"]
    assert main([*command, "console.toml"]) == 0


@pytest.mark.parametrize(
    "name", ["console.csv", "nulls.mod", "com.json", "com10.csv", ".hidden", "a b.csv", "con-file.csv"]
)
def test_ordinary_names_are_files_on_windows_too(name: str) -> None:
    assert elsewhere_on_windows(name) == ""


def held_open(source: str, target: str) -> None:
    raise PermissionError(13, "The process cannot access the file because it is being used by another process", target)


def test_file_that_another_program_holds_open_is_refused_and_stays(tmp_path, monkeypatch) -> None:
    """Windows does not rename over a file that a spreadsheet has open."""
    path = tmp_path / "table.csv"
    write_whole(path, "old")
    monkeypatch.setattr(os, "replace", held_open)
    with pytest.raises(FileError, match=r"table\.csv: cannot be written: .*used by another process"):
        write_all({path: "new", tmp_path / "more.csv": "more"})
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("table.csv", "old")]


def no_folders(path: Path, flags: int, *more: int) -> int:
    if Path(path).is_dir():
        raise PermissionError(13, "Permission denied", path)
    return os.open(path, flags, *more)


def killing(process: int, number: int) -> None:
    pytest.fail("os.kill(…, 0) sends Ctrl-C on Windows")


def test_writing_neither_opens_folders_nor_signals_processes_on_windows(tmp_path, monkeypatch) -> None:
    """A file of another process that may still run is left there, for nothing tells whether it does."""
    monkeypatch.setattr(
        writing, "os", SimpleNamespace(**vars(os) | {"name": "nt", "open": no_folders, "kill": killing})
    )
    write_all({tmp_path / "a.csv": "old", tmp_path / "b.csv": "old"})
    fresh, stale = (
        tmp_path / f"{writing.beside(Path('a.csv')).replace(str(os.getpid()), number)}x.part" for number in ("1", "2")
    )
    for file in (fresh, stale):
        file.touch()
    os.utime(stale, (0.0, 0.0))
    write_all({tmp_path / "a.csv": "new", tmp_path / "b.csv": "new"})
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {
        "a.csv": "new", "b.csv": "new", fresh.name: "",
    }  # fmt: skip


def test_backup_that_cannot_be_put_in_place_leaves_nothing(tmp_path, monkeypatch) -> None:
    """Windows does not rename a folder in which a file is open."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.mod").write_text("MODULE a\nENDMODULE\n")
    monkeypatch.setattr(os, "replace", held_open)
    with pytest.raises(FileError, match=r"out: cannot be written: .*used by another process"):
        put_in_place([lay_backup(Backup(path=tmp_path / "in", skipped=0), tmp_path / "out", [])])
    assert os.listdir(tmp_path) == ["in"]


class Locks(ModuleType):
    """Windows' locks of byte ranges, of which each byte has one holder."""

    LK_NBLCK = 2

    def __init__(self) -> None:
        super().__init__("msvcrt")
        self.taken: set[tuple[int, int]] = set()

    def locking(self, handle: int, mode: int, count: int) -> None:
        place = os.fstat(handle).st_ino, os.lseek(handle, 0, os.SEEK_CUR)
        assert (mode, count) == (self.LK_NBLCK, 1)
        if place in self.taken:
            raise PermissionError(13, "Permission denied")
        self.taken.add(place)


def test_project_is_locked_by_a_byte_that_hides_no_text_on_windows(tmp_path, monkeypatch) -> None:
    """A locked byte cannot be read by others, who are to read which process has the project."""
    locks = Locks()
    monkeypatch.setitem(sys.modules, "msvcrt", locks)
    monkeypatch.setattr(sys, "platform", "win32")
    spec = importlib.util.spec_from_file_location("files_on_windows", files.__file__)
    assert spec is not None
    assert spec.loader is not None
    there = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(there)
    monkeypatch.setattr(project, "take_lock", there.take_lock)
    lock = project.FolderLock(tmp_path)
    lock.tell("http://localhost:1")
    with pytest.raises(FileError, match=rf"in another studio already \(process {os.getpid()}, http://localhost:1\)"):
        project.FolderLock(tmp_path)
    assert {place > 10_000 for _, place in locks.taken} == {True}
    lock.release()
