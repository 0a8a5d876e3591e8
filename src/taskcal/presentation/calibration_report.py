"""A calibration as a page: what was found, what is left, and how well the tool is known over a task."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.task_uncertainty import Uncertainty
from taskcal.identification.calibration import Calibration
from taskcal.identification.prediction_errors import Validation
from taskcal.identification.residual_analysis import ResidualAnalysis
from taskcal.measurement.registration import Registration
from taskcal.presentation.calibration_tables import tabulate_left_out, tabulate_outliers, tabulate_parameters
from taskcal.presentation.content import Block, Chart, Numbers, Section, Table, Text
from taskcal.presentation.errors_table import tabulate_errors
from taskcal.presentation.fit_figures import draw_parameters, draw_residuals
from taskcal.presentation.held_out_section import held_out_section
from taskcal.presentation.model_error_origin import model_error_origin, prior_scale_origin
from taskcal.presentation.report import report_html
from taskcal.presentation.residual_analysis_section import residual_analysis_section
from taskcal.presentation.task_figures import draw_bands, draw_maps
from taskcal.presentation.unobservable import describe_unobservable


def calibration_html(
    calibration: Calibration, over: Uncertainty | None, *, version: str, remainder: ResidualAnalysis | None = None
) -> str:
    """The page of a calibration.

    Args:
        calibration: the calibration.
        over: uncertainty over a task, if one was named.
        version: of the package that makes the page.
        remainder: what is left on a campaign, if one was named.
    """
    model, source = calibration.model, calibration.provenance
    sections = [_summary(calibration, over), held_out_section(calibration), _residuals(calibration)]
    if remainder is not None:
        sections.append(residual_analysis_section(remainder, f"{len(remainder.residual)} poses"))
    if over is not None:
        sections.append(_uncertainty(over))
    sections += [_parameters(calibration), _provenance(calibration)]
    robot = model.robot.title or model.robot.name
    return report_html(
        f"Calibration of the {robot}",
        sections,
        lead=f"{len(calibration.kept)} of {len(model)} parameters from {source.rows} rows of {source.campaign or 'a campaign'}.",
        footer=f"Page by Taskcal {version}; calibration by Taskcal {source.version}, {source.created}.",
    )


def _summary(calibration: Calibration, over: Uncertainty | None) -> Section:
    length = _lengths(calibration)
    scale = calibration.prior_scale
    items = [
        *_before_and_after(calibration),
        (f"{np.nanmean(length) * 1e3:.4f}", "mm", "mean residual in space on the fitted rows"),
        (f"{np.nanmax(length) * 1e3:.4f}", "mm", "largest residual in space"),
        (
            f"{calibration.model_error[0] * 1e3:.4f}",
            "mm",
            f"model error per axis (1σ), {model_error_origin(calibration)}",
        ),
        *((f"{e * 1e3:.4f}", "mrad", "model error of rotation per axis (1σ)") for e in calibration.model_error[1:]),
        (
            "no prior" if scale is None else f"{scale:.3g}",
            "",
            "held the parameters"
            if scale is None
            else f"times the tolerances is the scale of the prior{_in_brackets(prior_scale_origin(calibration))}",
        ),
    ]
    if over is not None:
        items.append(
            (f"{over.target * 1e3:.4f}", "mm", f"uncertainty of the target over {over.task} (1σ in space, rms)")
        )
    blocks: list[Block] = [Numbers(tuple(items))]
    for table in (tabulate_left_out(calibration), tabulate_outliers(calibration)):
        if len(table):
            blocks.append(table)
    if not calibration.outliers:
        blocks.append(Text(("No point is too far off for chance.",)))
    described = zip(calibration.targets, describe_unobservable(calibration.layout.registration), strict=True)
    unobservable = tuple(f"Target {name}: {sentence}." for name, sentence in described if sentence)
    if unobservable:
        blocks.append(Text(unobservable))
    return Section(title="In short", blocks=tuple(blocks))


def _before_and_after(calibration: Calibration) -> list[tuple[str, str, str]]:
    """What is left on rows that were not fitted, before and after."""
    if calibration.held_out is None:
        return []
    before, after = calibration.held_out.nominal_validation, calibration.held_out.validation
    return [
        (
            f"{before.mean * 1e3:.4f}",
            "mm",
            "mean error in space of the nominal robot, tracker frame and targets fitted",
        ),
        (f"{after.mean * 1e3:.4f}", "mm", "mean error in space on rows that were not fitted"),
    ]


def _in_brackets(words: str) -> str:
    return f" ({words})" if words else ""


def _lengths(calibration: Calibration) -> Float[np.ndarray, "n targets"]:
    return np.linalg.norm(calibration.residuals[..., :3], axis=2)


def _residuals(calibration: Calibration) -> Section:
    base, residuals = calibration.T_tracker_base[:3, :3], calibration.residuals
    summaries = {
        name: Validation.of_residuals(residuals[:, [t]], base).summary()
        for t, name in enumerate(calibration.targets)
        if not np.isnan(residuals[:, t]).all()
    }
    first = calibration.targets[0]
    return Section(
        title="Residuals",
        blocks=(
            Chart(
                title=f"Measured less predicted, target {first}",
                figure=draw_residuals({calibration.provenance.campaign or "the campaign": {"fit": calibration}}),
                note="Pose by pose along the robot's base axes.",
            ),
            tabulate_errors(
                "Residuals of the fitted rows",
                summaries,
                of="target",
                note="Along the robot's base axes and in space; residuals of fitted rows are a little too small. Held-out rows are "
                "the measure.",
            ),
        ),
    )


def _uncertainty(over: Uncertainty) -> Section:
    reach = f" {over.unreachable:.1%} of its poses are out of reach and left out." if over.unreachable else ""
    text = (
        f"Standard deviations over {over.task} in space, root mean square, in the tracker's frame: the measured target is "
        f"known to {over.target * 1e3:.4f} mm, the tool point to {over.after * 1e3:.4f} mm. By the tolerances alone, in the "
        f"robot's own base, the tool point is known to {over.before * 1e3:.4f} mm. Model error comes on top.{reach}"
    )
    difference = (
        "Measurements of a single point say where that point is, not where it sits on the tool. That is found with the fit, so "
        "that the tool point itself is known only as far as the tolerances of tool and last axis say; several targets, or "
        "measured poses, make it sharper."
    )
    if over.slices:
        chart = Chart(
            title="Uncertainty over the workspace (1σ in space)",
            figure=draw_maps(over.slices, over.maps),
            note="In the tool orientation of the task's middle. White: out of the robot's reach there. Each view has "
            "its own scale of colours.",
        )
    else:
        chart = Chart(
            title="Uncertainty pose by pose (±1.96σ)",
            figure=draw_bands(over.deviations),
            note="Along the robot's base axes, about what is predicted.",
        )
    return Section(title="How well the tool is known over the task", blocks=(Text((text, difference)), chart))


def _parameters(calibration: Calibration) -> Section:
    table = tabulate_parameters(calibration)
    blocks: list[Block] = []
    if len(table):
        blocks.append(
            Chart(
                title="Estimated parameters",
                figure=draw_parameters({"fit": calibration}),
                note="Bars are two standard errors. Parameters that repeat each other share what is found.",
            )
        )
    blocks.append(table)
    return Section(title="Parameters", blocks=tuple(blocks))


def _provenance(calibration: Calibration) -> Section:
    source = calibration.provenance
    rows = [
        ("robot", source.robot),
        ("robot file, digest", source.robot_digest),
        ("effects", ", ".join(type(effect).__name__ for effect in calibration.model.effects) or "none"),
        ("residual field", "none" if calibration.field is None else f"of {len(calibration.field.q)} rows"),
        ("campaign", source.campaign),
        ("campaign, digest", source.campaign_digest),
        *(("campaign, as read", note) for note in source.notes),
        ("rows", str(source.rows)),
        ("registration", _registered(calibration.layout.registration)),
        ("made", source.created),
        ("by Taskcal", source.version),
        *((str(key), _words(value)) for key, value in source.options.items()),
        (
            "ended",
            f"{calibration.reason}; {calibration.iterations} iterations in the last of {calibration.rounds} rounds",
        ),
    ]
    return Section(
        title="Where it comes from",
        blocks=(Table.of_rows("Provenance", ("entry", "value"), rows, text_columns=(0, 1)),),
    )


def _registered(registration: Registration) -> str:
    """Where the fit's start of tracker frame and targets came from."""
    return f"from {registration.method}{f', {registration.file}' if registration.file else ''}"


def _words(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {item}" for key, item in value.items())  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list | tuple):
        return ", ".join(str(item) for item in value) or "none"  # pyright: ignore[reportUnknownVariableType]
    return str(value)
