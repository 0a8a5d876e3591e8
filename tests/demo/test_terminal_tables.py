"""The demonstration's tables in a terminal."""

import io

import pytest
from rich.console import Console

from taskcal.demo import procedure_tables as tables
from taskcal.demo.procedure import Procedure
from taskcal.presentation.content import Table
from taskcal.presentation.terminal import print_tables


def printed(table: Table, width: int) -> str:
    out = io.StringIO()
    print_tables(Console(file=out, width=width, markup=True, emoji=True), [table])
    return out.getvalue()


def tables_of(procedure: Procedure) -> list[Table]:
    return [
        tables.tabulate_model(procedure.model),
        tables.tabulate_influences(procedure, 10),
        tables.tabulate_counts(procedure),
        tables.tabulate_relations(procedure),
        tables.tabulate_residuals(procedure),
        tables.tabulate_held_out(procedure),
    ]


@pytest.mark.parametrize("width", [80, 120])
def test_every_number_and_name_is_readable(procedure: Procedure, width: int) -> None:
    for table in tables_of(procedure):
        text = printed(table, width)
        assert max(map(len, text.splitlines())) <= width
        words = set(text.split())
        for _, rows in table.groups:
            for row in rows:
                for cell in row:
                    assert set(cell.split()) <= words, (table.title, cell)
