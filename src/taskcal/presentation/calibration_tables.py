"""A calibration's tables, for the terminal and for its page."""

from collections.abc import Callable

from taskcal.identification.calibration import Calibration
from taskcal.identification.informed_parameters import informed_parameters
from taskcal.presentation.content import Table


def tabulate_parameters(calibration: Calibration, *, leave_out: Callable[[str], bool] = lambda _: False) -> Table:
    """Estimate, standard error and tolerance of every estimated parameter.

    Args:
        calibration: the calibration.
        leave_out: whether a parameter of this name is shown elsewhere.
    """
    informed = informed_parameters(calibration)
    rows: list[tuple[str, ...]] = []
    for i in calibration.estimated:
        p = calibration.model.parameters[i]
        if leave_out(p.name):
            continue
        unit = p.shown
        rows.append(
            (
                p.name,
                p.symbol,
                _signed(calibration.estimate[i] * unit.factor),
                f"{calibration.standard_errors[i] * unit.factor:.4f}",
                f"{p.tolerance * unit.factor:.4f}",
                unit.name,
                "not seen" if informed[p.name] is False else "",
            )
        )
    return Table.of_rows(
        f"The {len(rows)} identified parameters",
        ("parameter", "symbol", "estimate", "± 1σ", "tolerance", "unit", ""),
        rows,
        text_columns=(0, 1, 5, 6),
        note="Not seen: the measurements say nothing of it, its standard error is that of the prior.",
        folded=True,
    )


def tabulate_outliers(calibration: Calibration) -> Table:
    """Points that are too far off for chance."""
    return Table.of_rows(
        "Outliers, too far off for chance: measure again, or leave out",
        ("row", "line", "id", "target", "residual mm", "over its 1σ"),
        [
            (
                _number(outlier.row),
                _number(outlier.line),
                outlier.id,
                outlier.target,
                f"{outlier.residual * 1e3:.3f}",
                f"{outlier.studentised:.1f}",
            )
            for outlier in calibration.outliers
        ],
        text_columns=(2, 3),
        note="Rows of the campaign, counted from 0, and lines of its file, counted from 1.",
    )


def tabulate_left_out(calibration: Calibration) -> Table:
    """Rows that were not fitted, since they contradict all others."""
    return Table.of_rows(
        "Rows that contradict all others, left out: measure again",
        ("row", "line", "id", "off by mm", "over its 1σ"),
        [
            (_number(row.row), _number(row.line), row.id, f"{row.distance * 1e3:.2f}", f"{row.studentised:.0f}")
            for row in calibration.left_out
        ],
        text_columns=(2,),
        note="Rows of the campaign, counted from 0, and lines of its file, counted from 1.",
    )


def _number(number: int | None) -> str:
    return "–" if number is None else str(number)


def _signed(value: float) -> str:
    text = f"{value:+.4f}"
    return text if float(text) else " 0.0000"
