"""The parameters of a calibration, as a section of its page: what was found of each, or why it was not, and relations."""

import numpy as np

from taskcal.analysis.elimination_table import describe_combination
from taskcal.analysis.identifiability import Identifiability, identifiability
from taskcal.analysis.sensitivity import sensitivity
from taskcal.identification.calibration import Calibration
from taskcal.identification.calibration_summary import largest_correlations
from taskcal.identification.informed_parameters import informed_parameters
from taskcal.presentation.content import Block, Chart, Section, Table
from taskcal.presentation.effect_figures import draw_effects
from taskcal.presentation.fit_figures import draw_parameters
from taskcal.presentation.rounding import with_interval
from taskcal.robot.error_model import ErrorModel

CORRELATIONS = 10
"""That a page lists."""

MOST_TERMS = 6
"""Of a relation that are written out."""


def parameters_section(calibration: Calibration) -> Section:
    """The section."""
    q = calibration.q
    geometry = ErrorModel(calibration.model.robot, lengths_only=calibration.model.lengths_only)
    found = None if q is None else identifiability(geometry, q)
    blocks: list[Block] = []
    if q is not None:
        blocks.append(
            Chart(
                title="What each defect would do to the tool point at the measured poses",
                least_width=700,
                figure=draw_effects(sensitivity(geometry, q)),
                note="A high bar: a defect of one tolerance (1σ) moves the tool far. A bar near zero: it hardly matters here, and "
                "these poses say little of it. Along the robot's base axes, and in space.",
            )
        )
    if len(calibration.estimated):
        blocks.append(
            Chart(
                title="Estimated parameters",
                least_width=700,
                figure=draw_parameters({"fit": calibration}),
                note="A bar that crosses zero: the data do not prove that this defect is there. Bars are two standard errors. "
                "Parameters that repeat each other share what is found.",
            )
        )
    blocks.append(tabulate_intervals(calibration, found))
    if found is not None and (found.dependent or found.zero):
        blocks.append(_tabulate_relations(geometry, found))
    if len(calibration.estimated):
        blocks.append(_tabulate_correlations(calibration))
    return Section(title="Parameters", blocks=tuple(blocks))


def tabulate_intervals(calibration: Calibration, found: Identifiability | None) -> Table:
    """Every parameter of the model with its 95 % interval, and whether it was estimated.

    Args:
        calibration: the calibration.
        found: which parameters of the geometry repeat others at the fitted poses; None where these are not known.
    """
    informed, estimated = informed_parameters(calibration), set(calibration.estimated.tolist())
    rows: list[tuple[str, ...]] = []
    for i, p in enumerate(calibration.model.parameters):
        unit = p.shown
        value, interval = with_interval(
            float(calibration.estimate[i]) * unit.factor, float(calibration.standard_errors[i]) * unit.factor
        )
        kept = i in estimated
        why = _why(p.name, kept, informed.get(p.name), found)
        cells = (value, interval) if kept else ("0, held", interval)
        rows.append((p.label, *cells, f"{p.tolerance * unit.factor:.3g}", unit.name, why))
    return Table.of_rows(
        f"All {len(rows)} parameters: {len(estimated)} were estimated",
        ("parameter", "estimate", "95 % interval", "tolerance (1σ)", "unit", "kept, or why not"),
        rows,
        text_columns=(0, 4, 5),
        note="Digits are those that the standard error leaves. A parameter that was not estimated is held at zero, and counts with "
        "its tolerance in every uncertainty.",
        folded=True,
    )


def _why(name: str, kept: bool, informed: bool | None, found: Identifiability | None) -> str:
    """Whether a parameter was kept, or why not."""
    repeats = found is not None and (name in found.dependent or name in found.zero)
    if kept and informed is False:
        return "kept; not seen: its interval is that of its tolerance"
    if kept:
        return "kept; known with those it repeats alone (see relations)" if repeats else "kept"
    if found is not None and name in found.zero:
        return "left out: it does nothing to the tool point here"
    return "left out: it repeats others here (see relations)" if repeats else "left out by choice"


def _tabulate_relations(model: ErrorModel, found: Identifiability) -> Table:
    """What repeats what, exactly, at the fitted poses."""
    symbols = {p.name: p.symbol or p.name for p in model.parameters}
    rows = [(symbols[name], "0: no effect on the tool point") for name in found.zero]
    for name, terms in found.dependent.items():
        few = dict(sorted(terms.items(), key=lambda term: -abs(term[1]))[:MOST_TERMS])
        more = f" … ({len(terms) - MOST_TERMS} more)" if len(terms) > MOST_TERMS else ""
        rows.append((symbols[name], describe_combination(few, symbols) + more))
    return Table.of_rows(
        f"Relations: {len(rows)} parameters that repeat others at the measured poses",
        ("a defect in", "moves the tool point exactly as"),
        rows,
        text_columns=(0, 1),
        note="No measurement of the tool point at these poses tells the two sides apart, however good; what is found of them "
        "is shared in proportion to the tolerances. Per metre and radian.",
        folded=True,
    )


def _tabulate_correlations(calibration: Calibration) -> Table:
    rows = [
        (a, b, f"{value:+.3f}".replace("-", "−")) for a, b, value in largest_correlations(calibration, CORRELATIONS)
    ]
    size = float(np.max([abs(float(row[2].replace("−", "-"))) for row in rows], initial=0.0))
    return Table.of_rows(
        "Largest correlations of what was estimated",
        ("parameter", "and", "correlation"),
        rows,
        text_columns=(0, 1),
        note=f"The nearer to 1, the less the two are known one by one; the largest here is {size:.3f}. Predictions allow for it.",
        folded=True,
    )
