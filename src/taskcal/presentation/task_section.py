"""The part of a report that says where in a task the errors are."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.task_map import Slice
from taskcal.presentation.content import Block, Chart, Section, Text
from taskcal.presentation.task_figures import Maps, draw_curves, draw_maps
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskMaps:
    """Maps over slices of a workspace, metres."""

    slices: tuple[Slice, ...]
    coarse: tuple[Slice, ...]
    """Of the single parameters."""
    effects: Mapping[str, Maps]
    """Effect of each parameter's tolerance."""
    tolerance: Maps
    """All tolerances together, in the robot's base."""
    before: Maps
    """Expected error with the frames alone found."""
    after: Maps
    """Expected error with parameters identified."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskCurves:
    """The same pose by pose, for a list or a path, metres."""

    tolerance: Float[np.ndarray, " n"]
    before: Float[np.ndarray, " n"]
    after: Float[np.ndarray, " n"]


def task_section(model: ErrorModel, found: TaskMaps | TaskCurves, identified: str, measured: str) -> Section:
    """Where in the task the errors are.

    Args:
        model: the model.
        found: maps or curves.
        identified: which parameters are identified, in words.
        measured: at which poses, in words.
    """
    frames = (
        "Before is what remains when the measurements only serve to find the tracker's frame and the targets, after when "
        f"{identified} are identified as well, from {measured}. Both are root mean squares to be expected in the tracker's frame, "
        "in closed form; the tolerances alone are in the robot's own base, where nothing is fitted."
    )
    blocks: tuple[Block, ...]
    if isinstance(found, TaskCurves):
        curves = {"tolerances alone": found.tolerance, "before": found.before, "after": found.after}
        blocks = (
            Text((frames,)),
            Chart(title="Error to be expected, pose by pose", figure=draw_curves(curves), note="Logarithmic scale."),
        )
    else:
        shown = "Drawn in one tool orientation, that of the task's middle. White: out of the robot's reach there."
        labels = {p.name: p.label for p in model.parameters}
        # the strongest first: it is what a reader sees before choosing
        strongest = sorted(
            found.effects, key=lambda name: -max(float(np.nanmax(m, initial=0.0)) for m in found.effects[name])
        )
        blocks = (
            Text((frames,)),
            Chart(
                title="Error to be expected before identification and after",
                figure=draw_maps(
                    found.slices, {"after": found.after, "before": found.before, "tolerances": found.tolerance}
                ),
                note=f"{shown} Each view has its own scale of colours.",
            ),
            Chart(
                title="Effect of a single parameter's tolerance in space",
                figure=draw_maps(
                    found.coarse, {labels[name]: found.effects[name] for name in strongest}, from_nil=True
                ),
                note="Choose the parameter in the list, which begins with the strongest. Each has its own scale of colours.",
            ),
        )
    return Section(title="Where in the task", blocks=blocks)
