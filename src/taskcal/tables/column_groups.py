"""Columns that mean something together, whatever form of table they come from."""

import re
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import repeated
from taskcal.errors import FileError, shown
from taskcal.tables.table import Table

POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qx", "qy", "qz", "qw")

JOINT_UNITS = {"deg": np.pi / 180, "rad": 1.0, "mm": 1e-3, "m": 1.0}
"""What a joint's number is multiplied by for radians or metres."""

UNIT_LENGTH = 1e-3
"""How far the length of a quaternion or a direction may be from one: files round to a few digits."""

LEAVE_OUT = "give a number, or leave out the row"


@runtime_checkable
class Jointed(Protocol):
    """Whose joints columns name: a robot."""

    @property
    def name(self) -> str:
        """Of the robot."""
        ...

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Of its joints, in order."""
        ...

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which joints slide."""
        ...


class ColumnGroups:
    """Columns of a table by name, whatever the letter case; it remembers which were used.

    Columns are asked for in small letters, or as the file writes them, and named in errors as the file writes them.

    Raises:
        FileError: two columns differ in letter case only.
    """

    def __init__(self, table: Table):
        self.table = table
        lowered = [name.lower() for name in table.header]
        if twice := repeated(lowered):
            raise self.refusal(f"two columns are named '{shown(min(twice))}' but for letter case; keep one")
        self.names = dict(zip(lowered, table.header, strict=True))
        """As the file writes them, by their small letters."""
        self._used: set[str] = set()

    def __len__(self) -> int:
        return len(self.table)

    def __contains__(self, column: str) -> bool:
        return column.lower() in self.names

    def spelled(self, column: str) -> str:
        """A column's name as the file writes it, where it has it."""
        return self.names.get(column.lower(), column)

    def refusal(self, message: str, column: str | None = None) -> FileError:
        """An error that points at the header."""
        return FileError(self.table.path, message, line=self.table.header_line, column=column and self.spelled(column))

    def error(self, message: str, row: int | None = None, column: str | None = None) -> FileError:
        """An error that points at a cell, a line, or the file."""
        return self.table.error(message, row, column and self.spelled(column))

    def texts(self, column: str) -> list[str]:
        """The cells of a column; errors as of `Table.texts`."""
        self._used.add(column.lower())
        return self.table.texts(self.spelled(column))

    def numbers(self, column: str, **how: Any) -> Float[np.ndarray, " rows"]:
        """The numbers of a column; `how` and errors as of `Table.numbers`."""
        self._used.add(column.lower())
        return self.table.numbers(self.spelled(column), **how)

    def side_by_side(self, columns: Sequence[str], **how: Any) -> Float[np.ndarray, "rows columns"]:
        """The numbers of several columns; `how` and errors as of `Table.numbers`."""
        if not columns:
            return np.empty((len(self), 0))
        return np.stack([self.numbers(column, **how) for column in columns], axis=1)

    def together(self, columns: Sequence[str], why: str = "") -> tuple[str, ...]:
        """Columns that only make sense together, as the file writes them; none where it has none of them.

        Raises:
            FileError: it has some of them only, for the reason `why`, or they lack their unit.
        """
        given = tuple(self.names[name.lower()] for name in columns if name in self)
        lacking = [name for name in columns if name not in self]
        if given and lacking:
            raise self.refusal(f"has '{given[0]}' but no column '{lacking[0]}'{why and f'; {why}'}")
        for name in lacking:
            bare = name.removesuffix("_mm")
            if bare != name and bare in self:
                raise self.refusal(f"the unit is not stated; name the column {self.spelled(bare)}_mm", bare)
        self._used.update(name.lower() for name in given)
        return given

    def points(self, prefix: str = "", *, empty: bool = False, remedy: str = LEAVE_OUT) -> Float[np.ndarray, "rows 3"]:
        """``x_mm y_mm z_mm`` with a prefix, in metres; NaN for empty cells where `empty` allows them.

        Raises:
            FileError: a column is lacking, or a cell is not a number.
        """
        columns = [prefix + name for name in POSITION]
        self.together(columns)
        return self.side_by_side(columns, empty=empty, remedy=remedy) * 1e-3

    def quaternions(
        self, prefix: str = "", *, needed: Bool[np.ndarray, " rows"] | None = None, within: float = UNIT_LENGTH
    ) -> Float[np.ndarray, "rows 4"]:
        """``qx qy qz qw`` with a prefix, each of length one.

        Args:
            prefix: of the columns.
            needed: rows that must have one, all by default; the others may be empty, and turn nothing.
            within: how far a length may be from one.

        Raises:
            FileError: a column is lacking, a cell is empty or not a number, or a length is not one.
        """
        columns = [prefix + name for name in QUATERNION]
        self.together(columns, "a pose needs qx qy qz qw")
        quaternions = self.side_by_side(columns, empty=needed is not None, remedy=LEAVE_OUT)
        needed = np.ones(len(self), dtype=bool) if needed is None else needed
        for row, k in zip(*np.nonzero(np.isnan(quaternions) & needed[:, None]), strict=True):
            message = "the cell is empty while the position is there; a pose needs all of qx qy qz qw"
            raise self.error(message, int(row), columns[k])
        self.check_lengths(quaternions, needed, columns[0], "quaternion", within)
        quaternions[~needed] = (0.0, 0.0, 0.0, 1.0)
        return quaternions

    def check_lengths(
        self,
        vectors: Float[np.ndarray, "rows k"],
        needed: Bool[np.ndarray, " rows"],
        column: str,
        what: str,
        within: float = UNIT_LENGTH,
    ) -> None:
        """See that the needed ones of some vectors have length one.

        Raises:
            FileError: one has not; it points at the column.
        """
        lengths = np.linalg.norm(vectors, axis=1)
        for row in np.flatnonzero(needed & (np.abs(lengths - 1.0) > within)):
            hint = " (is qw last?)" if what == "quaternion" else ""
            raise self.error(f"the {what} has length {lengths[row]:.4f}; it must be 1{hint}", int(row), column)

    def joints(self, robot: Jointed) -> Float[np.ndarray, "rows joints"]:
        """Joint positions, radians or metres, in columns such as ``J1_deg``, ``q1_rad`` or ``rail_mm``.

        Raises:
            FileError: a joint has no column, or two, its unit is not stated, or there is a joint too many.
        """
        columns: list[str] = []
        for number, (joint, units) in enumerate(zip(robot.joint_names, _joint_units(robot), strict=True), start=1):
            column = self._joint_column(joint, number, units)
            if column is None:
                bare = [self.names[s] for s in _spellings(joint, number) if s in self.names]
                if bare:
                    wanted = " or ".join(f"{bare[0]}_{unit}" for unit in units)
                    raise self.refusal(f"the unit is not stated; name the column {wanted}", bare[0])
                raise self.refusal(
                    f"has no column for joint {joint} of {robot.name}; it needs one for each of "
                    f"{', '.join(robot.joint_names)}, such as {joint}_{units[0]} or q{number}_{units[1]}"
                )
            columns.append(column)
        count = len(columns)
        surplus = [name for lower, name in self.names.items() if re.match(rf"[jq]{count + 1}_(deg|rad)$", lower)]
        if surplus:
            message = f"is a joint that {robot.name} does not have; it has {count}: is it the right robot?"
            raise self.refusal(f"'{surplus[0]}' {message}")
        return self.side_by_side(columns, remedy=LEAVE_OUT) * joint_scale(columns)

    def joint_columns(
        self, robot: Jointed, endings: Sequence[Sequence[str]] | None = None, why: str = ""
    ) -> tuple[str, ...]:
        """A column for each joint, as the file writes them; none where it has none of them.

        Args:
            robot: whose joints they are.
            endings: what may follow each joint's name; the units of its position by default.
            why: what to say where some joints have a column and others do not.

        Raises:
            FileError: only some joints have a column, or one has two.
        """
        endings = _joint_units(robot) if endings is None else endings
        names = robot.joint_names
        columns = [self._joint_column(*one) for one in zip(names, range(1, len(names) + 1), endings, strict=True)]
        given = tuple(column for column in columns if column is not None)
        if given and None in columns:
            j = columns.index(None)
            raise self.refusal(
                f"has '{given[0]}' but no column '{names[j]}_{endings[j][0]}'{why or f' of {robot.name}'}"
            )
        self._used.update(column.lower() for column in given)
        return given

    def _joint_column(self, joint: str, number: int, endings: Sequence[str]) -> str | None:
        candidates = (f"{spelling}_{ending}" for spelling in _spellings(joint, number) for ending in endings)
        found = [self.names[column] for column in candidates if column in self.names]
        if len(found) > 1:
            raise self.refusal(f"joint {joint} is given twice, by '{found[0]}' and '{found[1]}'; keep one")
        return found[0] if found else None

    def is_used(self, column: str) -> bool:
        """Whether it was asked for."""
        return column.lower() in self._used

    def refuse_unused(self, known: str) -> None:
        """See that every column was used; `known` says which there may be.

        Raises:
            FileError: one was not.
        """
        unused = [name for lower, name in self.names.items() if lower not in self._used]
        if unused:
            named = shown(", ".join(map(repr, unused)))
            raise self.refusal(f"unknown column{'s' if len(unused) > 1 else ''} {named}; {known}")


def joint_scale(columns: Sequence[str]) -> Float[np.ndarray, " columns"]:
    """What the numbers in columns of joints are multiplied by for radians or metres, by the unit at the end of their names."""
    return np.array([JOINT_UNITS[column.lower().rpartition("_")[2]] for column in columns])


def _joint_units(robot: Jointed) -> list[tuple[str, ...]]:
    return [("mm", "m") if slides else ("deg", "rad") for slides in robot.prismatic]


def _spellings(joint: str, number: int) -> list[str]:
    return list(dict.fromkeys(spelling.lower() for spelling in (joint, f"J{number}", f"q{number}")))
