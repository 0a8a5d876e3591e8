"""Sensitivity as a page: what every parameter does to the tool, which can be told apart, and where in the task it matters."""

from taskcal.adaptation.task_errors import TaskCurves, TaskMaps
from taskcal.analysis.elimination_table import EliminationTable
from taskcal.analysis.measuring_noise import MeasuringNoise
from taskcal.analysis.sensitivity import Sensitivity
from taskcal.analysis.told_apart import ToldApart
from taskcal.presentation.content import Chart, Numbers, Section, Table, Text
from taskcal.presentation.effect_figures import draw_effects
from taskcal.presentation.effect_tables import tabulate_effects
from taskcal.presentation.model_figures import draw_singular_values
from taskcal.presentation.report import Page
from taskcal.presentation.task_section import task_section
from taskcal.presentation.told_apart_table import count_told_apart, tabulate_told_apart


def sensitivity_page(
    sensitivity: Sensitivity,
    table: EliminationTable,
    told_apart: ToldApart,
    noise: MeasuringNoise,
    *,
    maps: TaskMaps | TaskCurves | None,
    poses: str,
    version: str,
) -> Page:
    """The page of a sensitivity analysis.

    Args:
        sensitivity: over some poses.
        table: what these poses can tell apart.
        told_apart: how much of it a measurement with noise tells apart.
        noise: of that measurement.
        maps: errors over the task, if there is one.
        poses: which poses these are, in words.
        version: of the package, for the footer.
    """
    model = sensitivity.model
    sections = [_effects(sensitivity, table, told_apart), _elimination(sensitivity, table, told_apart, noise)]
    if maps is not None:
        measured = "the task's own poses" if isinstance(maps, TaskCurves) else "60 poses spread over the task"
        sections.append(task_section(model, maps, f"all {len(model)} parameters", measured))
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"Sensitivity of the {robot}",
        sections=tuple(sections),
        lead=f"{len(model)} parameters over {poses}.",
        footer=f"Taskcal {version}; robot {model.robot.name}.",
    )


def _effects(sensitivity: Sensitivity, table: EliminationTable, told_apart: ToldApart) -> Section:
    """What every parameter does."""
    model, eliminated = sensitivity.model, next(iter(table.eliminations.values()))
    largest = sensitivity.maximum_in_space(scaled=True)
    strongest = model.parameters[int(largest.argmax())]
    return Section(
        title="What each parameter does",
        blocks=(
            Numbers(
                (
                    (strongest.name, "", f"moves the tool most for its tolerance: {largest.max() * 1e3:.3f} mm"),
                    (f"{eliminated.rank} of {len(model)}", "", "parameters are independent at these poses"),
                    (
                        f"{told_apart.count} of {eliminated.rank}",
                        "",
                        "directions are told apart by a measurement's noise",
                    ),
                    (f"{eliminated.condition_number:.0f}", "", "is their condition number, columns of unit length"),
                )
            ),
            Chart(
                title="Effect of every parameter on the tool point",
                least_width=700,
                figure=draw_effects(sensitivity),
                note="A high bar: an ordinary defect moves the tool far. Without a bar: it does nothing at these "
                "poses. Along the robot's "
                "base axes and in space, nominal robot. A tolerance is one standard deviation.",
            ),
            tabulate_effects(sensitivity),
        ),
    )


def _elimination(
    sensitivity: Sensitivity, table: EliminationTable, told_apart: ToldApart, noise: MeasuringNoise
) -> Section:
    """What is independent exactly, and what of it the noise can tell apart."""
    model = sensitivity.model
    label, eliminated = next(iter(table.eliminations.items()))
    rows = [(r.name, r.symbol, r.published, r.repeats, r.eliminated[label]) for r in table.rows]
    columns: list[str] = ["parameter", "symbol", "published", "repeats", "full elimination"]
    if not model.robot.published.source:
        columns, rows = [c for c in columns if c != "published"], [row[:2] + row[3:] for row in rows]
    symbols = {p.name: p.symbol or p.name for p in model.parameters}
    return Section(
        title="What the poses can tell apart",
        blocks=(
            Text(
                (
                    f"{len(eliminated.zero)} parameters do nothing to the tool point, {len(eliminated.dependent)} equal a "
                    f"combination of others, {len(eliminated.kept)} are independent. The tracker's frame and the targets, "
                    "which repeat some of these too, are not counted here.",
                    f"Told apart by a measurement at these poses are {count_told_apart(told_apart)}. Its noise is "
                    f"{noise.describe()}.",
                )
            ),
            tabulate_told_apart(told_apart, symbols),
            Chart(
                title="Singular values",
                figure=draw_singular_values(table.eliminations),
                note="Filled marks count: so many parameters are independent. A wide gap below them: the number is beyond doubt. "
                "Filled marks far to the right and low: exactly independent, but the noise of a measurement drowns them.",
            ),
            Table.of_rows(
                f"Elimination of all {len(rows)} parameters",
                tuple(columns),
                rows,
                text_columns=tuple(range(len(columns))),
                folded=True,
            ),
        ),
    )
