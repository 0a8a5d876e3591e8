"""Tools and work objects: from tooldata and wobjdata to frames."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.program import Frame
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.unresolved import Unresolved

FARTHEST_MM = 1e6
"""No coordinate of a robot's cell is larger; the controller's 9E9 stands for none."""

UNIT_TOLERANCE = 0.01
"""A quaternion's length may differ from 1 by this: programmed digits are few."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Frames:
    """Which tool moves in which frame."""

    tool: Frame
    part: Frame
    part_in_hand: bool
    carrier: str = ""
    """Mechanical unit that moves the work object; empty where it stands still."""

    def on(self, T_world_base: Float[np.ndarray, "4 4"]) -> "Frames":
        """What stands still counted in the robot's base instead of the world, which RAPID counts in."""
        if self.part_in_hand:
            return replace(self, tool=_seen_from(T_world_base, self.tool))
        return self if self.carrier else replace(self, part=_seen_from(T_world_base, self.part))


def numbers(value: Value, count: int, what: str) -> tuple[float, ...]:
    """The numbers of a record of numbers.

    Raises:
        Unresolved: there are more or fewer, or something else.
    """
    if not isinstance(value, tuple) or len(value) != count or not all(isinstance(v, float) for v in value):
        raise Unresolved(f"{what} is not made of {count} numbers")
    return tuple(v for v in value if isinstance(v, float))


def parts(value: Value, count: int, what: str) -> tuple[Value, ...]:
    """The components of a record.

    Raises:
        Unresolved: there are more or fewer.
    """
    if not isinstance(value, tuple) or len(value) != count:
        raise Unresolved(f"{what} is not made of {count} components")
    return value


def position(value: Value, what: str) -> tuple[float, ...]:
    """The coordinates of a pos, millimetres.

    Raises:
        Unresolved: it is none.
    """
    xyz = numbers(value, 3, f"the position of {what}")
    if not all(abs(v) <= FARTHEST_MM for v in xyz):
        raise Unresolved(f"the position of {what} is out of any range")
    return xyz


def quaternion(value: Value, what: str) -> tuple[float, ...]:
    """The unit quaternion of an orient, its scalar first.

    Raises:
        Unresolved: it is none.
    """
    q = numbers(value, 4, f"the orientation of {what}")
    length = math.hypot(*q)
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise Unresolved(f"the orientation of {what} is not a unit quaternion: its length is {length:.4g}")
    return tuple(v / length for v in q)


def pose_of(xyz_mm: tuple[float, ...], wxyz: tuple[float, ...]) -> Float[np.ndarray, "4 4"]:
    """The transform of a position and a quaternion with its scalar first."""
    return se3.pose(se3.from_quaternion(np.array([*wxyz[1:], wxyz[0]])), np.array(xyz_mm) / 1e3)


@lru_cache(maxsize=256)
def frames_of(tool: tuple[str, Value], work_object: tuple[str, Value]) -> Frames:
    """The frames of a motion, from names and values of its tooldata and wobjdata.

    Raises:
        Unresolved: they are incomplete, or contradict each other.
    """
    tool_name, wobj_name = tool[0], work_object[0]
    tool_held, tframe, _ = parts(tool[1], 3, f"the tool '{tool_name}'")
    wobj_held, fixed, unit, uframe, oframe = parts(work_object[1], 5, f"the work object '{wobj_name}'")
    if not isinstance(tool_held, bool) or not isinstance(wobj_held, bool) or not isinstance(fixed, bool):
        raise Unresolved(f"the tool '{tool_name}' or the work object '{wobj_name}' does not say what the robot holds")
    if not fixed and not (isinstance(unit, str) and unit):
        raise Unresolved(f"the work object '{wobj_name}' is moved (ufprog is FALSE), and no mechanical unit is named")
    if tool_held == wobj_held:
        what = "both held by the robot" if tool_held else "neither held by the robot"
        raise Unresolved(f"the tool '{tool_name}' and the work object '{wobj_name}' are {what}")
    # the user frame of a work object that moves is that of the mechanical unit, whatever uframe says (wobjdata)
    user = _pose(uframe, f"'{wobj_name}'") if fixed else np.eye(4)
    inner = _pose(oframe, f"'{wobj_name}'")
    return Frames(
        tool=Frame(name=tool_name, T=_pose(tframe, f"'{tool_name}'")),
        part=Frame(name=wobj_name, T=user @ inner),
        part_in_hand=wobj_held,
        carrier="" if fixed else str(unit),
    )


def _seen_from(T_world_base: Float[np.ndarray, "4 4"], frame: Frame) -> Frame:
    return Frame(name=frame.name, T=se3.inverse(T_world_base) @ frame.T)


def _pose(value: Value, what: str) -> Float[np.ndarray, "4 4"]:
    trans, rot = parts(value, 2, f"the frame of {what}")
    return pose_of(position(trans, what), quaternion(rot, what))
