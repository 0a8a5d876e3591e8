"""Sensitivity as a page: what every parameter does to the tool, which can be told apart, and where in the task it matters."""

from taskcal.adaptation.task_errors import TaskCurves, TaskMaps
from taskcal.analysis.elimination_table import EliminationTable
from taskcal.analysis.sensitivity import Sensitivity
from taskcal.presentation.content import Block, Chart, Numbers, Section, Table, Text
from taskcal.presentation.effect_figures import draw_effects
from taskcal.presentation.effect_tables import tabulate_effects
from taskcal.presentation.model_figures import draw_singular_values
from taskcal.presentation.report import report_html
from taskcal.presentation.task_section import task_section


def sensitivity_html(
    found: Sensitivity, table: EliminationTable, maps: TaskMaps | TaskCurves | None, *, poses: str, version: str
) -> str:
    """The page of a sensitivity analysis.

    Args:
        found: sensitivity over some poses.
        table: what these poses can tell apart.
        maps: errors over the task, if there is one.
        poses: which poses these are, in words.
        version: of the package, for the footer.
    """
    model = found.model
    label, eliminated = next(iter(table.eliminations.items()))
    largest = found.maximum_in_space(scaled=True)
    strongest = model.parameters[int(largest.argmax())]
    rows = [(r.name, r.symbol, r.published, r.repeats, r.eliminated[label]) for r in table.rows]
    columns: list[str] = ["parameter", "symbol", "published", "repeats", "full elimination"]
    if not model.robot.published.source:
        columns, rows = [c for c in columns if c != "published"], [row[:2] + row[3:] for row in rows]
    effects: tuple[Block, ...] = (
        Numbers(
            (
                (strongest.name, "", f"moves the tool most for its tolerance: {largest.max() * 1e6:.0f} µm"),
                (f"{eliminated.rank} of {len(model)}", "", "parameters can be told apart at these poses"),
                (f"{eliminated.condition_number:.0f}", "", "is their condition number, columns of unit length"),
            )
        ),
        Chart(
            title="Effect of every parameter on the tool point",
            figure=draw_effects(found),
            note="Along the robot's base axes and in space, nominal robot. A tolerance is one standard deviation.",
        ),
        tabulate_effects(found),
    )
    sections = [
        Section(title="What each parameter does", blocks=effects),
        Section(
            title="What the poses can tell apart",
            blocks=(
                Text(
                    (
                        f"{len(eliminated.zero)} parameters do nothing to the tool point, {len(eliminated.dependent)} equal a "
                        f"combination of others, {len(eliminated.kept)} are independent. The tracker's frame and the targets, "
                        "which repeat some of these too, are not counted here.",
                    )
                ),
                Chart(title="Singular values", figure=draw_singular_values(table.eliminations)),
                Table.of_rows(
                    f"Elimination of all {len(rows)} parameters",
                    tuple(columns),
                    rows,
                    text_columns=tuple(range(len(columns))),
                    folded=True,
                ),
            ),
        ),
    ]
    if maps is not None:
        measured = "the task's own poses" if isinstance(maps, TaskCurves) else "60 poses spread over the task"
        sections.append(task_section(model, maps, f"all {len(model)} parameters", measured))
    robot = model.robot.title or model.robot.name
    return report_html(
        f"Sensitivity of the {robot}",
        sections,
        lead=f"{len(model)} parameters over {poses}.",
        footer=f"Taskcal {version}; robot {model.robot.name}.",
    )
