"""The demonstration's tables in a terminal."""

import io

import pytest
from rich.console import Console

from taskcal.demo import procedure_tables as tables
from taskcal.demo.procedure import Procedure
from taskcal.report.content import Table, print_tables


def printed(table: Table, width: int) -> str:
    out = io.StringIO()
    print_tables(Console(file=out, width=width, markup=True, emoji=True), [table])
    return out.getvalue()


@pytest.mark.parametrize("width", [80, 120])
def test_every_number_and_name_is_readable(procedure: Procedure, width: int) -> None:
    for table in tables.overview(procedure):
        text = printed(table, width)
        assert max(map(len, text.splitlines())) <= width
        words = set(text.split())
        for _, rows in table.groups:
            for row in rows:
                for cell in row:
                    assert set(cell.split()) <= words, (table.title, cell)
