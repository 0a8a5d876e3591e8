"""Points of KRL motions as they are written, and where these lead: incomplete ones, distances, and arcs up to an angle.

A component that a point leaves out keeps the value that it has where the motion before ended (KUKA System Software, programming of
motions to points); ``LIN_REL`` and ``PTP_REL`` add theirs to it, along the base's axes, or with ``#TOOL`` along the tool's. Both
points of ``CIRC_REL`` count from where the arc begins (KUKA.PLC mxAutomation as in Beckhoff TF5120, KRC_MoveCircRelative).

Status and turn, by which KRL tells apart the axis positions that reach one pose.

KUKA System Software, Operating and Programming Instructions for System Integrators, section "Status and Turn":

- T, bit i − 1: axis i stands below 0°.
- S, bit 0: the centre of the wrist lies behind axis 1, that is at negative x of a frame that turns with axis 1 (overhead area).
- S, bit 1: axis 3 stands at or beyond the angle at which the wrist's centre, axis 3 and axis 2 are in line; that angle is zero
  where axis 4 meets axis 3, and follows from their offset otherwise.
- S, bit 2: axis 5 lies in −180° … 0° or beyond 180°.
- S, bit 4: the point was taught by a robot whose controller corrects its own geometry.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from robot_programs.core.form import Text
from robot_programs.core.program import Motion, Target, Unresolved
from robot_programs.core.robot import Robot, arm_bends
from robot_programs.core.sharing import Pose
from robot_programs.core.source import Place, Source
from robot_programs.core.values import Lost, Origin, Structure
from robot_programs.krl.data import Datum, KrlFile
from robot_programs.krl.syntax import MotionLine, Operand
from robot_programs.krl.values import (
    AXES,
    EXTERNAL,
    POSE,
    STATUS,
    axes,
    external,
    frame,
    has_any,
    pose,
    pose_values,
    rotation_stated,
)
from taskcal_groundwork import se3

# Status and turn.

JOINTS = 6
ACCURATE_BIT = 0b10000
"""Of S, where the controller's own correction was on."""

BORDER_TOLERANCE = 1e-6
"""Nearer to the border between two values of a bit than this, radians, either value is right."""


@dataclass(frozen=True, kw_only=True)
class StatusTurn:
    """S and T of a position; either may be missing."""

    S: int | None
    T: int | None

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture has this status and turn.

        S does not count on a robot without a wrist of three axes through one point, where it cannot be told.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        return self.miss(robot, q) < BORDER_TOLERANCE

    @property
    def tolerated(self) -> float:
        """Largest deviation at which the controller still takes the nearest posture, radians: not at all."""
        return 0.0

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Deviation of each posture from the one meant, radians: the angle of joints to the sign that T states.

        On the wrong side of what S tells it is half a turn and more.
        """
        away = np.zeros(len(q))
        if self.T is not None:
            away = _bits_miss(self.T, -q[:, :JOINTS]).max(axis=1)
        beyond = None if self.S is None else _beyond(robot, q)
        if self.S is not None and beyond is not None:
            wrong = _bits_miss(self.S, beyond)
            away = np.maximum(away, np.where(wrong < BORDER_TOLERANCE, wrong, np.pi + wrong).max(axis=1))
        return away

    def of(self, robot: Robot, q: Float[np.ndarray, " joints"]) -> "StatusTurn":
        """Status and turn of a posture.

        What the posture does not decide stays as it is here: what is missing, bits of other meaning, bits on the border, and S
        on a robot without a wrist of three axes through one point.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        beyond = None if self.S is None else _beyond(robot, q[None])
        S = self.S if self.S is None or beyond is None else _with_bits(self.S, beyond[0])
        T = None if self.T is None else _with_bits(self.T, -q[:JOINTS])
        return StatusTurn(S=S, T=T)


def _bits_miss(value: int, positive: Float[np.ndarray, "n bits"]) -> Float[np.ndarray, "n bits"]:
    """Amount by which each value is on the wrong side, zero on the right one."""
    stated = (value >> np.arange(positive.shape[1])) & 1 == 1
    return np.maximum(np.where(stated, -positive, positive), 0.0)


def _with_bits(value: int, positive: Float[np.ndarray, " bits"]) -> int:
    for bit, amount in enumerate(positive):
        if abs(amount) >= BORDER_TOLERANCE:
            value = value | 1 << bit if amount > 0 else value & ~(1 << bit)
    return value


def _beyond(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3"] | None:
    """Angles, or the sine of one, that are positive where bits 0, 1 and 2 of S are set; None for a robot without such an arm."""
    bends = arm_bends(robot, q)
    return None if bends is None else np.column_stack([-bends[:, 0], bends[:, 1], -np.sin(q[:, 4])])


# Points as they are written.


@dataclass(frozen=True, eq=False, kw_only=True)
class WrittenPoint:
    """A point of a motion as it is written."""

    operand: Operand
    stated: tuple[Structure, ...]
    """What it states, and what is added to it by ``:``."""
    datum: Datum | None
    """Where it is a variable, or starts with one."""
    file: KrlFile
    """Of the motion."""
    computed: bool = False
    """Code computes the first of these, so that its numbers stand nowhere in the text."""

    @property
    def first(self) -> Structure:
        """What it states."""
        return self.stated[0]

    @property
    def stating(self) -> Structure:
        """Which states status and turn: of a sum its last part, where that does."""
        return self.stated[-1] if has_any(self.stated[-1], STATUS) else self.first

    @property
    def template(self) -> Source:
        """In which the first of these stands."""
        return (self.file if self.datum is None else self.datum.file).source

    @property
    def slot(self) -> Origin | None:
        """Where its numbers stand; None where code computes them, or other programs have them, too."""
        datum = self.datum
        if self.computed or (datum is not None and (datum.shared or datum.file.module != self.file.module)):
            return None
        return self.first.origin

    @cached_property
    def offset(self) -> Pose:
        """What is added.

        Raises:
            Unresolved: it is no frame.
        """
        T = np.eye(4)
        for added in self.stated[1:]:
            T = T @ frame(added)
        return T

    def with_offset(self, T: Pose) -> Pose:
        """The pose to which the motion leads, by the one to which is added."""
        return T @ self.offset if len(self.stated) > 1 else T

    def without_offset(self, T: Pose) -> Pose:
        """The inverse; of an auxiliary point that does not state them, angles do not count."""
        if len(self.stated) == 1:
            return T
        R = T[:3, :3] if has_any(self.first, "ABC") else self.offset[:3, :3]
        return se3.pose(R, T[:3, 3]) @ se3.inverse(self.offset)


@dataclass(frozen=True, eq=False, kw_only=True)
class KrlSite:
    """A motion's place in the text."""

    file: KrlFile
    motion: MotionLine
    written: tuple[WrittenPoint, ...]
    """Its points, the last of them the end."""
    leans: bool = False
    """It counts from where the motion before ends, at least in part."""
    before: tuple[int, ...] = ()
    """Numbers of the motions that may be the one before, as far as they are known."""

    @property
    def text(self) -> Text:
        """Number of the file and first character."""
        return (self.file.number, self.motion.start)


# Where it leads.

VARIABLE, CONSTANT, JOINT = "#VAR", "#CONSTANT", "#JOINT"
"""How lines and arcs turn the tool, by $ORI_TYPE: to the orientation of their end, not at all, or by the wrist's joints."""

UNKNOWN = "it counts from where the motion before ended, and that is not known"


def is_incomplete(point: Structure) -> bool:
    """Whether components of a pose, or axes, are left out."""
    return any(name not in point.parts for name in (POSE if has_any(point, POSE) else AXES))


def axes_at_end(point: Structure, before: Motion | None, *, relative: bool) -> Float[np.ndarray, " joints"]:
    """Joint positions, those left out as they were, or moved by angles, radians.

    Raises:
        Unresolved: where the motion before ended is not known by its joints.
    """
    missing = next((name for name in AXES if name not in point.parts), "")
    if not (relative or missing):
        return axes(point)
    if before is None or before.end.q is None:
        raise Unresolved(UNKNOWN if relative else f"{missing} is not stated, and {UNKNOWN}")
    given = axes(point, needed=())
    if relative:
        return before.end.q + given
    return np.where([name in point.parts for name in AXES], given, before.end.q)


def completed_pose(point: Structure, before: Motion | None) -> Float[np.ndarray, "4 4"]:
    """A pose, what is left out as it was; either all of A, B and C are, or none.

    Args:
        point: the point.
        before: the motion before, with the same tool and base.

    Raises:
        Unresolved: it is not known where that ended, or only some of the angles are stated.
    """
    if not is_incomplete(point):
        return pose(point)
    if before is None or before.end.T is None:
        missing = next(name for name in POSE if name not in point.parts)
        raise Unresolved(f"{missing} is not stated, and {UNKNOWN}")
    oriented = rotation_stated(point)
    kept = pose_values(before.end.T)
    position = [None if name in point.parts else kept[name] for name in "XYZ"]
    T = pose(point, needed=())
    xyz = [own if old is None else old * 1e-3 for own, old in zip(T[:3, 3], position, strict=True)]
    return se3.pose(T[:3, :3] if oriented else before.end.T[:3, :3], np.array(xyz))


def moved_pose(step: Float[np.ndarray, "4 4"], before: Motion | None, *, by_tool: bool) -> Float[np.ndarray, "4 4"]:
    """End of a motion by a distance.

    Args:
        step: the distance, metres.
        before: the motion before, with the same tool and base.
        by_tool: whether it is along the tool's axes.

    Raises:
        Unresolved: it is not known where it begins, or it turns, too.
    """
    if before is None or before.end.T is None:
        raise Unresolved(UNKNOWN)
    if np.abs(step[:3, :3] - np.eye(3)).max() > 0.0:
        raise Unresolved("it turns the tool by angles that are not added here; write a motion to a complete point")
    T = before.end.T.copy()
    T[:3, 3] += T[:3, :3] @ step[:3, 3] if by_tool else step[:3, 3]
    return T


MIN_SINE = 1e-3
"""Of the angle in which a circle is seen from one of three points on it: points nearer to a line are none of a circle."""

SAME_ORIENTATION_RAD = 1e-6

MAX_ARC_DEG = 350.0
"""Arcs that nearly close are told apart from those of next to no angle by digits that points do not have."""


def at_angle(
    angle: float, start: Float[np.ndarray, "4 4"], via: Float[np.ndarray, "4 4"], last: Float[np.ndarray, "4 4"]
) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "4 4"]]:
    """Middle and end of an arc that ends at an angle, on the circle from its start through two points.

    The angle is that of the whole arc, counted the way that leads by the first point to the second, negative the other way (KUKA
    System Software, circular motions, circular angle).

    Args:
        angle: degrees.
        start: pose where it begins.
        via: the first point.
        last: the second one.

    Raises:
        Unresolved: they are on no circle, the tool turns on the way to the second point, or the arc is none of one turn.
    """
    a, b = via[:3, 3] - start[:3, 3], last[:3, 3] - start[:3, 3]
    normal, aa, bb, cc = np.cross(a, b), a @ a, b @ b, (b - a) @ (b - a)
    if not normal @ normal > MIN_SINE**2 * max(aa * bb, bb * cc, cc * aa):
        raise Unresolved("its points and its start are on no circle on which CA would count")
    if np.abs(start[:3, :3] - last[:3, :3]).max() > SAME_ORIENTATION_RAD:
        raise Unresolved(
            "the tool turns along it, and how far up to the angle CA is not known; write it to its own end"
        )
    if not 0.0 < abs(angle) < MAX_ARC_DEG:
        raise Unresolved(f"CA {angle:g} is not between 0 and {MAX_ARC_DEG:g}°; write two arcs")
    centre = np.cross(aa * b - bb * a, normal) / (2.0 * normal @ normal)
    axis = normal / np.linalg.norm(normal)
    turns = (se3.exp(axis * np.radians(share * angle)) for share in (0.5, 1.0))
    middle, end = (se3.pose(last[:3, :3], start[:3, 3] + centre - R @ centre) for R in turns)
    return middle, end


def refuse_moved_axes(point: Structure) -> None:
    """Let no external axis be moved by a distance, which would be taken for its position.

    Raises:
        Unresolved: one is.
    """
    for name in EXTERNAL:
        if point.parts.get(name, 0.0) != 0.0:
            raise Unresolved(
                f"it moves {name} by a distance that is not added here; write a motion to a complete point"
            )


def turned(target: Target, orientation: Any, before: Motion | None) -> Target:
    """A target of a line or an arc with the orientation in which it is reached (KUKA System Software, $ORI_TYPE).

    Raises:
        Unresolved: the text does not tell it.
    """
    if orientation == JOINT:
        return target
    if orientation != CONSTANT:
        said = (
            "is not known before it"
            if not isinstance(orientation, str) or orientation[:1] != "#"
            else f"is {orientation}"
        )
        raise Unresolved(f"how it turns the tool ($ORI_TYPE) {said}; known are {VARIABLE}, {CONSTANT} and {JOINT}")
    if before is None or before.end.T is None or target.T is None:
        raise Unresolved(
            f"it keeps the orientation in which it begins ($ORI_TYPE={CONSTANT}), which the text does not tell; let the motion "
            "before go to a pose, in the same tool and base"
        )
    return replace(target, T=se3.pose(before.end.T[:3, :3], target.T[:3, 3]))


def distance(written: WrittenPoint) -> Float[np.ndarray, "4 4"]:
    """By what a motion goes on from where the one before ended.

    Raises:
        Unresolved: it is not stated as a frame.
    """
    first = written.first
    if has_any(first, AXES) or not has_any(first, POSE):
        refuse_moved_axes(first)
        raise Unresolved("its distance is not stated by X, Y and Z")
    return written.with_offset(frame(first))


def external_axes(point: Structure, *, relative: bool) -> tuple[float, ...]:
    """Positions of the external axes at the end of a motion; NaN where they stay as they are."""
    if not relative:
        return external(point)
    refuse_moved_axes(point)
    return (math.nan,) * len(EXTERNAL)


def auxiliary(
    written: WrittenPoint, end: Float[np.ndarray, "4 4"], relative: bool, before: Motion | None, place: Place
) -> Target:
    """The auxiliary point of an arc, which need not state an orientation."""
    place = place if written.datum is None else written.datum.place
    name = "" if written.datum is None else written.datum.name
    first = written.first
    external(first)  # refuses what is not a number
    if relative:
        T = moved_pose(distance(written), before, by_tool=False)
        return Target(name=name, T=T, q=None, posture=None, place=place)
    oriented = has_any(first, "ABC")
    T = written.with_offset(pose(first) if oriented else pose(first, needed=("X", "Y", "Z")))
    if not oriented:
        T[:3, :3] = end[:3, :3]
    return Target(name=name, T=T, q=None, posture=None, place=place)


def to_angle(angle: Any, via: Target, end: Target, before: Motion | None) -> tuple[Target, Target]:
    """Middle and end of an arc that ends at an angle.

    Raises:
        Unresolved: the angle, or where it begins, is not known.
    """
    if before is None or before.end.T is None:
        raise Unresolved(UNKNOWN)
    if not isinstance(angle, float):
        raise Unresolved(angle.reason if isinstance(angle, Lost) else "its angle is not a number")
    assert via.T is not None
    assert end.T is not None
    middle, T = at_angle(angle, before.end.T, via.T, end.T)
    return replace(via, T=middle), replace(end, T=T)
