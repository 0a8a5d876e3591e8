import re

import numpy as np
import pytest

from taskcal.analysis.elimination_table import published_kept
from taskcal.demo import procedure_tables as tables
from taskcal.demo.procedure import ONE, SEVERAL, Procedure
from taskcal.report.content import Table


def rows_of(table: Table) -> list[tuple[str, ...]]:
    rows = [row for _, group in table.groups for row in group]
    assert all(len(row) == len(table.header) for row in rows)
    assert len(table) == len(rows)
    return rows


def test_the_model_shows_every_symbol_once(procedure: Procedure) -> None:
    cells = [cell.split(" = ")[-1] for row in rows_of(tables.tabulate_model(procedure.model)) for cell in row[1:]]
    assert sorted(cell for cell in cells if cell) == sorted(p.symbol for p in procedure.model.parameters)


def test_counts_are_those_of_the_publication_and_of_the_elimination(procedure: Procedure) -> None:
    rows = rows_of(tables.tabulate_counts(procedure))
    assert [row[1:4] for row in rows] == [("9", "3", "33"), ("11", "3", "31"), ("18", "3", "24"), ("17", "3", "25")]


def test_relations_are_of_published_parameters_and_hold(procedure: Procedure) -> None:
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


def test_residuals_and_errors_are_those_of_the_fits(procedure: Procedure) -> None:
    residuals, held_out = rows_of(tables.tabulate_residuals(procedure)), rows_of(tables.tabulate_held_out(procedure))
    assert len(residuals) == len(procedure.fits) + 1
    for fit, residual, errors in zip(procedure.fits, residuals, held_out, strict=False):
        assert residual[0] == errors[0] == fit.model
        assert float(residual[3]) == pytest.approx(1e6 * fit.residual.maximum, abs=0.051)
        assert float(errors[3]) == pytest.approx(1e6 * fit.outside.mean, abs=0.051)


def test_long_tables_have_a_row_for_each_parameter_and_are_folded(procedure: Procedure) -> None:
    for table in (
        tables.tabulate_influences(procedure),
        tables.tabulate_elimination(procedure),
        tables.tabulate_parameters(procedure),
    ):
        assert len(rows_of(table)) == len(procedure.model)
        assert table.folded


def test_the_strongest_parameters_come_first(procedure: Procedure) -> None:
    rows = rows_of(tables.tabulate_influences(procedure, 10))
    strongest = [max(float(row[4]), float(row[8])) for row in rows]
    assert len(rows) == 10
    assert strongest == sorted(strongest, reverse=True)
