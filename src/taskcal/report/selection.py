"""A choice of parameters as a page: how many the task needs, which, and why the others are not among them."""

import numpy as np
import plotly.graph_objects as go

from taskcal.analysis.sensitivity import Sensitivity
from taskcal.planning.selection import Selection
from taskcal.planning.task_map import TaskCurves, TaskMaps
from taskcal.report.content import Chart, Numbers, Points, Section, Table, Text, state_model_error
from taskcal.report.fit_figures import draw_effects
from taskcal.report.page import Page
from taskcal.report.sensitivity import tabulate_effects
from taskcal.report.task import task_section
from taskcal.report.theme import BLUE, GREEN, GREY, INK, PURPLE, VERMILION, styled, with_decades
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

# The figure of a choice of parameters: the error over the number of parameters.

REFERENCES = {"identifiable": ("identifiable set", GREEN, "square"), "published": ("published set", PURPLE, "diamond")}


def draw_ladder(selection: Selection, accuracy: float | None = None) -> go.Figure:
    """Expected and cross-validated error against the number of parameters, and the size that was chosen.

    Args:
        selection: the choice.
        accuracy: that was asked for, metres.
    """
    figure = go.Figure()
    size = np.array([nested.size for nested in selection.ladder])
    expected = np.array([nested.expected for nested in selection.ladder]) * 1e3
    gone = [nested.dropped_next for nested in selection.ladder]
    figure.add_scatter(
        x=size,
        y=expected,
        mode="lines+markers",
        name="expected over the task (rms)",
        line={"color": BLUE, "width": 2.2},
        marker={"size": 6},
        customdata=[f"; next to go: {name}" if name else "" for name in gone],
        hovertemplate="%{x} parameters: %{y:.3f} mm%{customdata}<extra>expected</extra>",
    )
    _draw_cross_validated(figure, selection)
    _draw_references(figure, selection)
    _draw_choice(figure, selection)
    if accuracy is not None:
        figure.add_scatter(
            x=[size.min() - 1, size.max() + 1],
            y=[accuracy * 1e3] * 2,
            mode="lines",
            name="accuracy asked for",
            line={"color": GREY, "dash": "dash", "width": 1.5},
            hoverinfo="skip",
        )
    styled(figure, height=520, top=110)
    figure.update_xaxes(title_text="parameters in the model", range=[size.min() - 1, size.max() + 1])
    with_decades(figure, "error in space (mm)")
    return figure


def _draw_cross_validated(figure: go.Figure, selection: Selection) -> None:
    """Mean error on left-out rows for every size, where there is a campaign."""
    crossed = [nested for nested in selection.ladder if nested.cross_validated is not None]
    if crossed:
        figure.add_scatter(
            x=[nested.size for nested in crossed],
            y=[1e3 * (nested.cross_validated or 0.0) for nested in crossed],
            error_y={
                "array": [1e3 * (nested.standard_error or 0.0) for nested in crossed],
                "thickness": 1.4,
                "width": 3,
            },
            mode="markers",
            name="cross-validated on the campaign (mean ± standard error)",
            marker={"color": VERMILION, "size": 7, "symbol": "circle-open", "line": {"width": 2}},
            hovertemplate="%{x} parameters: %{y:.3f} mm<extra>cross-validated</extra>",
        )


def _draw_references(figure: go.Figure, selection: Selection) -> None:
    """The published and the identifiable set."""
    for name, (count, error) in selection.references.items():
        label, colour, symbol = REFERENCES[name]
        figure.add_scatter(
            x=[count],
            y=[error * 1e3],
            mode="markers",
            name=f"{label} ({count})",
            marker={"color": colour, "symbol": symbol, "size": 13, "line": {"color": "white", "width": 1.5}},
            hovertemplate=f"{label}, {count} parameters: " + "%{y:.3f} mm<extra></extra>",
        )


def _draw_choice(figure: go.Figure, selection: Selection) -> None:
    """A ring around the size that was chosen."""
    chosen = len(selection.kept)
    figure.add_scatter(
        x=[chosen],
        y=[1e3 * next(nested.expected for nested in selection.ladder if nested.size == chosen)],
        mode="markers",
        name=f"chosen ({chosen})",
        marker={"color": "rgba(0,0,0,0)", "symbol": "circle", "size": 17, "line": {"color": INK, "width": 2.5}},
        hovertemplate=f"chosen: {chosen} parameters, " + "%{y:.3f} mm<extra></extra>",
    )


# The tables of a choice of parameters, for the terminal and for its page.


def tabulate_ladder(selection: Selection) -> Table:
    """Error over the task by size of the model; cross-validated where there were measurements."""
    crossed = any(nested.cross_validated is not None for nested in selection.ladder)
    rows = [
        (
            str(nested.size),
            f"{nested.expected * 1e3:.3f}",
            *(["" if nested.cross_validated is None else f"{nested.cross_validated * 1e3:.3f}"] if crossed else []),
            "chosen" if nested.size == len(selection.kept) else "",
        )
        for nested in selection.ladder
    ]
    header = ("parameters", "expected mm (rms)", *(["cross-validated mm (mean)"] if crossed else []), "")
    return Table.of_rows(
        "Error in space over the task, by size of the model", header, rows, text_columns=(len(header) - 1,), folded=True
    )


def tabulate_dropped(selection: Selection, model: ErrorModel) -> Table:
    """Parameters that were dropped, in the order in which they went, and why."""
    symbols = {p.name: p.symbol for p in model.parameters}
    whole = {own[0]: name for name, own in selection.groups.items()}
    inside = {name for own in selection.groups.values() for name in own[1:]}
    return Table.of_rows(
        f"The {len(selection.dropped)} dropped parameters, in the order in which they went",
        ("parameter", "symbol", "why"),
        [
            (whole.get(name, name), symbols[name] if whole.get(name, name) == name else "", reason)
            for name, reason in selection.dropped.items()
            if name not in inside
        ],
        text_columns=(0, 1, 2),
        folded=True,
    )


def selection_page(
    model: ErrorModel,
    task: Task,
    selection: Selection,
    effects: Sensitivity,
    maps: TaskMaps | TaskCurves,
    *,
    accuracy: float | None,
    measured: str,
    version: str,
) -> Page:
    """The page of a choice of parameters.

    Args:
        model: the complete model.
        task: what the choice is for.
        selection: the choice.
        effects: sensitivity over the task's poses.
        maps: errors over the task, with the chosen parameters identified.
        accuracy: that was asked for, metres.
        measured: which poses are measured, in words.
        version: of the package, for the footer.
    """
    sections = [
        _how_many(model, selection, accuracy),
        _which(model, selection, effects),
        task_section(model, maps, f"the {len(selection.kept)} chosen parameters", measured),
    ]
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"The parameters that {task.name} needs",
        sections=tuple(sections),
        lead=f"A smaller model of the {robot}, chosen by the error to be expected over the task.",
        footer=f"Taskcal {version}; robot {model.robot.name}; measured: {measured}.",
    )


def _how_many(model: ErrorModel, selection: Selection, accuracy: float | None) -> Section:
    """The error over the number of parameters, and the number that was chosen."""
    chosen = next(nested for nested in selection.ladder if nested.size == len(selection.kept))
    rotation = selection.model_error_rotation
    error = state_model_error(
        selection.model_error * 1e3, selection.model_error_origin, None if rotation is None else rotation * 1e3
    )
    return Section(
        title="How many parameters",
        blocks=(
            Numbers(
                (
                    (f"{len(selection.kept)} of {len(model)}", "", "parameters are enough"),
                    (f"{chosen.expected * 1e3:.3f}", "mm", "expected with them over the task, rms in space"),
                    (f"{selection.ladder[0].expected * 1e3:.3f}", "mm", "expected with all of them"),
                    (f"{selection.before * 1e3:.3f}", "mm", "expected of the nominal robot, frames found"),
                )
            ),
            Points(
                (
                    f"Chosen is {selection.why}.",
                    f"Model error: {error}.",
                    *(
                        f"The {REFERENCES[name][0]} has {size} parameters and is expected to leave {left * 1e3:.3f} mm."
                        for name, (size, left) in selection.references.items()
                    ),
                )
            ),
            Chart(
                title="Expected task error against the number of parameters",
                figure=draw_ladder(selection, accuracy),
                note=_LADDER + (_CROSSED if chosen.cross_validated is not None else ""),
            ),
            tabulate_ladder(selection),
        ),
    )


def _which(model: ErrorModel, selection: Selection, effects: Sensitivity) -> Section:
    """The parameters that were kept, and why the others were not."""
    labels = {p.name: p.label for p in model.parameters}
    kept = ", ".join(labels.get(name, name) for name in selection.kept_groups)
    return Section(
        title="Which, and why not the others",
        blocks=(
            Text((f"Kept: {kept or 'none, the frames alone'}.",)),
            tabulate_dropped(selection, model),
            Chart(
                title="Effect of every parameter on the tool point",
                least_width=700,
                figure=draw_effects(effects),
                note=_EFFECTS,
            ),
            tabulate_effects(effects),
        ),
    )


_LADDER = (
    "Where the line is flat, further parameters buy nothing for this task. From right to left the parameter "
    "goes that is missed least over the task. Logarithmic scale."
)

_CROSSED = (
    " The cross-validated error is on measured points that were left out, their noise included, and a mean; the expected one "
    "is that of the prediction over the task, and root mean square."
)

_EFFECTS = (
    "Over the task's poses, along the robot's base axes and in space. What acts much is not always needed: a parameter "
    "may repeat others, or move the task as the tracker's frame and the targets do."
)
