"""Robots from Denavit–Hartenberg tables in CSV files."""

from pathlib import Path
from typing import Any, Literal

import tomli_w

from taskcal.csv_table import read_csv
from taskcal.errors import FileError, TaskcalError
from taskcal.robot.dh_units import check_units
from taskcal.robot.file import robot_from
from taskcal.robot.robot import Robot

Convention = Literal["dh", "mdh"]

_REQUIRED = ("joint", "alpha_deg", "a_mm", "d_mm", "theta_offset_deg")
_OPTIONAL = ("theta_from_controller", "type", "lower_deg", "upper_deg")


def describe_dh_table(path: str | Path, convention: Convention, name: str | None = None) -> dict[str, Any]:
    """A robot file's content from a table: ``joint, alpha_deg, a_mm, d_mm, theta_offset_deg``.

    Optional columns: ``theta_from_controller``, a linear expression in joint names such as -(J2+J3); ``type``,
    revolute or prismatic; ``lower_deg`` and ``upper_deg``, limits.

    Args:
        path: the CSV.
        convention: ``dh`` for Rz(θ)·Tz(d)·Tx(a)·Rx(α), ``mdh`` for Rx(α)·Tx(a)·Rz(θ)·Tz(d).
        name: the robot's name; the file's by default.

    Raises:
        FileError: a column is missing or unknown, or a cell is not what its column holds, or is in another unit.
    """
    table = read_csv(path)
    for column in _REQUIRED:
        table.texts(column)
    for column in table.header:
        if column not in _REQUIRED + _OPTIONAL:
            known = ", ".join(_REQUIRED + _OPTIONAL)
            raise FileError(table.path, f"unknown column '{column}'; a table has the columns {known}", line=1)
    if not table.rows:
        raise FileError(table.path, "has no joints; give a line for each")
    numbers = {column: table.numbers(column) for column in _REQUIRED[1:]}
    if ("lower_deg" in table) != ("upper_deg" in table):
        raise FileError(table.path, "gives one limit only; lower_deg and upper_deg go together", line=1)
    check_units(table)
    limits = [table.numbers(column) for column in ("lower_deg", "upper_deg")] if "lower_deg" in table else None
    joints: list[dict[str, Any]] = []
    for i, text in enumerate(table.texts("joint")):
        joint: dict[str, Any] = {"name": f"J{text}" if text.isdigit() else text}
        if "type" in table and table.texts("type")[i]:
            joint["type"] = table.texts("type")[i]
        joint[convention] = {key: float(numbers[key][i]) for key in ("alpha_deg", "a_mm", "d_mm")}
        if numbers["theta_offset_deg"][i]:
            joint["offset_deg"] = float(numbers["theta_offset_deg"][i])
        expression = table.texts("theta_from_controller")[i] if "theta_from_controller" in table else ""
        if expression:
            joint["angle"] = expression
        if limits is not None:
            joint["limits_deg"] = [float(limits[0][i]), float(limits[1][i])]
        joints.append(joint)
    described = {"name": name or table.path.stem, "source": [f"imported from {table.path.name}"], "joint": joints}
    try:
        robot_from(described)
    except TaskcalError as error:
        raise FileError(table.path, str(error)) from error
    return described


def read_dh_table(path: str | Path, convention: Convention, name: str | None = None) -> Robot:
    """The robot of a Denavit–Hartenberg table; arguments and errors as `describe_dh_table`."""
    return robot_from(describe_dh_table(path, convention, name))


def robot_toml(described: dict[str, Any]) -> str:
    """The text of a robot file, as read by `taskcal.load_robot`."""
    return tomli_w.dumps(described)
