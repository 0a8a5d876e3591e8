"""Sensitivity as a page: what every parameter does to the tool, which can be told apart, and where in the task it matters."""

from collections.abc import Mapping

from taskcal.analysis.distinguishable_directions import ToldApart
from taskcal.analysis.elimination_table import EliminationTable, describe_combination
from taskcal.analysis.sensitivity import MeasuringNoise, Sensitivity
from taskcal.planning.task_map import TaskCurves, TaskMaps
from taskcal.report.content import Chart, Numbers, Section, Table, Text
from taskcal.report.fit_figures import draw_effects, draw_singular_values
from taskcal.report.page import Page
from taskcal.report.task import task_section

# What a measurement with noise tells apart, for the terminal and for pages.

WEAKEST_SHOWN, TERMS_SHOWN = 5, 5
"""Directions that are shown, and terms of each."""


def tabulate_told_apart(told_apart: ToldApart, symbols: Mapping[str, str]) -> Table:
    """The directions that a measurement says least of.

    Args:
        told_apart: what it tells apart.
        symbols: of parameters by name, where they have any.
    """
    rows: list[tuple[str, ...]] = []
    for direction in told_apart.directions[:WEAKEST_SHOWN]:
        terms = list(direction.leading.items())
        shown = {name: round(share, 2) for name, share in terms[:TERMS_SHOWN]}
        more = " …" if len(terms) > TERMS_SHOWN else ""
        combination = describe_combination(shown, symbols) + more
        rows.append((combination, f"{direction.left:.3f}", "yes" if direction.information > 1.0 else "no"))
    return Table.of_rows(
        "Directions that such a measurement says least of, in units of the tolerances",
        ("direction", "σ left", "told apart"),
        rows,
        text_columns=(0, 2),
    )


def count_told_apart(told_apart: ToldApart) -> str:
    """How many directions are told apart, in words."""
    return (
        f"{told_apart.count} of {len(told_apart.directions)}: less than half of the tolerances' variance would be left"
    )


# The table of single parameters' effects over some poses.


def tabulate_effects(sensitivities: Sensitivity) -> Table:
    """Largest and root mean square effect of every parameter: per unit, and for its tolerance."""
    raw = [
        *sensitivities.maximum(),
        sensitivities.maximum_in_space(),
        *sensitivities.rms_per_axis(),
        sensitivities.rms(),
    ]
    scaled = [
        *sensitivities.maximum(scaled=True),
        sensitivities.maximum_in_space(scaled=True),
        *sensitivities.rms_per_axis(scaled=True),
        sensitivities.rms(scaled=True),
    ]
    to_shown = sensitivities.to_shown()
    rows: list[tuple[str, ...]] = []
    for i, p in enumerate(sensitivities.model.parameters):
        rows.append(
            (
                p.label,
                p.shown.influence,
                *(f"{values[i] * to_shown[i]:.3f}" for values in raw),
                f"{p.tolerance * p.shown.factor:g} {p.shown.name}",
                *(f"{values[i] * 1e3:.3f}" for values in scaled),
            )
        )
    kinds = [f"{kind}\n{axis}" for kind in ("largest", "rms") for axis in ("X", "Y", "Z", "space")]
    return Table.of_rows(
        f"All {len(rows)} parameters in numbers",
        ("parameter", "unit", *kinds, "tolerance", *(f"{kind} mm" for kind in kinds)),
        rows,
        text_columns=(0, 1),
        note="Per unit of the parameter; then in mm for a defect of one tolerance (1σ).",
        folded=True,
    )


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
