import os

import pytest

from robot_programs.core.source import read_source
from taskcal.correction.cell import load_cell
from taskcal.errors import FileError
from taskcal.identification.calibration import load_calibration
from taskcal.io.text_file import VARIABLE, read_bytes, read_text
from taskcal.observations.point import load_station
from taskcal.robot.robot_file import read_robot
from taskcal.tables.forms import read_csv
from taskcal.task.task import load_task

READERS = {
    "csv": read_csv,
    "robot": read_robot,
    "task": load_task,
    "station": load_station,
    "cell": load_cell,
    "calibration": load_calibration,
    "program": read_source,
}


@pytest.fixture
def line_of_200_mb(tmp_path):
    """A file that is as long as 200 MB and takes no room on the disk."""
    path = tmp_path / "long"
    with path.open("wb") as stream:
        stream.truncate(200_000_000)
    return path


@pytest.mark.parametrize("kind", READERS)
def test_every_reader_bounds_what_it_reads(kind, line_of_200_mb):
    with pytest.raises(FileError, match=rf"long: is larger than [\d.]+ MB; .*{VARIABLE}"):
        READERS[kind](line_of_200_mb)


@pytest.mark.parametrize("kind", READERS)
def test_every_reader_refuses_what_is_not_an_ordinary_file(kind, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, "/dev/zero"):
        with pytest.raises(FileError, match="cannot be read: it is a pipe or a device"):
            READERS[kind](path)
    with pytest.raises(FileError, match="cannot be read: Is a directory"):
        READERS[kind](tmp_path)
    with pytest.raises(FileError, match="cannot be read: No such file"):
        READERS[kind](tmp_path / "none")
    with pytest.raises(FileError, match="cannot be read: embedded null byte"):
        READERS[kind]("a\0b")


def test_the_environment_moves_the_bound(tmp_path, monkeypatch):
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    monkeypatch.setenv(VARIABLE, "4e-6")
    with pytest.raises(FileError, match="is larger than 4e-06 MB"):
        read_bytes(path)
    monkeypatch.setenv(VARIABLE, "5e-6")
    assert read_bytes(path) == b"12345"
    for wrong in ("much", "0", "-1", "nan", "inf"):
        monkeypatch.setenv(VARIABLE, wrong)
        with pytest.raises(FileError, match=rf"{VARIABLE} is '{wrong}'; give megabytes"):
            read_bytes(path)


def test_a_bound_beyond_all_memory_costs_none(tmp_path, monkeypatch):
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    monkeypatch.setenv(VARIABLE, "1e6")
    assert read_bytes(path) == b"12345"


def test_growing_file_is_read_to_its_end_or_size_limit(tmp_path, monkeypatch):
    """A file that grows while it is read is read to its end or to the size limit."""
    path = tmp_path / "file"
    path.write_bytes(3_000_000 * b"1")
    whole = os.fstat
    # as if it had been shorter when its size was asked for
    monkeypatch.setattr(os, "fstat", lambda handle: os.stat_result((*whole(handle)[:6], 5, *whole(handle)[7:])))
    assert len(read_bytes(path)) == 3_000_000
    with pytest.raises(FileError, match="is larger than 2 MB"):
        read_bytes(path, 2.0)


def test_line_ends_are_one_character(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"a\r\nb\rc\n")
    assert read_text(path) == "a\nb\nc\n"
