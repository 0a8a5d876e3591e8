"""What one file of measurements says: joints, points, or both, before they are a campaign."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import FileError, shown
from taskcal.measurement.column_meaning import Meaning, contradiction, meanings, numbered_parts
from taskcal.measurement.joint_columns import JointColumns, joint_columns, refuse_other_axes
from taskcal.measurement.observation import ObservedColumns, kinds
from taskcal.measurement.rotation_columns import AngleForm, OpenAngles, RotationColumns, rotations
from taskcal.measurement.spherical_columns import with_positions
from taskcal.measurement.summary_rows import without_summaries
from taskcal.measurement.target_columns import TargetColumns, target_columns
from taskcal.measurement.units import ANGLES, LENGTHS, TIMES, UNITS, split_unit
from taskcal.measurement.unnamed_columns import name_columns
from taskcal.robot.robot import Robot
from taskcal.tabular.column_groups import UNIT_LENGTH
from taskcal.tabular.csv_form import TableForm, lay_out_file
from taskcal.tabular.faults import Faults
from taskcal.tabular.layout import Laid
from taskcal.tabular.table import Table

LEAST_RANGE = 0.01
"""Of a column of lengths that may be what was measured, metres: uncertainties and deviations vary by less."""

MAX_TIME_S = 1e7
"""No robot works so many seconds before it is measured; clocks count more."""

_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)

KNOWN = (
    "a campaign has id, joints ({joint}_deg …), targets (x_mm … or NAME_x_mm …), qx qy qz qw, u_mm, temp_C, time_s, "
    "{joint}_approach …"
)
"""What columns there may be."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """The rows of one file."""

    path: Path
    ids: tuple[str, ...] | None
    """As the file names its rows, repeated where it repeats them; None where it does not."""
    groups: tuple[str, ...] | None
    """Of points that have names of their own in each; None where the file states none, or one throughout."""
    lines: Int[np.ndarray, " n"]
    """Of the file, from 1."""
    q: Float[np.ndarray, "n joints"] | None
    """Radians and metres; where `joint_unit_stated` is false, as in the file."""
    joint_unit_stated: bool
    joint_columns: tuple[str, ...]
    """As the file names them."""
    points: Mapping[str, Float[np.ndarray, "n 3"]]
    """By target, metres; where `length_unit_stated` is false, as in the file. NaN for a lost beam."""
    length_unit_stated: bool
    uncertainty: Mapping[str, Float[np.ndarray, " n"]]
    """By target in small letters, empty for all; as the points."""
    uncertainty_stated: frozenset[str]
    """Those of them that are in metres, whatever the points are in."""
    rotations: Float[np.ndarray, "n 3 3"] | None
    open_angles: OpenAngles | None
    """Where it is open what three angles mean."""
    rotated: str
    """Whose rotations they are, where their columns say."""
    other_rotations: Mapping[str, Float[np.ndarray, "n 3 3"]]
    """Of further targets, by their names."""
    temperature: Float[np.ndarray, " n"] | None
    """°C."""
    time: Float[np.ndarray, " n"] | None
    """Seconds."""
    approach: Float[np.ndarray, "n joints"] | None
    """1, −1, or 0 where it is unknown."""
    move: Float[np.ndarray, "n joints"] | None
    """Radians and metres."""
    targets_by_row: tuple[str, ...] | None
    """Whose position each row holds, where a column says."""
    observed: ObservedColumns | None
    """Columns of kinds of observation that need no tracker; None where there are none."""
    preamble: tuple[str, ...]
    """Lines above the table and comments."""
    left_lengths: tuple[str, ...]
    """Columns of lengths that were left out and vary by more than `LEAST_RANGE`."""
    notes: tuple[str, ...]
    """What was decided on the way."""

    def __len__(self) -> int:
        return len(self.lines)

    def take(self, rows: Int[np.ndarray, " k"]) -> "Readings":
        """Some of the rows."""

        def pick(value: np.ndarray | None) -> np.ndarray | None:
            return None if value is None else value[rows]

        return replace(
            self,
            ids=None if self.ids is None else tuple(self.ids[i] for i in rows),
            groups=None if self.groups is None else tuple(self.groups[i] for i in rows),
            lines=self.lines[rows],
            q=pick(self.q),
            points={name: points[rows] for name, points in self.points.items()},
            uncertainty={name: u[rows] for name, u in self.uncertainty.items()},
            rotations=pick(self.rotations),
            other_rotations={name: R[rows] for name, R in self.other_rotations.items()},
            open_angles=None if self.open_angles is None else self.open_angles.mapped(lambda R: R[rows]),
            temperature=pick(self.temperature),
            time=pick(self.time),
            approach=pick(self.approach),
            move=pick(self.move),
            targets_by_row=None if self.targets_by_row is None else tuple(self.targets_by_row[i] for i in rows),
            observed=None if self.observed is None else self.observed.take(rows),
        )


def read_readings(
    path: str | Path, robot: Robot, form: TableForm | None = None, angles: AngleForm | None = None
) -> Readings:
    """Read what one file says, whatever its form and its columns' names.

    Args:
        path: the file.
        robot: the robot that was measured.
        form: what is stated of the table.
        angles: what three angles of a pose mean, where their names do not say.

    Raises:
        FileError: with all that is wrong in it, the first twenty faults.
    """
    laid = with_positions(name_columns(lay_out_file(path, form), robot))
    known = meanings(laid.table.header, laid.units, robot.joint_names, _numbered_parts(laid.table))
    laid = without_summaries(laid, known)
    table = laid.table
    faults = Faults()
    for fault in laid.faults:
        with faults.collecting():
            raise fault
    _refuse_two_units(laid, faults)
    joints: JointColumns | None = None
    with faults.collecting():
        joints = joint_columns(table, known, robot)
    targets = TargetColumns(points={}, uncertainty={}, unit_stated=True)
    with faults.collecting():
        targets = target_columns(table, known)
    turned = RotationColumns()
    with faults.collecting():
        turned = rotations(table, known, _posed(targets, len(table)), angles)
    ids, targets_by_row = None, _texts(table, known, "target")
    with faults.collecting():
        ids = _ids(table, known)
    groups = _groups(table, known)
    if ids is None and groups is not None:
        # of a group in which targets have names, or the rows none
        ids, groups = groups, None
    temperature = time = approach = move = None
    with faults.collecting():
        temperature, time = _temperature(table, known), _time(table, known)
    with faults.collecting():
        approach, move = _approaches(table, known, robot), _moves(table, known, robot)
    with faults.collecting():
        _refuse_nearly_known(table, known, robot)
    with faults.collecting():
        refuse_other_axes(table, known, robot)
    with faults.collecting():
        _refuse_unlabelled(table, known)
    faults.raise_any()
    if not len(table):
        raise FileError(table.path, "has no measurements below its header")
    observed = _observed(table, known)
    if joints is None and not any(np.isfinite(points).any() for points in targets.points.values()):
        _refuse_nothing_measured(table, observed, robot)
    left = _left_out(laid, known)
    return Readings(
        path=table.path,
        ids=ids,
        groups=groups,
        lines=np.array(table.lines, dtype=np.int64),
        q=None if joints is None else joints.values,
        joint_unit_stated=joints is None or joints.unit_stated,
        joint_columns=() if joints is None else joints.columns,
        points=targets.points,
        length_unit_stated=targets.unit_stated,
        uncertainty=targets.uncertainty,
        uncertainty_stated=targets.uncertainty_stated,
        rotations=turned.rotations,
        open_angles=turned.open_angles,
        rotated=turned.rotated,
        other_rotations=turned.others,
        temperature=temperature,
        time=time,
        approach=approach,
        move=move,
        targets_by_row=targets_by_row,
        observed=observed,
        preamble=laid.preamble,
        left_lengths=left.lengths,
        notes=(*left.numbers, *laid.notes, *targets.notes, *turned.notes, *left.notes),
    )


def _refuse_nothing_measured(table: Table, observed: ObservedColumns | None, robot: Robot) -> None:
    """See that a file without joints and positions holds a number that was measured in another way.

    Raises:
        FileError: it does not.
    """
    if observed is not None and any(_NUMBER.fullmatch(cell) for cells in observed.cells.values() for cell in cells):
        return
    joint = robot.joint_names[0]
    columns = shown(", ".join(table.header), 200)
    message = (
        f"holds no measured number: none of its columns ({columns}) is read as a joint of {robot.name} or a position; "
        f"name them {joint}_deg … and x_mm y_mm z_mm, in the file or with --columns"
    )
    raise FileError(table.path, message, line=table.header_line)


def _observed(table: Table, known: Sequence[Meaning | None]) -> ObservedColumns | None:
    """Columns of kinds of observation that need no tracker."""
    at = {m.target: (table.header[k], m.unit) for k, m in enumerate(known) if m is not None and m.kind == "observed"}
    if not at:
        return None
    return ObservedColumns(
        path=table.path,
        lines=np.array(table.lines, dtype=np.int64),
        cells={column: tuple(table.texts(name)) for column, (name, _) in at.items()},
        headers={column: name for column, (name, _) in at.items()},
        scales={column: LENGTHS.get(unit or "") for column, (_, unit) in at.items()},
    )


def _refuse_two_units(laid: Laid, faults: Faults) -> None:
    """Note columns whose names state one unit and the row of units another."""
    for name, under in zip(laid.table.header, laid.units, strict=True):
        if units := contradiction(name, under):
            message = f"the name states {units[0]}, the row of units {units[1]}; mend one of them"
            with faults.collecting():
                raise laid.table.header_error(message, name)


def _posed(targets: TargetColumns, rows: int) -> dict[str, Bool[np.ndarray, " rows"]]:
    """Rows with a position, which need a rotation too: by target in small letters, and of any."""
    seen = {name.casefold(): ~np.isnan(points[:, 0]) for name, points in targets.points.items()}
    return {**seen, "": np.any(list(seen.values()), axis=0) if seen else np.ones(rows, dtype=bool)}


def _numbered_parts(table: Table) -> list[int]:
    """Columns ``Q0 … Q3`` or ``Q1 … Q4`` that hold a quaternion, the scalar first: its length is one in every row."""
    at = numbered_parts(table.header)
    rows = [row for row in zip(*(table.texts(table.header[k]) for k in at), strict=True) if all(row)]
    try:
        lengths = np.linalg.norm(np.array(rows, dtype=float).reshape(-1, 4), axis=1)
    except ValueError:
        return []
    return at if np.abs(lengths - 1.0).max(initial=0.0) <= UNIT_LENGTH and rows else []


def _refuse_unlabelled(table: Table, known: Sequence[Meaning | None]) -> None:
    """See that positions in the frame of a sensor on the tool are not taken for those of a target.

    Raises:
        FileError: they lack the column that names what was seen.
    """
    for kind in kinds():
        words = {word for column in kind.needed for word in kind.columns[column]}
        for name, meaning in zip(table.header, known, strict=True):
            if meaning is not None and meaning.kind == "position" and split_unit(name)[0] in words:
                message = (
                    f"what a sensor on the tool sees needs a column '{kind.label}' that names it; add one, or rename the columns, "
                    "as in smr_x_mm, if an instrument beside the robot measured them"
                )
                raise table.header_error(message, name)


def _texts(table: Table, known: Sequence[Meaning | None], kind: str) -> tuple[str, ...] | None:
    at = [k for k, meaning in enumerate(known) if meaning is not None and meaning.kind == kind]
    return tuple(table.texts(table.header[at[0]])) if at else None


def _groups(table: Table, known: Sequence[Meaning | None]) -> tuple[str, ...] | None:
    """The group of every row, of collections in which groups stand too; None where all rows are of one."""
    at = [k for k, meaning in enumerate(known) if meaning is not None and meaning.kind == "group"]
    columns = [texts for k in at if len(set(texts := table.texts(table.header[k]))) > 1]
    return tuple(map(" ".join, zip(*columns, strict=True))) if columns else None


def _ids(table: Table, known: Sequence[Meaning | None]) -> tuple[str, ...] | None:
    """From the surest column of names that names every row differently, or else from the surest that is there.

    Raises:
        FileError: a row has no name.
    """
    at = sorted((m.index, k) for k, m in enumerate(known) if m is not None and m.kind == "id")
    if not at:
        return None
    columns = [table.header[k] for _, k in at]
    texts = {column: table.texts(column) for column in columns}
    own = next((c for c in columns if all(texts[c]) and len(set(texts[c])) == len(table)), None)
    words = next((c for c in columns if all(texts[c]) and not all(re.fullmatch(r"\d+", t) for t in texts[c])), None)
    chosen = own or (columns[0] if len(columns) == 1 else words) or columns[0]
    faults = Faults()
    for row, text in enumerate(texts[chosen]):
        if not text:
            with faults.collecting():
                raise table.error("the row has no id; give each row its own", row, chosen)
    faults.raise_any()
    return tuple(texts[chosen])


def _temperature(table: Table, known: Sequence[Meaning | None]) -> np.ndarray | None:
    at = [k for k, m in enumerate(known) if m is not None and m.kind == "temperature"]
    return table.numbers(table.header[at[0]], empty=True) if at else None


def _time(table: Table, known: Sequence[Meaning | None]) -> np.ndarray | None:
    """Seconds since the robot began to work."""
    at = [k for k, m in enumerate(known) if m is not None and m.kind == "time" and m.unit in TIMES]
    if not at:
        return None
    meaning, column = known[at[0]], table.header[at[0]]
    assert meaning is not None
    assert meaning.unit is not None
    time = table.numbers(column, empty=True, largest=np.inf) * TIMES[meaning.unit]
    wrong = np.flatnonzero((time < 0.0) | (time > MAX_TIME_S))
    if len(wrong):
        message = f"{time[wrong[0]]:g} s is not a time since the robot began to work; subtract the time when it did"
        raise table.error(message, int(wrong[0]), column)
    return time


def _approaches(table: Table, known: Sequence[Meaning | None], robot: Robot) -> np.ndarray | None:
    columns = _of_every_joint(table, known, robot, "approach", [f"{name}_approach" for name in robot.joint_names])
    if not columns:
        return None
    approach = np.stack([table.numbers(c, remedy="give 1, -1, or 0 where it is unknown") for c in columns], axis=1)
    for row, j in zip(*np.nonzero(~np.isin(approach, (-1.0, 0.0, 1.0))), strict=True):
        message = f"{approach[row, j]:g} is not a way of approach; give 1 (the joint's value grew), -1 (it fell) or 0 (unknown)"
        raise table.error(message, int(row), columns[j])
    return approach


def _moves(table: Table, known: Sequence[Meaning | None], robot: Robot) -> np.ndarray | None:
    endings = [
        f"{name}_move_{'mm' if slides else 'deg'}"
        for name, slides in zip(robot.joint_names, robot.prismatic, strict=True)
    ]
    columns = _of_every_joint(table, known, robot, "move", endings)
    if not columns:
        return None
    scale: list[float] = []
    for column, slides in zip(columns, robot.prismatic, strict=True):
        meaning = known[table.header.index(column)]
        units = LENGTHS if slides else ANGLES
        if meaning is None or meaning.unit not in units:
            raise table.header_error(
                f"the unit is not stated; name the column {column}_{'mm' if slides else 'deg'}", column
            )
        scale.append(units[meaning.unit])
    return (
        np.stack([table.numbers(c, remedy="give the last move, or 0 where it is unknown") for c in columns], axis=1)
        * scale
    )


def _of_every_joint(
    table: Table, known: Sequence[Meaning | None], robot: Robot, kind: str, usual: Sequence[str]
) -> list[str]:
    """The column of each joint; none where no joint has one."""
    at: dict[int, str] = {}
    for k, meaning in enumerate(known):
        if meaning is not None and meaning.kind == kind:
            if meaning.index in at:
                twice = f"by '{at[meaning.index]}' and '{table.header[k]}'"
                raise table.header_error(f"joint {robot.joint_names[meaning.index]} is given twice, {twice}; keep one")
            at[meaning.index] = table.header[k]
    for j, column in enumerate(usual):
        if at and j not in at:
            raise table.header_error(
                f"has '{next(iter(at.values()))}' but no column '{column}'; give it, with 0 where it is unknown"
            )
    return [at[j] for j in sorted(at)]


def _refuse_nearly_known(table: Table, known: Sequence[Meaning | None], robot: Robot) -> None:
    """A column that begins or ends as one that is read, and is none, was meant to be read."""
    for name, meaning in zip(table.header, known, strict=True):
        if meaning is None and re.search(r"_(approach|move_\w+|u_mm|[xyz]_\w+|deg|rad)$", name, re.IGNORECASE):
            raise table.header_error(f"unknown column '{shown(name)}'; {KNOWN.format(joint=robot.joint_names[0])}")


class _Left(NamedTuple):
    """Columns that mean nothing to a campaign."""

    numbers: tuple[str, ...] = ()
    """In a line with what was measured, where numbers are among them: these may have been meant."""
    notes: tuple[str, ...] = ()
    """In a line, where they are texts."""
    lengths: tuple[str, ...] = ()
    """Those of lengths that might be what was measured."""


def _left_out(laid: Laid, known: Sequence[Meaning | None]) -> _Left:
    table = laid.table
    unused = _unused(known)
    left = [
        (name, split_unit(name)[1] or UNITS.get(under))
        for k, (name, under, meaning) in enumerate(zip(table.header, laid.units, known, strict=True))
        if (meaning is None or meaning.kind == "nominal" or k in unused) and not re.fullmatch(r"column \d+|-", name)
    ]
    if not left:
        return _Left()
    ranges = {name: _range(table, name) for name, _ in left}
    taken = [name for name, m in zip(table.header, known, strict=True) if m and m.kind in ("position", "observed")]
    numbers = any(span is not None for span in ranges.values())
    beside = f"; measured: {shown(', '.join(taken))}" if taken and numbers else ""
    nominal = {table.header[k] for k, m in enumerate(known) if m is not None}
    lengths = [
        name
        for name, unit in left
        if unit in LENGTHS and name not in nominal and LENGTHS[unit] * (ranges[name] or 0.0) > LEAST_RANGE
    ]
    note = f"column{'s' if len(left) > 1 else ''} left out: {shown(', '.join(name for name, _ in left))}{beside}"
    return _Left((note,), (), tuple(lengths)) if numbers else _Left((), (note,))


def _unused(known: Sequence[Meaning | None]) -> set[int]:
    """Columns of known meaning that are not read: parts of an uncertainty, rotations beside others, times without a unit."""
    at: dict[str, dict[str, list[int]]] = {}
    for k, m in enumerate(known):
        if m is not None:
            at.setdefault(m.kind, {}).setdefault(m.target.casefold(), []).append(k)
    out: set[int] = set()
    for columns in at.get("uncertainty", {}).values():
        parts = {m.index for k in columns if (m := known[k])}
        out |= {k for k in columns if (m := known[k]) and m.index != 3 and (3 in parts or len(parts) < 3)}
    matrices = [k for columns in at.get("matrix", {}).values() for k in columns]
    turned = "quaternion" in at
    if turned or len(matrices) < 9:
        out |= set(matrices)
    if turned or len(matrices) >= 9:
        out |= {k for columns in at.get("euler", {}).values() for k in columns}
    for kind in ("time", "temperature"):
        times = [k for columns in at.get(kind, {}).values() for k in columns]
        read = [k for k in times if kind == "temperature" or ((m := known[k]) and m.unit in TIMES)]
        out |= set(times) - set(read[:1])
    return out


def _range(table: Table, column: str) -> float | None:
    """Range of a column's numbers; None where a cell is none."""
    try:
        return float(np.ptp(np.array([float(text) for text in table.texts(column) if text])))
    except ValueError:
        return None
