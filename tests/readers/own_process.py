"""What reading a file costs: it is done in a process of its own, which says how long it computed and how much memory it took."""

import multiprocessing
import multiprocessing.connection
import os
import re
import resource
import signal
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from taskcal.errors import TaskcalError

MAX_CLOCK_RATIO = 10
"""Times the seconds of computing that a process may take; after them by the clock it is ended that does not even compute."""

EXTRA_MEMORY_BYTES = 3 * 10**9
"""Bytes of address space beyond what the process has already, so that a failure does not take the machine with it."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one file."""

    said: str
    """``read``, what the refusal says, or the traceback of what is neither."""
    taskcal: bool
    """Whether it was read or refused, and not failed at."""
    seconds: float
    """Of computing."""
    megabytes: float
    """Of resident memory at most, beyond what the process had before."""

    def within(self, seconds: float, megabytes: float) -> bool:
        """Whether the file was read or refused, and cost no more."""
        return self.taskcal and self.seconds <= seconds and self.megabytes <= megabytes


def in_own_process(read: Callable[[], object], given_up: int) -> Outcome:
    """What becomes of reading in a process that is like this one.

    Args:
        read: what is tried.
        given_up: seconds of computing after which the process is ended.
    """
    receiving, sending = multiprocessing.Pipe(duplex=False)
    child = os.fork()
    if child == 0:
        _report(read, given_up, sending)
    sending.close()
    try:
        if not receiving.poll(MAX_CLOCK_RATIO * given_up):
            os.kill(child, signal.SIGKILL)
        said, taskcal, seconds, megabytes = receiving.recv()
    except EOFError:
        said, taskcal, seconds, megabytes = "the process died, or took too long", False, float(given_up), 0.0
    os.waitpid(child, 0)
    return Outcome(said=said, taskcal=taskcal, seconds=seconds, megabytes=megabytes)


def _report(read: Callable[[], object], given_up: int, sending: multiprocessing.connection.Connection) -> None:
    """Read, tell the other process, and end without what Python does at its end."""
    bound = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + EXTRA_MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
    resource.setrlimit(resource.RLIMIT_CPU, (given_up, given_up))
    warnings.simplefilter("error")
    # the most so far is that of the process it was copied from
    Path("/proc/self/clear_refs").write_text("5")
    before, begin = _most_megabytes(), os.times()
    try:
        read()
        said, taskcal = "read", True
    except TaskcalError as refusal:
        said, taskcal = str(refusal), True
    except BaseException:
        said, taskcal = traceback.format_exc(limit=-3), False
    end = os.times()
    sending.send((said, taskcal, end.user + end.system - begin.user - begin.system, _most_megabytes() - before))
    os._exit(0)


def _most_megabytes() -> float:
    """Of resident memory at any time, after the last clearing."""
    return int(re.findall(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())[0]) * 1.024e-3
