"""Readings in the units that their file states above its table."""

from dataclasses import replace

import numpy as np

from taskcal.errors import FileError, shown
from taskcal.measurement.readings import Readings
from taskcal.measurement.stated_units import StatedUnits, stated_units
from taskcal.measurement.units import ANGLES, FARTHEST, LENGTHS
from taskcal.robot.robot import Robot


def with_stated_units(readings: Readings, robot: Robot) -> Readings:
    """Readings in radians and metres as far as the file states above its table what its columns do not.

    Raises:
        FileError: the points would not spread as the robot does in the unit stated, but would in another, or are beyond any robot.
    """
    stated = stated_units(readings.preamble)
    angle = None if readings.joint_unit_stated else stated.angle
    length = None if readings.length_unit_stated else stated.length
    if angle is None and length is None:
        return readings
    _refuse_contradiction(readings, stated, robot, angle, length)
    q, notes = readings.q, []
    if angle is not None and q is not None:
        q = np.where(robot.prismatic, q, q * ANGLES[angle])
        notes.append(f"joints are read in {angle}")
    scale = 1.0 if length is None else LENGTHS[length]
    if length is not None:
        notes.append(f"positions are read in {length}")
    where = f", as stated above the table: '{shown(stated.where, 60)}'"
    out = replace(
        readings,
        q=q,
        points={name: points * scale for name, points in readings.points.items()},
        uncertainty={
            name: u if name in readings.uncertainty_stated else u * scale for name, u in readings.uncertainty.items()
        },
        joint_unit_stated=readings.joint_unit_stated or angle is not None,
        length_unit_stated=readings.length_unit_stated or length is not None,
        notes=(*readings.notes, " and ".join(notes) + where),
    )
    if out.length_unit_stated:
        refuse_far(out)
    return out


def refuse_far(readings: Readings) -> None:
    """See that all positions, in metres, are within those of any robot.

    Raises:
        FileError: one is not.
    """
    for name, points in readings.points.items():
        for row, axis in np.argwhere(np.abs(points) > FARTHEST)[:1].tolist():
            message = f"{points[row, axis]:g} m is beyond ±{FARTHEST:g} m; check the cell and its unit"
            column = f"{name} {'xyz'[axis]}"
            raise FileError(readings.path, message, line=int(readings.lines[row]), column=column)


def _refuse_contradiction(
    readings: Readings, stated: StatedUnits, robot: Robot, angle: str | None, length: str | None
) -> None:
    if readings.q is None or not readings.points:
        return
    known_angle = "rad" if readings.joint_unit_stated else None
    known_length = "m" if readings.length_unit_stated else None
    from taskcal.measurement.unit_inference import infer_units  # fits, and so imports the compiler

    likely = {"mm", "m", "in"}
    for target, points in readings.points.items():
        fitting = infer_units(robot, readings.q, known_angle, points, known_length)
        if len(fitting) == 1 and any(
            unit is not None and unit != fits and (unit in likely or unit in ANGLES)
            for unit, fits in zip((angle, length), fitting[0], strict=True)
        ):
            named = " and ".join(unit for unit in (angle, length) if unit)
            fits = " and ".join(unit for unit, asked in zip(fitting[0], (angle, length), strict=True) if asked)
            whose = f"points of '{shown(target)}'" if len(readings.points) > 1 else "points"
            message = (
                f"states {named} above the table ('{shown(stated.where, 60)}'), but {robot.name} moved as far as the {whose} only "
                f"if they are {fits}: write the right unit into the columns' names"
            )
            raise FileError(readings.path, message)
