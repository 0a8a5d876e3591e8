"""An uncertainty budget, as a section of a page."""

from taskcal.identification.uncertainty_budget import COVERAGE_FACTOR, UncertaintyBudget
from taskcal.presentation.content import Section, Table, Text
from taskcal.presentation.rounding import decimals_of

_RULE = (
    "The sources are independent and add as squares (GUM, JCGM 100:2008, 5.1). A: from the residuals of this campaign; B: known "
    "beforehand."
)


def predicted_uncertainty_section(budget: UncertaintyBudget, where: str) -> Section:
    """Of the positions that a calibration predicts.

    Args:
        budget: of a predicted position.
        where: over which poses, in words.
    """
    text = (
        f"How far the first target may be from where it is predicted, on average over {where}. {_RULE} The tracker's noise is in "
        "the first line, as far as it went into the fit; measuring a point again adds the tracker's own."
    )
    return _section("Uncertainty of a predicted position", text, budget)


def corrected_uncertainty_section(budget: UncertaintyBudget) -> Section:
    """Of the targets of a corrected program."""
    text = (
        f"How far the tool may be from a target of the corrected program, on average over its targets. {_RULE} Tool and part are "
        "as uncertain as the cell file says that they were measured, or else as they are built. Not in it: what cutting forces "
        "bend, unless the calibration was told of them, and wear of the tool."
    )
    return _section("Uncertainty of a corrected position", text, budget)


def _section(title: str, text: str, budget: UncertaintyBudget) -> Section:
    combined = budget.combined * 1e3
    digits = decimals_of(combined)
    rows = [
        (
            one.source,
            one.evaluation,
            f"{one.deviation * 1e3:.{digits}f}",
            f"{100.0 * one.deviation**2 / max(budget.combined**2, 1e-300):.0f}",
        )
        for one in sorted(budget.contributions, key=lambda one: -one.deviation)
    ]
    rows += [
        ("combined standard uncertainty, in space", "", f"{combined:.{digits}f}", "100"),
        (
            f"expanded uncertainty along one axis, k = {COVERAGE_FACTOR:g}",
            "",
            f"{budget.expanded * 1e3:.{digits}f}",
            "",
        ),
    ]
    largest = max(budget.contributions, key=lambda one: one.deviation, default=None)
    see = "" if largest is None else f" The largest part is {largest.source}."
    return Section(
        title=title,
        blocks=(
            Text((text + see,)),
            Table.of_rows("Uncertainty budget", ("source", "type", "u, mm", "share %"), rows, text_columns=(0, 1)),
        ),
    )
