"""Positions of targets in a table of measurements: columns for each target, or a row for each."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from taskcal.errors import shown
from taskcal.measurement.column_meaning import CALCULATED, Meaning
from taskcal.measurement.lost_beams import rows_not_valid, without_lost
from taskcal.measurement.units import FARTHEST, LENGTHS
from taskcal.tabular.faults import Faults
from taskcal.tabular.table import Table

MAX_UNCERTAINTY = 0.01
"""Largest standard uncertainty under a name that positions have too, metres: no instrument that calibrates robots has as much."""

SMALL = 0.01
"""Largest of these over the largest coordinate, where the unit of both is unknown."""

LEAVE_EMPTY = "give a number, or leave all the target's cells empty"

MAX_TARGETS = 100
"""On one tool; plates for trackers carry up to a dozen reflectors, and the fit's matrices grow with the square."""

_OFF = re.compile(
    r"(?:^|[\s_.\-])(?:dif|diff|difference|dev|deviation|delta|err|error|residual|abw|abweichung)(?:$|[\s_.\-])", re.I
)
"""Names of how far the robot was off."""


class _Uncertainty(NamedTuple):
    """Of one target."""

    values: Float[np.ndarray, " rows"]
    stated: bool
    """Whether it has a unit, and is in metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetColumns:
    """The positions of a table's rows."""

    points: dict[str, Float[np.ndarray, "rows 3"]]
    """By target, ``tool`` where the file names none; NaN for a lost beam. Metres, or as in the file where no unit is stated."""
    uncertainty: dict[str, Float[np.ndarray, " rows"]]
    """Standard uncertainty per axis, by the target whose it is, empty for all; units as of the points, or metres."""
    uncertainty_stated: frozenset[str] = frozenset()
    """Those of them that are in metres, whatever the points are in."""
    unit_stated: bool
    """False where no position has a unit."""
    notes: tuple[str, ...] = ()
    """What was decided on the way."""


def target_columns(table: Table, meanings: Sequence[Meaning | None]) -> TargetColumns:
    """The positions of a table's rows, and how sure they are.

    Raises:
        FileError: an axis is lacking or given twice, only some have a unit, or a cell is not what it must be.
    """
    places: dict[str, dict[int, int]] = {}
    names: dict[str, str] = {}
    for k, meaning in enumerate(meanings):
        if meaning is None or meaning.kind != "position":
            continue
        axes = places.setdefault(meaning.target.casefold(), {})
        names.setdefault(meaning.target.casefold(), meaning.target)
        if meaning.index in axes:
            twice = f"'{table.header[axes[meaning.index]]}' and '{table.header[k]}'"
            raise table.header_error(f"{twice} are both the {'xyz'[meaning.index]} of one target; keep one")
        axes[meaning.index] = k
    _refuse_goals(table, meanings, places)
    if len(places) > 10 * MAX_TARGETS:
        raise table.header_error(f"names {len(places)} targets; Taskcal fits {MAX_TARGETS} at most: choose some")
    units = {low: _unit(table, meanings, names[low], axes) for low, axes in places.items()}
    stated = {unit is not None for unit in units.values()}
    if len(stated) > 1:
        without = next(low for low, unit in units.items() if unit is None)
        column = table.header[places[without][0]]
        raise table.header_error(f"the unit is not stated; name the column {column}_mm", column)
    points: dict[str, np.ndarray] = {}
    notes: list[str] = []
    faults = Faults()
    for low, axes in places.items():
        table, lost = without_lost(table, [table.header[axes[i]] for i in range(3)])
        notes += lost
        with faults.collecting():
            points[names[low] or "tool"] = _positions(table, [table.header[axes[i]] for i in range(3)], units[low])
    uncertainty: dict[str, _Uncertainty] = {}
    with faults.collecting():
        farthest = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in points.values()), default=0.0)
        uncertainty = _uncertainty(table, meanings, set(units.values()), SMALL * farthest)
    short = [table.header[k] for k, m in enumerate(meanings) if m and m.kind == "uncertainty" and m.form]
    if short and uncertainty:
        notes.append(f"{shown(', '.join(short))} are read as standard uncertainties")
    faults.raise_any()
    invalid, said = rows_not_valid(table) if points else ([], ())
    for values in points.values():
        values[invalid] = np.nan
    notes += said
    return TargetColumns(
        points=points,
        uncertainty={name: one.values for name, one in uncertainty.items()},
        uncertainty_stated=frozenset(name for name, one in uncertainty.items() if one.stated),
        unit_stated=stated != {False},
        notes=tuple(notes),
    )


def _refuse_goals(table: Table, meanings: Sequence[Meaning | None], places: dict[str, dict[int, int]]) -> None:
    """Goals, and how far the robot was off them, are not what was measured, though it follows from both."""
    if not places or not places.keys() <= CALCULATED:
        return
    off = [
        name for name, m in zip(table.header, meanings, strict=True) if m and m.kind == "nominal" and _OFF.search(name)
    ]
    if off:
        goal = table.header[min(k for axes in places.values() for k in axes.values())]
        message = (
            f"has goals ('{shown(goal)}') and differences from them ('{shown(off[0])}'), not points; add columns of what was "
            "measured"
        )
        raise table.header_error(message)


def _unit(table: Table, meanings: Sequence[Meaning | None], name: str, axes: dict[int, int]) -> str | None:
    """The unit of a target's axes, all of which must be there and in the same."""
    have = table.header[next(iter(axes.values()))]
    for axis in range(3):
        if axis not in axes:
            spelled = have[: len(have) - len("x_mm")] if have.lower().endswith("_mm") else (f"{name}_" if name else "")
            raise table.header_error(f"has '{have}' but no column '{spelled}{'xyz'[axis]}_mm'")
    columns = {table.header[k]: m.unit for k in axes.values() if (m := meanings[k]) is not None}
    units = set(columns.values())
    if units == {None}:
        return None
    if None in units:
        bare = next(column for column, unit in columns.items() if unit is None)
        raise table.header_error(f"the unit is not stated; name the column {bare}_mm", bare)
    if len(units) > 1:
        listed = ", ".join(f"'{column}' ({unit})" for column, unit in columns.items())
        raise table.header_error(f"the axes of one target have different units: {listed}; give all three in one unit")
    unit = units.pop()
    if unit not in LENGTHS:
        raise table.header_error(f"'{unit}' is no unit of length; known: {', '.join(LENGTHS)}", have)
    return unit


def _positions(table: Table, columns: Sequence[str], unit: str | None) -> np.ndarray:
    faults = Faults()
    largest = FARTHEST / LENGTHS[unit or "mm"]
    points = np.full((len(table), 3), np.nan)
    for axis, column in enumerate(columns):
        with faults.collecting():
            points[:, axis] = table.numbers(column, empty=True, remedy=LEAVE_EMPTY, largest=largest)
    faults.raise_any()
    blank = np.isnan(points)
    for row in np.flatnonzero(blank.any(axis=1) & ~blank.all(axis=1)):
        with faults.collecting():
            message = "the cell is empty while its target's others are not; leave all three empty for a lost beam, or drop the row"
            raise table.error(message, int(row), columns[int(np.argmax(blank[row]))])
    faults.raise_any()
    points[(points == 0.0).all(axis=1)] = np.nan
    return points * (LENGTHS[unit] if unit else 1.0)


def _uncertainty(
    table: Table, meanings: Sequence[Meaning | None], units: set[str | None], largest: float
) -> dict[str, _Uncertainty]:
    """By target; of three axes the root mean square. Without a unit of its own it is as the positions are, if these are in mm."""
    if not units and not any(m and m.kind == "observed" for m in meanings):
        return {}
    columns: dict[str, dict[int, int]] = {}
    for k, meaning in enumerate(meanings):
        if meaning is not None and meaning.kind == "uncertainty":
            columns.setdefault(meaning.target.casefold(), {})[meaning.index] = k
    out: dict[str, _Uncertainty] = {}
    for target, at in columns.items():
        chosen = [at[3]] if 3 in at else [at[i] for i in range(3) if i in at]
        if 3 not in at and len(chosen) < 3:
            continue
        own = {m.unit for k in chosen if (m := meanings[k])}
        unit = next(iter(own)) or ("mm" if units == {"mm"} else None)
        if len(own) > 1:
            raise table.header_error("the axes of one uncertainty have different units", table.header[chosen[0]])
        if unit is None and units != {None}:
            bare = table.header[chosen[0]]
            raise table.header_error(f"the unit is not stated; name the column {bare}_mm", bare)
        if unit is not None and unit not in LENGTHS:
            message = f"'{unit}' is not a unit of length; known: {', '.join(LENGTHS)}"
            raise table.header_error(message, table.header[chosen[0]])
        scale = 1.0 if unit is None else LENGTHS[unit]
        squares = np.zeros(len(table))
        for k in chosen:
            meaning, values = meanings[k], table.numbers(table.header[k])
            if meaning and meaning.form == "s":
                _refuse_positions(table, table.header[k], values, largest if unit is None else MAX_UNCERTAINTY / scale)
            for row in np.flatnonzero(values <= 0.0):
                message = f"{values[row]:g} is not a standard uncertainty; give one above zero"
                raise table.error(message, int(row), table.header[k])
            squares += (values * scale) ** 2
        out[target] = _Uncertainty(np.sqrt(squares / len(chosen)), unit is not None)
    return out


def _refuse_positions(table: Table, column: str, values: np.ndarray, largest: float) -> None:
    """See that values under a name such as ``sx`` are uncertainties, not positions of a sphere, a socket or a set-point."""
    row = int(np.argmax(np.abs(values))) if len(values) else 0
    if len(values) and not (values.min() > 0.0 and values[row] <= largest):
        message = (
            f"{values[row]:g} is not a standard uncertainty; give one named u_mm, or name the columns of a position for its "
            "target, as in sphere_x_mm"
        )
        raise table.error(message, row, column)
