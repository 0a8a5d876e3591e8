"""What commands print: tables for people or JSON for programs on standard output, everything else beside it."""

import json
import math
import os
import re
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Any, TextIO

from taskcal.errors import printable, shortened

if TYPE_CHECKING:
    import numpy as np
    from rich.console import Console

    from taskcal.report.content import Table


# How far a command is, a line of JSON for each step on standard error, for a program that started it and asks for
# them.

VARIABLE = "TASKCAL_PROGRESS"
"""Environment variable; ``lines`` asks for them."""


def report_step(step: str, done: int, of: int | None) -> None:
    """Say that a step begins, where that is asked for.

    Args:
        step: what is being done.
        done: steps before it.
        of: how many there are; None where that is not known.
    """
    if os.environ.get(VARIABLE) != "lines":
        return
    with suppress(OSError):
        print(json.dumps({"step": step, "done": done, "of": of}), file=sys.stderr, flush=True)


# A word on the terminal as soon as a command begins, while the libraries that it needs are still being imported.

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


MESSAGE_CHARACTERS = 4000
"""Of one message; whatever it repeats of its input is cut."""


def error(message: str) -> None:
    """An error, on standard error."""
    info(f"error: {message}")


def info(message: str) -> None:
    """A message beside the result, on standard error."""
    clear_sign()
    with suppress(OSError):  # where that is full or closed, the exit status has to do
        print(_folded(for_terminal(shortened(message, MESSAGE_CHARACTERS)), sys.stderr), file=sys.stderr, flush=True)


def tell(line: str = "") -> None:
    """A line of the result, on standard output."""
    clear_sign()
    print(_folded(for_terminal(line), sys.stdout))


def say(text: str) -> None:
    """A sentence of the result, folded between words whatever reads it."""
    from taskcal.report.content import fold

    clear_sign()
    for line in fold(for_terminal(text), line_width()):
        print(line)


def _folded(text: str, stream: TextIO) -> str:
    """A message cut between words for a terminal, which would cut within them; whole where programs read it."""
    if not stream.isatty():
        return text
    from taskcal.report.content import fold

    width = line_width()
    return "\n".join(part for line in text.split("\n") for part in (fold(line, width) if len(line) > width else [line]))


def for_terminal(text: str) -> str:
    """Text in which a name or a value from a file cannot command the terminal: only line feeds and tabs act."""
    return printable(text, keep="\n\t")


def started_as() -> str:
    """How to call the command line again: as it was called, or by its bare name where the shell finds it."""
    name = Path(sys.argv[0]).stem if sys.argv and sys.argv[0] else ""
    if name != "taskcal":
        return "taskcal"
    program = shutil.which("taskcal")
    if program and Path(program).exists() and Path(sys.argv[0]).exists() and Path(program).samefile(sys.argv[0]):
        return "taskcal"
    return shlex.quote(sys.argv[0])


@cache
def show_log() -> None:
    """From now on, what the library reports, such as that it compiles kernels, is said on standard error."""
    from logging import INFO, Handler, LogRecord, getLogger

    class Shown(Handler):
        """Each record as a message."""

        def emit(self, record: LogRecord) -> None:
            info(record.getMessage())

    log = getLogger("taskcal")
    log.setLevel(INFO)
    log.addHandler(Shown())


@contextmanager
def working(step: str, steps: int | None = None) -> Generator[Callable[[str], None], None, None]:
    """A line on standard error that says what is being done and for how long, where that is a terminal.

    Args:
        step: the first.
        steps: how many there are; the line has a bar then, and its end.

    Yields:
        how to say which step begins.
    """
    with progress_bar(for_terminal(step), steps) as update:
        report_step(step, 0, steps)
        begun = 0

        def begin(text: str) -> None:
            nonlocal begun
            if begun == 0 and text == step:
                return
            begun = begun + 1 if steps is None else min(begun + 1, steps - 1)
            update(begun, for_terminal(text), steps)
            report_step(text, begun, steps)

        yield begin
        if steps is not None:
            update(steps, for_terminal(step), steps)


def write_json(result: Mapping[str, Any]) -> None:
    """The machine-readable result, alone on standard output."""
    clear_sign()
    text = json.dumps(plain(result), indent=1, ensure_ascii=False, allow_nan=False)
    print(re.sub("[\x7f-\x9f]", lambda control: f"\\u{ord(control[0]):04x}", text))  # JSON escapes those below 0x20


def plain(value: Any) -> Any:
    """Lists, dictionaries and numbers that JSON knows; null for what is not finite."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    return value


def line_width() -> int:
    """Characters in a line: the terminal's, what COLUMNS says, or 80."""
    return max(shutil.get_terminal_size((80, 24)).columns, 20)


def console() -> "Console":
    """Standard output for what is laid out elsewhere."""
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment

    class Terminal(Console):
        """A console whose text carries no commands but its own."""

        def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
            for segment in super().render(renderable, options):
                yield segment if segment.control else Segment(for_terminal(segment.text), segment.style)

    clear_sign()
    return Terminal(width=line_width(), markup=False, highlight=False, emoji=False, soft_wrap=False)


def show_table(
    title: str,
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    left: Iterable[int] = (0,),
    spare: Sequence[int] = (),
) -> None:
    """Print a table; columns are flush right but for those in `left`, and those in `spare` go first where it is too wide."""
    from taskcal.report.content import fold, lay_out_table

    clear_sign()
    width = line_width()
    for line in fold(for_terminal(title), width) if title else ():
        _print_bold(line)
    cells = [[_in_a_cell(cell) for cell in row] for row in rows]
    for line in lay_out_table([_in_a_cell(name) for name in header], [("", cells)], set(left), width, spare):
        print(line)
    print()


def _print_bold(line: str) -> None:
    if sys.stdout.isatty() and "NO_COLOR" not in os.environ:
        line = f"\x1b[1m{line}\x1b[0m"
    print(line)


def _in_a_cell(text: str) -> str:
    """A cell's text, without line feeds, which would break the table."""
    return " ".join(for_terminal(text).split("\n"))


def show(table: "Table") -> None:
    """Print a table that a page shows as well."""
    show_table(table.title, table.header, table.rows, left=table.text_columns)


def show_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Print labelled lines."""
    from taskcal.report.content import lay_out_facts

    clear_sign()
    for line in lay_out_facts([(for_terminal(label), for_terminal(text)) for label, text in facts], line_width()):
        print(line)


# The table of position errors on the terminal.


def show_errors(title: str, summaries: Mapping[str, Mapping[str, float | int]]) -> None:
    """Print a row for each labelled `Validation.summary`; axes are those of the robot's base."""
    from taskcal.report.calibration import tabulate_errors

    show(tabulate_errors(title, summaries))


# The line on a terminal that shows how far a command is.

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


# Bars for work whose steps are known: beforehand, or as each part of it begins.


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


def placement(T: "np.ndarray") -> dict[str, Any]:
    """A pose for people: position in millimetres, orientation as a quaternion ``qx qy qz qw``."""
    from taskcal.geometry import se3

    position = [round(float(value) * 1e3, 9) for value in T[:3, 3]]
    return {"position_mm": position, "quaternion": se3.to_quaternion(T[None, :3, :3])[0].tolist()}
