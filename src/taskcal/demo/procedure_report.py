"""The published procedure as a page: what was done, what was found, and what to make of it, in short sentences."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from taskcal.analysis.elimination_table import published_kept
from taskcal.demo import procedure_tables as tables
from taskcal.demo.prediction_figures import (
    draw_coverage,
    draw_error_over_angle,
    draw_held_out,
    draw_workspace,
)
from taskcal.demo.predictions import Predictions
from taskcal.demo.procedure import ONE, SEVERAL, Fitted, Procedure
from taskcal.presentation.content import Chart, Commands, Numbers, Points, Section, Table, Text
from taskcal.presentation.fit_figures import draw_parameters, draw_residuals
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
        _identification(procedure),
        _held_out(procedure),
        _uncertainty(procedure),
        _parameters(procedure),
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
    one, several = (find_fit(procedure, label, "all") for label in (ONE, SEVERAL))
    reduced = find_fit(procedure, ONE, "identifiable")
    undamped = find_fit(procedure, ONE, f"published {kept}, damped")
    ranks = procedure.elimination.eliminations
    return (
        f"Of {len(procedure.model)} parameters the publication keeps {kept}. Only {ranks[ONE].rank} can be told apart in "
        f"one tool orientation, {ranks[SEVERAL].rank} when the tool also turns by {SEVERAL}: the others repeat them.",
        f"Redundant parameters do no harm where each has a prior from its tolerance: measured in one orientation, all "
        f"{len(procedure.model)} are wrong by {_um(one.inside.mean)} µm on average there and by {_um(one.outside.mean)} µm on "
        f"turned tools, the {reduced.parameters} identifiable ones by {_um(reduced.inside.mean)} and "
        f"{_um(reduced.outside.mean)} µm. Without a prior, damping alone holds the {kept}: {_um(undamped.inside.mean)} and "
        f"{_um(undamped.outside.mean)} µm.",
        f"Measured in one orientation, the model is good in that orientation ({_um(one.inside.mean)} µm on average) and poor "
        f"in others ({_um(one.outside.mean)} µm). Measured in {SEVERAL}, it is wrong by {_um(several.inside.mean)} µm there "
        f"and by {_um(several.outside.mean)} µm when turned farther.",
        "Errors are said in the tracker's frame. There the prediction is sharp; in the robot's base frame, the first "
        "axis and the base cannot be told apart.",
    )


def find_fit(procedure: Procedure, campaign: str, start: str) -> Fitted:
    """The fit of a campaign whose model's name starts so."""
    return next(f for f in procedure.fits if f.campaign == campaign and f.model.startswith(start))


def _summary(procedure: Procedure) -> Section:
    one, several = (find_fit(procedure, label, "all") for label in (ONE, SEVERAL))
    nominal = find_fit(procedure, SEVERAL, "nominal")
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
                    (_um(nominal.inside.mean), "µm", f"mean error of the nominal robot in {SEVERAL}, frames fitted"),
                    (_um(several.inside.mean), "µm", f"after calibration in {SEVERAL}, on new poses there"),
                    (
                        _um(one.outside.mean),
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
        f"in {label} the last that counts is {_power(last)}, the next {_power(following)}"
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


def _identification(procedure: Procedure) -> Section:
    panels = {
        label: {f.model: f.calibration for f in procedure.fits if f.campaign == label} for label in procedure.campaigns
    }
    return Section(
        title="Identification and residuals",
        blocks=(
            Text(
                (
                    "The tracker frame and the target are fitted together with the parameters; nothing has to be registered "
                    "beforehand. “Damped, no prior” is after the published way, Levenberg–Marquardt without a prior; it ends "
                    "early, once the objective falls by less than a millionth of itself or the next step is small beside the "
                    "standard errors.",
                    "All calibrated models leave nearly the same residuals, close to the tracker's noise. Residuals therefore "
                    "cannot say which model is better; new poses can. The published residuals are those of a real robot, with "
                    "gravity and all else that geometry does not explain, so they are larger.",
                )
            ),
            tables.tabulate_residuals(procedure),
            Chart(
                title="Residuals, pose by pose",
                figure=draw_residuals(panels, "all"),
                note="Measured less predicted, along the robot's base axes. The list at the right changes the model.",
            ),
        ),
    )


def _held_out(procedure: Procedure) -> Section:
    kept = len(published_kept(procedure.model))
    whole = [p for p in procedure.predictions if p.model.startswith("all")]
    undamped = [
        p for p in procedure.predictions if p.model.startswith(f"published {kept}, damped") and p.campaign == ONE
    ]
    base = {label: found.T[:, :3, 3] for label, found in procedure.poses.items()}
    return Section(
        title="Errors on poses that were not measured",
        blocks=(
            Text(
                (
                    "This is what counts: new poses, and the true robot. In the measured orientation even a redundant model "
                    "predicts well, because what it confuses acts alike there.",
                    "One orientation is good inside and poor outside for a simple reason. With the tool always turned alike, "
                    "defects of the wrist and the tool move the tool point like defects of the arm. The fit may blame either; "
                    "when the tool turns, the two part company. No fit can repair that, only measuring in several orientations. "
                    "Without prior the blame goes anywhere; with it, to where the tolerances make it likely, which need not be "
                    "where it belongs: with another seed the prior helps more, or not at all.",
                )
            ),
            tables.tabulate_held_out(procedure),
            Chart(
                title="Mean and largest error of each model on new poses",
                figure=draw_held_out(procedure.fits),
                note="Logarithmic scale. Same orientations: those of the campaign. Turned farther: tilted by up to 40° and "
                "turned by up to 40° about the tool's axis. The largest errors can come from poses near the wrist's "
                "singularity, where its joints turn farther than at any measured pose.",
            ),
            Chart(
                title="Error against the rotation of the tool",
                figure=draw_error_over_angle([*whole, *undamped]),
                note="Every point is a new pose. Measured in one orientation, the error grows with the rotation away from it.",
            ),
            Chart(
                title="Where the errors are in the workspace",
                figure=draw_workspace(whole, base),
                note="Turn it with the mouse. All views share one scale of colours; crosses are the measured poses, in base "
                "coordinates.",
            ),
        ),
    )


def _uncertainty(procedure: Procedure) -> Section:
    kept = len(published_kept(procedure.model))
    chosen = [p for p in procedure.predictions if p.model.startswith("all")]
    far = next(p for p in chosen if p.campaign == ONE and "farther" in p.where)
    undamped = [
        p
        for p in procedure.predictions
        if p.model.startswith(f"published {kept}, damped") and p.campaign == ONE and "farther" in p.where
    ]
    rows = [
        (
            f"{p.model}, {p.campaign}",
            p.where,
            f"{_rms(p.stated) * 1e6:.1f}",
            f"{_rms(p.length) * 1e6:.1f}",
            f"{100 * p.share_inside(0.95):.0f} %",
        )
        for p in (*chosen, *undamped)
    ]
    return Section(
        title="Does the calibration know how wrong it is?",
        blocks=(
            Text(
                (
                    "A calibration states an uncertainty for every pose, measured or not: an ellipsoid about the predicted "
                    "tool point. It comes from the tracker's noise, from the poses that were measured and from the prior.",
                    "With the prior, the statement grows where the tool turns away from what was measured "
                    f"({_length(_rms(far.stated))} stated, {_length(_rms(far.length))} actual, "
                    "root mean square). Out there it rests on the tolerances, not on measurements, and one robot can be luckier "
                    "or unluckier than its tolerances say; where poses were measured it rests on them."
                    + _without_prior(undamped),
                    "All errors here come from one robot and one campaign, so they rise and fall together: a curve may leave "
                    "the diagonal by chance. Another seed draws another robot, and gives other curves.",
                )
            ),
            Table.of_rows(
                "Stated uncertainty and actual error (µm, root mean square in space)",
                ("calibration", "new poses", "stated", "actual", "in 95 % ellipsoid"),
                rows,
                text_columns=(0, 1),
                note="Where the statement is right, stated and actual agree, and 95 % of the poses lie inside.",
            ),
            Chart(
                title="Stated uncertainty against actual error",
                figure=draw_coverage(chosen),
                note="Left: points about the dashed line are as wrong as stated. Right: a curve above the dashed line is "
                "cautious, one below it overconfident.",
            ),
        ),
    )


def _parameters(procedure: Procedure) -> Section:
    whole = {f.campaign: f.calibration for f in procedure.fits if f.parameters == len(procedure.model)}
    return Section(
        title="What was found of the parameters",
        blocks=(
            Text(
                (
                    "Parameters that repeat each other share what is found; their standard errors stay near the tolerance and "
                    "say so. Combinations that matter to the tool point are known far better than any one of them. J1.tz and "
                    "J1.rz repeat the tracker frame, which is fitted too. Read the predictions, not the single parameters.",
                )
            ),
            Chart(
                title="Estimated parameters and the truth",
                figure=draw_parameters(whole, procedure.truth.x),
                note="All parameters with their prior. Bars are two standard errors: about one truth in twenty lies outside.",
            ),
            tables.tabulate_parameters(procedure),
        ),
    )


_OWN = (
    "The same with your robot: measure some sixty poses in the task's workspace, with the tool turned as the task turns it "
    "and somewhat farther, and keep a few poses aside to check."
)


def _without_prior(predictions: Sequence[Predictions]) -> str:
    if not predictions:
        return ""
    stated, actual = _rms(predictions[0].stated), _rms(predictions[0].length)
    return (
        " Without prior, nothing holds the directions that the poses do not determine, and the statement means nothing: "
        f"{_length(stated)} stated, {_length(actual)} actual."
    )


def _rms(values: Float[np.ndarray, " n"]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _length(metres: float) -> str:
    return f"{_um(metres)} µm" if metres < 1e-3 else f"{metres * 1e3:.3g} mm"


def _power(value: float) -> str:
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}·10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _um(metres: float) -> str:
    return f"{metres * 1e6:.0f}" if metres >= 2e-5 else f"{metres * 1e6:.1f}"
