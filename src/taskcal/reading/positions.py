"""Positions of targets in a table of measurements: in columns for each target, as directions and ranges, or lost."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import Faults, listed, shown
from taskcal.reading.columns import (
    CALCULATED,
    MAX_COORDINATE_M,
    Kind,
    Meaning,
    MeasuredTable,
    find_word,
    split_unit,
    stated_units,
)
from taskcal.tables.table import ANGLES, LENGTHS, UNITS, Table, raise_all

# Positions as an instrument turns to them: an azimuth, an elevation or a zenith angle, and a range.

_OF_DIRECTIONS: tuple[Kind, ...] = ("azimuth", "clockwise", "elevation", "zenith", "either", "range", "theta")


def with_positions(table: Table) -> Table:
    """The table with columns ``x y z`` in place of angles and ranges; what was taken is noted.

    x points along azimuth zero and z upwards. An azimuth turns counter-clockwise seen from above; ``Hz`` clockwise.

    Raises:
        FileError: the unit of an angle is not stated, or whether it is counted from the horizontal.
    """
    if not any(table.header):
        return table
    parted = [split_unit(name) for name in table.header]
    if any(text in ("x", "x coordinate", "x koordinate") or text.endswith(" x") for text, _ in parted):
        return table
    units = [unit or UNITS.get(under) for (_, unit), under in zip(parted, table.units, strict=True)]
    by_target: dict[str, dict[Kind, int]] = {}
    for k, (text, _) in enumerate(parted):
        if found := find_word(text, *_OF_DIRECTIONS):
            by_target.setdefault(found[1]["target"] or "", {}).setdefault(found[0].kind, k)
    for target, at in by_target.items():
        turned = at.get("azimuth", at.get("clockwise"))
        polar = at.get("elevation", at.get("zenith", at.get("either") if "clockwise" in at else None))
        if "range" not in at:
            continue
        if turned is not None and polar is not None:
            table = _with_position(table, target, at, (turned, polar, at["range"]), units)
        elif "either" in at and (turned is not None or "theta" in at):
            name = table.header[at["either"]]
            message = (
                "is counted from the horizontal by some instruments and from the zenith by others; name it elevation or zenith, "
                "the angle about the vertical azimuth"
            )
            raise table.header_error(f"'{name}' {message}", name)
    return table


def _with_position(
    table: Table, target: str, at: Mapping[Kind, int], columns: tuple[int, int, int], units: Sequence[str | None]
) -> Table:
    """The table with one target's position in place of its angles and range."""
    header, angle = table.header, stated_units(table.preamble).angle
    scales: list[float] = []
    for k in columns[:2]:
        unit = units[k] or angle
        if unit not in ANGLES:
            what = "the unit of the angle is not stated" if unit is None else f"'{unit}' is no unit of an angle"
            raise table.header_error(f"{what}; name the column {header[k]}_deg, _rad or _gon", header[k])
        scales.append(ANGLES[unit])
    unit = units[columns[2]]
    if unit is not None and unit not in LENGTHS:
        raise table.header_error(f"'{unit}' is no unit of length; known: {', '.join(LENGTHS)}", header[columns[2]])
    azimuth, polar, distance = (table.numbers(header[k], empty=True) for k in columns)
    clockwise, from_zenith = "azimuth" not in at, "elevation" not in at
    turned, polar = (-1.0 if clockwise else 1.0) * azimuth * scales[0], polar * scales[1]
    elevation = np.pi / 2 - polar if from_zenith else polar
    level = distance * np.cos(elevation)
    points = np.stack([level * np.cos(turned), level * np.sin(turned), distance * np.sin(elevation)], axis=1)
    points[distance == 0.0] = np.nan
    names = {
        k: f"{target} {axis}".strip() + (f" {unit}" if unit else "") for k, axis in zip(columns, "xyz", strict=True)
    }
    cells = {
        k: ["" if np.isnan(value) else repr(value) for value in points[:, i].tolist()] for i, k in enumerate(columns)
    }
    note = (
        f"{', '.join(header[k] for k in columns)} are read as an azimuth that turns "
        f"{'clockwise' if clockwise else 'counter-clockwise'} seen from above, an angle from the "
        f"{'zenith' if from_zenith else 'horizontal'} and a range"
    )
    return replace(
        table,
        header=tuple(names.get(k, name) for k, name in enumerate(header)),
        rows=table.cells.with_columns(cells),
        units=tuple("" if k in names else under for k, under in enumerate(table.units)),
    ).noted(note)


# Cells that stand for what was not seen.

_LOST = re.compile(
    r"nan|nil|none|null|n/?a|#n/a|#nv|#value!|-+|–|—|\?+|\*+|inf|lost|no data|beam lost|invalid|[+-]?9{4,}(?:\.[09]*)?",
    re.ASCII | re.IGNORECASE,
)
"""What is written in place of a point that was not seen; all three cells of a target are the same."""

_YES = frozenset({"1", "true", "yes", "y", "ja", "j", "ok", "valid", "x", "wahr", "1.0", "checked"})
_NO = frozenset({"0", "false", "no", "n", "nein", "nok", "nio", "invalid", "falsch", "0.0", "unchecked"})


def is_lost(cell: str) -> bool:
    """Whether a cell is empty, or holds what stands for a lost beam."""
    return not cell or _LOST.fullmatch(cell) is not None


def rows_not_valid(table: Table) -> tuple[list[int], tuple[str, ...]]:
    """Rows that a column such as ``valid`` calls not valid, and a note of them."""
    for name in table.header:
        text, unit = split_unit(name)
        if unit is not None or find_word(text, "valid") is None:
            continue
        said = [text.casefold() for text in table.texts(name)]
        rows = [row for row, text in enumerate(said) if text in _NO]
        if rows and set(said) <= _YES | _NO:
            flag = shown(name, 40)
            return rows, (f"what was measured is taken for lost where '{flag}' says so ({_listed(table, rows)})",)
    return [], ()


def _listed(table: Table, rows: Sequence[int]) -> str:
    """The first lines of some rows, in words."""
    return f"line {listed((table.lines[row] for row in rows), 5)}"


def without_lost(table: Table, columns: Sequence[str]) -> tuple[Table, tuple[str, ...]]:
    """A table whose cells of a target are empty where all three hold one word, or the nines, for a beam that was lost.

    Args:
        table: the cells.
        columns: of the target's axes.

    Returns:
        The table, and a note of what was taken for a lost beam.
    """
    by_axis = [table.texts(column) for column in columns]
    lost = {
        row: cells[0]
        for row, cells in enumerate(zip(*by_axis, strict=True))
        if cells[0] and len(set(cells)) == 1 and _LOST.fullmatch(cells[0])
    }
    if not lost:
        return table, ()
    for cells in by_axis:
        for row in lost:
            cells[row] = ""
    axes = [table.header.index(column) for column in columns]
    rows = table.cells.with_columns(dict(zip(axes, by_axis, strict=True)))
    words = ", ".join(f"'{shown(word, 20)}'" for word in dict.fromkeys(lost.values()))
    note = f"{words} for {columns[0]} … is taken for a lost beam ({_listed(table, list(lost))})"
    return replace(table, rows=rows), (note,)


# Positions of targets in a table of measurements: columns for each target, or a row for each.

MAX_UNCERTAINTY_M = 0.01
"""Standard uncertainty, metres, at most, under a name that positions have too. A convention: no instrument that calibrates
robots has as much."""

MAX_UNCERTAINTY_SHARE = 0.01
"""Uncertainty over the largest coordinate, at most, where the unit of both is unknown. A convention: 10 mm on a metre."""

LEAVE_EMPTY = "give a number, or leave all the target's cells empty"

MAX_TARGETS = 100
"""On one tool; plates for trackers carry up to a dozen reflectors, and the fit's matrices grow with the square."""


def targets_of(measured: MeasuredTable) -> dict[str, Any]:
    """Fields of `Readings` on the positions of a table's rows and how sure they are, with notes of what was decided on the way.

    Raises:
        FileError: an axis is lacking or given twice, only some have a unit, or a cell is not what it must be.
    """
    places = measured.by_target("position")
    names: dict[str, str] = {}
    met: dict[tuple[str, int], str] = {}
    for column, meaning in measured.of("position"):
        low = meaning.target.casefold()
        names.setdefault(low, meaning.target)
        if (low, meaning.index) in met:
            twice = f"'{met[low, meaning.index]}' and '{column}'"
            raise measured.header_error(f"{twice} are both the {'xyz'[meaning.index]} of one target; keep one")
        met[low, meaning.index] = column
    _refuse_goals(measured, places)
    if len(places) > 10 * MAX_TARGETS:
        raise measured.header_error(f"names {len(places)} targets; Taskcal fits {MAX_TARGETS} at most: choose some")
    units = {low: _unit(measured, names[low], axes) for low, axes in places.items()}
    stated = {unit is not None for unit in units.values()}
    if len(stated) > 1:
        without = next(low for low, unit in units.items() if unit is None)
        column = places[without][0][0]
        raise measured.header_error(f"the unit is not stated; name the column {column}_mm", column)
    points, notes, faults = dict[str, np.ndarray](), list[str](), Faults()
    for low, axes in places.items():
        columns = [axes[i][0] for i in range(3)]
        table, lost = without_lost(measured, columns)
        notes += lost
        with faults.collecting():
            points[names[low] or "tool"] = _positions(table, columns, units[low])
    uncertainty: dict[str, np.ndarray] = {}
    in_metres: frozenset[str] = frozenset()
    with faults.collecting():
        farthest = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in points.values()), default=0.0)
        largest = MAX_UNCERTAINTY_SHARE * farthest
        uncertainty, in_metres = _uncertainty(measured, set(units.values()), largest)
    short = [name for name, meaning in measured.of("uncertainty") if meaning.form and name not in measured.unread]
    if short and uncertainty:
        notes.append(f"{shown(', '.join(short))} are read as standard uncertainties")
    faults.raise_any()
    invalid, said = rows_not_valid(measured) if points else ([], ())
    for values in points.values():
        values[invalid] = np.nan
    return {
        "points": points,
        "length_unit_stated": stated != {False},
        "uncertainty": uncertainty,
        "uncertainty_stated": in_metres,
        "notes": (*notes, *said),
    }


def _refuse_goals(measured: MeasuredTable, places: Mapping[str, object]) -> None:
    """Goals, and how far the robot was off them, are not what was measured, though it follows from both."""
    off = [name for name, meaning in measured.of("nominal") if meaning.form == "off"]
    if off and places and places.keys() <= CALCULATED:
        message = (
            f"has goals ('{shown(measured.of('position')[0][0])}') and differences from them ('{shown(off[0])}'), not points; add "
            "columns of what was measured"
        )
        raise measured.header_error(message)


def _unit(table: Table, name: str, axes: Mapping[int, tuple[str, Meaning]]) -> str | None:
    """The unit of a target's axes, all of which must be there and in the same."""
    have = next(iter(axes.values()))[0]
    for axis in range(3):
        if axis not in axes:
            spelled = have[: len(have) - len("x_mm")] if have.lower().endswith("_mm") else (f"{name}_" if name else "")
            raise table.header_error(
                f"has '{have}' but no column '{spelled}{'xyz'[axis]}_mm'; a point needs x, y and z"
            )
    columns = {column: meaning.unit for column, meaning in axes.values()}
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
    largest = MAX_COORDINATE_M / LENGTHS[unit or "mm"]
    points = table.side_by_side(columns, empty=True, remedy=LEAVE_EMPTY, largest=largest)
    blank = np.isnan(points)
    message = (
        "the cell is empty while its target's others are not; leave all three empty for a lost beam, or drop the row"
    )
    some = np.flatnonzero(blank.any(axis=1) & ~blank.all(axis=1)).tolist()
    raise_all(table.error(message, row, columns[int(np.argmax(blank[row]))]) for row in some)
    points[(points == 0.0).all(axis=1)] = np.nan
    return points * (LENGTHS[unit] if unit else 1.0)


def _uncertainty(
    measured: MeasuredTable, units: set[str | None], largest: float
) -> tuple[dict[str, Float[np.ndarray, " rows"]], frozenset[str]]:
    """Standard uncertainty by target, of three axes the root mean square, and the targets for which it is in metres.

    Without a unit of its own it is as the positions are, if these are in millimetres.
    """
    if not units and not measured.of("observed"):
        return {}, frozenset()
    out, in_metres = dict[str, np.ndarray](), set[str]()
    for target, at in measured.by_target("uncertainty").items():
        chosen = [at[3]] if 3 in at else [at[i] for i in range(3) if i in at]
        if 3 not in at and len(chosen) < 3:
            continue
        first, own = chosen[0][0], {meaning.unit for _, meaning in chosen}
        unit = next(iter(own)) or ("mm" if units == {"mm"} else None)
        if len(own) > 1:
            raise measured.header_error("the axes of one uncertainty have different units", first)
        if unit is None and units != {None}:
            raise measured.header_error(f"the unit is not stated; name the column {first}_mm", first)
        if unit is not None and unit not in LENGTHS:
            raise measured.header_error(f"'{unit}' is not a unit of length; known: {', '.join(LENGTHS)}", first)
        scale = 1.0 if unit is None else LENGTHS[unit]
        squares = np.zeros(len(measured))
        for name, meaning in chosen:
            values = measured.numbers(name)
            if meaning.form == "s":
                _refuse_positions(measured, name, values, largest if unit is None else MAX_UNCERTAINTY_M / scale)
            for row in np.flatnonzero(values <= 0.0):
                message = f"{values[row]:g} is not a standard uncertainty; give one above zero"
                raise measured.error(message, int(row), name)
            squares += (values * scale) ** 2
        out[target] = np.sqrt(squares / len(chosen))
        in_metres |= {target} if unit is not None else set()
    return out, frozenset(in_metres)


def _refuse_positions(table: Table, column: str, values: np.ndarray, largest: float) -> None:
    """See that values under a name such as ``sx`` are uncertainties, not positions of a sphere, a socket or a set-point."""
    row = int(np.argmax(np.abs(values))) if len(values) else 0
    if len(values) and not (values.min() > 0.0 and values[row] <= largest):
        message = (
            f"{values[row]:g} is not a standard uncertainty; give one named u_mm, or name the columns of a position for its "
            "target, as in sphere_x_mm"
        )
        raise table.error(message, row, column)
