"""A calibration as a page: what it was worth, where the robot was off, what is left, and how well the tool is known over a task."""

from collections.abc import Sequence
from dataclasses import dataclass

from taskcal.adaptation.calibration_ladder import Rung
from taskcal.adaptation.task_uncertainty import Uncertainty
from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_errors import measured_errors
from taskcal.identification.residual_analysis import ResidualAnalysis
from taskcal.identification.uncertainty_budget import budget_at
from taskcal.presentation.content import Block, Chart, Section, Text
from taskcal.presentation.held_out_section import held_out_section
from taskcal.presentation.ladder_section import ladder_section
from taskcal.presentation.parameters_section import parameters_section
from taskcal.presentation.provenance_section import provenance_section
from taskcal.presentation.report import Page
from taskcal.presentation.residual_analysis_section import residual_analysis_section
from taskcal.presentation.residuals_section import residuals_section
from taskcal.presentation.robot_scene import robot_scene
from taskcal.presentation.summary_section import outliers_section, summary_section
from taskcal.presentation.task_figures import draw_bands, draw_maps
from taskcal.presentation.uncertainty_section import predicted_uncertainty_section
from taskcal.task.workspace import Workspace


@dataclass(frozen=True, eq=False, kw_only=True)
class Beside:
    """What a page shows beside the calibration itself, each if it was asked for."""

    over: Uncertainty | None = None
    """Uncertainty over a task."""
    space: Workspace | None = None
    """The task's workspace."""
    remainder: ResidualAnalysis | None = None
    """What is left on a campaign."""
    rungs: Sequence[Rung] = ()
    """What each part of the model is worth on that campaign."""
    header: Sequence[tuple[str, str]] = ()
    """Whom and what the page is for: labels and what belongs to them."""


def calibration_page(calibration: Calibration, beside: Beside, *, version: str) -> Page:
    """The page of a calibration.

    Args:
        calibration: the calibration.
        beside: what else is shown.
        version: of the package that makes the page.
    """
    model, source = calibration.model, calibration.provenance
    errors = measured_errors(calibration)
    sections = [summary_section(calibration, errors, beside.over)]
    if errors is not None:
        scene = robot_scene(calibration, errors, beside.space)
        sections.append(Section(title="The robot", blocks=(scene,)))
    sections += [held_out_section(calibration), residuals_section(calibration, errors)]
    if beside.remainder is not None:
        sections.append(residual_analysis_section(beside.remainder, f"{len(beside.remainder.residual)} poses"))
    if calibration.q is not None and errors is not None:
        sections.append(predicted_uncertainty_section(budget_at(calibration, calibration.q), "the measured poses"))
    if beside.over is not None:
        sections.append(_task(beside.over))
    sections.append(parameters_section(calibration))
    if beside.rungs:
        sections.append(ladder_section(beside.rungs))
    sections += [outliers_section(calibration), provenance_section(calibration)]
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"Calibration of the {robot}",
        sections=tuple(sections),
        lead=f"{len(calibration.kept)} of {len(model)} parameters from {source.rows} rows of {source.campaign or 'a campaign'}. "
        "All lengths are in millimetres.",
        footer=f"Page by Taskcal {version}; calibration by Taskcal {source.version}, {source.created}.",
        header=tuple(beside.header),
    )


def _task(over: Uncertainty) -> Section:
    reach = f" {over.unreachable:.1%} of its poses are out of reach and left out." if over.unreachable else ""
    text = (
        f"Standard deviations over {over.task} in space, root mean square, in the tracker's frame: the measured target is "
        f"known to {over.target * 1e3:.3f} mm, the tool point to {over.after * 1e3:.3f} mm. By the tolerances alone, in the "
        f"robot's own base, the tool point is known to {over.before * 1e3:.3f} mm. Model error comes on top.{reach}"
    )
    difference = (
        "Measurements of a single point say where that point is, not where it sits on the tool. That is found with the fit, so "
        "that the tool point itself is known only as far as the tolerances of tool and last axis say; several targets, or "
        "measured poses, make it sharper."
    )
    chart: Block
    if over.slices:
        chart = Chart(
            title="Uncertainty over the workspace (1σ in space)",
            least_width=700,
            figure=draw_maps(over.slices, over.maps),
            note="Bright is worse: go there with care, or measure more poses there. In the tool orientation of the task's "
            "middle. White: out of the robot's reach there. Each view has its own scale of colours.",
        )
    else:
        chart = Chart(
            title="Uncertainty pose by pose (±1.96σ)",
            figure=draw_bands(over.deviations),
            note="The wider the band, the less is known of the tool there. Along the robot's base axes, about what is predicted.",
        )
    return Section(title="How well the tool is known over the task", blocks=(Text((text, difference)), chart))
