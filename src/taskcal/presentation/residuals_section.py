"""What a calibration left at the rows that it was fitted to, as a section of its page."""

import numpy as np

from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_errors import MeasuredErrors
from taskcal.identification.prediction_errors import Validation
from taskcal.presentation.content import Block, Chart, Section, Table
from taskcal.presentation.error_figures import draw_before_after, draw_by_axis, draw_over_joints, draw_over_orientation
from taskcal.presentation.errors_table import tabulate_errors
from taskcal.presentation.fit_figures import draw_residuals


def residuals_section(calibration: Calibration, errors: MeasuredErrors | None) -> Section:
    """The section.

    Args:
        calibration: the calibration.
        errors: at the fitted rows; None where their joint positions are not known.
    """
    blocks: list[Block] = [] if errors is None else _figures(calibration, errors)
    blocks.insert(
        min(1, len(blocks)),
        Chart(
            title=f"Measured less predicted, target {calibration.targets[0]}",
            figure=draw_residuals({calibration.provenance.campaign or "the campaign": {"fit": calibration}}),
            note="A band about zero without steps, drifts or waves: what is left looks like chance. A step: something moved. "
            f"{_axes(calibration)}, pose by pose.",
        ),
    )
    blocks.append(_table(calibration))
    return Section(title="What is left at the fitted poses", blocks=tuple(blocks))


def _figures(calibration: Calibration, errors: MeasuredErrors) -> list[Block]:
    return [
        Chart(
            title="Error of every measured pose, nominal and calibrated",
            figure=draw_before_after(errors),
            note="Circles should lie far below the crosses, all of them: a circle among the crosses is a pose that the "
            "calibration did not make better. Of several targets the worst one counts.",
        ),
        Chart(
            title="What is left along each axis, by target",
            figure=draw_by_axis(calibration, errors),
            note="Boxes about zero and alike: no axis and no target stands out. A box off zero: this target, or this "
            "direction, is measured differently. Half of the values are in the box; single points are far out.",
        ),
        Chart(
            title="What is left over the position of each joint",
            least_width=700,
            figure=draw_over_joints(calibration, errors),
            note="A cloud that rises to one side, or waves, names the joint that errs there; an even one names none.",
        ),
        Chart(
            title="Error over the orientation of the tool",
            figure=draw_over_orientation(calibration, errors),
            note="Circles that rise to the right: the farther the tool is turned, the worse; then measure more orientations. "
            "Poses far to the right are few in most campaigns.",
        ),
    ]


def _axes(calibration: Calibration) -> str:
    """What the residuals of the first target are along."""
    kinds = calibration.layout.observed
    if not kinds or kinds[0].along_axes:
        return "Along the robot's base axes"
    return "The one number that was read" if kinds[0].width == 1 else "Along the sensor's axes"


def _table(calibration: Calibration) -> Table:
    base, residuals = calibration.T_tracker_base[:3, :3], calibration.residuals
    observed = calibration.layout.observed
    summaries = {
        name: Validation.of_residuals(residuals[:, [t]], base, observed[t : t + 1]).summary()
        for t, name in enumerate(calibration.targets)
        if not np.isnan(residuals[:, t]).all()
    }
    return tabulate_errors(
        "Residuals of the fitted rows",
        summaries,
        of="target",
        note="Residuals of fitted rows are a little too small; held-out rows are the measure. Any x, y and z are the axes of the "
        "robot's base.",
    )
