"""Progress on standard error: a word as soon as a command begins, a bar on a terminal, lines of JSON for a program."""

import json
import os
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from threading import Event, Lock, Thread

from taskcal.errors import printable

# A word on the terminal as soon as a command begins, while the libraries that it needs are still being imported.

TICK_S = 1.0
"""Interval at which the word states anew for how long."""

_shown = [False]
"""Whether the word is on the terminal."""
_writing = Lock()


@contextmanager
def working() -> Generator[None, None, None]:
    """Show that something is being done, and for how long, where standard error is a terminal, until anything else is written."""
    ended = Event()
    if sys.stderr.isatty():
        _shown[0] = True
        _write("working …")
        Thread(target=_tick, args=(ended, time.monotonic()), daemon=True).start()
    try:
        yield
    finally:
        ended.set()
        clear_line()


def clear_line() -> None:
    """Take the word away again; to be called before anything is written."""
    with _writing:
        if _shown[0]:
            _shown[0] = False
            _write("\r\x1b[K")


def _tick(ended: Event, start: float) -> None:
    while not ended.wait(TICK_S):
        with _writing:
            if not _shown[0]:
                return
            _write(f"\rworking … {time.monotonic() - start:.0f} s")


def _write(text: str) -> None:
    with suppress(OSError):
        sys.stderr.write(text)
        sys.stderr.flush()


# The steps of a command.

VARIABLE = "TASKCAL_PROGRESS"
"""Environment variable of a program that started the command: ``lines`` asks for a line of JSON for each step."""


def report_step(step: str, done: int, of: int | None) -> None:
    """Write a step that begins as a line of JSON, where that is asked for.

    Args:
        step: what is being done.
        done: steps before it.
        of: how many there are; None where that is not known.
    """
    if os.environ.get(VARIABLE) == "lines":
        with suppress(OSError):
            print(json.dumps({"step": step, "done": done, "of": of}), file=sys.stderr, flush=True)


def is_watched() -> bool:
    """Whether standard error is a terminal, which shows a bar."""
    return bool(os.environ.get("FORCE_COLOR")) or sys.stderr.isatty()


Update = Callable[[str, int, int | None], None]
"""Shows what is being done now, how many steps are done, and how many there are."""


@contextmanager
def bar_by_parts(first: str, total: int | None = 1, *, known: bool = False) -> Generator[Update, None, None]:
    """A bar on standard error, where that is a terminal, for work that states how far it is.

    Args:
        first: what is done before anything is stated.
        total: steps of that; a wheel turns in place of the bar where the number is not known.
        known: whether the total is that of the whole work, so that programs are told it from the first step.

    Yields:
        how to state what is being done, how many steps of it are done, and how many it has.
    """
    report_step(first, 0, total if known else None)
    if not is_watched():
        yield report_step  # a terminal alone needs Rich, which takes a while to import
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    clear_line()
    described = TextColumn("{task.description} …", markup=False)
    counted = (described, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    columns = (SpinnerColumn(), described, TimeElapsedColumn()) if total is None else counted
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(printable(first), total=total)

        def show(step: str, done: int, of: int | None) -> None:
            bar.update(task, completed=done, description=printable(step), total=of, refresh=True)
            report_step(step, done, of)

        yield show
        if known:
            bar.update(task, completed=total, refresh=True)


@contextmanager
def bar_over(steps: Sequence[str], count: int | None = None) -> Generator[Callable[[str], None], None, None]:
    """A bar that is full after the last step; yields how to state which step begins.

    A step may be named several times, and steps may be passed over. A step that is not named counts where the number of steps is
    given instead of all their names, and else changes the words alone.

    Args:
        steps: all of them; or the first, where only their number is known.
        count: their number.
    """
    total = count or len(steps)
    with bar_by_parts(steps[0], total, known=True) as show:
        begun = 0

        def begin(step: str) -> None:
            nonlocal begun
            if step in steps[begun:]:
                done = steps.index(step, begun)
                begun = done + 1
            elif count is None:
                done = max(begun - 1, 0)
            else:
                done = min(max(begun, 1), count - 1)
                begun = done + 1
            show(step, done, total)

        yield begin
