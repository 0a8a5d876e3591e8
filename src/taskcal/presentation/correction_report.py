"""A correction as a page: errors before and after, where they are, and what was left alone."""

from taskcal.correction.correction import Correction
from taskcal.identification.calibration import Calibration
from taskcal.identification.uncertainty_budget import evaluation_of_model_error
from taskcal.presentation.content import Block, Chart, Numbers, Points, Section, Table, Text
from taskcal.presentation.correction_figures import draw_errors_along, draw_errors_per_axis, draw_program
from taskcal.presentation.correction_tables import (
    state_expected,
    state_uncertain,
    tabulate_correction,
    tabulate_errors,
    tabulate_targets,
)
from taskcal.presentation.grouped_remarks import group_remarks
from taskcal.presentation.report import Page
from taskcal.presentation.uncertainty_section import corrected_uncertainty_section


def correction_page(correction: Correction, calibration: Calibration, *, version: str) -> Page:
    """The page of a correction.

    Args:
        correction: the corrected program.
        calibration: by which it was corrected.
        version: of the package that makes the page.
    """
    robot = calibration.model.robot
    names = ", ".join(source.path.name for source in correction.program.sources)
    return Page(
        title=f"Correction of {names}",
        sections=(
            _summary(correction),
            _errors(correction),
            *_uncertainty(correction, calibration),
            _left(correction),
            _targets(correction),
        ),
        lead=f"For the {robot.title or robot.name}, by the calibration of {calibration.provenance.campaign or 'a campaign'}.",
        footer=f"Page by Taskcal {version}; calibration of {calibration.provenance.created}.",
    )


def _summary(correction: Correction) -> Section:
    summary, budget = correction.summary(), correction.budget
    expected = (
        (f"{budget.before * 1e3:.3f}", "mm", "error to be expected before (rms in space at the targets)"),
        (f"{budget.after * 1e3:.3f}", "mm", "error to be expected after, uncertainty included"),
        (
            f"{budget.uncertainty * 1e3:.3f}",
            "mm",
            "of uncertainty: what the calibration must expect beyond its prediction",
        ),
    )
    items = (
        *(expected if len(correction.before.error) else ()),
        (f"{summary['largest_shift_mm']:.3f}", "mm", "farthest that a target was moved"),
        (str(summary["refused"]), "", "motions refused, and left as they were"),
        (str(summary["unresolved"]), "", "remarks on motions and texts that were not read, and were left as they were"),
    )
    facts = Table.of_rows(
        "The correction", ("", ""), [*state_expected(correction), *tabulate_correction(correction)], text_columns=(0, 1)
    )
    doubt = (Text((f"Look out: {state_uncertain(correction)}.",)),) if correction.uncertain else ()
    return Section(title="In short", blocks=(Numbers(items), *doubt, facts))


def _errors(correction: Correction) -> Section:
    blocks: list[Block] = [tabulate_errors(correction)]
    if len(correction.before.error):
        blocks += [
            Chart(
                title="Predicted error along the program",
                figure=draw_errors_along(correction),
                note="The lower line should lie well below the upper one along the whole program; where it does not, see "
                "what was left alone. Distance of the true tool from where it is wanted; between targets, from its way.",
            ),
            Chart(
                title="Errors at targets along the part's axes",
                figure=draw_errors_per_axis(correction),
                note="After the correction, boxes should lie about zero and be short. They hold the middle half, whiskers "
                "reach 1.5 times as far.",
            ),
            draw_program(correction),
        ]
    return Section(title="Errors", blocks=tuple(blocks))


def _uncertainty(correction: Correction, calibration: Calibration) -> tuple[Section, ...]:
    if not len(correction.before.error):
        return ()
    budget = correction.budget.of_targets(evaluation_of_model_error(calibration))
    return (corrected_uncertainty_section(budget),)


def _left(correction: Correction) -> Section:
    moves = correction.program.moves
    refused = group_remarks((moves[i].place, why) for i, why in sorted(correction.rejected.items()))
    diagnostics = group_remarks((diagnostic.place, diagnostic.text) for diagnostic in correction.diagnostics)
    blocks: list[Block] = []
    if refused:
        blocks += [Text(("These motions stay as they were:",)), Points(tuple(refused))]
    if diagnostics:
        blocks += [Text(("To be looked at:",)), Points(tuple(diagnostics))]
    if not blocks:
        blocks.append(Text(("Every motion was corrected, and nothing else is to be said.",)))
    return Section(title="What was left alone", blocks=tuple(blocks))


def _targets(correction: Correction) -> Section:
    return Section(title="Targets", blocks=(tabulate_targets(correction),))
