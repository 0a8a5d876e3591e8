"""The uncertainty budget of what a calibration predicts, as a section of its page."""

from taskcal.identification.uncertainty_budget import COVERAGE_FACTOR, UncertaintyBudget
from taskcal.presentation.content import Section, Table, Text
from taskcal.presentation.rounding import decimals_of


def uncertainty_section(budget: UncertaintyBudget, where: str) -> Section:
    """The section.

    Args:
        budget: of a predicted position.
        where: over which poses, in words.
    """
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
    text = (
        f"How far the first target may be from where it is predicted, on average over {where}. The sources are independent and "
        "add as squares (GUM, JCGM 100:2008, 5.1). A: from the residuals of this campaign; B: known beforehand. The tracker's "
        "noise is in the first line, as far as it went into the fit; measuring a point again adds the tracker's own."
    )
    largest = max(budget.contributions, key=lambda one: one.deviation, default=None)
    see = "" if largest is None else f" The largest part is {largest.source}."
    return Section(
        title="Uncertainty of a predicted position",
        blocks=(
            Text((text + see,)),
            Table.of_rows("Uncertainty budget", ("source", "type", "u, mm", "share %"), rows, text_columns=(0, 1)),
        ),
    )
