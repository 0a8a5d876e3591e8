"""Folders and zip files with a program in them: hostile ones are refused, and others written again as they were."""

import os
import stat
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from robot_programs import backup as backup_module
from robot_programs.backup import lay_backup, open_backup
from robot_programs.core.source import Source
from robot_programs.reading import read_program
from taskcal.errors import FileError
from taskcal.robot.catalogue import load_robot
from taskcal_groundwork.writing import put_in_place
from tests.robot_programs.rapid.samples import POINTS
from tests.robot_programs.tp.samples import joints, listing

MAIN = "MoveL p1,v5,fine,tool0;\nMoveL p2,v5,fine,tMiss;\nMoveL p3,v5,fine,tMiss;\n"
MODULE = f"MODULE Part\n{POINTS}PROC main()\n{MAIN}ENDPROC\nENDMODULE\n"
FILES = {
    "RAPID/TASK1/PROGMOD/Part.mod": MODULE.encode(),
    "RAPID/TASK1/SYSMOD/Empty.sys": b"\x00\x01",
    "SYSPAR/MOC.cfg": b'MOC:CFG_1.0:6:0::\r\n#\r\nROBOT:\r\n\r\n      -name "ROB_1" -base_frame_pos_z 0.5\r\n',
    "SYSPAR/EIO.cfg": b"EIO:CFG_1.0:6:0::\r\n",
    "BACKINFO/backinfo.txt": b"4711\r\n",
    "HOME/points.csv": b"x,y\n1,2\n",
}


@pytest.fixture(params=["folder", "zip"])
def made(request, tmp_path):
    path = tmp_path / ("backup.zip" if request.param == "zip" else "backup")
    if request.param == "zip":
        with zipfile.ZipFile(path, "w") as packed:
            for name, data in FILES.items():
                packed.writestr(name, data)
    else:
        for name, data in FILES.items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            (path / name).write_bytes(data)
    return path


def contents(path: Path) -> dict[str, bytes]:
    if path.is_dir():
        return {p.relative_to(path).as_posix(): p.read_bytes() for p in path.rglob("*") if p.is_file()}
    with zipfile.ZipFile(path) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def test_backup_is_read_and_missing_names_are_listed_once(made):
    """The program in it is read and what is missing is said once."""
    program = read_program(made)
    assert [move.end.name for move in program.motions] == ["p1"]
    assert program.T_world_base[2, 3] == 0.5
    assert program.backup.skipped == 4
    place = made / "RAPID/TASK1/PROGMOD/Part.mod"
    assert str(program.diagnostics[0]) == f"{place}:13: the files miss 1 names: tMiss (2)"


def test_backup_is_written_with_only_the_program_changed(made):
    """It is written again with the program changed and all else as it was."""
    found, sources = open_backup(made)
    edited = [
        Source(path=s.path, text=s.text.replace("fine", "z1"), encoding=s.encoding) if "Part" in s.path.name else s
        for s in sources
    ]
    out = made.with_name(f"corrected{made.suffix}")
    put_in_place([lay_backup(found, out, edited)])
    expected = {**FILES, "RAPID/TASK1/PROGMOD/Part.mod": MODULE.replace("fine", "z1").encode()}
    assert contents(out) == expected
    assert sorted(p.name for p in made.parent.iterdir()) == sorted([made.name, out.name])


def test_nothing_is_written_where_something_is(made):
    found, sources = open_backup(made)
    with pytest.raises(FileError, match="exists already"):
        put_in_place([lay_backup(found, _taken(made), sources)])
    other = made.with_name("c" if made.suffix else "c.zip")
    with pytest.raises(FileError, match="another kind"):
        put_in_place([lay_backup(found, other, sources)])
    if made.is_dir():
        with pytest.raises(FileError, match="which is read"):
            put_in_place([lay_backup(found, made / "inside", sources)])


def _taken(made: Path) -> Path:
    taken = made.with_name(f"taken{made.suffix}")
    if made.suffix:
        taken.write_bytes(b"mine")
    else:
        taken.mkdir()
        (taken / "mine").write_bytes(b"mine")
    return taken


def test_a_failure_on_the_way_leaves_nothing(made, monkeypatch):
    found, sources = open_backup(made)
    broken = [Source(path=s.path, text="\udcff", encoding="utf-8") for s in sources]
    with pytest.raises(UnicodeEncodeError):
        put_in_place([lay_backup(found, made.with_name(f"out{made.suffix}"), broken)])

    def fails(*args, **kwargs):
        raise OSError(28, "no space left")

    monkeypatch.setattr(os, "replace", fails)
    with pytest.raises(FileError, match="no space left"):
        put_in_place([lay_backup(found, made.with_name(f"out{made.suffix}"), sources)])
    assert [p.name for p in made.parent.iterdir()] == [made.name]


@pytest.mark.parametrize("name", ["./RAPID/Part.mod", "RAPID\\Part.mod"])
def test_backup_keeps_the_names_that_a_packer_gave(name, tmp_path):
    """A program is corrected under whatever name a packer gave it."""
    path, out = tmp_path / "b.zip", tmp_path / "out.zip"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("./", b"")
        packed.writestr(name, MODULE)
    found, sources = open_backup(path)
    changed = [Source(path=s.path, text=s.text.replace("fine", "z1"), encoding=s.encoding) for s in sources]
    put_in_place([lay_backup(found, out, changed)])
    assert contents(out) == {"./": b"", "RAPID/Part.mod": MODULE.replace("fine", "z1").encode()}


def test_names_that_lead_out_of_a_zip_file_are_refused(tmp_path):
    path = tmp_path / "b.zip"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("ok.mod", MODULE)
        packed.writestr("../evil.txt", MODULE)
    with pytest.raises(FileError, match="leads out of it"):
        read_program(path)


def test_links_are_refused(tmp_path):
    path = tmp_path / "b.zip"
    with zipfile.ZipFile(path, "w") as packed:
        info = zipfile.ZipInfo("link.txt")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        packed.writestr(info, "/etc/passwd")
        packed.writestr("ok.mod", MODULE)
    with pytest.raises(FileError, match=r"b\.zip/link\.txt: is a link, which a backup has none of"):
        read_program(path)
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "part.mod").write_text(MODULE)
    (folder / "link.mod").symlink_to("/etc/passwd")
    with pytest.raises(FileError, match="is a link"):
        read_program(folder)
    (folder / "link.mod").unlink()
    (folder / "sub").symlink_to("/etc")
    with pytest.raises(FileError, match="is a link"):
        read_program(folder)


def test_a_zip_file_that_cannot_be_copied_whole_leaves_nothing(tmp_path):
    path = tmp_path / "liar.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("part.mod", MODULE)
        packed.writestr("other.txt", b"x" * 1000)
    data = path.read_bytes()
    at = data.rindex(b"PK\x01\x02")
    path.write_bytes(data[: at + 24] + (10).to_bytes(4, "little") + data[at + 28 :])
    found, sources = open_backup(path)
    with pytest.raises(FileError, match=r"liar\.zip/other\.txt: unpacks to more than the 10 bytes it states"):
        put_in_place([lay_backup(found, tmp_path / "out.zip", sources)])
    assert [place.name for place in tmp_path.iterdir()] == ["liar.zip"]


def test_programs_that_are_far_too_large_are_refused(made, monkeypatch):
    monkeypatch.setattr(backup_module, "MAX_PROGRAM_MB", 1e-4)
    monkeypatch.setattr(backup_module, "ZIPPED", replace(backup_module.ZIPPED, largest_entry_mb=1e-4))
    with pytest.raises(FileError, match=r"Part\.mod: (is larger|has more) than 0\.0001 MB"):
        read_program(made)


def test_too_much_twice_and_nothing(tmp_path, monkeypatch):
    path = tmp_path / "b.zip"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("a.mod", MODULE)
        packed.writestr("A.MOD", MODULE)
    with pytest.raises(FileError, match="two files of the name"):
        read_program(path)
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "readme.txt").write_text("hello")
    with pytest.raises(FileError, match="holds no robot program among its 1 files"):
        read_program(folder)
    (folder / "a.mod").write_text(MODULE)
    (folder / "b.src").write_text("DEF b()\nEND\n")
    with pytest.raises(FileError, match=r"several languages \(1 of RAPID, 1 of KRL\)"):
        read_program(folder)
    (folder / "b.src").rename(folder / "b.mod")
    (folder / "b.mod").write_text(MODULE)
    with pytest.raises(FileError, match="has the module Part, as"):
        read_program(folder)
    monkeypatch.setattr(backup_module, "MAX_FILES", 2)
    with pytest.raises(FileError, match="more than 2 files"):
        read_program(folder)


def test_tasks_are_programs_of_their_own(tmp_path):
    for task in ("T_ROB1", "T_ROB2"):
        (tmp_path / f"RAPID/{task}/PROGMOD").mkdir(parents=True)
        (tmp_path / f"RAPID/{task}/PROGMOD/Part.mod").write_text(MODULE)
    with pytest.raises(FileError, match=r"2 tasks: T_ROB1 \(1 modules\), T_ROB2 \(1 modules\)"):
        read_program(tmp_path)
    assert read_program(tmp_path / "RAPID/T_ROB1").motions


@pytest.mark.parametrize("top", [".", "Backup_2026"])
def test_of_an_abb_backup_what_is_loaded_is_the_program(top, tmp_path):
    (tmp_path / "notes.txt").write_text("beside")
    for place in ("RAPID/TASK1/PROGMOD/Part.mod", "RAPID/TASK1/SYSMOD/user.sys", "HOME/user.sys", "HOME/old/Part.mod"):
        (tmp_path / top / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / top / place).write_text(MODULE.replace("Part", "user") if "user" in place else MODULE)
    found, sources = open_backup(tmp_path)
    assert [source.path.parent.name for source in sources] == ["PROGMOD", "SYSMOD"]
    assert found.skipped == 3


def test_folders_of_one_task_are_not_tasks(tmp_path):
    for place in ("RAPID/PROGMOD/Part.mod", "RAPID/SYSMOD/user.sys"):
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text(MODULE.replace("Part", "user") if "user" in place else MODULE)
    assert len(open_backup(tmp_path)[1]) == 2


def test_krl_and_tp_backups_leave_out_what_is_no_program(tmp_path):
    (tmp_path / "krl").mkdir()
    (tmp_path / "krl/a.src").write_text("DEF a()\nPTP {A1 0, A2 -90, A3 90, A4 0, A5 0, A6 0}\nEND\n")
    (tmp_path / "krl/log.dat").write_text("binary\0")
    (tmp_path / "krl/notes.dat").write_text("measured today")
    program = read_program(tmp_path / "krl")
    assert (len(program.motions), program.backup.skipped) == (1, 2)
    (tmp_path / "tp").mkdir()
    (tmp_path / "tp/ERRALL.LS").write_text("ERRALL.LS Robot Name ROBOT\n")
    text = listing(["J P[1] 10% FINE"], {"1": joints(0, 0, 0, 0, -90, 0)}).text
    (tmp_path / "tp/A.LS").write_text(text)
    program = read_program(tmp_path / "tp", robot=load_robot("fanuc-r2000ic-165f"))
    assert ([source.path.name for source in program.sources], program.backup.skipped) == (["A.LS"], 1)
