"""Joint positions: of a table of measurements, of a robot program, and counted within the robot's limits."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from robot_programs import Frame, read_program
from robot_programs.languages import Language, languages
from taskcal.errors import FileError, shown
from taskcal.io.text_file import read_bytes
from taskcal.reading.columns import MeasuredTable, as_written, find_word, meanings, split_unit
from taskcal.robot.robot import Robot
from taskcal.tables.forms import decode, read_table
from taskcal.tables.options import TableForm
from taskcal.tables.table import ANGLES, LARGEST, LEAVE_OUT, LENGTHS, Table, raise_all

# Joint positions in a table of measurements.


def joints_of(measured: MeasuredTable) -> dict[str, Any]:
    """Fields of `Readings` on the joints of a table's rows; none where it has no column of a joint.

    Raises:
        FileError: a joint has no column, or two, or a joint too many, only some have a unit, or a cell is not a number.
    """
    robot, at = measured.robot, measured.by_joint("joint")
    if len(at) < len(robot.joints):
        _refuse_named_counts(measured)
    if not at:
        return {}
    for j in range(len(robot.joints)):
        if j not in at:
            raise measured.header_error(no_joint(robot, j))
    turning = [at[j][1].unit for j, slides in enumerate(robot.prismatic) if not slides]
    scale = np.ones(len(at))
    for j, slides in enumerate(robot.prismatic):
        name, unit = at[j][0], at[j][1].unit
        known = LENGTHS if slides else ANGLES
        if unit in known:
            scale[j] = known[unit]
        elif unit is not None or slides or any(turning):
            bare = robot.joint_names[j] if unit is not None else name
            what = f"'{unit}' is no unit of this joint" if unit else "the unit is not stated"
            raise measured.header_error(
                f"{what}; name the column {' or '.join(f'{bare}_{u}' for u in _units(slides))}", name
            )
    columns = tuple(at[j][0] for j in range(len(at)))
    values = measured.side_by_side(columns, remedy=LEAVE_OUT, largest=np.inf)
    _refuse_counts(measured, values[:, ~np.array(robot.prismatic)])
    if np.abs(values).max(initial=0.0) > LARGEST:
        measured.side_by_side(columns, remedy=LEAVE_OUT)
    return {"q": values * scale, "joint_columns": columns, "joint_unit_stated": any(turning) or not turning}


COUNTS_OF_A_DEGREE = (
    "write degrees: each joint's number over that of a degree, which the controller's parameters or its manual state"
)
"""What is to be done with counts of encoders."""

MAX_TURNS_DEG = 720.0
"""Two turns, which a controller shows at most, degrees; as radians they are far more."""

MIN_COUNTED_SHARE = 0.1
"""Share of the rows beyond two turns, above which a joint's values are counts. A convention: fewer are wrong digits."""


def _refuse_named_counts(measured: MeasuredTable) -> None:
    """See that no joint's column is named one of counts or turns."""
    names = measured.header
    found = [None if unit else find_word(text, "counts") for text, unit in map(split_unit, names)]
    joints = [as_written(one[1]["joint"], name) if one else "-" for one, name in zip(found, names, strict=True)]
    known = meanings(joints, [""] * len(joints), measured.robot.joint_names)
    for one, name, joint, meaning in zip(found, names, joints, known, strict=True):
        if one is not None and meaning is not None and meaning.kind == "joint":
            what, remedy = "counts", COUNTS_OF_A_DEGREE
            if one[0].form == "turns":
                what, remedy = "turns", "multiply it by 360"
            raise measured.header_error(f"holds {what}, not an angle; {remedy}, and name it {joint}_deg", name)


def _refuse_counts(table: Table, values: Float[np.ndarray, "rows joints"]) -> None:
    """See that joints that turn are no counts: half of them are not beyond two turns in several rows, in whatever unit."""
    beyond = (np.abs(values) > MAX_TURNS_DEG).sum(axis=0) > max(1.0, MIN_COUNTED_SHARE * len(values))
    if beyond.any() and 2 * beyond.sum() >= values.shape[1]:
        message = (
            f"the joints have values up to {np.abs(values).max():.15g}, which are no angles in degrees or radians: counts of an "
            f"encoder, or pulses? If so, {COUNTS_OF_A_DEGREE}"
        )
        raise table.header_error(message)


def read_joints(table: Table, robot: Robot, *, poses: bool = False) -> Float[np.ndarray, "rows joints"] | None:
    """The joints of a table's rows, radians and metres; None where it has no column of a joint.

    Args:
        table: the table.
        robot: whose joints they are.
        poses: whether the table has poses, too, of which columns ``x``, ``y`` and ``z`` are then part.

    Raises:
        FileError: as of `joints_of`, or no unit is stated.
    """
    names = robot.column_names if poses else robot.joint_names
    known = meanings(table.header, [""] * len(table.header), names)
    found = joints_of(MeasuredTable.of_table(table, robot, known))
    if not found.get("joint_unit_stated", True):
        name = found["joint_columns"][int(np.argmin(robot.prismatic))]
        raise table.header_error(f"the unit is not stated; name the column {name}_deg or {name}_rad", name)
    return found.get("q")


def no_joint(robot: Robot, j: int) -> str:
    """Message on a table without a column for a joint."""
    units, joint = _units(robot.prismatic[j]), robot.joint_names[j]
    return (
        f"has no column for joint {joint} of {robot.name}; it needs one for each of "
        f"{', '.join(robot.joint_names)}, such as {joint}_{units[0]} or q{j + 1}_{units[1]}"
    )


def _units(slides: bool) -> tuple[str, str]:
    return ("mm", "m") if slides else ("deg", "rad")


MAX_STILL_RANGE = 1e-3
"""Range of an axis, at most, that stands still, in any unit. A convention: what an encoder flickers."""


def refuse_other_axes(measured: MeasuredTable) -> None:
    """See that no axis moved that the robot does not have: rails carry it, and what is left out would seem an error of it.

    Raises:
        FileError: one did.
    """
    robot, faults = measured.robot, list[FileError]()
    for name, meaning in zip(measured.header, measured.known, strict=True):
        found = None if meaning is not None else find_word(split_unit(name)[0], "axis")
        if found is None or int(found[1].groupdict().get("number") or len(robot.joints) + 1) <= len(robot.joints):
            continue
        try:
            values = measured.numbers(name, empty=True, largest=np.inf)
        except FileError:
            continue
        seen = values[~np.isnan(values)]
        if len(seen) and np.ptp(seen) > MAX_STILL_RANGE:
            message = (
                f"is an axis that {robot.name} does not have, and it moves ({seen.min():g} to {seen.max():g}); describe the robot "
                "with it, or take rows in which it stands still"
            )
            faults.append(measured.header_error(message, name))
    raise_all(faults)


# Angles counted in another turn than the robot's limits, as from 0 to 360°.

TURN = 2.0 * np.pi

ROUNDING_RAD = 1e-6
"""That limits and a whole turn forgive."""


def within_limits(robot: Robot, q: Float[np.ndarray, "n joints"]) -> tuple[Float[np.ndarray, "n joints"], str]:
    """Joint positions with whole turns added or subtracted where a joint is counted so, and a note that says it.

    A column is counted so if some of its values are outside the joint's limits, and every value is within them as it is or a whole
    turn away; its values must be of one turn, so that a wrong digit beside others is none. Where limits take several, the one
    nearest to zero is taken: the pose is the same.

    Args:
        robot: whose joints they are.
        q: radians and metres.

    Returns:
        The positions, and the note; the positions as they are, and an empty note, where none is counted so.
    """
    low, high = robot.limits.T
    candidates = q[..., None] + TURN * np.array([-1.0, 0.0, 1.0])
    inside = (candidates > low[:, None] - ROUNDING_RAD) & (candidates < high[:, None] + ROUNDING_RAD)
    of_one_turn = (np.ptp(q, axis=0) <= TURN + ROUNDING_RAD) & (np.abs(q).max(axis=0) <= TURN + ROUNDING_RAD)
    possible = of_one_turn & inside.any(axis=2).all(axis=0) & ~np.array(robot.prismatic)
    counted = possible & ~inside[..., 1].all(axis=0)
    if not counted.any():
        return q, ""
    nearest = np.argmin(np.where(inside, np.abs(candidates), np.inf), axis=2)
    out = np.where(counted, np.take_along_axis(candidates, nearest[..., None], axis=2)[..., 0], q)
    row, joint = np.argwhere(out != q)[0]
    names = np.array(robot.joint_names)
    note = (
        f"{', '.join(names[counted])}: counted in another turn than the limits of {robot.name}, as from 0 to 360°; whole turns are "
        f"added or subtracted, as {names[joint]} = {np.degrees(q[row, joint]):.6g}° is {np.degrees(out[row, joint]):.6g}°"
    )
    several = inside.sum(axis=2) > 1
    if chosen := ", ".join(names[counted & several.any(axis=0)]):
        note += f"; the limits of {chosen} take more than one turn, and the one nearest to zero is taken"
    if left := ", ".join(names[possible & ~counted & several.any(axis=0)]):
        note += f"; left as written, as the limits take it, though it may be counted so too: {left}"
    return out, note


# Joints that stand in a robot program: those of its motions to joint positions.


def read_table_or_program(path: str | Path, robot: Robot, form: TableForm | None = None) -> Table:
    """The table of a file, or the joints of a robot program's motions.

    Raises:
        FileError: as of `read_table`; or the program has no motions to joint positions, or motions that are not read.
    """
    path = Path(path)
    language = _language_of(path)
    return read_table(path, form) if language is None else _joints_of_program(path, language, robot)


def _language_of(path: Path) -> Language | None:
    """The language in which a file is written, by the end of its name and by its text; None of a table."""
    for language in languages():
        if path.suffix.lower() in language.suffixes and language.marks:
            text = decode(path, read_bytes(path))
            return language if re.search(language.marks, text, re.MULTILINE | re.IGNORECASE) else None
    return None


def _joints_of_program(path: Path, language: Language, robot: Robot) -> Table:
    """Names, joints and lines of the motions of a program that go to joint positions."""
    beside = path.with_suffix(".dat")
    paths = [path, beside] if path.suffix.lower() == ".src" and beside.is_file() else [path]
    # joints do not hang on them, and what they are need not be known
    frames = {} if language.declares_frames else dict.fromkeys(("tool", "part"), Frame(name="", T=np.eye(4)))
    program = read_program(*paths, robot=robot, **frames)
    what = f"is a {language.name} program"
    if unread := next((one for one in program.diagnostics if one.unread or one.rejected), None):
        message = f"{what}, and its joints cannot be taken from it ({shown(unread.text)}); give a table with a row for each pose"
        raise FileError(path, message, line=unread.place.line)
    motions = [motion for motion in program.motions if motion.end.q is not None]
    if not motions:
        raise FileError(
            path, f"{what} without motions to joint positions; give a table with a row for each measured pose"
        )
    header = tuple(
        f"{name}_{'mm' if slides else 'deg'}" for name, slides in zip(robot.joint_names, robot.prismatic, strict=True)
    )
    scale = np.where(robot.prismatic, 1e3, 180.0 / np.pi)
    rows: list[tuple[str, ...]] = []
    for motion in motions:
        assert motion.end.q is not None
        if len(motion.end.q) != len(header):
            message = f"{what}, and moves {len(motion.end.q)} joints, where {robot.name} has {len(header)}; is it the right robot?"
            raise FileError(path, message, line=motion.place.line)
        rows.append((motion.end.name, *map(repr, (motion.end.q * scale).tolist())))
    named = all(name for name, *_ in rows)
    left = len(program.motions) - len(motions)
    note = f"the joints are those of the {len(motions)} motions to joint positions of a {language.name} program"
    return Table(
        path=path,
        header=(*(("id",) if named else ()), *header),
        rows=tuple(row if named else row[1:] for row in rows),
        lines=[motion.place.line for motion in motions],
        units=("",) * (len(header) + named),
        notes=(f"{note}; {left} to poses are left out" if left else note,),
    )
