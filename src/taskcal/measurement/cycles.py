"""Reading measured cycles from CSV: poses approached, or paths passed, again and again."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.short_repr import short_repr
from taskcal.tabular.column_groups import POSITION, QUATERNION, ColumnGroups
from taskcal.tabular.csv_form import read_csv

_POINT = "x_mm y_mm z_mm, qx qy qz qw"
_COMMAND = "command_x_mm …, command_qx …"
_COMMANDED = "command_"


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PoseCycles:
    """One commanded pose, approached from one direction again and again."""

    pose: str
    """Its name."""
    direction: str
    """Name of the direction of approach; empty where the file names none."""
    cycles: tuple[str, ...]
    """Name of every cycle."""
    attained: Float[np.ndarray, "cycles 3"]
    """Measured positions, in the frame of the command, metres."""
    rotations: Float[np.ndarray, "cycles 3 3"] | None
    """Measured orientations; None for positions."""
    commanded: Float[np.ndarray, " 3"] | None
    """Commanded position, metres; None where the file has none."""
    commanded_rotation: Float[np.ndarray, "3 3"] | None
    """Commanded orientation."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PathCycles:
    """A commanded path, and passes along it."""

    sections: tuple[str, ...]
    """Name of every commanded point, in order."""
    commanded: Float[np.ndarray, "points 3"]
    """Commanded points, metres."""
    commanded_rotations: Float[np.ndarray, "points 3 3"] | None
    """Commanded orientations."""
    cycles: tuple[str, ...]
    """Name of every pass."""
    attained: tuple[Float[np.ndarray, "_ 3"], ...]
    """Samples of each pass in order, in the frame of the command, metres."""
    rotations: tuple[Float[np.ndarray, "_ 3 3"], ...] | None
    """Measured orientations; None for positions."""


def read_pose_cycles(path: str | Path) -> tuple[PoseCycles, ...]:
    """Read poses measured in cycles.

    Columns: ``pose``, ``cycle``, optionally ``direction``; measured ``x_mm y_mm z_mm``, optionally ``qx qy qz qw``; the
    command as ``command_x_mm …`` and ``command_qx …``, the same in all rows of a pose. Letter case does not matter.

    Args:
        path: the CSV.

    Returns:
        one entry for each pose and direction, in the file's order.

    Raises:
        FileError: with file, line, column and remedy, for anything that cannot be read as such.
    """
    columns = _columns(path)
    if "section" in columns and "pose" not in columns:
        raise columns.refusal(
            "has 'section' in place of 'pose': it holds passes along a path; read it as such (--path)"
        )
    poses, cycles = _names(columns, "pose"), _names(columns, "cycle")
    directions = _names(columns, "direction") if "direction" in columns else [""] * len(poses)
    attained, rotations = columns.points(), _rotations(columns)
    commanded = columns.points(_COMMANDED) if columns.together([_COMMANDED + name for name in POSITION]) else None
    commanded_rotations = _rotations(columns, _COMMANDED)
    columns.refuse_unused(f"it may have pose, cycle, direction, {_POINT}, {_COMMAND}")
    commands = _commands(columns)
    first_of_pose: dict[str, int] = {}
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for row, (pose, direction, cycle) in enumerate(zip(poses, directions, cycles, strict=True)):
        _check_same_command(columns, commands, row, first_of_pose.setdefault(pose, row), f"pose '{pose}'")
        group = groups.setdefault((pose, direction), {})
        if cycle in group:
            where = f"pose '{pose}'" + (f" from direction '{direction}'" if direction else "")
            message = f"cycle '{cycle}' of {where} is in line {columns.table.lines[group[cycle]]} already; give each its own name"
            raise columns.error(message, row, "cycle")
        group[cycle] = row
    out: list[PoseCycles] = []
    for (pose, direction), group in groups.items():
        rows = list(group.values())
        out.append(
            PoseCycles(
                pose=pose,
                direction=direction,
                cycles=tuple(group),
                attained=attained[rows],
                rotations=None if rotations is None else rotations[rows],
                commanded=None if commanded is None else commanded[rows[0]],
                commanded_rotation=None if commanded_rotations is None else commanded_rotations[rows[0]],
            )
        )
    return tuple(out)


def read_path_cycles(path: str | Path, commanded: str | Path | None = None) -> PathCycles:
    """Read passes along a path.

    Columns: ``cycle``; measured ``x_mm y_mm z_mm``, optionally ``qx qy qz qw``; rows of a pass in its order. The commanded
    path is in the same file, as ``section`` and ``command_x_mm …`` (``command_qx …``), the same in all rows of a section;
    or it is a file of its own with ``x_mm y_mm z_mm`` (``qx qy qz qw``), and samples may lie anywhere along it.

    Args:
        path: the CSV of the passes.
        commanded: the CSV of the commanded path, where it is a file of its own.

    Raises:
        FileError: with file, line, column and remedy, for anything that cannot be read as such.
    """
    columns = _columns(path)
    cycles = _names(columns, "cycle")
    passes: dict[str, list[int]] = {}
    for row, cycle in enumerate(cycles):
        passes.setdefault(cycle, []).append(row)
    attained, rotations = columns.points(), _rotations(columns)
    if commanded is None:
        names, path_points, path_rotations = _sections(columns, passes)
    else:
        columns.refuse_unused(f"it may have cycle, {_POINT}")
        own = _columns(commanded)
        path_points, path_rotations = own.points(), _rotations(own)
        own.refuse_unused(f"it may have {_POINT}")
        names = tuple(str(number) for number in range(len(path_points)))
    lonely = [rows[0] for rows in passes.values() if len(rows) < 2]
    if lonely:
        message = f"pass '{cycles[lonely[0]]}' has one row; a pass needs two or more"
        raise columns.error(message, lonely[0], "cycle")
    return PathCycles(
        sections=names,
        commanded=path_points,
        commanded_rotations=path_rotations,
        cycles=tuple(passes),
        attained=tuple(attained[rows] for rows in passes.values()),
        rotations=None if rotations is None else tuple(rotations[rows] for rows in passes.values()),
    )


def _sections(
    columns: ColumnGroups, passes: dict[str, list[int]]
) -> tuple[tuple[str, ...], Float[np.ndarray, "points 3"], Float[np.ndarray, "points 3 3"] | None]:
    """The commanded path that the rows of the first pass say, after a look at all others."""
    if "section" not in columns:
        message = "has no column 'section'; give it and command_x_mm, command_y_mm, command_z_mm, or the path as a file of its own"
        raise columns.refusal(f"{message} (--command)")
    sections, commanded = _names(columns, "section"), columns.points(_COMMANDED)
    rotations = _rotations(columns, _COMMANDED)
    columns.refuse_unused(f"it may have section, cycle, {_POINT}, {_COMMAND}")
    commands = _commands(columns)
    first_pass, *_ = passes.values()
    place = {sections[row]: row for row in first_pass}
    for cycle, rows in passes.items():
        row_of_section: dict[str, int] = {}
        for row in rows:
            name = sections[row]
            if name in row_of_section:
                line = columns.table.lines[row_of_section[name]]
                message = f"section '{name}' of pass '{cycle}' is in line {line} already; give each its own name"
                raise columns.error(message, row, "section")
            if name not in place:
                message = f"the first pass has no section '{name}'; it says the path, so it must have all"
                raise columns.error(message, row, "section")
            row_of_section[name] = row
            _check_same_command(columns, commands, row, place[name], f"section '{name}'")
    rows = list(place.values())
    return tuple(place), commanded[rows], None if rotations is None else rotations[rows]


def _columns(path: str | Path) -> ColumnGroups:
    columns = ColumnGroups(read_csv(path))
    if not len(columns):
        raise columns.error("has no measurements below its header")
    return columns


def _names(columns: ColumnGroups, column: str) -> list[str]:
    """Names in a column, none of them empty."""
    names = columns.texts(column)
    if "" in names:
        raise columns.error(f"the cell is empty; name the {column}", names.index(""), column)
    return names


def _rotations(columns: ColumnGroups, prefix: str = "") -> Float[np.ndarray, "rows 3 3"] | None:
    if not columns.together([prefix + name for name in QUATERNION]):
        return None
    return se3.from_quaternion(columns.quaternions(prefix))


def _commands(columns: ColumnGroups) -> dict[str, Float[np.ndarray, " rows"]]:
    """The numbers of the command, by their columns."""
    return {name: columns.numbers(name) for name in columns.names if name.startswith(_COMMANDED)}


def _check_same_command(
    columns: ColumnGroups, commands: Mapping[str, Float[np.ndarray, " rows"]], row: int, first: int, what: str
) -> None:
    """See that two rows have one command.

    Raises:
        FileError: a cell of the first row says another.
    """
    for name, numbers in commands.items():
        if numbers[row] != numbers[first]:
            other = f"{numbers[first]:g} in line {columns.table.lines[first]}"
            message = f"{numbers[row]:g} is another command for {what} than {other}; give one command"
            raise columns.error(message, row, name)
