"""``taskcal poses``: tool poses at joint positions, and joint positions for tool poses."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import taskcal
from taskcal.cli.command import argument, option, output_option
from taskcal.cli.options.common import RobotOptions
from taskcal.cli.output import info
from taskcal.cli.run import File, OutputOptions, Result
from taskcal.errors import ReachError, listed
from taskcal.report.content import Column, Section, TextTable
from taskcal.tables.frame import csv_of

if TYPE_CHECKING:
    import numpy as np

    from taskcal.tables.table import Table as Read

MAX_SHOWN_ROWS = 30
"""Rows that a terminal shows; a file holds all."""

MAX_COLUMNS = 14
IN_A_TERMINAL = ("x_mm", "y_mm", "z_mm", "dx_mm", "dy_mm", "dz_mm", "distance_mm", "angle_mrad", "u_mm")
"""Columns of a calibrated robot's poses that a terminal shows where there are more than fit."""

Angles = Literal["quaternion", "rpy", "abc", "wpr"]
"""How orientations are written."""


def command(
    *,
    table: Path = argument(
        ...,
        "TABLE.csv",
        "Joints (J1_deg …), or tool poses in the base: x_mm y_mm z_mm with qx qy qz qw, roll_deg pitch_deg yaw_deg, a_deg "
        "b_deg c_deg (KUKA), w_deg p_deg r_deg (FANUC) or a direction i j k.",
    ),
    of: RobotOptions,
    reverse: bool = option(False, help="Compute joints although the table has some: they select the configuration."),
    angles: Angles = option("quaternion", help="Form of the orientations.", case_sensitive=False),
    output: Path | None = output_option(None, "OUT.csv", "Output CSV: all rows."),
    out: OutputOptions,
) -> Result:
    """Compute tool poses from joint values, or joint values from tool poses."""
    from taskcal.reading.joints import read_joints
    from taskcal.tables.forms import read_csv
    from taskcal.task.orientation import has_poses

    model, calibration = of.load()
    columns = read_csv(table)
    ids = columns.texts("id") if "id" in columns else [str(row) for row in range(len(columns))]
    if not len(columns):
        raise columns.error("has no rows below its header")
    q = read_joints(columns, model.robot, poses=has_poses(columns))
    if reverse or q is None:
        q, header, rows = _joints_for(columns, q, model, calibration)
    else:
        header, rows = _poses_at(columns, q, model, calibration, angles)
    if calibration is not None:
        header, rows = _with_range(calibration.measured_range, q, ids, header, rows)
    entries = [{"id": name, **dict(zip(header, row, strict=True))} for name, row in zip(ids, rows, strict=True)]
    result = {"robot": model.robot.name, "calibrated": calibration is not None, "rows": entries}
    return Result(
        summary=result,
        sections=lambda: [] if output else [_section(model.robot.name, ids, header, rows)],
        files=[File("poses", output, _csv(ids, header, rows), f": {len(rows)} rows")] if output else (),
    )


def _with_range(
    measured: "taskcal.identification.MeasuredRange",
    q: "np.ndarray",
    ids: list[str],
    header: list[str],
    rows: list[list[Any]],
) -> tuple[list[str], list[list[Any]]]:
    """The rows with the joint that lies farthest outside of what was measured, and how far; and one line about all."""
    from taskcal.identification.measured_range import name_rows

    outside = measured.farthest(q)
    if warning := measured.warning(q, name_rows(range(len(ids)), ids)):
        info(warning)
    return [*header, *outside[0]], [[*row, *entry.values()] for row, entry in zip(rows, outside, strict=True)]


def _csv(ids: list[str], header: list[str], rows: list[list[Any]]) -> str:
    named = (dict(zip(("id", *header), (name, *row), strict=True)) for name, row in zip(ids, rows, strict=True))
    return csv_of(named, digits=9)


def _section(robot: str, ids: list[str], header: list[str], rows: list[list[Any]]) -> Section:
    from taskcal.identification.measured_range import describe_outside

    shown = [k for k in range(len(header)) if not header[k].startswith("outside_")]
    kept = [k for k in shown if len(shown) <= MAX_COLUMNS or header[k] in IN_A_TERMINAL]
    columns = (
        Column("id", ids.__getitem__),
        *(Column(header[k], lambda number, k=k: rows[number][k], ".4f") for k in kept),
        Column(
            "outside range",
            lambda number: describe_outside(dict(zip(header, rows[number], strict=True))),
            optional=True,
        ),
    )
    more = len(rows) - MAX_SHOWN_ROWS
    left_out = (
        "Nominal poses and orientations are in the file (--output) and in --json." if len(kept) < len(shown) else "",
        f"{more} more rows; write them all with --output." if more > 0 else "",
    )
    table = TextTable.of(
        f"{robot}, tool in the base",
        columns,
        range(min(len(rows), MAX_SHOWN_ROWS)),
        note=" ".join(filter(None, left_out)),
    )
    return Section("Poses", table)


def _poses_at(
    columns: "Read",
    q: "np.ndarray",
    model: "taskcal.ErrorModel",
    calibration: "taskcal.Calibration | None",
    angles: Angles,
) -> tuple[list[str], list[list[Any]]]:
    """Poses at joints, and with a calibration how they differ."""
    import numpy as np

    left = [name for name in columns.header if not columns.is_used(name) and name.lower() != "id"]
    if left:
        info(f"ignored columns: {', '.join(left)}")
    outside = model.robot.outside_limits(q)
    if outside:
        rows = sorted({row for row, _ in outside})
        more = f"; outside are {_named(rows)}" if len(rows) > 1 else ""
        info(f"row {outside[0][0]}: {outside[0][1]}{more}")
    if calibration is None:
        header, cells = _pose_cells("", model.poses(q), angles)
        return header, np.stack(cells, axis=1).tolist()
    at = taskcal.correction.locate_tool(calibration, q)
    header, cells = _pose_cells("nominal_", at.nominal, angles)
    names, more = _pose_cells("", at.calibrated, angles)
    moved = at.moved * 1e3
    header += [*names, "dx_mm", "dy_mm", "dz_mm", "distance_mm", "angle_mrad", "u_mm"]
    cells += [*more, *moved.T, np.linalg.norm(moved, axis=1), at.turned * 1e3, at.uncertainty * 1e3]
    return header, np.stack(cells, axis=1).tolist()


MAX_NAMED_ROWS = 10
"""That a message names."""


def _named(rows: list[int]) -> str:
    """Rows in words, all of them counted."""
    return f"row{'s' if len(rows) > 1 else ''} {listed(rows, MAX_NAMED_ROWS)}"


def _pose_cells(prefix: str, T: "np.ndarray", angles: Angles) -> tuple[list[str], list[Any]]:
    import numpy as np

    from taskcal.geometry import se3
    from taskcal.geometry.euler import ANGLES, to_angles

    names, values = [f"{axis}_mm" for axis in "xyz"], [*(T[:, :3, 3] * 1e3).T]
    if angles == "quaternion":
        names += ["qx", "qy", "qz", "qw"]
        values += [*se3.to_quaternion(T[:, :3, :3]).T]
    else:
        names += [f"{name}_deg" for name in ANGLES[angles]]
        values += [*np.degrees(to_angles(angles, T[:, :3, :3])).T]
    return [prefix + name for name in names], values


def _joints_for(
    columns: "Read", seed: "np.ndarray | None", model: "taskcal.ErrorModel", calibration: "taskcal.Calibration | None"
) -> tuple["np.ndarray", list[str], list[list[Any]]]:
    """Joints for poses: nominal, and with a calibration those of the calibrated robot."""
    import numpy as np

    from taskcal.reading.joints import no_joint
    from taskcal.task.orientation import has_poses, read_tool_poses

    robot = model.robot
    if not has_poses(columns) and "x_mm" not in columns:
        raise columns.header_error(no_joint(robot, 0))
    T = read_tool_poses(columns)
    joints = taskcal.correction.find_joints(model if calibration is None else calibration, T, seed)
    if not joints.reached.any():
        raise ReachError(
            f"{robot.name} reaches none of the {len(T)} poses of {columns.path} inside its limits; check that they "
            "are of its tool, in its base, in millimetres"
        )
    if (missed := np.flatnonzero(~joints.reached)).size:
        poses = "the pose is" if len(missed) == 1 else f"{len(missed)} poses are"
        info(f"{_named(missed.tolist())}: {poses} out of reach inside the limits, and left empty")
    _say_turned(T, joints, model, calibration)
    scale = np.where(robot.prismatic, 1e3, 180.0 / np.pi)
    units = ["mm" if slides else "deg" for slides in robot.prismatic]
    names = [f"{name}_{unit}" for name, unit in zip(robot.column_names, units, strict=True)]
    if joints.calibrated is None:
        return joints.nominal, names, (joints.nominal * scale).tolist()
    both = np.concatenate([joints.calibrated, joints.nominal], axis=1) * np.tile(scale, 2)
    return joints.calibrated, [*names, *(f"nominal_{name}" for name in names)], both.tolist()


def _say_turned(
    T: "np.ndarray",
    joints: "taskcal.correction.ToolJoints",
    model: "taskcal.ErrorModel",
    calibration: "taskcal.Calibration | None",
) -> None:
    """One line on how far a robot of few joints stays turned from the poses, where it is more than rounding."""
    import numpy as np

    from taskcal.geometry import se3
    from taskcal.kinematics.inverse import ROUNDED_POSE, freedom_of

    rows = np.flatnonzero(joints.reached)
    at = model.poses(joints.nominal[rows])
    if calibration is not None and joints.calibrated is not None:
        at = calibration.tool_in_base(joints.calibrated[rows])
    turned = np.linalg.norm(se3.log(at[:, :3, :3] @ np.swapaxes(T[rows, :3, :3], 1, 2)), axis=1)
    far = int(np.argmax(turned))
    if turned[far] > ROUNDED_POSE[1]:
        info(
            f"the tool stays turned by up to {np.degrees(turned[far]):.2g}°, in row {rows[far]}, from poses that it meets in "
            f"place: {freedom_of(model)}"
        )
