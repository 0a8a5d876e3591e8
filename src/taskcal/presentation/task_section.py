"""The part of a report that says where in a task the errors are."""

import numpy as np

from taskcal.adaptation.task_errors import TaskCurves, TaskMaps
from taskcal.presentation.content import Block, Chart, Section, Text
from taskcal.presentation.task_figures import draw_curves, draw_maps
from taskcal.robot.error_model import ErrorModel


def task_section(model: ErrorModel, maps: TaskMaps | TaskCurves, identified: str, measured: str) -> Section:
    """Where in the task the errors are.

    Args:
        model: the model.
        maps: maps or curves.
        identified: which parameters are identified, in words.
        measured: at which poses, in words.
    """
    frames = (
        "Before is what remains when the measurements only serve to find the tracker's frame and the targets, after when "
        f"{identified} are identified as well, from {measured}. Both are root mean squares to be expected in the tracker's frame, "
        "in closed form; the tolerances alone are in the robot's own base, where nothing is fitted."
    )
    blocks: tuple[Block, ...]
    if isinstance(maps, TaskCurves):
        curves = {"tolerances alone": maps.tolerance, "before": maps.before, "after": maps.after}
        blocks = (
            Text((frames,)),
            Chart(
                title="Error to be expected, pose by pose",
                figure=draw_curves(curves),
                note="The farther the lowest line lies below the others, the more identification is worth there. "
                "Logarithmic scale.",
            ),
        )
    else:
        shown = "Bright is worse. Drawn in one tool orientation, that of the task's middle. White: out of the robot's reach there."
        labels = {p.name: p.label for p in model.parameters}
        # the strongest first: it is what a reader sees before choosing
        strongest = sorted(
            maps.effects, key=lambda name: -max(float(np.nanmax(m, initial=0.0)) for m in maps.effects[name])
        )
        blocks = (
            Text((frames,)),
            Chart(
                title="Error to be expected before identification and after",
                least_width=700,
                figure=draw_maps(
                    maps.slices, {"after": maps.after, "before": maps.before, "tolerances": maps.tolerance}
                ),
                note=f"{shown} Each view has its own scale of colours.",
            ),
            Chart(
                title="Effect of a single parameter's tolerance in space",
                least_width=700,
                figure=draw_maps(maps.coarse, {labels[name]: maps.effects[name] for name in strongest}, from_zero=True),
                note="One colour all over: the defect moves the whole task alike. Bright corners: it matters there "
                "most. Choose the "
                "parameter in the list, which begins with the strongest. Each has its own scale of colours.",
            ),
        )
    return Section(title="Where in the task", blocks=blocks)
