"""The published procedure as a page: what was done, what was found, and what to make of it, in short sentences."""

import numpy as np

from taskcal.analysis.elimination_table import published_kept
from taskcal.demo import procedure_tables as tables
from taskcal.demo.number_text import power_text, um
from taskcal.demo.procedure import ONE, SEVERAL, Procedure
from taskcal.demo.procedure_results import (
    held_out_section,
    identification_section,
    parameters_section,
    uncertainty_section,
)
from taskcal.presentation.content import Chart, Commands, Numbers, Points, Section, Table, Text
from taskcal.presentation.model_figures import draw_sensitivities, draw_singular_values
from taskcal.presentation.report import report_html


def procedure_html(procedure: Procedure, *, next_steps: str, version: str) -> str:
    """The page of a run of the procedure.

    Args:
        procedure: what was found.
        next_steps: commands to go on with.
        version: of the package, for the footer.
    """
    model = procedure.model
    sections = [
        _summary(procedure),
        _mechanism(procedure),
        _sensitivity(procedure),
        _elimination(procedure),
        identification_section(procedure),
        held_out_section(procedure),
        uncertainty_section(procedure),
        parameters_section(procedure),
        Section(title="Your own robot", blocks=(Text((_OWN,)), Commands(next_steps))),
    ]
    return report_html(
        "Adapting a robot's geometric model to its task",
        sections,
        lead=f"The procedure of Gutiérrez, Chanal, Durieux and Duc on a virtual {model.robot.title or model.robot.name}, "
        "and what goes past it.",
        footer=f"Taskcal {version}; seed {procedure.seed}; robot {model.robot.name}, "
        f"{len(next(iter(procedure.campaigns.values())))} poses in each campaign. The publication: Gutiérrez, Chanal, "
        "Durieux, Duc, Adaptation of the geometric model of a 6 dof serial robot to the task space.",
    )


def summary_points(procedure: Procedure) -> tuple[str, ...]:
    """What to remember, with the numbers of this run."""
    kept = len(published_kept(procedure.model))
    one, several = (procedure.fit(label, "all") for label in (ONE, SEVERAL))
    reduced = procedure.fit(ONE, "identifiable")
    undamped = procedure.fit(ONE, f"published {kept}, damped")
    ranks = procedure.elimination.eliminations
    return (
        f"Of {len(procedure.model)} parameters the publication keeps {kept}. Only {ranks[ONE].rank} can be told apart in "
        f"one tool orientation, {ranks[SEVERAL].rank} when the tool also turns by {SEVERAL}: the others repeat them.",
        f"Redundant parameters do no harm where each has a prior from its tolerance: measured in one orientation, all "
        f"{len(procedure.model)} are wrong by {um(one.inside.mean)} µm on average there and by {um(one.outside.mean)} µm on "
        f"turned tools, the {reduced.parameters} identifiable ones by {um(reduced.inside.mean)} and "
        f"{um(reduced.outside.mean)} µm. Without a prior, damping alone holds the {kept}: {um(undamped.inside.mean)} and "
        f"{um(undamped.outside.mean)} µm.",
        f"Measured in one orientation, the model is good in that orientation ({um(one.inside.mean)} µm on average) and poor "
        f"in others ({um(one.outside.mean)} µm). Measured in {SEVERAL}, it is wrong by {um(several.inside.mean)} µm there "
        f"and by {um(several.outside.mean)} µm when turned farther.",
        "Errors are said in the tracker's frame. There the prediction is sharp; in the robot's base frame, the first "
        "axis and the base cannot be told apart.",
    )


def _summary(procedure: Procedure) -> Section:
    one, several = (procedure.fit(label, "all") for label in (ONE, SEVERAL))
    nominal = procedure.fit(SEVERAL, "nominal")
    ranks = procedure.elimination.eliminations
    return Section(
        title="In short",
        blocks=(
            Numbers(
                (
                    (
                        f"{ranks[ONE].rank} of {len(procedure.model)}",
                        "",
                        "parameters can be told apart in one orientation",
                    ),
                    (
                        um(nominal.inside.mean),
                        "µm",
                        f"mean error of the nominal robot in {SEVERAL}, frames fitted",
                    ),
                    (um(several.inside.mean), "µm", f"after calibration in {SEVERAL}, on new poses there"),
                    (
                        um(one.outside.mean),
                        "µm",
                        "after calibration in one orientation, with the tool turned away from it",
                    ),
                )
            ),
            Points(summary_points(procedure)),
            Text(
                (
                    "The robot is virtual: its defects are drawn from the tolerances (one standard deviation: 0.3 mm and "
                    "0.3 mrad unless its file says otherwise) and its tracker has the noise of a Leica AT901, ±(15 µm + "
                    "6 µm/m) taken as two standard deviations. So the truth is known, and errors are errors, not residuals. "
                    "It does not bend, warm up or backlash; a real robot leaves more.",
                )
            ),
        ),
    )


def _mechanism(procedure: Procedure) -> Section:
    found, model = procedure.mechanism, procedure.model
    lengths = ", ".join(
        f"{part.symbol} {1e3 * float(np.linalg.norm(part.transform[:3, 3])):g}"
        for joint in model.robot.joints
        for part in joint.before
        if part.symbol
    )
    explanation = found.explanation[0].upper() + found.explanation[1:] + "."
    nominal = (f"The nominal model has the lengths {lengths} mm.",) if lengths else ()
    parameters = [(p.name, p.symbol, p.shown.name, f"{p.tolerance * p.shown.factor:g}") for p in model.parameters]
    listed = Table.of_rows(
        "All parameters with their tolerances",
        ("parameter", "symbol", "unit", "tolerance (1σ)"),
        parameters,
        text_columns=(0, 1, 2),
        folded=True,
    )
    return Section(
        title="Mechanism and model",
        blocks=(
            Text((explanation, *nominal, "Every defect that the mechanism leaves free is a parameter.")),
            tables.tabulate_model(model),
            listed,
        ),
    )


def _sensitivity(procedure: Procedure) -> Section:
    return Section(
        title="Sensitivity",
        blocks=(
            Text(
                (
                    "How far does each defect move the tool point? The sensitivity S = ∂X/∂ξ answers at every pose; shown is "
                    "its largest value over the measured poses. Scaled by the tolerance, it is the error to expect from that "
                    "defect alone. A large influence does not make a parameter identifiable: the next section says why.",
                )
            ),
            Chart(
                title="Largest influence of each parameter on X, Y and Z",
                figure=draw_sensitivities(procedure.sensitivities, procedure.elimination.eliminations),
                note="Along the robot's base axes. Pale bars: parameters that repeat others at these poses. The buttons "
                "change between the influence of a defect as large as its tolerance and the influence per unit.",
            ),
            tables.tabulate_influences(procedure),
        ),
    )


def _elimination(procedure: Procedure) -> Section:
    kept = published_kept(procedure.model)
    counts = {
        label: sum(name not in found.kept for name in kept)
        for label, found in procedure.elimination.eliminations.items()
    }
    said = " and ".join(f"{count} in {label}" for label, count in counts.items())
    gaps = "; ".join(
        f"in {label} the last that counts is {power_text(last)}, the next {power_text(following)}"
        for label, found in procedure.elimination.eliminations.items()
        if 0 < found.rank < len(found.singular_values)
        for last, following in [found.singular_values[found.rank - 1 : found.rank + 1]]
    )
    return Section(
        title="Which parameters can be told apart",
        blocks=(
            Text(
                (
                    "Two parameters that move the tool point in the same way at every pose cannot be told apart, however good "
                    "the tracker. Gaussian elimination of the stacked sensitivities finds them, and the relations between them.",
                    f"The published {len(kept)} are not all identifiable: of them, {said} repeat others. A least-squares fit "
                    "without prior has no unique answer for these; only its damping keeps them from running away.",
                )
            ),
            tables.tabulate_counts(procedure),
            tables.tabulate_relations(procedure),
            Chart(
                title="Singular values of the stacked sensitivities",
                figure=draw_singular_values(procedure.elimination.eliminations),
                note=f"Filled: counted as rank. The gap is clear: {gaps}. Below it there is only rounding. Values under "
                "10⁻¹⁸ are drawn there.",
            ),
            tables.tabulate_elimination(procedure),
        ),
    )


_OWN = (
    "The same with your robot: measure some sixty poses in the task's workspace, with the tool turned as the task turns it "
    "and somewhat farther, and keep a few poses aside to check."
)
