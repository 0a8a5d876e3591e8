"""A report's tables in a terminal."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from taskcal.presentation.layout import fold, lay_out_table

if TYPE_CHECKING:
    from rich.console import Console

    from taskcal.presentation.content import Table


def print_tables(console: "Console", tables: "Iterable[Table]") -> None:
    """Print tables one below the other, what each shows under it."""
    from rich.text import Text

    for table in tables:
        for line in fold(table.title, console.width):
            console.print(Text(line, style="bold"), soft_wrap=True)
        for line in lay_out_table(table.header, table.groups, table.text_columns, console.width):
            console.print(Text(line), soft_wrap=True)
        for line in fold(table.note, console.width) if table.note else ():
            console.print(Text(line, style="dim"), soft_wrap=True)
        console.print()
