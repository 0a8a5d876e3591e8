"""Joint positions in a table of measurements."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError
from taskcal.measurement.column_meaning import Meaning
from taskcal.measurement.units import ANGLES, LENGTHS, split_unit
from taskcal.robot.robot import Robot
from taskcal.tabular.column_groups import LEAVE_OUT
from taskcal.tabular.faults import Faults
from taskcal.tabular.table import Table

_OTHER_AXIS = re.compile(
    r"(?:e|ext|eax|external|external axis|zusatzachse) ?[1-6]|(?:linear axis|linearachse|rail|track)"
    r"|(?:j|joint|a|axis|achse|q) ?(?P<number>\d{1,2})"
)
"""Axes beside the robot's own, as controllers call them."""

_STILL = 1e-3
"""Range of an axis that stands still, in any unit: what an encoder flickers."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointColumns:
    """The joints of a table's rows."""

    columns: tuple[str, ...]
    """As the file names them, one for each joint."""
    values: Float[np.ndarray, "rows joints"]
    """Radians and metres where units are stated; as in the file where none is."""
    unit_stated: bool
    """False where no joint that turns has a unit."""


def joint_columns(table: Table, meanings: Sequence[Meaning | None], robot: Robot) -> JointColumns | None:
    """The joints of a table's rows; None where it has no column of a joint.

    Raises:
        FileError: a joint has no column, or two, or a joint too many, only some have a unit, or a cell is not a number.
    """
    at: dict[int, int] = {}
    for k, meaning in enumerate(meanings):
        if meaning is None or meaning.kind != "joint":
            continue
        if meaning.index >= len(robot.joints):
            count = len(robot.joints)
            message = f"is a joint that {robot.name} does not have; it has {count}: is it the right robot?"
            raise table.header_error(f"'{table.header[k]}' {message}")
        if meaning.index in at:
            twice = f"by '{table.header[at[meaning.index]]}' and '{table.header[k]}'"
            raise table.header_error(f"joint {robot.joint_names[meaning.index]} is given twice, {twice}; keep one")
        at[meaning.index] = k
    if not at:
        return None
    for number, (name, slides) in enumerate(zip(robot.joint_names, robot.prismatic, strict=True)):
        if number not in at:
            units = ("mm", "m") if slides else ("deg", "rad")
            raise table.header_error(
                f"has no column for joint {name} of {robot.name}; it needs one for each of {', '.join(robot.joint_names)}, such "
                f"as {name}_{units[0]} or q{number + 1}_{units[1]}"
            )
    return _values(table, meanings, robot, at)


def _values(table: Table, meanings: Sequence[Meaning | None], robot: Robot, at: dict[int, int]) -> JointColumns:
    stated = {number for number, k in at.items() if (m := meanings[k]) is not None and m.unit}
    turning = {number for number, slides in enumerate(robot.prismatic) if not slides}
    scale = np.ones(len(at))
    for number, slides in enumerate(robot.prismatic):
        name, meaning = table.header[at[number]], meanings[at[number]]
        assert meaning is not None
        known = LENGTHS if slides else ANGLES
        if meaning.unit in known:
            scale[number] = known[meaning.unit]
        elif meaning.unit is not None or slides or stated & turning:
            bare = robot.joint_names[number] if meaning.unit is not None else name
            wanted = " or ".join(f"{bare}_{unit}" for unit in (("mm", "m") if slides else ("deg", "rad")))
            what = f"'{meaning.unit}' is no unit of this joint" if meaning.unit else "the unit is not stated"
            raise table.header_error(f"{what}; name the column {wanted}", name)
    faults = Faults()
    values = np.full((len(table), len(at)), np.nan)
    for number, k in sorted(at.items()):
        with faults.collecting():
            values[:, number] = table.numbers(table.header[k], remedy=LEAVE_OUT)
    faults.raise_any()
    columns = tuple(table.header[at[number]] for number in range(len(at)))
    return JointColumns(columns=columns, values=values * scale, unit_stated=bool(stated & turning) or not turning)


def refuse_other_axes(table: Table, meanings: Sequence[Meaning | None], robot: Robot) -> None:
    """See that no axis moved that the robot does not have: rails carry it, and what is left out would seem an error of it.

    Raises:
        FileError: one did.
    """
    faults = Faults()
    for name, meaning in zip(table.header, meanings, strict=True):
        match = _OTHER_AXIS.fullmatch(split_unit(name)[0])
        if meaning is not None or match is None or (match["number"] and int(match["number"]) <= len(robot.joints)):
            continue
        try:
            values = table.numbers(name, empty=True, largest=np.inf)
        except FileError:
            continue
        seen = values[~np.isnan(values)]
        if len(seen) and np.ptp(seen) > _STILL:
            message = (
                f"is an axis that {robot.name} does not have, and it moves ({seen.min():g} to {seen.max():g}); describe the robot "
                "with it, or take rows in which it stands still"
            )
            with faults.collecting():
                raise table.header_error(message, name)
    faults.raise_any()
