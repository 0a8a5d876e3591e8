"""Ctrl-C ends the program within a second, whatever it is doing."""

import os
import signal
import socket
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress

GRACE = 0.8
"""Seconds that the main thread has to end by itself."""


@contextmanager
def prompt(status: int, say: Callable[[], None]) -> Generator[threading.Event, None, None]:
    """Watch for an interrupt beside the main thread, which may be in a library that does not return or swallows it.

    Yields an event: once set, the end is no longer said.
    """
    said = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield said
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    earlier = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_wait, args=(reader, status, say, said), daemon=True).start()
    try:
        yield said
    finally:
        signal.set_wakeup_fd(earlier)
        writer.close()


def _wait(reader: socket.socket, status: int, say: Callable[[], None], said: threading.Event) -> None:
    while number := reader.recv(1):
        if number[0] == signal.SIGINT:
            break
    else:
        return
    threading.Event().wait(GRACE)  # not in vain where the program has ended: it may wait for threads of a library
    if not said.is_set():
        with suppress(OSError):
            say()
    os._exit(status)
