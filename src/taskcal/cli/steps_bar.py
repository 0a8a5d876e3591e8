"""A bar for work whose steps are known beforehand."""

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager

from taskcal.cli.output import for_terminal
from taskcal.cli.progress_lines import report_step
from taskcal.cli.sign_of_life import clear_sign


@contextmanager
def bar_over(steps: Sequence[str]) -> Generator[Callable[[str], None], None, None]:
    """A bar on standard error that is full behind the last step, where that is a terminal; yields how to say which one begins.

    A step may stand several times, and steps may be passed over. What is not among those that are left changes the words alone.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    clear_sign()
    out = Console(stderr=True)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=out, transient=True, disable=not out.is_terminal) as bar:
        task = bar.add_task(for_terminal(steps[0]), total=len(steps))
        report_step(steps[0], 0, len(steps))
        begun = 0

        def begin(step: str) -> None:
            nonlocal begun
            done = max(begun - 1, 0)
            if step in steps[begun:]:
                done = steps.index(step, begun)
                begun = done + 1
            bar.update(task, completed=done, description=for_terminal(step), refresh=True)
            report_step(step, done, len(steps))

        yield begin
        bar.update(task, completed=len(steps), refresh=True)
