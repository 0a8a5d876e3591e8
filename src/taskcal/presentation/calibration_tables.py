"""A calibration's tables, for the terminal and for its page."""

from collections.abc import Callable, Sequence

import numpy as np

from taskcal.identification.calibration import Calibration
from taskcal.identification.informed_parameters import informed_parameters
from taskcal.identification.outlier import Outlier
from taskcal.presentation.content import Table

MODEL, READING = "model error", "reading"
"""Likely causes of an outlier."""

SHARED_ERROR = (
    "Model error: neighbouring rows or poses err alike, so that measuring again does not help; identify effects (--effects auto), "
    "or measure more poses there. Where something moved for a while, taskcal doctor finds it."
)
SINGLE_ERROR = "Reading: it errs alone among its neighbours; measure again, or leave out."
MOSTLY_OUTLIERS = (
    "Most points are outliers, so that no single row is at fault: the model errs by more than was stated, or robot, target or "
    "tracker frame are not those that were calibrated."
)


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
    """Points that are too far off for chance, and whether the reading or the model is at fault."""
    mostly = are_most(len(calibration.outliers), int(np.isfinite(calibration.studentised).sum()))
    return tabulate_judged(calibration.outliers, calibration.shared_outliers, "residual mm", mostly=mostly)


def tabulate_judged(
    outliers: Sequence[Outlier], shared: Sequence[bool], length: str, *, mostly: bool, count: int | None = None
) -> Table:
    """Outliers, each with its likely cause.

    Args:
        outliers: the worst first.
        shared: whether neighbours have the same error, of each.
        length: title of the column with the length of the error.
        mostly: whether most points are outliers, so that none of them is at fault.
        count: how many are listed; all by default.
    """
    causes = ["" if mostly else MODEL if alike else READING for alike in shared]
    notes = ["Rows of the campaign, counted from 0, and lines of its file, counted from 1."]
    if mostly:
        notes.append(MOSTLY_OUTLIERS)
    else:
        notes += [{MODEL: SHARED_ERROR, READING: SINGLE_ERROR}[cause] for cause in dict.fromkeys(causes)]
    rows = [
        (
            _number(outlier.row),
            _number(outlier.line),
            outlier.id,
            outlier.target,
            f"{outlier.residual * 1e3:.3f}",
            f"{outlier.studentised:.1f}",
            cause,
        )
        for outlier, cause in zip(outliers, causes, strict=True)
    ][:count]
    more = f", the {len(rows)} worst of {len(outliers)}" if len(rows) < len(outliers) else ""
    header = ("row", "line", "id", "target", length, "over its 1σ", "likely cause")
    title = f"Outliers, too far off for chance{more}"
    return Table.of_rows(title, header, rows, text_columns=(2, 3, 6), note=" ".join(notes))


def are_most(outliers: int, points: int) -> bool:
    """Whether outliers are more than half of the points: then the uncertainty that was stated is wrong, not they."""
    return 2 * outliers > points


def describe_outliers(shared: Sequence[bool], *, mostly: bool) -> str:
    """How many there are, and what to do about them."""
    alone, alike = sum(not one for one in shared), sum(shared)
    if not shared:
        return "none"
    if mostly:
        return f"{len(shared)} too far off for chance. {MOSTLY_OUTLIERS}"
    advice = (
        [f"{alike} together with {'its' if alike == 1 else 'their'} neighbours: {MODEL}, do not measure again"]
        if alike
        else []
    )
    advice += (
        [f"{alone} alone among {'its' if alone == 1 else 'their'} neighbours: measure again, or leave out"]
        if alone
        else []
    )
    return f"{len(shared)} too far off for chance, {'; '.join(advice)}"


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
