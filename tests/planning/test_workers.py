import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from taskcal.errors import UnknownName
from taskcal.planning.workers import side_by_side


@pytest.mark.parametrize("engine", ["sequential", "threading", "loky"])
def test_every_engine_gives_every_result(engine):
    assert sorted(side_by_side(partial(pow, 3), range(5), engine, 2)) == [1, 3, 9, 27, 81]


def test_a_single_worker_is_the_caller_who_lives_on():
    code = (
        "import time; from taskcal.planning.workers import side_by_side\n"
        "print(sorted(side_by_side(abs, [-1, 2], 'loky', 1))); time.sleep(1.5); print('on')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.split()) == (0, ["[1,", "2]", "on"])


def test_an_engine_that_is_not_there_is_named():
    with pytest.raises(UnknownName, match="no engine 'loki'; did you mean 'loky'"):
        list(side_by_side(abs, [1], "loki", 1))


def test_workers_end_soon_after_a_parent_that_was_killed():
    code = (
        "import os, time; from taskcal.planning.workers import side_by_side\n"
        "def sleep(k): print(os.getpid(), flush=True); time.sleep(60)\n"
        "list(side_by_side(sleep, range(2), 'loky', 2))"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        workers = [int(parent.stdout.readline()) for _ in range(2)]
        parent.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + 5.0
    while any(_runs(worker) for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.1)
    left = [worker for worker in workers if _runs(worker)]
    for worker in left:
        os.kill(worker, signal.SIGKILL)
    assert not left


def _runs(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as stat:
            return stat.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return os.path.isdir("/proc/self") is False


def test_workers_do_not_hear_an_interrupt_of_the_terminal():
    blocked = list(side_by_side(_blocked_signals, range(2), "loky", 2))
    assert all(signals >> (signal.SIGINT - 1) & 1 for signals in blocked)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def _blocked_signals(_: int) -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split("SigBlk:")[1].split()[0], 16)
