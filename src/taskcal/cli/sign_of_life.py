"""A word on the terminal as soon as a command begins, while the libraries that it needs are still being imported."""

import sys
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from threading import Event, Lock, Thread

TICK = 1.0
"""Seconds after which the word says anew for how long."""

_shown = [False]
"""Whether the word stands there."""
_writing = Lock()


@contextmanager
def sign_of_life() -> Generator[None, None, None]:
    """Say that something is being done, and for how long, where standard error is a terminal, until anything else is said."""
    ended = Event()
    if sys.stderr.isatty():
        _shown[0] = True
        _write("working …")
        Thread(target=_tick, args=(ended, time.monotonic()), daemon=True).start()
    try:
        yield
    finally:
        ended.set()
        clear_sign()


def clear_sign() -> None:
    """Take the word away again; to be called before anything is written."""
    with _writing:
        if _shown[0]:
            _shown[0] = False
            _write("\r\x1b[K")


def _tick(ended: Event, start: float) -> None:
    while not ended.wait(TICK):
        with _writing:
            if not _shown[0]:
                return
            _write(f"\rworking … {time.monotonic() - start:.0f} s")


def _write(text: str) -> None:
    with suppress(OSError):
        sys.stderr.write(text)
        sys.stderr.flush()
