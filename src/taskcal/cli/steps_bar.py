"""Bars for work whose steps are known: beforehand, or as each part of it begins."""

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager

from taskcal.cli.output import for_terminal
from taskcal.cli.progress_bar import progress_bar
from taskcal.cli.progress_lines import report_step


@contextmanager
def bar_over(steps: Sequence[str]) -> Generator[Callable[[str], None], None, None]:
    """A bar on standard error that is full behind the last step, where that is a terminal; yields how to say which one begins.

    A step may stand several times, and steps may be passed over. What is not among those that are left changes the words alone.
    """
    with progress_bar(for_terminal(steps[0]), len(steps)) as update:
        report_step(steps[0], 0, len(steps))
        begun = 0

        def begin(step: str) -> None:
            nonlocal begun
            done = max(begun - 1, 0)
            if step in steps[begun:]:
                done = steps.index(step, begun)
                begun = done + 1
            update(done, for_terminal(step), len(steps))
            report_step(step, done, len(steps))

        yield begin
        update(len(steps), for_terminal(steps[-1]), len(steps))


@contextmanager
def bar_by_parts(first: str) -> Generator[Callable[[str, int, int], None], None, None]:
    """A bar on standard error for work that says how far each part of it is, where that is a terminal.

    Args:
        first: what is done before any part is said.

    Yields:
        how to say the part, how many of its steps are done, and how many it has.
    """
    with progress_bar(for_terminal(first), 1) as update:
        report_step(first, 0, None)

        def show(part: str, done: int, of: int) -> None:
            update(done, for_terminal(part), of)
            report_step(part, done, of)

        yield show
