"""A report's tables in a terminal."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from taskcal.presentation.content import Table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable


def print_tables(console: "Console", tables: Iterable[Table]) -> None:
    """Print tables one below the other, what each shows under it."""
    from rich.text import Text

    for table in tables:
        console.print(Text(table.title, style="bold"))
        console.print(as_rich(table))
        if table.note:
            console.print(Text(table.note, style="dim"))
        console.print()


def as_rich(table: Table) -> "RichTable":
    """The table for a terminal: words fold, numbers stay whole."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table as RichTable
    from rich.text import Text

    out = RichTable(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1))
    for i, name in enumerate(table.header):
        words = i in table.text_columns
        out.add_column(name, justify="left" if words else "right", overflow="fold", no_wrap=not words)
    for heading, rows in table.groups:
        if heading:
            out.add_row(Text(heading, style="italic"), *[""] * (len(table.header) - 1))
        for row in rows:
            out.add_row(*(Text(cell) for cell in row))
    return out
