"""Reading measured cycles from CSV: poses approached, or paths passed, again and again."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.csv_table import CsvTable, read_csv
from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.short_repr import short_repr

_AXES, _QUATERNION = ("x_mm", "y_mm", "z_mm"), ("qx", "qy", "qz", "qw")
_UNIT_QUATERNION = 1e-3
"""How far a quaternion's length may be from one: files round to a few digits."""
_POINT = "x_mm y_mm z_mm, qx qy qz qw"
_COMMAND = "command_x_mm …, command_qx …"
_LEAVE_OUT = "give a number, or leave out the row"


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
    columns = _Columns(read_csv(path))
    if "section" in columns.names and "pose" not in columns.names:
        raise FileError(
            path, "has 'section' in place of 'pose': it holds passes along a path; read it as such (--path)", line=1
        )
    poses, cycles = columns.texts("pose"), columns.texts("cycle")
    directions = columns.texts("direction") if "direction" in columns.names else [""] * len(poses)
    attained, rotations = columns.points(""), columns.rotations("")
    commanded = columns.points("command_") if columns.has("command_", _AXES) else None
    commanded_rotations = columns.rotations("command_")
    columns.refuse_others(f"pose, cycle, direction, {_POINT}, {_COMMAND}")
    first_of_pose: dict[str, int] = {}
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for row, (pose, direction, cycle) in enumerate(zip(poses, directions, cycles, strict=True)):
        columns.check_same_command(row, first_of_pose.setdefault(pose, row), f"pose '{pose}'")
        group = groups.setdefault((pose, direction), {})
        if cycle in group:
            where = f"pose '{pose}'" + (f" from direction '{direction}'" if direction else "")
            message = f"cycle '{cycle}' of {where} is in line {columns.table.lines[group[cycle]]} already; give each its own name"
            raise columns.table.error(message, row, columns.names["cycle"])
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
    columns = _Columns(read_csv(path))
    cycles = columns.texts("cycle")
    passes: dict[str, list[int]] = {}
    for row, cycle in enumerate(cycles):
        passes.setdefault(cycle, []).append(row)
    attained, rotations = columns.points(""), columns.rotations("")
    if commanded is None:
        names, path_points, path_rotations = _sections(columns, passes)
    else:
        columns.refuse_others(f"cycle, {_POINT}")
        own = _Columns(read_csv(commanded))
        path_points, path_rotations = own.points(""), own.rotations("")
        own.refuse_others(_POINT)
        names = tuple(str(number) for number in range(len(path_points)))
    lonely = [rows[0] for rows in passes.values() if len(rows) < 2]
    if lonely:
        message = f"pass '{cycles[lonely[0]]}' has one row; a pass needs two or more"
        raise columns.table.error(message, lonely[0], columns.names["cycle"])
    return PathCycles(
        sections=names,
        commanded=path_points,
        commanded_rotations=path_rotations,
        cycles=tuple(passes),
        attained=tuple(attained[rows] for rows in passes.values()),
        rotations=None if rotations is None else tuple(rotations[rows] for rows in passes.values()),
    )


def _sections(
    columns: "_Columns", passes: dict[str, list[int]]
) -> tuple[tuple[str, ...], Float[np.ndarray, "points 3"], Float[np.ndarray, "points 3 3"] | None]:
    """The commanded path that the rows of the first pass say, after a look at all others."""
    if "section" not in columns.names:
        message = "has no column 'section'; give it and command_x_mm, command_y_mm, command_z_mm, or the path as a file of its own"
        raise FileError(columns.table.path, f"{message} (--command)", line=1)
    sections, commanded = columns.texts("section"), columns.points("command_")
    rotations = columns.rotations("command_")
    columns.refuse_others(f"section, cycle, {_POINT}, {_COMMAND}")
    first_pass, *_ = passes.values()
    place = {sections[row]: row for row in first_pass}
    for cycle, rows in passes.items():
        known: dict[str, int] = {}
        for row in rows:
            name = sections[row]
            if name in known:
                line = columns.table.lines[known[name]]
                message = f"section '{name}' of pass '{cycle}' is in line {line} already; give each its own name"
                raise columns.table.error(message, row, columns.names["section"])
            if name not in place:
                message = f"the first pass has no section '{name}'; it says the path, so it must have all"
                raise columns.table.error(message, row, columns.names["section"])
            known[name] = row
            columns.check_same_command(row, place[name], f"section '{name}'")
    rows = list(place.values())
    return tuple(place), commanded[rows], None if rotations is None else rotations[rows]


class _Columns:
    """Columns of a table by their names in small letters, and which of them were used."""

    def __init__(self, table: CsvTable):
        self.table = table
        self.names = {name.lower(): name for name in table.header}
        if len(self.names) < len(table.header):
            lowered = [name.lower() for name in table.header]
            twice = min(name for name, times in Counter(lowered).items() if times > 1)
            raise FileError(table.path, f"two columns are named '{twice}' but for letter case", line=1)
        if not len(table):
            raise FileError(table.path, "has no measurements below its header")
        self._used: set[str] = set()
        self._commands: dict[str, np.ndarray] = {}

    def has(self, prefix: str, columns: tuple[str, ...]) -> bool:
        """Whether any of the columns is there; all of them must be then.

        Raises:
            FileError: only some are.
        """
        given = [prefix + name for name in columns if prefix + name in self.names]
        lacking = [prefix + name for name in columns if prefix + name not in self.names]
        if given and lacking:
            raise FileError(
                self.table.path, f"has no column '{lacking[0]}' beside '{self.names[given[0]]}'; it needs both", line=1
            )
        return bool(given)

    def texts(self, column: str) -> list[str]:
        """Names in a column, none of them empty."""
        self._used.add(column)
        cells = self.table.texts(self.names.get(column, column))
        if "" in cells:
            raise self.table.error(f"the cell is empty; name the {column}", cells.index(""), self.names[column])
        return cells

    def points(self, prefix: str) -> Float[np.ndarray, "rows 3"]:
        """Three columns of millimetres, in metres."""
        self.has(prefix, _AXES)
        return self._numbers(prefix, _AXES) * 1e-3

    def rotations(self, prefix: str) -> Float[np.ndarray, "rows 3 3"] | None:
        """Rotations of four columns of unit quaternions; None where they are not there."""
        if not self.has(prefix, _QUATERNION):
            return None
        quaternions = self._numbers(prefix, _QUATERNION)
        lengths = np.linalg.norm(quaternions, axis=1)
        wrong = np.flatnonzero(np.abs(lengths - 1.0) > _UNIT_QUATERNION)
        if len(wrong):
            message = f"the quaternion has length {lengths[wrong[0]]:.4f}; it must be 1 (is qw last?)"
            raise self.table.error(message, int(wrong[0]), self.names[prefix + "qx"])
        return se3.from_quaternion(quaternions)

    def _numbers(self, prefix: str, columns: tuple[str, ...]) -> Float[np.ndarray, "rows columns"]:
        names = [prefix + name for name in columns]
        self._used.update(names)
        numbers = [self.table.numbers(self.names.get(name, name), remedy=_LEAVE_OUT) for name in names]
        if prefix:
            self._commands |= dict(zip(names, numbers, strict=True))
        return np.stack(numbers, axis=1)

    def check_same_command(self, row: int, first: int, what: str) -> None:
        """See that two rows have one command.

        Raises:
            FileError: a cell of the first row says another.
        """
        for name, numbers in self._commands.items():
            if numbers[row] != numbers[first]:
                other = f"{numbers[first]:g} in line {self.table.lines[first]}"
                message = f"{numbers[row]:g} is another command for {what} than {other}"
                raise self.table.error(f"{message}; give one command", row, self.names[name])

    def refuse_others(self, known: str) -> None:
        """See that every column was used.

        Raises:
            FileError: one was not.
        """
        unknown = [name for lower, name in self.names.items() if lower not in self._used]
        if unknown:
            found = f"unknown column{'s' if len(unknown) > 1 else ''} {', '.join(repr(name) for name in unknown)}"
            raise FileError(self.table.path, f"{found}; it may have {known}", line=1)
