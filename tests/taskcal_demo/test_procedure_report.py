import re

import numpy as np
import pytest

from taskcal.analysis.identifiability import published_kept
from taskcal.cli.output import show
from taskcal.report.content import TextTable
from taskcal_demo import procedure_report as tables
from taskcal_demo.procedure import ONE, SEVERAL, Procedure
from taskcal_demo.procedure_report import procedure_page, summary_points


def rows_of(table: TextTable) -> list[tuple[str, ...]]:
    rows = [row for _, group in table.groups for row in group]
    assert all(len(row) == len(table.header) for row in rows)
    assert len(table) == len(rows)
    return rows


def test_model_table_shows_every_symbol_once(procedure: Procedure) -> None:
    cells = [cell.split(" = ")[-1] for row in rows_of(tables.tabulate_model(procedure.model)) for cell in row[1:]]
    assert sorted(cell for cell in cells if cell) == sorted(p.symbol for p in procedure.model.parameters)


def test_counts_are_as_published_and_as_eliminated(procedure: Procedure) -> None:
    rows = rows_of(tables.tabulate_counts(procedure))
    assert [row[1:4] for row in rows] == [("9", "3", "33"), ("11", "3", "31"), ("18", "3", "24"), ("17", "3", "25")]


def test_relations_hold_and_are_of_published_parameters(procedure: Procedure) -> None:
    """The printed coefficients, read back, give the parameter's own column."""
    model = procedure.model
    index = {p.symbol: i for i, p in enumerate(model.parameters)}
    rows = rows_of(tables.tabulate_relations(procedure))
    assert len(rows) == 33 - 24
    for row in rows:
        symbol = row[0].split("(")[1].rstrip(")")
        assert model.names[index[symbol]] in published_kept(model)
        for said, label in zip(row[1:], (ONE, SEVERAL), strict=True):
            if said == "independent":
                continue
            J = procedure.sensitivities[label].matrix
            total = np.zeros(J.shape[:2])
            for sign, size, name in re.findall(r"([−+]?) ?(?:([\d.e-]+)·)?(\w+)", said.removeprefix("= ")):
                total += (-1.0 if sign == "−" else 1.0) * float(size or 1.0) * J[..., index[name]]
            np.testing.assert_allclose(total, J[..., index[symbol]], atol=2e-3 * np.abs(J[..., index[symbol]]).max())


def test_tables_show_the_errors_of_the_fits(procedure: Procedure) -> None:
    residuals, held_out = rows_of(tables.tabulate_residuals(procedure)), rows_of(tables.tabulate_held_out(procedure))
    assert len(residuals) == len(procedure.fits) + 1
    for fit, residual, errors in zip(procedure.fits, residuals, held_out, strict=False):
        assert residual[0] == errors[0] == fit.model
        assert float(residual[3]) == pytest.approx(1e6 * fit.residual.maximum, abs=0.051)
        assert float(errors[3]) == pytest.approx(1e6 * fit.outside.mean, abs=0.051)


def test_long_tables_have_all_parameters_and_are_folded(procedure: Procedure) -> None:
    for table in (
        tables.tabulate_influences(procedure),
        tables.tabulate_elimination(procedure),
        tables.tabulate_parameters(procedure),
    ):
        assert len(rows_of(table)) == len(procedure.model)
        assert table.folded


def test_influences_begin_with_the_largest(procedure: Procedure) -> None:
    rows = rows_of(tables.tabulate_influences(procedure, 10))
    strongest = [max(float(row[4]), float(row[8])) for row in rows]
    assert len(rows) == 10
    assert strongest == sorted(strongest, reverse=True)


@pytest.mark.parametrize("width", [80, 120])
def test_terminal_tables_keep_every_word(procedure: Procedure, width: int, monkeypatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    for table in tables.overview(procedure):
        show(table)
        text = capsys.readouterr().out
        assert max(map(len, text.splitlines())) <= width
        words = set(text.split())
        for row in table.rows:
            for cell in row:
                assert set(cell.split()) <= words, (table.title, cell)


def test_page_has_every_section_and_finite_numbers(procedure: Procedure) -> None:
    page = procedure_page(procedure, next_steps="taskcal identify …").html()
    body = page[page.index("<body>") :]
    assert re.findall(r"<h2>(\d)", body) == [str(k) for k in range(1, 10)]
    assert body.count("<figure>") == 8
    assert body.count("<details>") == 4
    texts = re.sub(r"<script.*?</script>", "", body, flags=re.DOTALL)
    assert not re.search(r"\bnan\b|\binf\b|\bNone\b", texts)
    assert "taskcal identify …" in texts


def test_summary_states_the_ranks_of_the_run(procedure: Procedure) -> None:
    said = " ".join(summary_points(procedure))
    assert "Only 24 are identifiable in one tool orientation, 25 when" in said
