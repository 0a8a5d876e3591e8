"""Robots from Denavit–Hartenberg tables in CSV files."""

import re
from pathlib import Path
from typing import Any, Literal, get_args

from taskcal.errors import FileError, TaskcalError, UnknownName, shown
from taskcal.robot.dh_columns import in_own_terms
from taskcal.robot.dh_units import LIMITS, check_units
from taskcal.robot.file import MOST_JOINTS, robot_from
from taskcal.robot.robot import Robot
from taskcal.tabular.column_groups import ColumnGroups
from taskcal.tabular.csv_form import read_csv

Convention = Literal["dh", "mdh"]

_NUMBERS = ("alpha_deg", "a_mm", "d_mm", "theta_offset_deg")
_OPTIONAL = ("theta_from_controller", "type", "lower_deg", "upper_deg")


def describe_dh_table(
    path: str | Path, convention: str, name: str | None = None, units: str | None = None
) -> dict[str, Any]:
    """A robot file's content from a table: ``joint, alpha_deg, a_mm, d_mm, theta_offset_deg``.

    Columns may be called otherwise, such as ``alpha [rad]``, ``r`` or ``theta``. Where a unit is not stated, it is told by the
    size of the numbers, which the robot's ``source`` then says.

    Optional columns: ``theta_from_controller``, a linear expression in joint names such as -(J2+J3); ``type``,
    revolute or prismatic; ``lower_deg`` and ``upper_deg``, limits.

    Args:
        path: the CSV.
        convention: ``dh`` for Rz(θ)·Tz(d)·Tx(a)·Rx(α), ``mdh`` for Rx(α)·Tx(a)·Rz(θ)·Tz(d); in any letter case.
        name: the robot's name; the file's by default.
        units: of columns that do not state theirs, such as ``m,rad``.

    Raises:
        FileError: a column is missing or unknown, or a cell is not what its column holds, or is in another unit, or a unit is
            neither stated nor told by size.
        UnknownName: a convention that does not exist.
    """
    if convention.lower() not in get_args(Convention):
        raise UnknownName("convention", convention, get_args(Convention), "of Denavit–Hartenberg tables")
    rows = read_csv(path)
    if len(rows) > MOST_JOINTS:
        raise FileError(rows.path, f"has {len(rows)} rows, one for each joint; a robot has up to {MOST_JOINTS}")
    before = next((name for name in rows.header if re.search(r"i ?- ?1", name)), None)
    if before is not None and convention.lower() == "dh":
        message = (
            f"'{shown(before, 40)}' is of the joint before, as modified tables have it; import it with --convention mdh"
        )
        raise FileError(rows.path, message, line=1)
    table, told = in_own_terms(rows, units)
    columns = ColumnGroups(table)
    joint_names = columns.texts("joint")
    numbers = {column: columns.numbers(column) for column in _NUMBERS}
    given = {column: columns.texts(column) for column in _OPTIONAL if column in columns}
    columns.refuse_unused(f"a table has the columns {', '.join(('joint', *_NUMBERS, *_OPTIONAL))}")
    if not len(columns):
        raise columns.error("has no joints; give a line for each")
    if ("lower_deg" in columns) != ("upper_deg" in columns):
        raise columns.refusal("gives one limit only; lower_deg and upper_deg go together")
    check_units(columns)
    limits = columns.side_by_side(LIMITS) if "lower_deg" in columns else None
    joints: list[dict[str, Any]] = []
    for i, text in enumerate(joint_names):
        joint: dict[str, Any] = {"name": f"J{text}" if text.isdigit() else text}
        if "type" in given and given["type"][i]:
            joint["type"] = given["type"][i]
        joint[convention.lower()] = {key: float(numbers[key][i]) for key in ("alpha_deg", "a_mm", "d_mm")}
        if numbers["theta_offset_deg"][i]:
            joint["offset_deg"] = float(numbers["theta_offset_deg"][i])
        if "theta_from_controller" in given and given["theta_from_controller"][i]:
            joint["angle"] = given["theta_from_controller"][i]
        if limits is not None:
            joint["limits_deg"] = limits[i].tolist()
        joints.append(joint)
    path = columns.table.path
    described = {"name": name or path.stem, "source": [f"imported from {path.name}", *told], "joint": joints}
    try:
        robot_from(described)
    except TaskcalError as error:
        raise FileError(path, str(error)) from error
    return described


def read_dh_table(path: str | Path, convention: str, name: str | None = None, units: str | None = None) -> Robot:
    """The robot of a Denavit–Hartenberg table; arguments and errors as `describe_dh_table`."""
    return robot_from(describe_dh_table(path, convention, name, units))
