"""A process that ends, or finds the disk full, at a chosen one of its calls that write."""

import errno
import os
import sys
from collections.abc import Callable

CALLS = {"os.rename", "os.remove", "os.link", "os.mkdir", "os.rmdir", "os.chmod", "os.truncate"}
"""Events of Python's auditing that change a disk, beside opening a file to write it; and `os.fsync`, which has none."""

NEEDING = {"open", "os.link", "os.mkdir"}
"""Those that take room."""
CREATING = NEEDING | {"os.rename", "os.fsync"}
"""Those that may: a folder grows by a name, and some disks find out late that they are full."""

WROTE, SURVIVED, KILLED, REFUSED = 0, 3, 9, 1
"""How the process ended: it did not come to that call, did its work although it failed, was killed there, or raised an error."""


def at_point(action: Callable[[], object], point: int, *, full: bool = False) -> int:
    """Run an action in a process of its own, which ends before its point-th call that writes; or of which that call fails.

    Args:
        action: writes.
        point: number of the call, from 0.
        full: whether the disk is full there, and from there on for calls that need room.
    """
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    count = 0

    def met(call: str, arguments: tuple[object, ...] = ()) -> None:
        nonlocal count
        if call == "open":
            if not isinstance(flags := arguments[2], int) or not flags & (os.O_WRONLY | os.O_RDWR):
                return
        elif call not in CALLS and call != "os.fsync":
            return
        if full and call not in CREATING:
            return
        count += 1
        if count == point + 1 and not full:
            os._exit(KILLED)
        if full and (count == point + 1 or (count > point and call in NEEDING)):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    fsync = os.fsync

    def met_fsync(handle: int) -> None:
        met("os.fsync")
        fsync(handle)

    os.fsync = met_fsync
    sys.addaudithook(met)
    try:
        action()
        os._exit(WROTE if count <= point else SURVIVED)
    except BaseException:
        os._exit(REFUSED)
