"""From a table to quantities: joints, positions, orientations and all else that one file states, as it states it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import Faults, FileError, shown
from taskcal.observations import ObservedColumns, kinds
from taskcal.observations.base import Quantity
from taskcal.reading.columns import Kind, Meaning, MeasuredTable, meanings, numbered_parts, split_unit
from taskcal.reading.joints import joints_of, read_table_or_program, refuse_other_axes
from taskcal.reading.orientations import OpenAngles, rotations_of
from taskcal.reading.positions import targets_of, with_positions
from taskcal.reading.unnamed import name_columns
from taskcal.robot.robot import Robot
from taskcal.tables.options import AngleForm, TableForm
from taskcal.tables.table import ANGLES, LENGTHS, NUMBER, TIMES, UNIT_LENGTH, UNITS, Table, raise_all
from taskcal.tables.text import footer_note, is_statistic

MIN_RANGE_M = 0.01
"""Range of a column of lengths that may be what was measured, metres: uncertainties and deviations vary by less."""

MAX_TIME_S = 1e7
"""No robot works so many seconds before it is measured; clocks count more."""

TEMPERATURES_C = (-50.0, 150.0)
"""Between these a robot works."""

KNOWN = (
    "a campaign has id, joints ({joint}_deg …), targets (x_mm … or NAME_x_mm …), qx qy qz qw, u_mm, station, temp_C, time_s, "
    "{joint}_approach …"
)
"""What columns there may be."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """The rows of one file, or of two whose rows were paired."""

    path: Path
    lines: Int[np.ndarray, " n"]
    """Of the file, from 1."""
    ids: tuple[str, ...] | None = None
    """As the file names its rows, repeated where it repeats them; None where it does not."""
    groups: tuple[str, ...] | None = None
    """Of points that have names of their own in each; None where the file states none, or one throughout."""
    q: Float[np.ndarray, "n joints"] | None = None
    """Radians and metres; where `joint_unit_stated` is false, as in the file. None without joints."""
    joint_unit_stated: bool = True
    """False where no joint that turns has a unit."""
    joint_columns: tuple[str, ...] = ()
    """As the file names them, one for each joint."""
    points: Mapping[str, Float[np.ndarray, "n 3"]] = field(default_factory=dict[str, np.ndarray])
    """By target, ``tool`` where the file names none, metres; where `length_unit_stated` is false, as in the file. NaN for a lost
    beam."""
    length_unit_stated: bool = True
    """False where no position has a unit."""
    uncertainty: Mapping[str, Float[np.ndarray, " n"]] = field(default_factory=dict[str, np.ndarray])
    """Standard uncertainty per axis, by target in small letters, empty for all; as the points."""
    uncertainty_stated: frozenset[str] = frozenset()
    """Those of them that are in metres, whatever the points are in."""
    rotations: Mapping[str, Float[np.ndarray, "n 3 3"]] = field(default_factory=dict[str, np.ndarray])
    """By target, an empty name where their columns name none."""
    open_angles: OpenAngles | None = None
    """Where it is open what three angles mean."""
    temperature: Float[np.ndarray, " n"] | None = None
    """°C."""
    time: Float[np.ndarray, " n"] | None = None
    """Seconds."""
    approach: Float[np.ndarray, "n joints"] | None = None
    """1, −1, or 0 where it is unknown."""
    move: Float[np.ndarray, "n joints"] | None = None
    """Radians and metres."""
    targets_by_row: tuple[str, ...] | None = None
    """Whose position each row holds, where a column says."""
    stations: tuple[str, ...] | None = None
    """Where the tracker stood at each row, where a column says."""
    observed: ObservedColumns | None = None
    """Columns of kinds of observation that need no tracker; None where there are none."""
    preamble: tuple[str, ...] = ()
    """Lines above the table and comments."""
    left_lengths: tuple[str, ...] = ()
    """Columns of lengths that were left out and vary by more than `MIN_RANGE_M`."""
    notes: tuple[str, ...] = ()
    """What was decided on the way."""
    acted: frozenset[str] = frozenset()
    """What the user stated that made a difference, by the fields of `ReadOptions` and `TableForm`."""
    points_path: Path | None = None
    """File of the points, where that is another than that of the joints."""
    point_lines: Int[np.ndarray, " n"] | None = None
    """Its lines, from 1."""

    def points_error(self, message: str, row: int | None = None, column: str | None = None) -> FileError:
        """Error of the points, with their file: its header, or the line of a row."""
        line = 1 if row is None else int(self.lines_of_points[row])
        return FileError(self.points_path or self.path, message, line=line, column=column)

    @property
    def lines_of_points(self) -> Int[np.ndarray, " n"]:
        """Lines of the file that holds the points."""
        return self.lines if self.point_lines is None else self.point_lines

    @property
    def names(self) -> str:
        """Name of the file, or of both."""
        return self.path.name if self.points_path is None else f"{self.path.name} with {self.points_path.name}"

    def __len__(self) -> int:
        return len(self.lines)

    def noted(self, *notes: str) -> "Readings":
        """The readings with more notes."""
        return replace(self, notes=(*self.notes, *notes))

    def converted(self, robot: Robot, angle: str | None, lengths: Mapping[str, str]) -> "Readings":
        """With joints that turn in radians from a unit, and positions in metres from one for each target, where these are given.

        An uncertainty is as its target; one of all targets as the first.
        """
        scale = {name.casefold(): LENGTHS[unit] for name, unit in lengths.items()}
        first = next(iter(scale.values()), 1.0)
        q = self.q
        if angle is not None and q is not None:
            q = np.where(robot.prismatic, q, q * ANGLES[angle])
        return replace(
            self,
            q=q,
            joint_unit_stated=self.joint_unit_stated or angle is not None,
            points={name: values * scale.get(name.casefold(), 1.0) for name, values in self.points.items()},
            length_unit_stated=self.length_unit_stated or bool(lengths),
            uncertainty={
                name: values * (1.0 if name in self.uncertainty_stated else scale.get(name, first))
                for name, values in self.uncertainty.items()
            },
        )

    def take(self, rows: Int[np.ndarray, " k"]) -> "Readings":
        """Some of the rows."""

        def pick(value: Any) -> Any:
            if isinstance(value, np.ndarray):
                return value[rows]
            if isinstance(value, tuple):
                return tuple(value[i] for i in rows)
            if isinstance(value, Mapping):
                return {name: values[rows] for name, values in value.items()}
            if isinstance(value, OpenAngles):
                return value.mapped(lambda R: R[rows])
            return None if value is None else value.take(rows)

        return replace(self, **{name: pick(getattr(self, name)) for name in _BY_ROW})


_BY_ROW = (
    "ids", "groups", "lines", "q", "points", "uncertainty", "rotations", "open_angles", "temperature", "time", "approach", "move",
    "targets_by_row", "stations", "observed", "point_lines",
)  # fmt: skip
"""What readings hold for each row."""


def read_readings(
    path: str | Path | Table, robot: Robot, form: TableForm | None = None, angles: AngleForm | None = None
) -> Readings:
    """Read what one file says, whatever its form and its columns' names.

    Args:
        path: the file, or its table.
        robot: the robot that was measured.
        form: what is stated of the table.
        angles: what three angles of a pose mean, where their names do not say.

    Raises:
        FileError: with all that is wrong in it, the first twenty faults.
    """
    table = path if isinstance(path, Table) else read_table_or_program(path, robot, form)
    table = with_positions(name_columns(table, robot))
    known = meanings(table.header, table.units, robot.joint_names, _numbered_parts(table))
    measured = without_summaries(MeasuredTable.of_table(table, robot, known))
    faults = Faults()
    for fault in (*measured.faults, *_contradictions(measured)):
        with faults.collecting():
            raise fault
    found: dict[str, Any] = {}
    for read in (joints_of, targets_of):
        with faults.collecting():
            found |= read(measured)
    with faults.collecting():
        found |= rotations_of(measured, found.get("points", {}), angles)
    for read in (_ids, _conditions, _approaches, _moves):
        with faults.collecting():
            found |= read(measured)
    for refuse in (_refuse_nearly_known, refuse_other_axes, _refuse_unlabelled):
        with faults.collecting():
            refuse(measured)
    faults.raise_any()
    if not len(measured):
        raise FileError(measured.path, "has no measurements below its header")
    found["groups"], found["observed"] = _groups(measured), _observed(measured)
    if found["ids"] is None:
        # of a group in which targets have names, or the rows none
        found["ids"], found["groups"] = found["groups"], None
    if "q" not in found and not any(np.isfinite(points).any() for points in found["points"].values()):
        _refuse_nothing_measured(measured, found["observed"])
    named, turned = measured.of("target"), {name for name, _ in measured.of("euler")} - measured.unread
    stations = _stations(measured)
    left_numbers, left_texts, left_lengths = _left_out(measured)
    return Readings(
        path=measured.path,
        lines=np.array(measured.lines, dtype=np.int64),
        targets_by_row=tuple(measured.texts(named[0][0])) if named else None,
        stations=stations,
        preamble=measured.preamble,
        left_lengths=left_lengths,
        notes=(*left_numbers, *measured.notes, *found.pop("notes"), *left_texts),
        acted=measured.acted | ({"angles"} if angles is not None and turned else frozenset()),
        **found,
    )


def _contradictions(table: Table) -> list[FileError]:
    """Errors of columns whose name and row of units state different units."""
    out: list[FileError] = []
    for name, under in zip(table.header, table.units, strict=True):
        unit, other = split_unit(name)[1], UNITS.get(under)
        if unit and other and unit != other:
            message = f"the name states {unit}, the row of units {other}; mend one of them"
            out.append(table.header_error(message, name))
    return out


def without_summaries(measured: MeasuredTable) -> MeasuredTable:
    """The table without rows whose id is the name of a statistic, such as ``Mean``; a note says which."""
    summing: dict[int, str] = {}
    for name, _ in measured.of("id"):
        summing |= {row: text for row, text in enumerate(measured.texts(name)) if is_statistic(text)}
    if not summing:
        return measured
    summing = dict(sorted(summing.items()))
    listed = footer_note([int(measured.lines[row]) for row in summing], [(text,) for text in summing.values()])
    rest = measured.take(np.array([row not in summing for row in range(len(measured))]))
    rest = rest.noted(f"rows that sum others up are left out: {listed}")
    return MeasuredTable.of_table(rest, measured.robot, measured.known)


def _refuse_nothing_measured(measured: MeasuredTable, observed: ObservedColumns | None) -> None:
    """See that a file without joints and positions holds a number that was measured in another way."""
    if observed is not None and any(NUMBER.fullmatch(cell) for cells in observed.cells.values() for cell in cells):
        return
    columns = shown(", ".join(measured.header), 200)
    message = (
        f"holds no measured number: none of its columns ({columns}) is read as a joint of {measured.robot.name} or a position; "
        f"name them {measured.robot.joint_names[0]}_deg … and x_mm y_mm z_mm, in the file or with --columns"
    )
    raise measured.header_error(message)


def quantity_of(unit: str | None) -> tuple[Quantity, float] | None:
    """Quantity of a unit, and its factor to metres or radians."""
    if unit in LENGTHS:
        return "length", LENGTHS[unit]
    return ("angle", ANGLES[unit]) if unit in ANGLES else None


def _observed(measured: MeasuredTable) -> ObservedColumns | None:
    """Columns of kinds of observation that need no tracker."""
    at = {meaning.target: (name, meaning.unit) for name, meaning in measured.of("observed")}
    if not at:
        return None
    return ObservedColumns(
        path=measured.path,
        lines=np.array(measured.lines, dtype=np.int64),
        cells={column: tuple(measured.texts(name)) for column, (name, _) in at.items()},
        headers={column: name for column, (name, _) in at.items()},
        units={column: quantity_of(unit) for column, (_, unit) in at.items()},
    )


def _numbered_parts(table: Table) -> list[int]:
    """Columns ``Q0 … Q3`` or ``Q1 … Q4`` that hold a quaternion, the scalar first: its length is one in every row."""
    at = numbered_parts(table.header)
    rows = [row for row in zip(*(table.texts(table.header[k]) for k in at), strict=True) if all(row)]
    try:
        lengths = np.linalg.norm(np.array(rows, dtype=float).reshape(-1, 4), axis=1)
    except ValueError:
        return []
    return at if np.abs(lengths - 1.0).max(initial=0.0) <= UNIT_LENGTH and rows else []


def _refuse_unlabelled(measured: MeasuredTable) -> None:
    """See that positions in the frame of a sensor on the tool are not taken for those of a target."""
    for kind in kinds():
        words = {word for column in kind.needed for word in kind.columns[column]}
        for name, _ in measured.of("position"):
            if split_unit(name)[0] in words:
                message = (
                    f"what a sensor on the tool sees needs a column '{kind.label}' that names it; add one, or rename the columns, "
                    "as in smr_x_mm, if an instrument beside the robot measured them"
                )
                raise measured.header_error(message, name)


def _groups(measured: MeasuredTable) -> tuple[str, ...] | None:
    """The group of every row, of collections in which groups stand too; None where all rows are of one."""
    columns = [texts for name, _ in measured.of("group") if len(set(texts := measured.texts(name))) > 1]
    return tuple(map(" ".join, zip(*columns, strict=True))) if columns else None


def _ids(measured: MeasuredTable) -> dict[str, Any]:
    """Names of the rows, from the surest column that names every row differently, or else from the surest."""
    columns = [name for name, _ in sorted(measured.of("id"), key=lambda column: column[1].index)]
    if not columns:
        return {"ids": None}
    texts = {column: measured.texts(column) for column in columns}
    full = [column for column in columns if all(texts[column])]
    own = next((c for c in full if len(set(texts[c])) == len(measured)), None)
    words = next((c for c in full if not all(re.fullmatch(r"\d+", text) for text in texts[c])), None)
    chosen = own or (columns[0] if len(columns) == 1 else words) or columns[0]
    _refuse_empty(measured, chosen, "the row has no id; give each row its own")
    return {"ids": tuple(texts[chosen])}


def _refuse_empty(table: Table, column: str, message: str) -> None:
    raise_all(table.error(message, row, column) for row, text in enumerate(table.texts(column)) if not text)


def _stations(measured: MeasuredTable) -> tuple[str, ...] | None:
    """Where the tracker stood at each row."""
    columns = measured.of("station")
    if not columns:
        return None
    _refuse_empty(measured, columns[0][0], "the row has no station; name where the tracker stood")
    return tuple(measured.texts(columns[0][0]))


def _conditions(measured: MeasuredTable) -> dict[str, Any]:
    """Temperature, and time since the robot began to work."""
    columns = measured.of("temperature")
    temperature = measured.numbers(columns[0][0], empty=True) if columns else None
    if temperature is not None:
        low, high = TEMPERATURES_C
        wrong = np.flatnonzero((temperature < low) | (temperature > high))
        if len(wrong):
            message = (
                f"{temperature[wrong[0]]:g} °C is not a robot's temperature ({low:g} to {high:g} °C): subtract 273.15 from "
                "kelvins, and leave the cell empty where none was measured"
            )
            raise measured.error(message, int(wrong[0]), columns[0][0])
    timed = [(name, TIMES[m.unit]) for name, m in measured.of("time") if m.unit in TIMES]
    if not timed:
        return {"temperature": temperature}
    column, scale = timed[0]
    time = measured.numbers(column, empty=True, largest=np.inf) * scale
    wrong = np.flatnonzero((time < 0.0) | (time > MAX_TIME_S))
    if len(wrong):
        message = f"{time[wrong[0]]:g} s is not a time since the robot began to work; subtract the time when it did"
        raise measured.error(message, int(wrong[0]), column)
    return {"temperature": temperature, "time": time}


def _approaches(measured: MeasuredTable) -> dict[str, Any]:
    columns = [name for name, _ in _of_every_joint(measured, "approach", "_approach", "_approach")]
    if not columns:
        return {}
    approach = measured.side_by_side(columns, remedy="give 1, -1, or 0 where it is unknown")
    for row, j in zip(*np.nonzero(~np.isin(approach, (-1.0, 0.0, 1.0))), strict=True):
        message = f"{approach[row, j]:g} is not a way of approach; give 1 (the joint's value grew), -1 (it fell) or 0 (unknown)"
        raise measured.error(message, int(row), columns[j])
    return {"approach": approach}


def _moves(measured: MeasuredTable) -> dict[str, Any]:
    columns = _of_every_joint(measured, "move", "_move_deg", "_move_mm")
    if not columns:
        return {}
    scale: list[float] = []
    for (column, meaning), slides in zip(columns, measured.robot.prismatic, strict=True):
        units = LENGTHS if slides else ANGLES
        if meaning.unit not in units:
            wanted = f"{column}_{'mm' if slides else 'deg'}"
            raise measured.header_error(f"the unit is not stated; name the column {wanted}", column)
        scale.append(units[meaning.unit])
    remedy = "give the last move, or 0 where it is unknown"
    return {"move": measured.side_by_side([name for name, _ in columns], remedy=remedy) * scale}


def _of_every_joint(measured: MeasuredTable, kind: Kind, turning: str, sliding: str) -> list[tuple[str, Meaning]]:
    """The column of each joint; none where no joint has one.

    Args:
        measured: the cells.
        kind: of the columns.
        turning: what follows the name of a joint that turns.
        sliding: what follows that of one that slides.
    """
    at = measured.by_joint(kind)
    for j, (name, slides) in enumerate(zip(measured.robot.joint_names, measured.robot.prismatic, strict=True)):
        if at and j not in at:
            have, lacking = next(iter(at.values()))[0], name + (sliding if slides else turning)
            raise measured.header_error(f"has '{have}' but no column '{lacking}'; give it, with 0 where it is unknown")
    return [at[j] for j in sorted(at)]


def _refuse_nearly_known(measured: MeasuredTable) -> None:
    """A column that begins or ends as one that is read, and is none, was meant to be read."""
    for name, meaning in zip(measured.header, measured.known, strict=True):
        if meaning is None and re.search(r"_(approach|move_\w+|u_mm|[xyz]_\w+|deg|rad)$", name, re.IGNORECASE):
            known = KNOWN.format(joint=measured.robot.joint_names[0])
            raise measured.header_error(f"unknown column '{shown(name)}'; {known}")


def _left_out(measured: MeasuredTable) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Columns that mean nothing to a campaign.

    Returns:
        A note of them beside what was measured, where numbers are among them, as these may have been meant; a note where all are
        texts; and those of lengths that might be what was measured.
    """
    columns, unread = list(zip(measured.header, measured.units, measured.known, strict=True)), measured.unread
    left = [
        (name, split_unit(name)[1] or UNITS.get(under))
        for name, under, meaning in columns
        if (meaning is None or meaning.kind == "nominal" or name in unread) and not re.fullmatch(r"column \d+|-", name)
    ]
    if not left:
        return (), (), ()
    ranges = {name: _range(measured, name) for name, _ in left}
    taken = [name for name, _, meaning in columns if meaning and meaning.kind in ("position", "observed")]
    numbers = any(span is not None for span in ranges.values())
    beside = f"; measured: {shown(', '.join(taken))}" if taken and numbers else ""
    note = f"column{'s' if len(left) > 1 else ''} left out: {shown(', '.join(name for name, _ in left))}{beside}"
    if not numbers:
        return (), (note,), ()
    with_meaning = {name for name, _, meaning in columns if meaning is not None}
    lengths = [(name, LENGTHS[unit]) for name, unit in left if unit in LENGTHS and name not in with_meaning]
    return (note,), (), tuple(name for name, metres in lengths if metres * (ranges[name] or 0.0) > MIN_RANGE_M)


def _range(table: Table, column: str) -> float | None:
    """Range of a column's numbers; None where a cell is none."""
    try:
        return float(np.ptp(np.array([float(text) for text in table.texts(column) if text])))
    except ValueError:
        return None
