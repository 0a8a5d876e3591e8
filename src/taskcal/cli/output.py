"""What commands print: tables for people or JSON for programs on standard output, everything else beside it."""

import json
import math
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    with suppress(OSError):  # where that is full or closed, the exit status has to do
        print(for_terminal(shortened(message, MESSAGE_CHARACTERS)), file=sys.stderr, flush=True)


def tell(line: str = "") -> None:
    """A line of the result, on standard output."""
    print(for_terminal(line))


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
def working(step: str) -> Generator[Callable[[str], None], None, None]:
    """A line on standard error that says what is being done, where that is a terminal; yields how to change it."""
    from rich.console import Console

    with Console(stderr=True).status(f"{for_terminal(step)} …") as status:
        yield lambda text: status.update(f"{for_terminal(text)} …")


def write_json(result: Mapping[str, Any]) -> None:
    """The machine-readable result, alone on standard output."""
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


def console() -> "Console":
    """Standard output for tables; not narrower than they need where no terminal says how wide it is."""
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment

    class Terminal(Console):
        """A console whose text carries no commands but its own."""

        def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
            for segment in super().render(renderable, options):
                yield segment if segment.control else Segment(for_terminal(segment.text), segment.style)

    width = None if sys.stdout.isatty() else 140
    return Terminal(width=width, markup=False, highlight=False, emoji=False, soft_wrap=False)


def show_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]], *, left: Iterable[int] = (0,)) -> None:
    """Print a table; columns are flush right but for those in `left`."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    flush_left = set(left)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for i, name in enumerate(header):
        table.add_column(for_terminal(name), justify="left" if i in flush_left else "right", overflow="fold")
    for row in rows:
        table.add_row(*map(for_terminal, row))
    out = console()
    if title:  # above the table, not in it: it may be the wider of the two
        out.print(Text(for_terminal(title), style="bold"))
    out.print(table)


def show(table: "Table") -> None:
    """Print a table that a page shows as well."""
    show_table(table.title, table.header, table.rows, left=table.text_columns)


def show_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Print labelled lines."""
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for label, text in facts:
        table.add_row(for_terminal(label), for_terminal(text))
    console().print(table)
