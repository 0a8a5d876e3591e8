"""No room and no right to write: no half file, no lost one, and a line that names the place."""

import ctypes
import os
import resource
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading import chunked as chunked_campaign
from taskcal.reading.chunked import campaign_in_chunks
from taskcal.tables.parquet import parquet_of
from tests.cli.interruptions import COMMANDS, prepare
from tests.faults.kills import digests
from tests.faults.uncovered import uncovered_environment
from tests.reading.known_campaign import ROBOT

MAX_FILE_BYTES = 50
"""Bytes that a file may get; none that a command writes has fewer."""


def _bounded() -> None:
    """As on a full disk, writing fails at some byte; a cache of compiled code that cannot be written costs time alone."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (MAX_FILE_BYTES, MAX_FILE_BYTES))


def without_room(folder, line: str) -> subprocess.CompletedProcess[str]:
    """Bytecode is not written: Python would leave it cut off beside the sources, for all tests that run at the same time."""
    return subprocess.run(
        [sys.executable, "-m", "taskcal", *line.split()], cwd=folder, capture_output=True, text=True, check=False,
        preexec_fn=_bounded, stdin=subprocess.DEVNULL,
        env=uncovered_environment() | {"PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip


def refused(ended: subprocess.CompletedProcess[str], reason: str) -> bool:
    """Whether it ended with a line that says why, and with nothing of Python's."""
    last = ended.stderr.strip().splitlines()[-1]
    return ended.returncode == 1 and reason in last and "Traceback" not in ended.stderr and "itself failed" not in last


def test_a_robot_is_not_written_half_where_there_is_no_room(tmp_path):
    (tmp_path / "table.csv").write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n")
    (tmp_path / "new.toml").write_text("old")
    before = digests(tmp_path)
    ended = without_room(tmp_path, COMMANDS["import"] + " --force")
    assert refused(ended, "new.toml: cannot be written: File too large"), ended.stderr
    assert digests(tmp_path) == before
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.long
def test_bytecode_that_was_cut_off_is_named(tmp_path):
    """Python keeps what it could write of it, and an end of file too soon looks to Typer like a question without an answer."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}

    def run():
        return subprocess.run(
            [sys.executable, "-m", "taskcal", "robots"], cwd=tmp_path, capture_output=True, text=True, check=False,
            env=environment | {"PYTHONPYCACHEPREFIX": str(tmp_path)}, stdin=subprocess.DEVNULL,
        )  # fmt: skip

    assert run().returncode == 0
    (path,) = tmp_path.rglob("commands/robots*.pyc")
    path.write_bytes(path.read_bytes()[:MAX_FILE_BYTES])
    ended = run()
    assert refused(ended, f"{path}: compiled Python file is truncated"), ended.stderr
    path.unlink()
    assert run().returncode == 0


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    prepare(folder)
    return folder


@pytest.mark.long
@pytest.mark.parametrize(
    "command", [name for name, line in COMMANDS.items() if "-o" in line.split() and name != "demo full"]
)
def test_no_command_leaves_half_a_file_where_there_is_no_room(command, inputs, tmp_path):
    folder = tmp_path / "folder"
    shutil.copytree(inputs, folder)
    before = digests(folder)
    ended = without_room(folder, COMMANDS[command])
    assert refused(ended, "File too large"), ended.stderr
    assert digests(folder) == before
    assert not list(folder.rglob("*.part"))


def _like_others() -> None:
    """Root may write anywhere, until it gives up the right to: on Linux, CAP_DAC_OVERRIDE by PR_CAPBSET_DROP."""
    if os.geteuid() == 0:
        assert ctypes.CDLL(None).prctl(24, 1, 0, 0, 0) == 0


def test_a_folder_that_may_only_be_read_is_named(tmp_path):
    (tmp_path / "table.csv").write_text("joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\n")
    tmp_path.chmod(0o555)
    ended = subprocess.run(
        [sys.executable, "-m", "taskcal", *COMMANDS["import"].split()],
        cwd=tmp_path, capture_output=True, text=True, check=False, preexec_fn=_like_others,
    )  # fmt: skip
    tmp_path.chmod(0o755)
    assert refused(ended, "new.toml: cannot be written: no permission to write in folder '.'"), ended.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


def test_parts_of_a_large_campaign_that_find_no_room_say_where(tmp_path, monkeypatch):
    header = ["id", *(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    path = tmp_path / "large.parquet"
    rng = np.random.default_rng(0)
    rows = [[str(k), *map(repr, rng.uniform(-90, 90, 6).tolist()), "500.5", "1.5", repr(300.0 + k)] for k in range(40)]
    path.write_bytes(parquet_of(header, rows))

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(chunked_campaign.np, "savez", full)
    with (
        pytest.raises(FileError, match=r"No space left on device; name a folder with room for the parts in TMPDIR"),
        campaign_in_chunks(path, ROBOT),
    ):
        pass
