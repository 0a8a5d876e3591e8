"""The line on a terminal that shows how far a command is."""

import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager

from taskcal.cli.sign_of_life import clear_sign

Update = Callable[[int, str, int | None], None]
"""Of the steps that are done, what is being done now, and how many steps there are."""


@contextmanager
def progress_bar(text: str, total: int | None) -> Generator[Update, None, None]:
    """A line on standard error with what is being done, a bar and the time; nothing where that is not a terminal.

    Args:
        text: what is being done, fit for a terminal.
        total: steps to the end; a wheel turns in place of the bar where that is not known.

    Yields:
        how to say how many steps are done, what is being done now, and how many there are.
    """
    if not _is_watched():
        yield _say_nothing
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    clear_sign()
    described = TextColumn("{task.description} …", markup=False)
    counted = (described, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    columns = (SpinnerColumn(), described, TimeElapsedColumn()) if total is None else counted
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total)
        yield lambda done, now, of: bar.update(task, completed=done, description=now, total=of, refresh=True)


def _is_watched() -> bool:
    return bool(os.environ.get("FORCE_COLOR")) or sys.stderr.isatty()


def _say_nothing(done: int, now: str, of: int | None) -> None:
    """Nobody watches; a terminal alone needs Rich, which takes a while to import."""
