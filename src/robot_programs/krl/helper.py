"""A KRL module with functions of an E6POS and a FRAME that move points while the program runs, for the active tool and base.

Positions are in millimetres and three angles, functions in degrees, numbers in single precision (KUKA System Software, Operating
and Programming Instructions for System Integrators: REAL, FRAME, E6POS, status and turn, geometric operator, B_AND, DEFFCT,
$POS_ACT, $AXIS_ACT, HALT). By the section on status and turn these count in PTP alone; a line or an arc keeps the status with
which it begins, and so does a PTP to a point without status, whose turns are those of the shortest way. The axes are computed here
from the status, since the manuals for programmers do not describe INVERSE.

Points of motions are put through these functions as far as the text tells which they may be.
"""

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import cos, degrees
from typing import Any

import numpy as np
from jaxtyping import Float

from robot_programs.core.form import Ask, Expression, Key, Lit, Rec, Ref, Routine, Text, inside
from robot_programs.core.helper import MEASURED, Computed, Dialect, HelperModule, Makings, measured, returned, single
from robot_programs.core.program import Unresolved, Wrapped, pose_numbers
from robot_programs.core.robot import Robot, arm_bends, meeting_point
from robot_programs.core.source import Source, TextEdit
from robot_programs.core.values import Structure
from robot_programs.krl.data import BUILT_IN, PLACES, KrlFile, KrlRoutine, Names
from robot_programs.krl.lower import CARRYING, MotionStep, is_stated
from robot_programs.krl.points import StatusTurn
from robot_programs.krl.syntax import (
    RELATIVE_MOTIONS,
    Assignment,
    KrlLine,
    MotionLine,
    Operand,
)
from robot_programs.krl.values import POSE, numbers_in, texts_in
from taskcal_groundwork import se3
from taskcal_groundwork.errors import InputError

KRL = Dialect(
    number=single,
    functions={
        "sin": "SIN({0})", "cos": "COS({0})", "sqrt": "SQRT({0})", "fabs": "ABS({0})", "atan2": "ATAN2({0},{1})",
    },
    variable="T[{0}]",
    assignment="{0}={1}",
    degrees={f"Q[{k}]": f"J[{k}]" for k in range(1, 7)}
    | {f"{of}.{a}": f"{of}.{a}" for of in ("P", "W", "H") for a in "ABC"},
)  # fmt: skip

JOINTS, SIDES = tuple(KRL.degrees or ())[:6], tuple(f"S[{k}]" for k in range(1, 4))
"""Joint positions, radians; and the sides of axes 1, 3 and 5."""

RESULTS = tuple(f"D[{k}]" for k in range(1, 12))
"""Shift in the base, millimetres; half of the turn; and what the changes of the angles follow from."""

AXES = (*(f"A[{k}]" for k in range(1, 7)), "M[1]", "M[2]")
"""Axes of a flange, degrees, and two numbers that are negative where there are none."""

BORDER_DEG = 1e-2
"""Nearer to zero an axis has the turn that its angle has, whatever T says: single precision does not tell its side."""

MAX_ARC_DEG = 350.0
"""Arcs of larger angles nearly close, and have no middle that tells the way."""

FLAT_ARC_SINE = 0.1
"""Of the angle in which two of the three points of a circle are seen from the third: with a smaller one, the end of an arc on it
would be off by more than 25 times what its points are, which single precision and the inverse have to 0.4 µm."""


def krl_helper(
    module: HelperModule,
    first: Source,
    axes: Computed,
    sides: Sequence[float],
    T_world_base: Float[np.ndarray, "4 4"] | None,
    *,
    stops_with_axes: bool,
) -> Source:
    """The module, whose correction computes `RESULTS`.

    Args:
        module: what it computes.
        first: file of the program.
        axes: compute `AXES`.
        sides: of axes 1, 3 and 5 for a status of zero.
        T_world_base: where the robot stands; None for where the controller has it.
        stops_with_axes: external axes may carry the robot or the part.
    """
    root = "$ROBROOT"
    if T_world_base is not None:
        numbers = zip("XYZABC", pose_numbers(T_world_base), strict=True)
        root = "{FRAME: " + ",".join(f"{name} {single(value)}" for name, value in numbers) + "}"
    stop = ("IF $EX_AX_NUM>0 THEN", "TaskcalStop ( ) ; external axes may carry robot or part", "ENDIF")
    words = {
        "AXES": "\n".join(stop) if stops_with_axes else "",
        "SIDES": "\n".join(f"SIDES[{k}]={side:.1f}" for k, side in enumerate(sides, start=1)),
        "ROOT": root, "BORDER": single(BORDER_DEG), "JOINT": single(degrees(module.joint)), "MAX_ARC": single(MAX_ARC_DEG),
        "FLAT": single(FLAT_ARC_SINE**2), "SHIFT": single(module.shift * 1e3), "COSINE": single(cos(0.5 * module.turn) ** 2),
        "SETTLED_MM": single(module.settled * 1e3), "LEVER_MM": single(module.lever * 1e3),
        "AXES_VARIABLES": str(max(axes.variables, 1)), "AXES_BODY": "\n".join(axes.lines),
        "BODY": "\n".join(module.correction.lines),
    }  # fmt: skip
    return module.written("krl", ".src", first, words, inside=False)


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
    def of(cls, robot: Robot, limits: Float[np.ndarray, "6 2"]) -> "BentArm":
        """The arm of a robot.

        Args:
            robot: the robot.
            limits: between which it is looked at, radians.

        Raises:
            InputError: it is none, or S does not tell its sides apart.
        """
        refused = InputError(f"--helper: {robot.name} is no arm with a spherical wrist, which a helper in KRL needs")
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
        lower, upper = limits.T
        q = lower + (upper - lower) * np.random.default_rng(0).uniform(0.1, 0.9, size=(PROBES, 6))
        choices = np.array(list(product((1.0, -1.0), repeat=3)))
        found = set[tuple[float, ...]]()
        for own, T in zip(q, robot.tool_poses(q) @ to_flange, strict=True):
            off = [np.abs(np.sin(0.5 * (arm.joints(T[:3, :3], T[:3, 3], one)[0] - own))).max() for one in choices]
            S = StatusTurn(S=0, T=None).of(robot, own).S or 0
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


# Points that only the running program knows, put through a function: which may be, and where they stand.

OF_PATH, OF_FRAME, OF_HERE, OF_ARC = "Path", "Frame", "Here", "Arc"

ENDINGS = ("", OF_PATH, OF_FRAME)
"""Of the names of three functions: of an E6POS of a PTP; of one of a line or arc, which keeps the status before; of a FRAME. Two
others give where the tool truly is, of which motions by a distance begin (`OF_HERE`), and the point at an angle on the circle from
there through two points (`OF_ARC`)."""

FRAMES = frozenset({"$NULLFRAME", "$WORLD", "$ROBROOT", "$BASE", "$TOOL", "BASE_DATA", "TOOL_DATA"})
"""Variables of the controller's that are frames, arrays without their index."""

HELD = ("$BASE", "$TOOL", "BASE_DATA", "TOOL_DATA")
"""Those that motions are counted in."""

_COUPLED = re.compile(
    r"#(?:EX|LK|EB)_BASE\b|MACHINE_FRAME_DAT(?=\[\d+\]\s*=\s*\{[^}]*MACH_DEF_INDEX\s+[1-9])", re.IGNORECASE
)
"""A command by which BAS has them set a base, or a base of ``$config.dat`` that stands on another kinematic system."""

_HANDED = re.compile(r"\$IPO_MODE\s*=\s*#TCP\b|\bIPO_FRAME\s+#TCP\b", re.IGNORECASE)

MEASURING = frozenset(
    {*PLACES, "$POS_INT", "$AXIS_INT", "$POS_RET", "$AXIS_RET", "$POS_FOR", "$AXIS_FOR", "$POS_BACK", "FORWARD"}
)
"""Where the robot is or was: numbers of the nominal robot for where the true one stands."""


def wrap(
    files: Sequence[KrlFile],
    routines: Sequence[Routine],
    motions: Container[Text],
    function: str,
    without: Container[str],
) -> Iterator[Wrapped]:
    """Some motions, each with the edits that put a function around its points.

    Args:
        files: of the program.
        routines: of the program, and what runs beside or outside of them.
        motions: places of motions.
        function: name of a function of an E6POS whose status and turn count; the names of two others begin with it, see `ENDINGS`.
        without: names of tools and bases, in lower case, one of which the program may have active.
    """
    names = Names(files=tuple(files))
    places = _MeasuredData(names, routines)
    elsewhere: dict[Text, Wrapped] = {}
    own = [file for file in files if file.module != BUILT_IN]
    named = {name for file in own for name in file.mentions}
    coupled = (match[0] for file in own if (match := _COUPLED.search(file.source.text)))
    carried = next(iter(sorted(named & CARRYING)), "") or next(coupled, "")
    handed = any(_HANDED.search(file.source.text) for file in own)

    def edits(step: MotionStep, routine: Routine) -> Iterator[TextEdit]:
        line = step.statement
        if carried:
            raise Unresolved(f"a base may be moved ({carried})")
        if handed:
            raise Unresolved("the robot may hold the part ($IPO_MODE #TCP), where the function only stops the program")
        if without:
            raise Unresolved("a tool or base was measured, and it is not known which is active")
        if names.orients and not line.keyword.startswith(("PTP", "SPTP")):
            raise Unresolved(
                "it may keep the orientation in which it begins ($ORI_TYPE), which the function does not see"
            )
        elsewhere.update(places.elsewhere(routine, files))
        _expect_points(step, routine, places, named)
        points = [
            MotionPoint(operand=one, parts=tuple(filter(is_stated, step.points[own])), step=step)
            for one, own in step.operands
        ]
        if line.keyword in RELATIVE_MOTIONS:
            yield from _from_here(line, points, function)
        elif line.angle:
            yield from _to_angle(line, points, names, function)
        else:
            yield from (_around(one, names, function) for one in points)

    for routine, step in ((one, line) for one in routines for line in one.lines):
        if isinstance(step, MotionStep) and step.at[:2] in motions:
            place = step.routine.file.source.place(step.statement.start)
            yield Wrapped.of(place, step.statement.keyword, edits(step, routine))
    yield from elsewhere.values()


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionPoint:
    """A point of a motion."""

    operand: Operand
    parts: Sequence[Expression]
    """Structures and variables that are joined by ``:``; none where it is computed."""
    step: MotionStep

    @property
    def text(self) -> str:
        """As written."""
        return self.step.routine.file.source.text[self.operand.start : self.operand.end]

    @property
    def joint(self) -> bool:
        """Whether its status and turn count."""
        return self.step.statement.keyword.endswith("PTP")

    def types(self, names: Names) -> Sequence[str]:
        """Of its parts; empty where they are not known."""
        return [_type_of(part, self.step.routine, names) for part in self.parts]


def calls_function(line: KrlLine, function: str) -> bool:
    """Whether a function stands around a point of a motion."""
    names = {f"{function}{ending}".upper() for ending in ENDINGS}
    return isinstance(line, MotionLine) and any(word.upper in names for word in line.words)


def _expect_points(step: MotionStep, routine: Routine, places: "_MeasuredData", named: Container[str]) -> None:
    """See that a motion goes to points of which a function can make others.

    Raises:
        Unresolved: it does not.
    """
    line = step.statement
    relative = line.keyword in RELATIVE_MOTIONS
    if line.keyword == "SPL" or line.trouble or (relative and line.angle):
        raise Unresolved("it does not go to points that it names")
    if line.keyword.startswith("S") and "SPLINE" in named:
        raise Unresolved("it may be part of a SPLINE")
    if any(name.startswith(("$TOOL", "$BASE", "$IPO_MODE", "$LOAD")) for name in line.settings):
        raise Unresolved("it sets tool or base for itself, which the function does not see")
    # a distance is the same in whatever base: only the way along its axes counts
    own = (one for point in step.points for one in _named(point))
    for name, key in (*own, *(() if relative else zip(HELD, HELD, strict=True))):
        if places.says(key, routine):
            raise Unresolved(f"'{name}' comes from where the robot stood, which is true already")


def _named(point: Expression) -> Iterator[tuple[str, Key]]:
    """Data of which a point is made, by their names, without its own index; what functions return behind all others."""
    for one in (point,) if isinstance(point, Ref) else sorted(inside(point), key=lambda each: isinstance(each, Ask)):
        match one:
            case Ref(name=name) | Ask(name=name) if _is_measuring(one):
                yield name, MEASURED
            case Ref(name=name, key=key):
                yield name, key
            case Ask(name=name, routines=routines, changes=changes):
                yield from ((name, returned(routine)) for routine in routines)
                yield from ((ref.name, ref.key) for ref in changes)
            case _:
                pass


def _around(point: MotionPoint, names: Names, function: str) -> TextEdit:
    """A point with the function around it that serves its type.

    What ``:`` gives has the type of its right side, and status and turn count in PTP alone (KUKA System Software, geometric
    operator; status and turn): the product with a FRAME is one, whatever stands before it.

    Raises:
        Unresolved: it has none.
    """
    start, end = point.operand.start, point.operand.end
    if point.types(names) == ["E6POS"] and isinstance(point.parts[0], Ref):
        return TextEdit(start=start, end=end, text=f"{function}{'' if point.joint else OF_PATH}({point.text})")
    return TextEdit(start=start, end=end, text=f"{function}{OF_FRAME}({_as_frame(point, names)})")


def _as_frame(point: MotionPoint, names: Names) -> str:
    """A point as an expression of type FRAME.

    Raises:
        Unresolved: it may not be one; or the motion needs its status, and that is not known.
    """
    parts, own = point.parts, point.types(names)
    complete = all(
        isinstance(one, Ref) or (isinstance(one, Lit) and numbers_in(one.value).keys() >= {*POSE}) for one in parts
    )
    if not complete or (parts and not isinstance(parts[0], Ref)) or "AXIS" in "".join(own):
        raise Unresolved("its point is no variable, and no product of variables and complete frames")
    if not parts and not _own_functions(point.operand, names):
        raise Unresolved("its point comes from a function that the files do not have")
    if point.joint and own[-1:] != ["FRAME"]:
        raise Unresolved(
            "its point is neither declared as E6POS nor as FRAME, whose status and turn are then not known"
        )
    return point.text if own == ["FRAME"] else f"{point.text}:$NULLFRAME"


def _to_angle(line: MotionLine, points: Sequence[MotionPoint], names: Names, function: str) -> Iterator[TextEdit]:
    """An arc that ends at an angle as one to the point that is there.

    Raises:
        Unresolved: its points may be no frames.
    """
    (via, last), angle = line.operands, (line.angle[0].start, line.angle[-1].end)
    given = ",".join(_as_frame(one, names) for one in points)
    text = points[0].step.routine.file.source.text[slice(*angle)]
    for start, end, share in ((via.start, via.end, "0.5"), (last.start, angle[1], "1.0")):
        yield TextEdit(start=start, end=end, text=f"{function}{OF_FRAME}({function}{OF_ARC}({given},{share}*({text})))")


def _from_here(line: MotionLine, points: Sequence[MotionPoint], function: str) -> Iterator[TextEdit]:
    """A motion by a distance as one to the point that is so far from where the tool truly is.

    Raises:
        Unresolved: the distance is not stated by numbers along the axes alone.
    """
    text = points[0].step.routine.file.source.text
    yield TextEdit(start=line.start, end=line.start + len(line.keyword), text=line.keyword.removesuffix("_REL"))
    for point in points:
        match point.parts:
            case [Lit(value=Structure() as step)]:
                values, stated = step.parts, texts_in(step)
            case [Rec(parts=parts)]:
                values = {name: one.value if isinstance(one, Lit) else None for name, one in parts.items()}
                stated = {name: text[one.at[1] : one.at[2]] for name, one in parts.items()}
            case _:
                values, stated = {"": None}, dict[str, str]()
        if any(name not in ("X", "Y", "Z") and value != 0.0 for name, value in values.items()):
            raise Unresolved("its distance is not stated by X, Y and Z alone")
        along = {name: written for name, written in stated.items() if name in ("X", "Y", "Z")}
        whole = "{FRAME: " + ",".join(f"{name} {along.get(name, 0)}" for name in POSE) + "}"
        parts = (f"{function}{OF_HERE}()", whole) if line.along == "#TOOL" else (whole, f"{function}{OF_HERE}()")
        new, start = f"{function}{OF_FRAME}({parts[0]}:{parts[1]})", point.operand.start
        yield TextEdit(start=start, end=point.operand.end, text=f" {new}" if text[start - 1].isalnum() else new)
    behind = line.operands[-1].end
    axes = re.search(rf"\s*{line.along}\b", text[behind : line.end], re.IGNORECASE) if line.along else None
    if axes is not None:
        yield TextEdit(start=behind + axes.start(), end=behind + axes.end(), text="")


def _own_functions(operand: Operand, names: Names) -> bool:
    """Whether all functions that compute a point stand in the files, or do geometry alone."""
    called = {word.upper for word, behind in pairwise(operand.words) if word.kind == "name" and behind.text == "("}
    return bool(called) and called <= {head.name for file in names.files for head in file.heads} | {"INV_POS"}


def _type_of(part: Expression, routine: KrlRoutine, names: Names) -> str:
    """Type of a part of a point; empty where it is not known."""
    match part:
        case Ref(name=name):
            if name in FRAMES:
                return "FRAME"
            types = names.types.get(str(part.key), ())
            return next(iter(types)) if len(types) == 1 else "E6POS" if _of_inline_form(part, routine) else ""
        case Rec(kind=kind, parts=parts) | Lit(value=Structure(kind=kind, parts=parts)):
            return kind or ("FRAME" if parts.keys() <= {*POSE} else "")
        case _:
            return ""


def _of_inline_form(point: Ref, routine: KrlRoutine) -> bool:
    """Whether a point is one of an inline form, which declares it as E6POS; home positions are axes."""
    of_point = {line.text for line in routine.lines if isinstance(line, Assignment) and line.variable == "FDAT_ACT"}
    name = point.name
    return not point.path and name.startswith("X") and f"F{name[1:]}" in of_point and not name.startswith("XHOME")


# Which data come from where the robot stood.


def _is_measuring(expression: Expression) -> bool:
    """Whether it is one of `MEASURING`."""
    return isinstance(expression, Ref | Ask) and expression.name in MEASURING


_MAKINGS = Makings(measures=_is_measuring)


class _MeasuredData:
    """What the program's own variables have from where the robot stood."""

    def __init__(self, names: Names, routines: Iterable[Routine]) -> None:
        self.names = names
        self.places = measured(_MAKINGS.gifts(routines), self._sees)

    def _sees(self, key: Key, by: Routine, routine: Routine) -> bool:
        """Whether a routine may meet in a variable what another one gave it.

        Tools and bases that a program of its own measures count as what the data list states, as in all motions.
        """
        return key not in HELD or not self.names.is_apart(routine.name, by.name)

    def says(self, key: Key, routine: Routine) -> bool:
        """Whether a variable has such a value in a routine."""
        return key == MEASURED or any(self._sees(key, gift.routine, routine) for gift in self.places.get(key, ()))

    def elsewhere(self, routine: Routine, files: Sequence[KrlFile]) -> dict[Text, Wrapped]:
        """Where tools and bases are so in a program other than that of a routine."""
        why = "it is set from where the robot stood, in a program of its own; its value is taken as true"
        found = ((key, gift) for key in HELD for gift in self.places.get(key, ()))
        return {
            gift.line.at[:2]: Wrapped(
                place=files[gift.line.at[0]].source.place(gift.line.at[1]), name=key, obstacle=why
            )
            for key, gift in found
            if not self._sees(key, gift.routine, routine)
        }
