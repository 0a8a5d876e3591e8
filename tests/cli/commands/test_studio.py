"""``taskcal studio`` refuses what it cannot serve before it serves anything."""

import socket
from pathlib import Path

import pytest

from taskcal.cli import main
from taskcal_studio.project import FolderLock


def test_a_folder_that_is_open_elsewhere_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lock = FolderLock(tmp_path)
    try:
        assert main(["studio", str(tmp_path), "--no-browser"]) == 1
    finally:
        lock.release()
    assert "is open in another studio already (process" in capsys.readouterr().err


def test_a_port_that_is_taken_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert main(["studio", str(tmp_path), "--no-browser", "--port", str(port)]) == 1
    assert f"cannot listen on 127.0.0.1:{port}" in capsys.readouterr().err
    FolderLock(tmp_path).release()


def test_a_file_is_not_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert main(["studio", str(tmp_path / "file"), "--no-browser"]) == 1
    assert "cannot be made" in capsys.readouterr().err
