"""A choice of parameters as a page: how many the task needs, which, and why the others are not among them."""

from itertools import groupby

import numpy as np

from taskcal.analysis.sensitivity import Sensitivity
from taskcal.planning.selection import NestedModel, Selection
from taskcal.planning.task_map import TaskCurves, TaskMaps
from taskcal.report.chart import GREEN, INK, PURPLE, VERMILION, Axis, Figure, Level, Panel, Series
from taskcal.report.content import Chart, Column, Facts, Section, TextTable, millimetres, state_model_error
from taskcal.report.page import Report
from taskcal.report.sensitivity import draw_effects, tabulate_effects
from taskcal.report.task import task_section
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

# Error against the number of parameters.

REFERENCES = {"identifiable": ("identifiable set", GREEN, "square"), "published": ("published set", PURPLE, "diamond")}


def draw_ladder(selection: Selection, accuracy: float | None = None) -> Figure:
    """Draw expected and cross-validated error against the number of parameters, and the size that was chosen.

    Args:
        selection: the choice.
        accuracy: that was asked for, metres.
    """
    ladder, chosen = selection.ladder, _chosen(selection)
    gone = [f"{n.size} parameters{f', next to go: {n.dropped_next}' if n.dropped_next else ''}" for n in ladder]
    series = [
        Series(
            kind="line",
            name="expected over the task (rms)",
            x=[nested.size for nested in ladder],
            y=[1e3 * nested.expected for nested in ladder],
            shape="circle",
            labels=gone,
        )
    ]
    crossed = [nested for nested in ladder if nested.cross_validated is not None]
    if crossed:
        mean = np.array([1e3 * (nested.cross_validated or 0.0) for nested in crossed])
        error = np.array([1e3 * (nested.standard_error or 0.0) for nested in crossed])
        series.append(
            Series(
                name="cross-validated on the campaign (mean, standard error)",
                x=[nested.size for nested in crossed],
                y=mean,
                low=mean - error,
                high=mean + error,
                colour=VERMILION,
                hollow=True,
            )
        )
    for name, (count, error) in selection.references.items():
        label, colour, shape = REFERENCES[name]
        series.append(Series(name=f"{label} ({count})", x=[count], y=[1e3 * error], colour=colour, shape=shape))
    name, x, y = f"chosen ({chosen.size})", [chosen.size], [1e3 * chosen.expected]
    series.append(Series(name=name, x=x, y=y, colour=INK, shape="ring", hollow=True))
    levels = () if accuracy is None else (Level(at=accuracy * 1e3, name="accuracy asked for"),)
    y = Axis(title="3D error", unit="mm", log=True)
    panel = Panel(x=Axis(title="parameters in the model"), y=y, series=tuple(series), levels=levels, height=340.0)
    return Figure(panels=(panel,))


def _chosen(selection: Selection) -> NestedModel:
    return next(nested for nested in selection.ladder if nested.size == len(selection.kept))


# The tables of a choice of parameters, for the terminal and for its page.


def tabulate_ladder(selection: Selection) -> TextTable:
    """Tabulate the error over the task by size of the model; cross-validated where there were measurements.

    Neighbouring sizes with the same figures share a row.
    """
    columns = (
        Column(
            "parameters",
            lambda sizes: str(sizes[0].size) if len(sizes) == 1 else f"{sizes[0].size} to {sizes[-1].size}",
        ),
        millimetres("expected mm (rms)", lambda sizes: sizes[0].expected),
        Column("cross-validated mm (mean)", lambda sizes: sizes[0].cross_validated, ".3f", 1e3, optional=True),
        Column("", lambda sizes: "chosen" if sizes[0].size == len(selection.kept) else ""),
    )
    shown = columns[1:]
    rows = [list(sizes) for _, sizes in groupby(selection.ladder, lambda one: [column.cell([one]) for column in shown])]
    return TextTable.of("3D error over the task, by size of the model", columns, rows, folded=True)


def tabulate_dropped(selection: Selection, model: ErrorModel) -> TextTable:
    """Tabulate why parameters were dropped, in the order in which the first of each reason was, and which."""
    symbols = {p.name: p.symbol for p in model.parameters}
    whole = {own[0]: name for name, own in selection.groups.items()}
    inside = {name for own in selection.groups.values() for name in own[1:]}
    by_reason: dict[str, list[str]] = {}
    for name, reason in selection.dropped.items():
        if name not in inside:
            symbol = symbols[name] if name not in whole else ""
            by_reason.setdefault(reason, []).append(
                f"{whole.get(name, name)} ({symbol})" if symbol else whole.get(name, name)
            )
    rows = [(reason, ", ".join(names)) for reason, names in by_reason.items()]
    title = f"The {len(selection.dropped)} dropped parameters"
    return TextTable.of_rows(title, ("reason", "parameters"), rows, text_columns=(0, 1), folded=True)


def selection_page(
    model: ErrorModel,
    task: Task,
    selection: Selection,
    effects: Sensitivity,
    maps: TaskMaps | TaskCurves,
    *,
    accuracy: float | None,
    measured: str,
) -> Report:
    """Make the page of a choice of parameters.

    Args:
        model: the complete model.
        task: what the choice is for.
        selection: the choice.
        effects: sensitivity over the task's poses.
        maps: errors over the task, with the chosen parameters identified.
        accuracy: that was asked for, metres.
        measured: which poses are measured, in words.
    """
    sections = [
        *selection_sections(model, selection, accuracy, effects),
        task_section(model, maps, f"the {len(selection.kept)} chosen parameters", measured),
    ]
    robot = model.robot.title or model.robot.name
    return Report(
        title=f"The parameters that {task.name} needs",
        sections=tuple(sections),
        lead=f"A smaller model of the {robot}, chosen by the error to be expected over the task.",
        source=f"robot {model.robot.name}; measured: {measured}",
    )


def selection_sections(
    model: ErrorModel, selection: Selection, accuracy: float | None, effects: Sensitivity | None = None
) -> tuple[Section, Section]:
    """Make the sections of how many parameters were chosen, and of which.

    Args:
        model: the complete model.
        selection: the choice.
        accuracy: that was asked for, metres.
        effects: sensitivity over the task's poses, where it is to be shown.
    """
    chosen, rotation = _chosen(selection), selection.model_error_rotation
    labels = {p.name: p.label for p in model.parameters}
    kept = ", ".join(labels.get(name, name) for name in selection.kept_groups) or "tracker frame and targets alone"
    origin, turned = selection.model_error_origin, None if rotation is None else rotation * 1e3
    number = Section(
        "Number of parameters",
        Facts(
            ("selected", f"{len(selection.kept)} of {len(model)}: {kept}"),
            ("reason", selection.why),
            ("model error", state_model_error(selection.model_error * 1e3, origin, turned)),
            ("with these", _expected(chosen.expected)),
            ("with all", _expected(selection.ladder[0].expected)),
            ("nominal (registered)", _expected(selection.before)),
            *(
                (REFERENCES[name][0], f"{size} parameters, {_expected(left)}")
                for name, (size, left) in selection.references.items()
            ),
            ("out of reach", f"{selection.unreachable:.1%} of the task's poses") if selection.unreachable else None,
        ),
        Chart(
            "Expected task error against the number of parameters",
            draw_ladder(selection, accuracy),
            _LADDER + (_CROSSED if chosen.cross_validated is not None else ""),
        ),
        tabulate_ladder(selection),
    )
    which = Section(
        "Dropped parameters",
        tabulate_dropped(selection, model),
        *([] if effects is None else [_chart_effects(effects), tabulate_effects(effects)]),
    )
    return number, which


def _expected(error: float) -> str:
    return f"expected error {error * 1e3:.3f} mm (3D rms)"


def _chart_effects(effects: Sensitivity) -> Chart:
    return Chart(
        "Effect of every parameter on the TCP",
        draw_effects(effects),
        "Over the task's poses, along the robot's base axes and in space. A large effect does not make a parameter "
        "necessary: it may depend linearly on others, or move the task as tracker frame and targets do.",
    )


_LADDER = (
    "Where the line is flat, further parameters do not reduce the error of this task. From right to left, each time the parameter "
    "with the smallest effect on the expected task error is removed. Logarithmic scale."
)

_CROSSED = (
    " The cross-validated error is the mean on held-out measured points, their noise included; the expected error is the rms of "
    "the prediction over the task."
)
