"""Sensitivity as a page: what every parameter does to the tool, which are determined, and where in the task it matters."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.analysis.identifiability import (
    NEGLIGIBLE,
    Direction,
    DistinguishableDirections,
    EliminationRow,
    EliminationTable,
    Identifiability,
    describe_combination,
    published_kept,
)
from taskcal.analysis.sensitivity import MeasuringNoise, Sensitivity
from taskcal.planning.task_map import TaskCurves, TaskMaps
from taskcal.report.chart import AXIS_COLOURS, INK, SERIES, SHAPES, Axis, Figure, Level, Panel, Series
from taskcal.report.content import Chart, Column, Facts, Numbers, Section, TextTable
from taskcal.report.page import Report
from taskcal.report.task import task_section
from taskcal.robot.parameter import Parameter
from taskcal_groundwork.said import Said

# Figures of a model over some poses: how much each parameter moves the tool, and how many are independent.

SMALLEST_DRAWN = 1e-18
"""Singular values are drawn no lower; exact zeros have no logarithm."""


def draw_effects(found: Sensitivity) -> Mapping[str, Figure]:
    """Largest and root mean square effect of every parameter on X, Y, Z and in space, for its tolerance or per unit."""
    kinds = {
        Said("largest over the poses"): (found.maximum, found.maximum_in_space),
        Said("root mean square"): (found.rms_per_axis, found.rms),
    }
    panels: dict[str, Any] = {
        title: (
            1e3 * np.vstack([per_axis(scaled=True), in_space(scaled=True)]),
            found.to_shown() * np.vstack([per_axis(), in_space()]),
        )
        for title, (per_axis, in_space) in kinds.items()
    }
    axes: dict[str, Axis] = {
        Said("for its tolerance"): Axis(title=Said("effect of its tolerance"), unit="mm", zero=True),
        Said("per unit"): Axis(title=Said("effect per unit"), unit="mm/mm, mm/mrad …", zero=True),
    }
    return _by_parameter(found.model.parameters, panels, axes)


def draw_sensitivities(
    found: Mapping[str, Sensitivity], eliminations: Mapping[str, Identifiability]
) -> Mapping[str, Figure]:
    """Largest effect of each parameter on X, Y and Z, for its tolerance or per unit.

    Args:
        found: a panel for each set of poses.
        eliminations: of the same sets; marks of parameters that they do not keep are empty.
    """
    parameters = next(iter(found.values())).model.parameters
    panels = {f"poses in {label}": (1e6 * one.maximum(scaled=True), one.maximum()) for label, one in found.items()}
    axes = {
        "scaled by tolerance": Axis(title="largest influence", unit="µm", zero=True),
        "per unit": Axis(title="influence", unit="mm/mm, mm/mrad", zero=True),
    }
    return _by_parameter(
        parameters, panels, axes, [[p.name not in eliminations[label].kept for p in parameters] for label in found]
    )


def _by_parameter(
    parameters: Sequence[Parameter],
    panels: Mapping[str, tuple[Float[np.ndarray, "axes p"], Float[np.ndarray, "axes p"]]],
    axes: Mapping[str, Axis],
    hollow: Sequence[Sequence[bool]] = (),
) -> Mapping[str, Figure]:
    """Marks of every parameter along each axis, and in space where there is a fourth row.

    Args:
        parameters: of the model.
        panels: values for the tolerance and per unit, by the panel's title.
        axes: for either, by the label of the view.
        hollow: marks that are empty, in each panel.
    """
    styles = [*zip(AXIS_COLOURS, AXIS_COLOURS.values(), SHAPES, strict=False), (Said("in space"), INK, "tick")]
    names = Axis(categories=tuple(p.symbol or p.name for p in parameters))
    return {
        label: Figure(
            panels=tuple(
                Panel(
                    title=title,
                    x=axis,
                    y=names,
                    series=tuple(
                        Series(
                            name=name,
                            x=line,
                            y=range(len(parameters)),
                            colour=colour,
                            shape=shape,
                            hollow=hollow[number] if hollow else False,
                            labels=[p.label for p in parameters],
                        )
                        for line, (name, colour, shape) in zip(values[view], styles, strict=False)
                    ),
                )
                for number, (title, values) in enumerate(panels.items())
            ),
            columns=2,
        )
        for view, (label, axis) in enumerate(axes.items())
    }


def draw_singular_values(eliminations: Mapping[str, Identifiability]) -> Figure:
    """Singular values of the stacked sensitivities, columns of unit length: the gap that decides the rank."""
    series = tuple(
        Series(
            name=f"{label}: {found.rank} of {len(found.singular_values)} count",
            x=np.arange(1, len(found.singular_values) + 1),
            y=np.maximum(found.singular_values, SMALLEST_DRAWN),
            colour=SERIES[k % len(SERIES)],
            shape=SHAPES[k % len(SHAPES)],
            hollow=[number >= found.rank for number in range(len(found.singular_values))],
        )
        for k, (label, found) in enumerate(eliminations.items())
    )
    largest = max(float(found.singular_values.max(initial=0.0)) for found in eliminations.values())
    limit = Level(at=NEGLIGIBLE * largest, name="limit: 10⁻⁹ of the largest")
    x, y = Axis(title="number of the singular value"), Axis(title="singular value (columns of unit length)", log=True)
    return Figure(panels=(Panel(x=x, y=y, series=series, levels=(limit,), height=320.0),))


# What a measurement with noise determines, for the terminal and for pages.

MAX_DIRECTIONS, MAX_TERMS = 5, 5
"""Directions that are shown, and terms of each."""


def tabulate_distinguishable(told_apart: DistinguishableDirections, symbols: Mapping[str, str]) -> TextTable:
    """The directions that a measurement determines least.

    Args:
        told_apart: the directions.
        symbols: of parameters by name, where they have any.
    """

    def combination(direction: Direction) -> str:
        terms = list(direction.leading.items())
        shown = {name: round(share, 2) for name, share in terms[:MAX_TERMS]}
        return describe_combination(shown, symbols) + (" …" if len(terms) > MAX_TERMS else "")

    columns = (
        Column("direction", combination),
        Column("posterior/prior σ", "left", ".3f"),
        Column("determined", lambda direction: "yes" if direction.information > 1.0 else "no"),
    )
    return TextTable.of(
        "Least determined parameter directions (prior-normalised)", columns, told_apart.directions[:MAX_DIRECTIONS]
    )


def count_distinguishable(told_apart: DistinguishableDirections) -> str:
    """Count the directions that are determined, in words."""
    return (
        f"{told_apart.count} of {len(told_apart.directions)} directions are determined: less than half of the prior variance "
        "remains"
    )


# The tables of single parameters: what elimination says of each, and their effects over some poses.


def tabulate_eliminated(title: str, table: EliminationTable, rows: Iterable[EliminationRow]) -> TextTable:
    """What was published of some parameters, which one other each equals at all poses, and what elimination at each set says.

    Args:
        title: of the table.
        table: of all parameters.
        rows: of it.
    """
    sets = list(table.eliminations)
    columns = (
        Column("parameter", "name"),
        Column("symbol", "symbol", optional=True),
        Column("published", "published", optional=True),
        Column("equal to", "repeats"),
        *(
            Column(label if len(sets) > 1 else "full elimination", lambda row, label=label: row.eliminated[label])
            for label in sets
        ),
    )
    return TextTable.of(title, columns, rows)


def tabulate_all_eliminated(table: EliminationTable, note: str = "") -> TextTable:
    """Tabulate the elimination of all parameters, which a page shows on demand."""
    whole = tabulate_eliminated(f"Elimination of all {len(table.rows)} parameters", table, table.rows)
    return replace(whole, note=note, folded=True)


def tabulate_effects(found: Sensitivity) -> TextTable:
    """Largest and root mean square effect of every parameter: per unit, and for its tolerance."""
    sizes = (found.maximum, found.maximum_in_space, found.rms_per_axis, found.rms)
    raw = np.vstack([size() for size in sizes]) * found.to_shown()
    scaled = np.vstack([size(scaled=True) for size in sizes]) * 1e3
    parameters = found.model.parameters
    kinds = [f"{kind}\n{axis}" for kind in ("largest", "rms") for axis in ("X", "Y", "Z", "space")]
    columns = (
        Column("parameter", lambda i: parameters[i].label),
        Column("unit", lambda i: parameters[i].shown.influence),
        *(Column(kind, values.__getitem__, ".3f") for kind, values in zip(kinds, raw, strict=True)),
        Column("tolerance", lambda i: parameters[i].stated_tolerance, "s"),
        *(Column(f"{kind} mm", values.__getitem__, ".3f") for kind, values in zip(kinds, scaled, strict=True)),
    )  # fmt: skip
    return TextTable.of(
        f"All {len(parameters)} parameters in numbers",
        columns,
        range(len(parameters)),
        note="Per unit of the parameter; then in mm for a geometric error of one tolerance (1σ).",
        folded=True,
    )


SPACES = {"x": "x", "y": "y", "z": "z", "space": "3D"}
"""Axes of the robot's base, and all of them together; how a column names them."""


def sensitivity_section(
    parameters: Sequence[Mapping[str, Any]],
    found: Sensitivity,
    table: EliminationTable,
    told_apart: DistinguishableDirections,
    noise: MeasuringNoise,
) -> Section:
    """Make the section that a terminal shows: influences in short, and what is identifiable.

    Args:
        parameters: as `taskcal sensitivity --json` lists them.
        found: sensitivity over some poses.
        table: exact linear dependence at these poses.
        told_apart: directions that a measurement with noise determines.
        noise: of that measurement.
    """
    fate = {row.name: "kept" for row in table.rows} | dict.fromkeys(_eliminated(table).zero, "zero")
    fate |= dict.fromkeys(_eliminated(table).dependent, "dependent")
    columns = (
        Column("parameter", "name"),
        Column("symbol", "symbol", optional=True),
        *(Column(words, f"max_{axis}", ".3f") for axis, words in SPACES.items()),
        Column("unit", "unit"),
        *(
            Column(f"{words} µm", lambda p, axis=axis: p["tolerance_scaled_um"][axis], ".1f")
            for axis, words in SPACES.items()
        ),
        Column("elimination", lambda p: fate[p["name"]]),
    )
    title = f"Maximum influence over {len(found.matrix)} poses: per unit, and at the tolerance (1σ) in µm"
    spare = ("x", "y", "z", "x µm", "y µm", "z µm", "symbol")
    gone = [row for row in table.rows if fate[row.name] != "kept" or row.published not in ("", "kept")]
    return Section(
        "Sensitivity",
        TextTable.of(title, columns, parameters, spare=spare),
        tabulate_eliminated("Linearly dependent parameters at these poses", table, gone),
        tabulate_distinguishable(told_apart, _symbols(found)),
        Facts(*_identifiable(found, table, told_apart, noise)),
    )


def _eliminated(table: EliminationTable) -> Identifiability:
    return next(iter(table.eliminations.values()))


def _symbols(found: Sensitivity) -> dict[str, str]:
    return {p.name: p.symbol or p.name for p in found.model.parameters}


def _identifiable(
    found: Sensitivity, table: EliminationTable, told_apart: DistinguishableDirections, noise: MeasuringNoise
) -> list[tuple[str, str]]:
    """State how many parameters are independent, and how many directions noise leaves determined; label and text."""
    model, eliminated = found.model, _eliminated(table)
    indices = "  ".join(f"{name}={value:.3g}" for name, value in asdict(eliminated.observability()).items())
    counts = (
        f"{len(eliminated.zero)} without effect, {len(eliminated.dependent)} dependent, {len(eliminated.kept)} kept"
    )
    published = model.robot.published.source
    return [
        ("rank", f"{eliminated.rank} of {len(model)} ({counts}); gap={eliminated.gap:.2g}"),
        ("determined", count_distinguishable(told_apart)),
        ("noise", noise.describe()),
        ("condition number", f"{eliminated.condition_number:.3g} (kept columns, unit length)"),
        ("observability", f"{indices} (kept, in units of tolerance)"),
        *([("published", f"{len(published_kept(model))} kept: {published}")] if published else []),
    ]


def sensitivity_page(
    found: Sensitivity,
    table: EliminationTable,
    told_apart: DistinguishableDirections,
    noise: MeasuringNoise,
    *,
    maps: TaskMaps | TaskCurves | None,
    poses: str,
) -> Report:
    """Make the page of a sensitivity analysis.

    Args:
        found: sensitivity over some poses.
        table: exact linear dependence at these poses.
        told_apart: directions that a measurement with noise determines.
        noise: of that measurement.
        maps: errors over the task, if there is one.
        poses: which poses these are, in words.
    """
    model = found.model
    sections = [_effects(found), _elimination(found, table, told_apart, noise)]
    if maps is not None:
        measured = "the task's own poses" if isinstance(maps, TaskCurves) else "60 poses spread over the task"
        sections.append(task_section(model, maps, f"all {len(model)} parameters", measured))
    robot = model.robot.title or model.robot.name
    return Report(
        title=f"Sensitivity of the {robot}",
        sections=sections,
        lead=f"{len(model)} parameters over {poses}.",
        source=f"robot {model.robot.name}",
    )


def _effects(found: Sensitivity) -> Section:
    """Effects of every parameter."""
    model, largest = found.model, found.maximum_in_space(scaled=True)
    return Section(
        "Effect of each parameter",
        Numbers(
            (model.parameters[int(largest.argmax())].name, "", f"has the largest effect: {largest.max() * 1e3:.3f} mm"),
        ),
        Chart(
            "Effect of every parameter on the TCP",
            draw_effects(found),
            "Far to the right: an ordinary geometric error moves the tool far. At zero: it has no effect at these poses. "
            "Along the base axes and in space, nominal model. A tolerance is one standard deviation.",
        ),
        tabulate_effects(found),
    )


def _elimination(
    found: Sensitivity, table: EliminationTable, told_apart: DistinguishableDirections, noise: MeasuringNoise
) -> Section:
    """Exactly independent parameters, and the directions that noise leaves determined."""
    return Section(
        "Identifiable parameters",
        Facts(*_identifiable(found, table, told_apart, noise)),
        "Tracker frame and targets, which are dependent on some of these parameters too, are not counted here.",
        tabulate_distinguishable(told_apart, _symbols(found)),
        Chart(
            "Singular values",
            draw_singular_values(table.eliminations),
            "Filled marks count: so many parameters are independent. A wide gap below them: the number is beyond doubt. "
            "Filled marks far to the right and low: exactly independent, but lost in the noise of a measurement.",
        ),
        tabulate_all_eliminated(table),
    )
