"""One process at a time writes in a folder; a killed one gives its lock back."""

import subprocess
import sys
from pathlib import Path

import pytest

from taskcal.errors import FileError
from taskcal_studio.project import FolderLock

HOLD = "import sys, time; from pathlib import Path; from taskcal_studio.project import FolderLock; "
HOLD += (
    "lock = FolderLock(Path(sys.argv[1])); lock.tell('http://127.0.0.1:1/'); print('held', flush=True); time.sleep(60)"
)


def test_folder_lock_names_holder_until_it_is_killed(tmp_path: Path) -> None:
    """A second lock is rejected with the process that holds the first, until that one is killed."""
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(FileError, match=rf"process {holder.pid}, http://127\.0\.0\.1:1/"):
            FolderLock(tmp_path)
    finally:
        holder.kill()
        holder.communicate()
    FolderLock(tmp_path).release()


def test_a_released_lock_can_be_taken_again(tmp_path: Path) -> None:
    lock = FolderLock(tmp_path)
    with pytest.raises(FileError, match="another studio"):
        FolderLock(tmp_path)
    lock.release()
    FolderLock(tmp_path).release()
