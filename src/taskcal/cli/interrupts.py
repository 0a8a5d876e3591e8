"""Ctrl-C ends the program within a second, whatever it is doing."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from typing import NoReturn

INTERRUPTED = 130
"""Exit status after Ctrl-C."""

GRACE = 0.5
"""Seconds that the main thread has to end by itself."""


@contextmanager
def prompt(say: Callable[[], None]) -> Generator[threading.Event, None, None]:
    """Watch for an interrupt beside the main thread, which may be in a library that does not return or swallows it.

    Yields an event: once set, the end is no longer said. An interrupt that a library's callback loses is not shown either.
    """
    said = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield said
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    earlier = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_wait, args=(reader, say, said), daemon=True).start()
    shown = sys.unraisablehook
    sys.unraisablehook = lambda lost: None if issubclass(lost.exc_type, KeyboardInterrupt) else shown(lost)
    try:
        yield said
    finally:
        sys.unraisablehook = shown
        said.set()  # by whoever called: this thread is on its way out
        signal.set_wakeup_fd(earlier)
        writer.close()


def leave() -> NoReturn:
    """End the process without what libraries do at its end: they wait for processes and threads of theirs."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(INTERRUPTED)


def _wait(reader: socket.socket, say: Callable[[], None], said: threading.Event) -> None:
    while number := reader.recv(1):
        if number[0] == signal.SIGINT:
            break
    else:
        return
    threading.Event().wait(GRACE)  # not in vain where the program has ended: it may wait for threads of a library
    if not said.is_set():
        with suppress(OSError):
            say()
    os._exit(INTERRUPTED)
