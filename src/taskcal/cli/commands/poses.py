"""``taskcal poses``: where the tool is at joint positions, and which joints bring it to poses."""

import csv
import io
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.common import OutputOptions
from taskcal.cli.options.model import RobotOptions
from taskcal.cli.output import check_outputs, info, show_table, tell, write_json
from taskcal.errors import ReachError

if TYPE_CHECKING:
    import numpy as np

    from taskcal.identification.calibration import Calibration
    from taskcal.robot.error_model import ErrorModel
    from taskcal.tables.table import Table

MOST_SHOWN = 30
"""Rows that a terminal shows; a file holds all."""

MOST_COLUMNS = 14
IN_A_TERMINAL = ("x_mm", "y_mm", "z_mm", "dx_mm", "dy_mm", "dz_mm", "distance_mm", "angle_mrad", "u_mm")
"""Of a calibrated robot's poses, where all columns are more than a terminal has room for."""


Angles = StrEnum("Angles", ("quaternion", "rpy", "abc", "wpr"))
"""How orientations are written."""


def command(
    table: Annotated[
        Path,
        typer.Argument(
            metavar="TABLE.csv",
            readable=False,
            help="Joints (J1_deg …), or tool poses in the base: x_mm y_mm z_mm with qx qy qz qw, roll_deg pitch_deg yaw_deg, a_deg "
            "b_deg c_deg (KUKA), w_deg p_deg r_deg (FANUC) or a direction i j k.",
        ),
    ],
    of: RobotOptions,
    reverse: Annotated[
        bool,
        typer.Option("--reverse", help="Look for joints although the table has some: they say which branch is meant."),
    ] = False,
    angles: Annotated[
        Angles, typer.Option("--angles", case_sensitive=False, help="How orientations are written.")
    ] = Angles.quaternion,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="OUT.csv", readable=False, help="Write all rows here.")
    ] = None,
    *,
    out: OutputOptions,
) -> None:
    """Compute tool poses from joint values, or joint values from tool poses."""
    outputs = check_outputs("poses", [("--output", output)], [table, of.robot, of.calibration], force=out.force)
    from taskcal.tables.forms import read_csv

    model, calibration = of.load()
    columns = read_csv(table)
    ids = columns.texts("id") if "id" in columns else [str(row) for row in range(len(columns))]
    if not len(columns):
        raise columns.error("has no rows below its header")
    if reverse or not columns.joint_columns(model.robot):
        header, rows = _joints_for(columns, model, calibration)
    else:
        header, rows = _poses_at(columns, model, calibration, angles)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["id", *header])
    writer.writerows([name, *(_cell(value) for value in row)] for name, row in zip(ids, rows, strict=True))
    if output is not None:
        outputs.write({output: text.getvalue()})
    if out.as_json:
        entries = [{"id": name, **dict(zip(header, row, strict=True))} for name, row in zip(ids, rows, strict=True)]
        write_json({"robot": model.robot.name, "calibrated": calibration is not None, "rows": entries})
        return
    if output is not None:
        tell(f"wrote {output}: {len(rows)} rows")
        return
    kept = [k for k in range(len(header)) if len(header) <= MOST_COLUMNS or header[k] in IN_A_TERMINAL]
    shown = [(name, *(f"{row[k]:.4f}" for k in kept)) for name, row in zip(ids[:MOST_SHOWN], rows, strict=False)]
    show_table(f"{model.robot.name}, tool in the base", ("id", *(header[k] for k in kept)), shown)
    if len(kept) < len(header):
        info("nominal poses and orientations are in the file (--output) and in --json")
    if len(rows) > MOST_SHOWN:
        info(f"{len(rows) - MOST_SHOWN} more rows; write them all with --output")


def _cell(value: float) -> str:
    return f"{value:.9f}" if value == value else ""


def _poses_at(
    columns: "Table", model: "ErrorModel", calibration: "Calibration | None", angles: Angles
) -> tuple[list[str], list[list[float]]]:
    """Poses at joints, and with a calibration how they differ."""
    import numpy as np

    from taskcal.correction.tool_poses import locate_tool

    q = columns.joints(model.robot)
    left = [name for name in columns.header if not columns.is_used(name) and name.lower() != "id"]
    if left:
        info(f"not needed and left alone: {', '.join(left)}")
    outside = model.robot.outside_limits(q)
    if outside:
        row, reason = outside[0]
        info(f"row {row}: {reason}")
    if calibration is None:
        header, cells = _pose_cells("", model.poses(q), angles)
        return header, np.stack(cells, axis=1).tolist()
    at = locate_tool(calibration, q)
    header, cells = _pose_cells("nominal_", at.nominal, angles)
    names, more = _pose_cells("", at.calibrated, angles)
    moved = at.moved * 1e3
    header += [*names, "dx_mm", "dy_mm", "dz_mm", "distance_mm", "angle_mrad", "u_mm"]
    cells += [*more, *moved.T, np.linalg.norm(moved, axis=1), at.turned * 1e3, at.uncertainty * 1e3]
    return header, np.stack(cells, axis=1).tolist()


def _pose_cells(prefix: str, T: "np.ndarray", angles: Angles) -> tuple[list[str], list[Any]]:
    import numpy as np

    from taskcal.geometry import se3
    from taskcal.geometry.euler import ANGLES, AngleForm, to_angles

    names, values = [f"{axis}_mm" for axis in "xyz"], [*(T[:, :3, 3] * 1e3).T]
    if angles is Angles.quaternion:
        names += ["qx", "qy", "qz", "qw"]
        values += [*se3.to_quaternion(T[:, :3, :3]).T]
    else:
        form: AngleForm = next(form for form in ANGLES if form == str(angles))
        names += [f"{name}_deg" for name in ANGLES[form]]
        values += [*np.degrees(to_angles(form, T[:, :3, :3])).T]
    return [prefix + name for name in names], values


def _joints_for(
    columns: "Table", model: "ErrorModel", calibration: "Calibration | None"
) -> tuple[list[str], list[list[float]]]:
    """Joints for poses: nominal, and with a calibration those of the calibrated robot."""
    import numpy as np

    from taskcal.correction.tool_poses import find_joints
    from taskcal.task.orientation import has_poses, read_tool_poses

    robot = model.robot
    if not has_poses(columns) and "x_mm" not in columns:
        columns.joints(robot)  # says which columns there must be
    T = read_tool_poses(columns)
    seed = columns.joints(robot) if columns.joint_columns(robot) else None
    joints = find_joints(model if calibration is None else calibration, T, seed)
    if not joints.reached.any():
        raise ReachError(
            f"{robot.name} reaches none of the {len(T)} poses of {columns.path} inside its limits; are they of its tool, "
            "in its base, in millimetres?"
        )
    for row in np.flatnonzero(~joints.reached)[:3]:
        info(f"row {row}: the tool does not reach this pose inside the limits; its joints are left empty")
    scale = np.where(robot.prismatic, 1e3, 180.0 / np.pi)
    units = ["mm" if slides else "deg" for slides in robot.prismatic]
    names = [f"{name}_{unit}" for name, unit in zip(robot.joint_names, units, strict=True)]
    if joints.calibrated is None:
        return names, (joints.nominal * scale).tolist()
    both = np.concatenate([joints.calibrated, joints.nominal], axis=1) * np.tile(scale, 2)
    return [*names, *(f"nominal_{name}" for name in names)], both.tolist()
