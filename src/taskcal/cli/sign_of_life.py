"""A word on the terminal as soon as a command begins, while the libraries that it needs are still being imported."""

import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress

_shown = [False]
"""Whether the word stands there."""


@contextmanager
def sign_of_life() -> Generator[None, None, None]:
    """Say that something is being done, where standard error is a terminal, until anything else is said."""
    if sys.stderr.isatty():
        with suppress(OSError):
            sys.stderr.write("working …")
            sys.stderr.flush()
            _shown[0] = True
    try:
        yield
    finally:
        clear_sign()


def clear_sign() -> None:
    """Take the word away again; to be called before anything is written."""
    if _shown[0]:
        _shown[0] = False
        with suppress(OSError):
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
