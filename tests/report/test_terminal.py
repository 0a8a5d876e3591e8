import io

from rich.console import Console

from taskcal.report.content import Table, print_tables


def printed(table: Table, width: int) -> str:
    out = io.StringIO()
    print_tables(Console(file=out, width=width, markup=True, emoji=True), [table])
    return out.getvalue()


def test_brackets_in_cells_are_no_markup() -> None:
    assert "[red]x[/red] :smile:" in printed(Table.of_rows("t", ("a",), [("[red]x[/red] :smile:",)]), 80)
