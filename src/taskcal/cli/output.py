"""What commands print: tables for people or JSON for programs on standard output, everything else beside it."""

import json
import math
import os
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from taskcal.cli.progress_lines import report_step
from taskcal.cli.sign_of_life import clear_sign
from taskcal.errors import printable, shortened

if TYPE_CHECKING:
    from rich.console import Console

    from taskcal.presentation.content import Table

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
    from taskcal.presentation.layout import fold

    clear_sign()
    for line in fold(for_terminal(text), line_width()):
        print(line)


def _folded(text: str, stream: TextIO) -> str:
    """A message cut between words for a terminal, which would cut within them; whole where programs read it."""
    if not stream.isatty():
        return text
    from taskcal.presentation.layout import fold

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
    from taskcal.cli.progress_bar import progress_bar

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
    from taskcal.presentation.layout import fold, lay_out_table

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
    from taskcal.presentation.layout import lay_out_facts

    clear_sign()
    for line in lay_out_facts([(for_terminal(label), for_terminal(text)) for label, text in facts], line_width()):
        print(line)
