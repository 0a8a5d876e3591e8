"""Correction at run time: a module in the controller's language that moves a target by what the calibrated robot is off there.

With the nominal poses f(q) and the calibrated ones C(q)·f(q), a target's pose F is met at joints q where C(q)·f(q) = F: the
controller is to drive to f(q) = C(q)⁻¹·F, which it finds by itself. C is the product of the small displacements of all error
frames and of what the joints turn further, each about where it is on the nominal robot. All that is computed is small, so that
single precision is enough; q is found by repeating q ← f⁻¹(C(q)⁻¹·F).
"""

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import Diagnostic, Program, Wrapping, pose_numbers
from robot_programs.core.robot import arm_bends, meeting_point
from robot_programs.core.source import Place, Source
from robot_programs.krl.rewrite import Status
from robot_programs.languages import language_of
from taskcal.correction.cell import Cell
from taskcal.correction.correction import Bounds, Correction, Helper
from taskcal.correction.frames import MAX_TOOL_DIFFERENCE
from taskcal.errors import TaskcalError, shown
from taskcal.geometry import se3
from taskcal.geometry.expressions import Dialect, Pool, StraightLine, is_zero, straight_line, trace
from taskcal.identification.calibration import Calibration
from taskcal.kernels.chain import ERROR_FRAME, FIXED, REVOLUTE
from taskcal.robot.error_model import COMPONENTS
from taskcal.robot.robot import Robot

FUNCTION = "TaskcalCorrected"
"""Sixteen characters, as many as a name has on the oldest controllers."""

MODULE = "TaskcalHelper"

NO_ERROR = 1e-7
"""Errors of the robot's own tool that are smaller, metres and radians, are none."""

MAX_TITLE = 100
"""Characters of a comment."""

USUAL_ROUNDS = 3

MAX_ROUNDS = 8
"""Of the repetition: each leaves the share of the error by which a millimetre at the tool changes C, a hundredth as a rule and a
quarter near singular postures."""

SETTLED_MM, LEVER_MM = 2e-3, 2000.0
"""Change of the shift, with that of the half turn on a lever, millimetres, at which the repetition ends: less is left."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Module:
    """A module that corrects at run time."""

    source: Source
    operations: int
    """Sums, products and functions of one evaluation of the model."""
    without: frozenset[str]
    """Keys of tools and parts that were measured, which it does not know."""
    function: str = FUNCTION

    def wrap(
        self, program: Program, rejected: Container[int] = (), *, declared: bool = False, keep_joints: bool = False
    ) -> Wrapping:
        """The program with the function around targets that only the running program knows.

        Args:
            program: to be corrected.
            rejected: numbers of motions that its text does not let correct.
            declared: whether it has the module already.
            keep_joints: leave motions to joint positions as they are.
        """
        added = None if declared else self.source
        return program.wrap(self.function, added, without=self.without, rejected=rejected, keep_joints=keep_joints)

    def told(self, found: Correction, wrappings: Sequence[Wrapping]) -> Correction:
        """A correction with what the module does in it."""
        motions = tuple(place for one in wrappings for place in one.wrapped)
        start = Place(path=found.program.sources[0].path, line=1)
        inside = self.source.path == start.path
        where = (
            ", which stands before its first statement and stops where the arm's kinematics are not the robot file's"
            if inside
            else f" of {self.source.path.name}: load it with the program"
        )
        said = [Diagnostic(place=start, text="no motion needs a helper, or can have one; none is added")]
        if motions:
            count = f"{len(motions)} motions are" if len(motions) > 1 else "1 motion is"
            text = (
                f"{count} corrected at run time by {self.function}{where}; a call takes {self.operations} "
                f"operations and an inverse {USUAL_ROUNDS} times as a rule, {MAX_ROUNDS} at most"
            )
            said = [Diagnostic(place=start, text=text)]
            said += [Diagnostic(place=one, text="is corrected at run time, and not assessed here") for one in motions]
        said += [one for wrapping in wrappings for one in wrapping.left]
        helper = Helper(path=self.source.path, operations=self.operations, motions=motions) if motions else None
        sources = found.sources
        for wrapping in wrappings:
            sources = wrapping.completed(sources)
        return replace(found, sources=sources, helper=helper, diagnostics=(*said, *found.diagnostics))


# The displacement of the calibrated robot against the nominal one, in expressions.


class Displacement(NamedTuple):
    """A small rigid displacement x ↦ t + x + 2·(w·v×x + v×(v×x)): half a turn in w and v, a quaternion."""

    w: Any
    v: Any
    t: Any

    def turned(self, x: Any) -> Any:
        """By how much a point is moved by the rotation alone."""
        across = np.cross(self.v, x)
        return 2.0 * (self.w * across + np.cross(self.v, across))

    def then(self, other: "Displacement") -> "Displacement":
        """The product of two; the other one acts first."""
        w = self.w * other.w - self.v @ other.v
        v = self.w * other.v + other.w * self.v + np.cross(self.v, other.v)
        return Displacement(w, v, self.t + other.t + self.turned(other.t))


def displacement(calibration: Calibration, q: Any, T_world_base: Float[np.ndarray, "4 4"]) -> Displacement:
    """C(q) of the flange in the world.

    Args:
        calibration: of a robot whose effects depend on nothing but joint positions.
        q: joint positions, expressions (1, joints).
        T_world_base: where the robot stands.

    Raises:
        TaskcalError: an effect decides by comparisons.
    """
    model, x = calibration.model, calibration.estimate
    side, errors = model.robot.joint_side, model.error_frames(x)
    nominal = model.coordinates(q, np.zeros(len(x)), side.loop_numbers(np.zeros(3))).still
    moved = model.coordinates(q, x, side.loop_numbers(model.loop_deviations(x))).moved
    traced = trace(model.chain, nominal, np.zeros_like(errors))
    R, place = T_world_base[:3, :3], T_world_base[:3, 3]
    out = Displacement(1.0, np.zeros(3), np.zeros(3))
    last = model.chain.frames - (not model.lengths_only)  # the tool's own errors are not the flange's
    for kind, number in zip(model.chain.kind, model.chain.index, strict=True):
        if kind == ERROR_FRAME and number < last and errors[number].any():
            frame = traced.frames[number]
            E = se3.error_transform(errors[number])
            axes, origin, (w, *v) = R @ frame[:3, :3], R @ frame[:3, 3] + place, _quaternion(E[:3, :3])
            own = Displacement(w, axes @ np.array(v), axes @ E[:3, 3])
        elif kind not in (ERROR_FRAME, FIXED) and not is_zero(further := moved[number] - nominal[number]):
            axis, origin = R @ traced.axes[number], R @ traced.origins[number] + place
            half = 0.5 * further
            turns = kind == REVOLUTE
            own = Displacement(
                np.cos(half) if turns else 1.0,
                np.sin(half) * axis if turns else np.zeros(3),
                np.zeros(3) if turns else further * axis,
            )
        else:
            continue
        out = out.then(own._replace(t=own.t - own.turned(origin)))
    return out


def nominal_flange(calibration: Calibration, q: Any) -> Any:
    """Pose of the controller's flange in the base, (4, 4), at joint positions (1, joints), as the nominal robot has it."""
    model, robot = calibration.model, calibration.model.robot
    side = robot.joint_side
    still = model.coordinates(q, np.zeros(len(calibration.estimate)), side.loop_numbers(np.zeros(3))).still
    errors = np.zeros_like(model.error_frames(calibration.estimate))
    return trace(model.chain, still, errors).T @ se3.inverse(robot.T_flange_tool)


def _quaternion(R: Float[np.ndarray, "3 3"]) -> tuple[float, ...]:
    """Of a small rotation: scalar part first."""
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    x, y, z = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * w)
    return float(w), float(x), float(y), float(z)


# The inverse of the nominal robot in closed form: an arm of two parallel axes across axis 1, and a wrist whose axes meet.


PROBES = 24
"""Postures in which an arm's inverse and the sides that status tells apart are compared with the robot itself."""

PROBE_RAD = 0.1
"""By which each joint is turned, to see about which end of its axis it counts."""

CLEAR = 1e-9
"""Smaller numbers of an arm's geometry, metres or parts of one, are zero."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BentArm:
    """Geometry of an arm with a spherical wrist, all joints at zero."""

    axes: Float[np.ndarray, "6 3"]
    origins: Float[np.ndarray, "6 3"]
    """A point of each axis, metres."""
    flange: Float[np.ndarray, "4 4"]
    wrist: Float[np.ndarray, " 3"]
    """Where the last three axes meet."""
    sides: tuple[float, ...] = (1.0, 1.0, 1.0)
    """Of axes 1, 3 and 5, as `joints` takes them, for a status S of zero; each of its bits changes one."""

    @classmethod
    def of(cls, robot: Robot) -> "BentArm":
        """The arm of a robot.

        Raises:
            TaskcalError: it is none, or S does not tell its sides apart.
        """
        refused = TaskcalError(f"--helper: {robot.name} is no arm with a spherical wrist, which a helper in KRL needs")
        zero = np.zeros((1, len(robot.joint_names)))
        if arm_bends(robot, zero) is None:
            raise refused
        frames = robot.joint_frames(zero)[0]
        to_flange = se3.inverse(robot.T_flange_tool)
        wrist, _ = meeting_point(frames[3:])
        turned = robot.tool_poses(PROBE_RAD * np.eye(6))[:, :3, :3] @ robot.tool_poses(zero)[0, :3, :3].T
        axes = np.sign((se3.log(turned) * frames[:, :3, 2]).sum(axis=1))[:, None] * frames[:, :3, 2]
        arm = cls(axes=axes, origins=frames[:, :3, 3], flange=robot.tool_poses(zero)[0] @ to_flange, wrist=wrist)
        if max(abs(arm.axes[4] @ arm.axes[3]), abs(arm.axes[4] @ arm.axes[5])) > CLEAR:
            raise refused
        lower, upper = robot.bounded_limits().T
        q = lower + (upper - lower) * np.random.default_rng(0).uniform(0.1, 0.9, size=(PROBES, 6))
        choices = np.array(list(product((1.0, -1.0), repeat=3)))
        found = set[tuple[float, ...]]()
        for own, T in zip(q, robot.tool_poses(q) @ to_flange, strict=True):
            off = [np.abs(np.sin(0.5 * (arm.joints(T[:3, :3], T[:3, 3], one)[0] - own))).max() for one in choices]
            S = Status(S=0, T=None).of(robot, own).S or 0
            if min(off) > CLEAR * 1e3:
                raise refused
            found.add(tuple(choices[int(np.argmin(off))] * [1.0 - 2.0 * (S >> bit & 1) for bit in range(3)]))
        if len(found) > 1:
            raise refused
        return replace(arm, sides=found.pop())

    def joints(self, R: Any, p: Any, sides: Any) -> tuple[Any, Any]:
        """Joint positions of a pose of the flange in the base: numbers or expressions.

        Args:
            R: its rotation.
            p: its place, metres.
            sides: plus or minus one, of axes 1, 3 and 5.

        Returns:
            The six, radians; and two numbers that are negative where there are none: for axis 1, and for axis 3.
        """
        z, u = self.axes[:2]
        across = np.array([u, np.cross(z, u), z])  # its last two span the plane of the arm, where all axes are at zero
        plane = lambda point: _clear(across[1:] @ (point - self.origins[0]))  # noqa: E731
        r = _clear(across) @ (p + R @ _clear(self.flange[:3, :3].T @ (self.wrist - self.flange[:3, 3])))
        r = r - _clear(across @ self.origins[0])
        # Axis 1: the wrist's distance from the plane of axis 1 along axis 2 is what it was
        offset = _clear(u @ (self.wrist - self.origins[0]))
        square = r[0] * r[0] + r[1] * r[1]
        ahead = square - offset * offset
        forward = sides[0] * np.sqrt(abs(ahead))
        cosine, sine = offset * r[0] - forward * r[1], offset * r[1] + forward * r[0]
        q1, c1, s1 = np.arctan2(sine, cosine), cosine / square, sine / square
        # Axes 2 and 3: two sides of a triangle in the plane
        second, third = plane(self.origins[1]), plane(self.origins[2])
        arm, forearm = third - second, plane(self.wrist) - third
        d = np.array([-1.0 * forward, r[2]]) - second
        reach = d[0] * d[0] + d[1] * d[1]
        along, aside = arm @ forearm, arm[0] * -forearm[1] + arm[1] * forearm[0]
        cosine3 = 0.5 * (reach + -1.0 * (arm @ arm + forearm @ forearm))
        bend = (arm @ arm) * (forearm @ forearm)
        elbow = bend - cosine3 * cosine3
        height = sides[1] * np.sqrt(abs(elbow))
        cf, sf = along * cosine3 - aside * height, aside * cosine3 + along * height
        turned = np.array([cf * forearm[0] - sf * forearm[1], sf * forearm[0] + cf * forearm[1]]) * (1.0 / bend) + arm
        dot, cross = turned[0] * d[0] + turned[1] * d[1], turned[0] * d[1] - turned[1] * d[0]
        q2, q3 = np.arctan2(cross, dot), np.sign(self.axes[2] @ u) * np.arctan2(sf, cf)
        # The wrist: what is left of the rotation behind axis 3, in the axes of `across`
        c23, s23 = (cf * dot - sf * cross) / (bend * reach), (sf * dot + cf * cross) / (bend * reach)

        def behind_arm(axis: Float[np.ndarray, " 3"]) -> Any:
            x, y, w = _clear(across) @ (R @ _clear(self.flange[:3, :3].T @ axis))
            x, y = c1 * x + s1 * y, c1 * y - s1 * x
            return np.array([x, c23 * y + s23 * w, c23 * w - s23 * y])

        Z, Y = (_clear(across @ self.axes[k]) for k in (3, 4))
        X, last, cross_axis = np.cross(Y, Z), behind_arm(self.axes[5]), behind_arm(self.axes[4])
        nx, ny, nz = X @ last, Y @ last, Z @ last
        straight = np.arctan2(X @ across @ self.axes[5], Z @ across @ self.axes[5])
        fifth = sides[2] * (nx * Y - ny * X)
        return np.array(
            [
                q1,
                q2,
                q3,
                np.arctan2(sides[2] * ny, sides[2] * nx),
                np.arctan2(sides[2] * np.sqrt(nx * nx + ny * ny), nz) - straight,
                np.arctan2(cross_axis @ np.cross(last, fifth), cross_axis @ fifth),
            ],
        ), (ahead, elbow)


def _clear(values: Any) -> Any:
    """Numbers of a robot's geometry, what is nearly zero or one exactly so, which then costs nothing."""
    near = np.round(values)
    return np.where(np.abs(values - near) < CLEAR, near, values)


# What the controller cannot know where the function is called.


def check_known_there(calibration: Calibration, program: Program, cell: Cell) -> None:
    """See that joint positions are all that the correction depends on.

    Raises:
        TaskcalError: an effect depends on more, or the robot does not stand still, or its own tool was calibrated.
    """
    model, robot = calibration.model, calibration.model.robot
    unknown = [
        f"{effect.name} ({', '.join((*effect.needs, *effect.uses))})"
        for effect, term in zip(model.effects, model.effect_terms, strict=True)
        if term.given is not None
    ]
    if unknown:
        raise TaskcalError(
            f"--helper: the calibration has {', '.join(unknown)}, which a controller does not know where it computes a target; "
            "identify without it, or correct without --helper"
        )
    if any(axis.carries == "robot" for axis in cell.axes):
        raise TaskcalError(
            "--helper: an external axis carries the robot; its helper is written for one that stands still"
        )
    tool = [
        abs(value) for name, value in zip(model.names, calibration.estimate, strict=False) if name.startswith("tool.")
    ]
    own = next(
        (m.tool.name for m in program.motions if np.abs(m.tool.T - robot.T_flange_tool).max() < MAX_TOOL_DIFFERENCE), ""
    )
    if own and max(tool, default=0.0) > NO_ERROR:
        raise TaskcalError(
            f"--helper: tool '{own}' is the robot file's own, whose errors were identified; the helper corrects the flange alone: "
            f"identify without {COMPONENTS[0]} … {COMPONENTS[-1]} of the tool, or correct without --helper"
        )


def measured_frames(cell: Cell) -> frozenset[str]:
    """Tools and parts of the cell that are known to be elsewhere than the controller has them."""
    return frozenset(
        key
        for frames in (cell.tools, cell.parts)
        for key, m in frames.items()
        if m.reflectors
        or any(given is not None for given in (m.in_tracker, m.touched, m.tip, m.in_flange, m.in_target))
    )


# RAPID: robtargets in millimetres and quaternions, functions in degrees, numbers in single precision (Technical reference
# manual, RAPID Instructions, Functions and Data types, 3HAC050917: num, robtarget, orient, CalcJointT, PoseMult, PoseVect,
# PoseInv, ErrWrite, EXIT).


def _single(value: float) -> str:
    """In the digits that single precision has."""
    text = f"{value:.9g}".upper()
    return text if any(mark in text for mark in ".E") else f"{text}.0"


RAPID = Dialect(
    number=_single,
    functions={"sin": "Sin({0})", "cos": "Cos({0})", "sqrt": "Sqrt({0})", "exp": "Exp({0})", "atan2": "ATan2({0},{1})"},
    variable="t{{{0}}}",
    assignment="{0}:={1};",
    degrees={f"q{{{k}}}": f"j.rax_{k}" for k in range(1, 7)},
)


def rapid_helper(calibration: Calibration, program: Program, cell: Cell, bounds: Bounds) -> Module:
    """A RAPID module with a function of a robtarget, a tooldata and a wobjdata."""
    pool = Pool()
    at = _inputs(pool, "at.x", "at.y", "at.z")
    bases = (cell.T_world_base, program.T_world_base, np.eye(4))
    base = next(T for T in bases if T is not None)
    shift, turn = _needed(calibration, base, _inputs(pool, *RAPID.degrees or ()), 1e-3 * at)
    line = _written(pool, {"shift": 1e3 * shift, "turn": turn}, [f"{{0}}.{letter}" for letter in "xyz"], RAPID)
    axes = [
        f'IF Abs(p.extax.eax_{a})<1E+08 AND p.extax.eax_{a}<>0 TaskcalStop "axis {a} is away from zero";'
        for k, a in enumerate("abcdef", start=1)
        if k not in {axis.number for axis in cell.axes if axis.carries == "nothing"}
    ]
    joints = [
        f'IF Abs(now.robax.rax_{k}-first.robax.rax_{k})>{_single(np.degrees(bounds.joint))} TaskcalStop "axis {k} would swing";'
        for k in range(1, 7)
    ]
    words = {"AXES": _indented(axes, 4), "JOINTS": _indented(joints, 6), "BODY": _indented(line.lines, 4)}
    return _helper("rapid.mod", ".mod", calibration, program, cell, bounds, line, words)


def _indented(lines: Sequence[str], by: int) -> str:
    return "\n".join(" " * by + line for line in lines)


# KRL: positions in millimetres and three angles, functions in degrees, numbers in single precision (KUKA System Software,
# Operating and Programming Instructions for System Integrators: REAL, FRAME, E6POS, status and turn, geometric operator, B_AND,
# DEFFCT, $POS_ACT, $AXIS_ACT, HALT). By the section on status and turn these count in PTP alone; a line or an arc keeps the
# status with which it begins, and so does a PTP to a point without status, whose turns are those of the shortest way. The axes
# are computed here from the status, since the manuals for programmers do not describe INVERSE.

KRL = Dialect(
    number=_single,
    functions={
        "sin": "SIN({0})", "cos": "COS({0})", "sqrt": "SQRT({0})", "fabs": "ABS({0})", "atan2": "ATAN2({0},{1})",
    },
    variable="T[{0}]",
    assignment="{0}={1}",
    degrees={f"Q[{k}]": f"J[{k}]" for k in range(1, 7)}
    | {f"{of}.{a}": f"{of}.{a}" for of in ("P", "W", "H") for a in "ABC"},
)  # fmt: skip

BORDER_DEG = 1e-2
"""Nearer to zero an axis has the turn that its angle has, whatever T says: single precision does not tell its side."""


MAX_ARC_DEG = 350.0
"""Arcs of larger angles nearly close, and have no middle that tells the way."""

FLAT_ARC_SINE = 0.1
"""Of the angle in which two of the three points of a circle are seen from the third: with a smaller one, the end of an arc on it
would be off by more than 25 times what its points are, which single precision and the inverse have to 0.4 µm."""


def krl_helper(calibration: Calibration, program: Program, cell: Cell, bounds: Bounds) -> Module:
    """A KRL module with functions of an E6POS and a FRAME, for the tool and base that are active.

    Raises:
        TaskcalError: the robot has no spherical wrist on the usual arm.
    """
    axes, sides = _krl_axes(calibration.model.robot)
    pool = Pool()
    (R, p), (R_base, place) = (_frame(pool, of) for of in ("P", "W"))
    joints = _inputs(pool, *(f"Q[{k}]" for k in range(1, 7)))
    shift, turn = _needed(calibration, np.eye(4), joints, 1e-3 * (R_base @ p + place))
    about, w = R_base.T @ turn, (1.0 - turn @ turn).sqrt()
    changes = [Displacement(w, about, None).turned(R[:, k]) for k in range(3)]  # of the axes
    a, c = ([pool.input(f"P.{name}").cos(), pool.input(f"P.{name}").sin()] for name in "AC")
    cosine = pool.input("P.B").cos()
    # Of R' = Rz(A')·Ry(B')·Rx(C'): A' − A from its first column turned back by A, C' − C from its last row turned back by C
    results = [
        *(1e3 * (R_base.T @ shift)),
        *turn,
        a[0] * changes[0][1] - a[1] * changes[0][0],
        cosine + a[0] * changes[0][0] + a[1] * changes[0][1],
        -1.0 * (R[2, 0] + changes[0][2]),
        c[0] * changes[1][2] - c[1] * changes[2][2],
        cosine + c[1] * changes[1][2] + c[0] * changes[2][2],
    ]
    line = _written(pool, {"D": results}, [f"{{0}}[{k}]" for k in range(1, 12)], KRL)
    alone = bool(cell.axes) and all(axis.carries == "nothing" for axis in cell.axes)
    root = "$ROBROOT"
    if cell.T_world_base is not None:
        numbers = zip("XYZABC", pose_numbers(cell.T_world_base), strict=True)
        root = "{FRAME: " + ",".join(f"{name} {_single(value)}" for name, value in numbers) + "}"
    words = {
        "AXES": "" if alone else "\n".join(_stop("$EX_AX_NUM>0", "external axes may carry robot or part")),
        "SIDES": "\n".join(f"SIDES[{k}]={side:.1f}" for k, side in enumerate(sides, start=1)),
        "ROOT": root, "BORDER": _single(BORDER_DEG), "JOINT": _single(np.degrees(bounds.joint)),
        "MAX_ARC": _single(MAX_ARC_DEG), "FLAT": _single(FLAT_ARC_SINE**2),
        "AXES_VARIABLES": str(max(axes.variables, 1)), "AXES_BODY": "\n".join(axes.lines), "BODY": "\n".join(line.lines),
    }  # fmt: skip
    both = line._replace(operations=line.operations + axes.operations)
    return _helper("krl.src", ".src", calibration, program, cell, bounds, both, words)


def _krl_axes(robot: Robot) -> tuple[StraightLine, tuple[float, ...]]:
    """Lines that compute the axes of a flange, and the sides of axes 1, 3 and 5 on which a status of zero has them.

    Raises:
        TaskcalError: there are none.
    """
    arm = BentArm.of(robot)
    pool = Pool()
    R, p = _frame(pool, "H")
    q, margins = arm.joints(R, 1e-3 * p, _inputs(pool, "S[1]", "S[2]", "S[3]"))
    elements = [*(f"A[{k}]" for k in range(1, 7)), "M[1]", "M[2]"]
    return _written(pool, {"": [*np.degrees(1.0) * q, *margins]}, elements, KRL), arm.sides


def _stop(condition: str, why: str) -> tuple[str, str, str]:
    return f"IF {condition} THEN", f"TaskcalStop ( ) ; {why}", "ENDIF"


def _frame(pool: Pool, of: str) -> tuple[Any, Any]:
    """Rotation and position, millimetres, of a KRL frame."""
    (ca, sa), (cb, sb), (cc, sc) = (
        (np.cos(one), np.sin(one)) for one in _inputs(pool, f"{of}.A", f"{of}.B", f"{of}.C")
    )
    R = [
        [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
        [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
        [-1.0 * sb, cb * sc, cb * cc],
    ]
    return np.array(R, dtype=object), _inputs(pool, f"{of}.X", f"{of}.Y", f"{of}.Z")


# URScript: poses in metres and rotation vectors in the robot's base, functions in radians (Script manual, e-Series:
# get_inverse_kin, get_forward_kin, pose_trans, norm, popup, thread scheduling). A controller's inverse is that of its own arm, as
# the factory measured it; the robot file must have that, too, which the function sees for itself by get_forward_kin.


def _decimal(value: float) -> str:
    """Without an exponent."""
    text = f"{value:.15f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text


URSCRIPT = Dialect(
    number=_decimal,
    functions={
        "sin": "sin({0})", "cos": "cos({0})", "sqrt": "sqrt({0})", "exp": f"pow({np.e!r},{{0}})", "atan2": "atan2({0},{1})",
    },
    variable="tc_t[{0}]",
    assignment="{0} = {1}",
)  # fmt: skip

SAME_M = 2e-5
"""Distance of the controller's flange from the robot file's, and of a point beside it, below which both are one robot."""

BESIDE_FLANGE_M = (0.2, 0.5, 1.0)
"""On no axis by which frames of flanges are mistaken for each other."""


def urscript_helper(calibration: Calibration, program: Program, cell: Cell, bounds: Bounds) -> Module:
    """URScript functions of a pose, and of joint positions, in the base, for the TCP that is active."""
    pool = Pool()
    q, pose = (_inputs(pool, *(f"tc_{of}[{k}]" for k in range(count))) for of, count in (("q", 6), ("pose", 3)))
    shift, half = _moved(displacement(calibration, q[None], np.eye(4)), pose)
    size = half @ half
    turn = (
        2.0 + size * (1.0 / 3.0 + 3.0 / 20.0 * size)
    ) * half  # 2 asin(s) / s for a half turn's sine s, to 6e-8 at 0.2 rad
    flange = nominal_flange(calibration, q[None])
    beside = flange[:3, :3] @ np.array(BESIDE_FLANGE_M) + flange[:3, 3]
    line = _written(
        pool, {"tc_d": [*shift, *turn, *flange[:3, 3], *beside]}, [f"{{0}}[{k}]" for k in range(12)], URSCRIPT
    )
    words = {
        "FUNCTION": "taskcal_corrected", "ROBOT": shown(calibration.model.robot.name),
        "ZEROS": ",".join(["0.0"] * (line.variables + 1)), "RESULTS": ",".join(["0.0"] * 12),
        "SHIFT": _decimal(bounds.shift), "TURN": _decimal(bounds.turn), "JOINT": _decimal(bounds.joint), "SAME": _decimal(SAME_M),
        "BESIDE": ",".join(map(str, BESIDE_FLANGE_M)), "SETTLED": _decimal(1e-3 * SETTLED_MM),
        "LEVER": _decimal(0.5e-3 * LEVER_MM), "BODY": _indented(line.lines, 2),
    }  # fmt: skip
    module = _helper("urscript.script", None, calibration, program, cell, bounds, line, words)
    return replace(module, function=words["FUNCTION"])


# What the languages have in common.


def _inputs(pool: Pool, *names: str) -> Any:
    return np.array([pool.input(name) for name in names], dtype=object)


def _needed(calibration: Calibration, T_world_base: Float[np.ndarray, "4 4"], q: Any, place: Any) -> tuple[Any, Any]:
    """Shift of a place in the world, metres, and half of the turn there, that the nominal robot needs at joints q, radians."""
    return _moved(displacement(calibration, q[None], T_world_base), place)


def _moved(by: Displacement, place: Any) -> tuple[Any, Any]:
    """Shift of a place, and half of the turn there, that take a displacement back."""
    back = Displacement(by.w, -1.0 * by.v, by.t)
    return back.turned(place - by.t) - by.t, back.v


def _written(
    pool: Pool, results: Mapping[str, Iterable[Any]], elements: Sequence[str], dialect: Dialect
) -> StraightLine:
    """Lines that compute some results.

    Args:
        pool: of their expressions.
        results: by name, the elements of each.
        elements: formats of a name, for its elements.
        dialect: of the language.

    Raises:
        TaskcalError: the language does not have a function that an effect uses.
    """
    places = {
        element.format(name): value
        for name, values in results.items()
        for element, value in zip(elements, values, strict=True)
    }
    try:
        line = straight_line(pool, places, dialect)
    except TypeError as error:
        raise TaskcalError(f"--helper: the calibrated robot cannot be written: {error}") from error
    angles = [
        dialect.assignment.format(name, f"{dialect.number(np.radians(1.0))}*{angle}")
        for name, angle in (dialect.degrees or {}).items()
        if name != angle and any(name in text for text in line.lines)
    ]
    return line._replace(lines=angles + line.lines, operations=line.operations + len(angles))


def _helper(
    template: str,
    suffix: str | None,
    calibration: Calibration,
    program: Program,
    cell: Cell,
    bounds: Bounds,
    line: StraightLine,
    words: Mapping[str, str],
) -> Module:
    robot = calibration.model.robot.name
    campaign = shown(calibration.provenance.campaign)
    title = f"Taskcal: targets of {shown(robot)} corrected at run time, by a calibration from {campaign}"
    known = {
        "MODULE": MODULE, "FUNCTION": FUNCTION, "TITLE": title[:MAX_TITLE], "OPERATIONS": str(line.operations),
        "USUAL": str(USUAL_ROUNDS), "ROUNDS": str(MAX_ROUNDS), "SHIFT": _single(bounds.shift * 1e3),
        "COSINE": _single(np.cos(0.5 * bounds.turn) ** 2), "SETTLED_MM": _single(SETTLED_MM), "LEVER_MM": _single(LEVER_MM),
        "VARIABLES": str(max(line.variables, 1)), **words,
    }  # fmt: skip
    text = (resources.files("taskcal.correction") / "helpers" / template).read_text(encoding="utf-8")
    for name, value in known.items():
        text = text.replace(f"@{name}@", value)
    first = program.sources[0]
    path = first.path if suffix is None else first.path.with_name(f"{MODULE}{suffix}")
    source = Source(path=path, text=text.replace("\n", first.newline), encoding="utf-8")
    return Module(source=source, operations=line.operations, without=measured_frames(cell))


HELPERS: Mapping[str, Callable[[Calibration, Program, Cell, Bounds], Module]] = {
    "RAPID": rapid_helper,
    "KRL": krl_helper,
    "URScript": urscript_helper,
}
"""By language."""


def helper_for(
    calibration: Calibration, program: Program, cell: Cell, bounds: Bounds, into: str | Path | None
) -> Module:
    """The module for a program.

    Raises:
        TaskcalError: there is none for its language, robot or calibration, or no place for it.
    """
    language, robot = language_of(program.sources[0].path).name, calibration.model.robot
    if language not in HELPERS or into is not None:
        raise TaskcalError(
            f"--helper: a helper is written for {', '.join(HELPERS)}, in the program's own language; "
            f"{program.sources[0].path} is {language}{' and becomes a new program' if into is not None else ''}"
        )
    if program.backup is not None:
        raise TaskcalError(
            f"--helper: {program.backup.path} is a backup, in which a new module has no place; pass the files of the program"
        )
    if len(robot.joint_names) != 6 or any(robot.prismatic):
        raise TaskcalError(f"--helper: {robot.name} is not a robot of six turning axes")
    check_known_there(calibration, program, cell)
    return HELPERS[language](calibration, program, cell, bounds)
