"""Correction at run time: a module in the controller's language that moves a target by what the calibrated robot is off there.

With the nominal poses f(q) and the calibrated ones C(q)·f(q), a target's pose F is met at joints q where C(q)·f(q) = F: the
controller is to drive to f(q) = C(q)⁻¹·F, which it finds by itself. C is the product of the small displacements of all error
frames and of what the joints turn further, each about where it is on the nominal robot. All that is computed is small, so that
single precision is enough; q is found by repeating q ← f⁻¹(C(q)⁻¹·F).
"""

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from robot_programs.core.helper import Computed, Dialect, HelperModule
from robot_programs.core.program import Diagnostic, Motion, Program, Wrapping
from robot_programs.core.source import Place, Source
from robot_programs.krl import helper as krl
from robot_programs.languages import language_of
from robot_programs.rapid import helper as rapid
from robot_programs.urscript import helper as urscript
from taskcal.correction.cell import Cell
from taskcal.correction.correction import Correction, Helper
from taskcal.correction.frames import MAX_TOOL_DIFFERENCE
from taskcal.correction.options import Bounds
from taskcal.errors import TaskcalError, shown
from taskcal.geometry import se3
from taskcal.geometry.expressions import Pool, is_zero, straight_line, trace
from taskcal.identification.calibration import Calibration
from taskcal.kernels.chain import ERROR_FRAME, FIXED, REVOLUTE
from taskcal.robot.error_model import COMPONENTS

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

SETTLED_M, LEVER_M = 2e-6, 2.0
"""Change of the shift, with that of the half turn on a lever, metres, at which the repetition ends: less is left."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Module:
    """A module that corrects at run time."""

    source: Source
    operations: int
    """Sums, products and functions of one evaluation of the model."""
    without: frozenset[str]
    """Keys of tools and parts that were measured, which it does not know."""
    function: str = FUNCTION
    carry_nothing: frozenset[int] = frozenset()
    """Numbers of external axes that may be anywhere."""

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
        rejected = [i for i in range(len(program.motions)) if i in rejected and not self._stops_at(program.motions[i])]
        return program.wrap(self.function, added, without=self.without, rejected=rejected, keep_joints=keep_joints)

    def _stops_at(self, move: Motion) -> bool:
        """Whether the function stops at a motion: its part is held or carried, or an axis that may carry is not at zero."""
        away = (k for k, position in enumerate(move.external, start=1) if np.isfinite(position) and position != 0.0)
        return move.part_in_hand or bool(move.carrier) or any(k not in self.carry_nothing for k in away)

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
        return replace(found, helper=helper, diagnostics=(*said, *found.diagnostics))


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
    return frozenset(key for frames in (cell.tools, cell.parts) for key, m in frames.items() if m.is_known)


# The languages' modules: what is computed in each.


def rapid_helper(calibration: Calibration, program: Program, cell: Cell, bounds: Bounds) -> Module:
    """A RAPID module with a function of a robtarget, a tooldata and a wobjdata."""
    pool = Pool()
    bases = (cell.T_world_base, program.T_world_base, np.eye(4))
    base = next(T for T in bases if T is not None)
    joints, place = _inputs(pool, *rapid.RAPID.degrees or ()), _inputs(pool, *rapid.PLACE)
    shift, turn = _needed(calibration, base, joints, 1e-3 * place)
    line = _written(pool, zip(rapid.RESULTS, [*(1e3 * shift), *turn], strict=True), rapid.RAPID)
    spelled = partial(rapid.rapid_helper, free_axes=_carry_nothing(cell))
    return _module(calibration, program, cell, bounds, line, spelled)


def krl_helper(calibration: Calibration, program: Program, cell: Cell, bounds: Bounds) -> Module:
    """A KRL module with functions of an E6POS and a FRAME, for the tool and base that are active.

    Raises:
        TaskcalError: the robot has no spherical wrist on the usual arm, or an external axis carries the part.
    """
    if any(axis.carries != "nothing" for axis in cell.axes):
        raise TaskcalError(
            "--helper: an external axis carries the part, and a helper in KRL stops wherever the controller has such an axis; "
            "correct without --helper"
        )
    robot = calibration.model.robot
    arm, of_axes, pool = krl.BentArm.of(robot, robot.bounded_limits()), Pool(), Pool()
    R, p = _frame(of_axes, "H")
    q, margins = arm.joints(R, 1e-3 * p, _inputs(of_axes, *krl.SIDES))
    axes = _written(of_axes, zip(krl.AXES, [*np.degrees(1.0) * q, *margins], strict=True), krl.KRL)
    (R, p), (R_base, place) = (_frame(pool, of) for of in ("P", "W"))
    shift, turn = _needed(calibration, np.eye(4), _inputs(pool, *krl.JOINTS), 1e-3 * (R_base @ p + place))
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
    line = _written(pool, zip(krl.RESULTS, results, strict=True), krl.KRL)
    alone = bool(cell.axes) and all(axis.carries == "nothing" for axis in cell.axes)
    return _module(
        calibration, program, cell, bounds, line,
        partial(krl.krl_helper, axes=axes, sides=arm.sides, T_world_base=cell.T_world_base, stops_with_axes=not alone),
        operations=axes.operations,
    )  # fmt: skip


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


SAME_M = 2e-5
"""Distance of the controller's flange from the robot file's, and of a point beside it, below which both are one robot."""

BESIDE_FLANGE_M = (0.2, 0.5, 1.0)
"""On no axis by which frames of flanges are mistaken for each other."""


def urscript_helper(calibration: Calibration, program: Program, cell: Cell, bounds: Bounds) -> Module:
    """URScript functions of a pose, and of joint positions, in the base, for the TCP that is active."""
    pool = Pool()
    q, pose = _inputs(pool, *urscript.JOINTS), _inputs(pool, *urscript.PLACE)
    shift, half = _moved(displacement(calibration, q[None], np.eye(4)), pose)
    size = half @ half
    turn = (
        2.0 + size * (1.0 / 3.0 + 3.0 / 20.0 * size)
    ) * half  # 2 asin(s) / s for a half turn's sine s, to 6e-8 at 0.2 rad
    flange = nominal_flange(calibration, q[None])
    beside = flange[:3, :3] @ np.array(BESIDE_FLANGE_M) + flange[:3, 3]
    results = [*shift, *turn, *flange[:3, 3], *beside]
    line = _written(pool, zip(urscript.RESULTS, results, strict=True), urscript.URSCRIPT)
    return _module(
        calibration, program, cell, bounds, line,
        partial(urscript.urscript_helper, same_m=SAME_M, beside_m=BESIDE_FLANGE_M), function=urscript.FUNCTION,
    )  # fmt: skip


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


def _written(pool: Pool, results: Iterable[tuple[str, Any]], dialect: Dialect) -> Computed:
    """Lines that compute some results.

    Args:
        pool: of their expressions.
        results: what each is assigned to, and the expression.
        dialect: of the language.

    Raises:
        TaskcalError: the language does not have a function that an effect uses.
    """
    try:
        line = straight_line(pool, dict(results), dialect)
    except TypeError as error:
        raise TaskcalError(f"--helper: the calibrated robot cannot be written: {error}") from error
    angles = [
        dialect.assignment.format(name, f"{dialect.number(np.radians(1.0))}*{angle}")
        for name, angle in (dialect.degrees or {}).items()
        if name != angle and any(name in text for text in line.lines)
    ]
    return replace(line, lines=[*angles, *line.lines], operations=line.operations + len(angles))


def _carry_nothing(cell: Cell) -> frozenset[int]:
    return frozenset(axis.number for axis in cell.axes if axis.carries == "nothing")


def _module(
    calibration: Calibration,
    program: Program,
    cell: Cell,
    bounds: Bounds,
    correction: Computed,
    spelled: Callable[[HelperModule, Source], Source],
    *,
    function: str = FUNCTION,
    operations: int = 0,
) -> Module:
    robot, campaign = (shown(one) for one in (calibration.model.robot.name, calibration.provenance.campaign))
    correction = replace(correction, operations=correction.operations + operations)
    said = HelperModule(
        name=MODULE, function=function, robot=robot, correction=correction,
        title=f"Taskcal: targets of {robot} corrected at run time, by a calibration from {campaign}"[:MAX_TITLE],
        shift=bounds.shift, turn=bounds.turn, joint=bounds.joint, usual_rounds=USUAL_ROUNDS, rounds=MAX_ROUNDS,
        settled=SETTLED_M, lever=LEVER_M,
    )  # fmt: skip
    return Module(
        source=spelled(said, program.sources[0]), operations=correction.operations, without=measured_frames(cell),
        function=function, carry_nothing=_carry_nothing(cell),
    )  # fmt: skip


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
