"""The second half of the procedure's page: identification, errors on new poses, uncertainty, parameters."""

from collections.abc import Sequence

from taskcal.analysis.elimination_table import published_kept
from taskcal.demo import procedure_tables as tables
from taskcal.demo.number_text import length_text, rms
from taskcal.demo.prediction_figures import (
    draw_coverage,
    draw_error_over_angle,
    draw_held_out,
    draw_workspace,
)
from taskcal.demo.predictions import Predictions
from taskcal.demo.procedure import ONE, Procedure
from taskcal.presentation.content import Chart, Section, Table, Text
from taskcal.presentation.fit_figures import draw_parameters, draw_residuals
from taskcal.presentation.length_unit import MICROMETRES


def identification_section(procedure: Procedure) -> Section:
    """What was fitted, and what each model leaves of the measurements."""
    panels = {
        label: {f.model: f.calibration for f in procedure.fits if f.campaign == label} for label in procedure.campaigns
    }
    return Section(
        title="Identification and residuals",
        blocks=(
            Text(
                (
                    "The tracker frame and the target are fitted together with the parameters; nothing has to be registered "
                    "beforehand. The publication registers the tracker from circles that single motors draw; that way, held, "
                    "stands beside it. “Damped, no prior” is after the published way, Levenberg–Marquardt without a prior; it ends "
                    "early, once the objective falls by less than a millionth of itself or the next step is small beside the "
                    "standard errors.",
                    "All models of defects with fitted frames leave nearly the same residuals, close to the tracker's noise; "
                    "the lengths alone do not. Residuals therefore "
                    "cannot say which model is better; new poses can. The published residuals are those of a real robot, with "
                    "gravity and all else that geometry does not explain, so they are larger.",
                )
            ),
            tables.tabulate_registration(procedure),
            tables.tabulate_residuals(procedure),
            Chart(
                title="Residuals, pose by pose",
                figure=draw_residuals(panels, "all", MICROMETRES),
                note="Measured less predicted, along the robot's base axes. The list at the right changes the model.",
            ),
        ),
    )


def held_out_section(procedure: Procedure) -> Section:
    """Errors on poses that were not measured."""
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


def uncertainty_section(procedure: Procedure) -> Section:
    """Whether the stated uncertainty is as large as the errors."""
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
            f"{rms(p.stated) * 1e6:.1f}",
            f"{rms(p.length) * 1e6:.1f}",
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
                    f"({length_text(rms(far.stated))} stated, {length_text(rms(far.length))} actual, "
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


def parameters_section(procedure: Procedure) -> Section:
    """Estimates beside the truth."""
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


def _without_prior(predictions: Sequence[Predictions]) -> str:
    if not predictions:
        return ""
    stated, actual = rms(predictions[0].stated), rms(predictions[0].length)
    return (
        " Without prior, nothing holds the directions that the poses do not determine, and the statement means nothing: "
        f"{length_text(stated)} stated, {length_text(actual)} actual."
    )
