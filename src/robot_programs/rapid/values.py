"""Values of data that the text gives: constants, variables that nothing assigns to, and what the flow of the program tells."""

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import numpy as np
from jaxtyping import Float

from robot_programs.core.form import Span
from robot_programs.core.program import Frame, MotionFrames, Unresolved, rotation
from robot_programs.core.values import FUNCTIONS, Operators, Origin, Settable, Structure, applied, whole
from robot_programs.rapid.names import Symbol, Value
from robot_programs.rapid.syntax import AggregateText
from taskcal_groundwork import se3

# Operators of RAPID, and shifts of targets.
#
# Source: Technical reference manual, RAPID overview (expressions), and RAPID instructions, functions and data types
# (Offs, RelTool).

MAX_SHIFT_MM = 1e6
"""No shift is farther."""


def _whole_quotient(a: float, b: float) -> float:
    """Quotient of two whole numbers, cut off towards zero.

    Raises:
        ValueError: one is not whole.
    """
    if not (a.is_integer() and b.is_integer()):
        raise ValueError("DIV and MOD are of whole numbers")
    return float(int(a / b))


OPERATORS: Operators = {
    # the remainder has the sign of the dividend
    ("div", 2): _whole_quotient, ("mod", 2): lambda a, b: a - _whole_quotient(a, b) * b,
}  # fmt: skip
"""Those of RAPID alone."""


def shifted(name: str, T: Float[np.ndarray, "4 4"], by: Sequence[Value], options: Mapping[str, Value]) -> np.ndarray:
    """Shift a pose by Offs or RelTool.

    Offs shifts along the axes of the work object; RelTool shifts along those of the tool, then turns about its x, the new y
    and the new z.

    Args:
        name: key of the function.
        T: the pose, metres.
        by: three distances, millimetres.
        options: what it is given by name.

    Raises:
        Unresolved: it is given something else.
    """
    xyz = [v for v in by if isinstance(v, float)]
    if len(by) != 3 or len(xyz) != 3:
        raise Unresolved(f"{name}() is not given a target and three distances")
    if not all(abs(v) <= MAX_SHIFT_MM for v in xyz):
        raise Unresolved(f"{name}() shifts out of any range")
    T = T.copy()
    if name.lower() == "offs":
        if options:
            raise Unresolved("Offs() has no options")
        T[:3, 3] += np.array(xyz) / 1e3
        return T
    if not options.keys() <= {"rx", "ry", "rz"}:
        raise Unresolved(f"RelTool() has no option '{min(options.keys() - {'rx', 'ry', 'rz'})}'")
    degrees = [options.get(key, 0.0) for key in ("rx", "ry", "rz")]
    angles = [math.radians(v) for v in degrees if isinstance(v, float)]
    if len(angles) != 3 or not all(math.isfinite(a) for a in angles):
        raise Unresolved("RelTool() turns by no finite angle")
    T = T @ se3.translation(*(v / 1e3 for v in xyz))
    for axis, angle in zip("xyz", angles, strict=True):
        T = T @ se3.rotation(axis, angle)
    return T


def pose_numbers(T: Float[np.ndarray, "4 4"]) -> tuple[float, ...]:
    """Position in mm and unit quaternion, scalar first."""
    return tuple(pose_rows(T[None])[0].tolist())


def pose_rows(T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 7"]:
    """The same of several poses."""
    return np.hstack([T[:, :3, 3] * 1e3, se3.to_quaternion(T[:, :3, :3])[:, [3, 0, 1, 2]]])


# Tools and work objects: from tooldata and wobjdata to frames.

MAX_COORDINATE_MM = 1e6
"""No coordinate of a robot's cell is larger; the controller's 9E9 stands for none."""

UNIT_TOLERANCE = 0.01
"""A quaternion's length may differ from 1 by this: programmed digits are few."""


def numbers(value: Value, count: int, what: str) -> tuple[float, ...]:
    """The numbers of a record of numbers.

    Raises:
        Unresolved: there are more or fewer, or something else.
    """
    if (
        not isinstance(value, tuple)
        or len(value) != count
        or not (set(map(type, value)) == {float} or all(isinstance(v, float) for v in value))
    ):
        whole(value)
        raise Unresolved(f"{what} is not made of {count} numbers")
    return cast("tuple[float, ...]", value)


def parts(value: Value, count: int, what: str) -> tuple[Value, ...]:
    """The components of a record.

    Raises:
        Unresolved: there are more or fewer.
    """
    if not isinstance(value, tuple) or len(value) != count:
        whole(value)
        raise Unresolved(f"{what} is not made of {count} components")
    return value


def position(value: Value, what: str) -> tuple[float, ...]:
    """The coordinates of a pos, millimetres.

    Raises:
        Unresolved: it is none.
    """
    xyz = x, y, z = numbers(value, 3, f"the position of {what}")
    if abs(x) <= MAX_COORDINATE_MM and abs(y) <= MAX_COORDINATE_MM and abs(z) <= MAX_COORDINATE_MM:
        return xyz
    raise Unresolved(f"the position of {what} is out of any range")


def quaternion(value: Value, what: str) -> tuple[float, ...]:
    """The unit quaternion of an orient, its scalar first.

    Raises:
        Unresolved: it is none.
    """
    w, x, y, z = numbers(value, 4, f"the orientation of {what}")
    length = math.hypot(w, x, y, z)
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise Unresolved(f"the orientation of {what} is not a unit quaternion: its length is {length:.4g}")
    return (w / length, x / length, y / length, z / length)


def pose_of(xyz_mm: tuple[float, ...], wxyz: tuple[float, ...]) -> Float[np.ndarray, "4 4"]:
    """The transform of a position and a quaternion with its scalar first."""
    x, y, z = xyz_mm
    qw, qx, qy, qz = wxyz
    return se3.pose_of((x / 1e3, y / 1e3, z / 1e3), (qx, qy, qz, qw))


def pose(value: Value, what: str, whole: str = "") -> Float[np.ndarray, "4 4"]:
    """The transform of a record of a position and an orientation.

    Args:
        value: the record.
        what: for messages about its parts.
        whole: for messages about itself, where it is called otherwise.

    Raises:
        Unresolved: it is none.
    """
    trans, rot = parts(value, 2, whole or what)
    return pose_of(position(trans, what), quaternion(rot, what))


@lru_cache(maxsize=256)
def frames_of(tool: tuple[str, Value], work_object: tuple[str, Value]) -> MotionFrames:
    """The frames of a motion, from names and values of its tooldata and wobjdata.

    Raises:
        Unresolved: they are incomplete, or contradict each other.
    """
    tool_name, wobj_name = tool[0], work_object[0]
    tool_held, tframe, _ = parts(tool[1], 3, f"the tool '{tool_name}'")
    wobj_held, fixed, unit, uframe, oframe = parts(work_object[1], 5, f"the work object '{wobj_name}'")
    whole((tool_held, wobj_held, fixed, unit))
    if not isinstance(tool_held, bool) or not isinstance(wobj_held, bool) or not isinstance(fixed, bool):
        raise Unresolved(f"the tool '{tool_name}' or the work object '{wobj_name}' does not say what the robot holds")
    if not fixed and not (isinstance(unit, str) and unit):
        raise Unresolved(f"the work object '{wobj_name}' is moved (ufprog is FALSE), and no mechanical unit is named")
    if tool_held == wobj_held:
        what = "both held by the robot" if tool_held else "neither held by the robot"
        raise Unresolved(f"the tool '{tool_name}' and the work object '{wobj_name}' are {what}")
    # the user frame of a work object that moves is that of the mechanical unit, whatever uframe says (wobjdata)
    user = _frame_pose(uframe, wobj_name) if fixed else np.eye(4)
    inner = _frame_pose(oframe, wobj_name)
    return MotionFrames(
        tool=Frame(name=tool_name, T=_frame_pose(tframe, tool_name)),
        part=Frame(name=wobj_name, T=user @ inner),
        part_in_hand=wobj_held,
        carrier="" if fixed else str(unit),
    )


def _frame_pose(value: Value, name: str) -> Float[np.ndarray, "4 4"]:
    return pose(value, f"'{name}'", f"the frame of '{name}'")


# Functions of RAPID whose value the text gives: shifts of targets, poses and orientations, and of numbers, angles
# in degrees.
#
# Source: Technical reference manual, RAPID instructions, functions and data types (3HAC050917).

Options = Mapping[str, Value]
Function = Callable[[Sequence[Value], Options], Value]

TIE_TOLERANCE = 1e-6
"""So near to halfway between two rounded numbers, the controller's 32-bit numbers may lie on either side."""


def _shifting(name: str) -> Function:
    """Offs or RelTool."""

    def function(given: Sequence[Value], options: Options) -> Value:
        if len(given) != 4:
            raise Unresolved(f"{name}() is not given a target and three distances")
        trans, rot, conf, extax = parts(given[0], 4, "the target")
        T = pose_of(position(trans, "the target"), quaternion(rot, "the target"))
        own = pose_numbers(shifted(name, T, given[1:], options))
        return (own[:3], own[3:], conf, extax)

    return function


def _size(given: Sequence[Value], options: Options) -> Value:
    """Dim(array, k): how many elements an array has in its k-th dimension."""
    if len(given) != 2 or not isinstance(given[1], float):
        raise Unresolved("Dim() is not given an array and a number")
    array: Value = given[0]
    for _ in range(int(given[1]) - 1):
        array = array[0] if isinstance(array, tuple) and array else 0.0
    if not isinstance(array, tuple):
        raise Unresolved("Dim() is not given an array of so many dimensions")
    return float(len(array))


def as_pose(T: Float[np.ndarray, "4 4"]) -> Value:
    """The record of a position and an orientation: the inverse of `pose`."""
    own = pose_numbers(T)
    return (own[:3], own[3:])


def _seen(T: Float[np.ndarray, "4 4"], point: tuple[float, ...]) -> Value:
    """A point of a frame, millimetres, in what the frame is counted in."""
    return tuple(map(float, T[:3, :3] @ np.array(point) + T[:3, 3] * 1e3))


def _orient_zyx(given: Sequence[Value], options: Options) -> Value:
    """OrientZYX(z, y, x): turned about z, the new y and the new x."""
    z, y, x = numbers(tuple(given), 3, "what OrientZYX() is given")
    return pose_numbers(se3.pose(rotation(z, y, x), np.zeros(3)))[3:]


def _geometric(
    name: str, function: Callable[..., Value], *given: tuple[Callable[[Value, str], object], str]
) -> Function:
    """A function of poses, positions and orientations.

    Args:
        name: for messages.
        function: its value.
        given: how each argument is read, and what it is called in messages.
    """

    def checked(values: Sequence[Value], options: Options) -> Value:
        own = parts(tuple(values), len(given), f"what {name}() is given")
        return function(*(read(value, what) for value, (read, what) in zip(own, given, strict=True)))

    return checked


def _cut(name: str, to_whole: Callable[[float], float], ties: float) -> Function:
    """Round or Trunc, to a number of decimals."""

    def function(given: Sequence[Value], options: Options) -> Value:
        (value,) = numbers(tuple(given), 1, f"what {name}() is given")
        decimals = options.get("dec", 0.0)
        if not options.keys() <= {"dec"} or not isinstance(decimals, float) or decimals not in range(7):
            raise Unresolved(f"{name}() is not given a number of decimals from 0 to 6")
        scaled = value * 10.0**decimals
        if abs((scaled - ties) - round(scaled - ties)) < TIE_TOLERANCE * max(1.0, abs(scaled)) and scaled != round(
            scaled
        ):
            raise Unresolved(f"{name}() is given a number that lies between two others")
        return to_whole(scaled) / 10.0**decimals

    return function


def _numeric(name: str, count: int) -> Function:

    def checked(given: Sequence[Value], options: Options) -> Value:
        if options:
            raise Unresolved(f"{name}() has no option '{min(options)}'")
        return applied(name, numbers(tuple(given), count, f"what {name}() is given"))

    return checked


_NUMERIC = ("Abs", "Sqrt", "Exp", "Pow", "Sin", "Cos", "Tan", "ASin", "ACos", "ATan", "ATan2")

COMPUTED: Mapping[str, Function] = {
    **{name.lower(): _numeric(name, FUNCTIONS[name.upper()][0]) for name in _NUMERIC},
    "offs": _shifting("Offs"), "reltool": _shifting("RelTool"), "dim": _size, "orientzyx": _orient_zyx,
    "round": _cut("Round", round, 0.5), "trunc": _cut("Trunc", math.trunc, 0.0),
    "posemult": _geometric("PoseMult", lambda a, b: as_pose(a @ b), (pose, "the first pose"), (pose, "the second pose")),
    "poseinv": _geometric("PoseInv", lambda a: as_pose(np.linalg.inv(a)), (pose, "the pose")),
    "posevect": _geometric("PoseVect", _seen, (pose, "the pose"), (position, "the point")),
    "norient": _geometric("NOrient", lambda q: q, (quaternion, "the orientation")),
    "distance": _geometric("Distance", math.dist, (position, "the first point"), (position, "the second point")),
    "vectmagn": _geometric("VectMagn", lambda v: math.hypot(*v), (position, "the vector")),
    "dotprod": _geometric(
        "DotProd", lambda a, b: float(np.dot(a, b)), (position, "the first vector"), (position, "the second vector")
    ),
}  # fmt: skip
"""Functions of the system by their keys, of what they are given in order and by name."""


# Values as the one interpreter keeps them: structures whose parts are counted from 0.

MAX_BLANK = 10_000
"""Elements of an array that is followed although it is declared without a value."""

MAX_ELEMENTS = 1e7
"""No array has more."""

TARGETS = ("robtarget", "jointtarget")


class Listed(Mapping[Hashable, Any]):
    """Parts of a list of nothing but numbers, or of such lists, which are read when they are asked for."""

    __slots__ = ("_made", "node", "persistent")

    def __init__(self, node: AggregateText, *, persistent: bool = False) -> None:
        """Take a list as it is written, and whether an operator may change its numbers by hand."""
        self.node, self.persistent = node, persistent
        self._made: dict[Hashable, Any] | None = None

    @property
    def made(self) -> dict[Hashable, Any]:
        """The parts."""
        if self._made is None:
            self._made = dict[Hashable, Any](
                enumerate(_structured(v, persistent=self.persistent) for v in self.node.values)
            )
        return self._made

    def __getitem__(self, key: Hashable) -> Any:
        return self.made[key]

    def __iter__(self) -> Iterator[Hashable]:
        return iter(self.made)

    def __len__(self) -> int:
        return len(self.made)

    def __eq__(self, other: object) -> bool:
        return self is other or dict(self) == other

    __hash__ = None  # pyright: ignore[reportAssignmentType]


def _structured(value: Any, *, persistent: bool = False) -> Any:
    if isinstance(value, tuple):
        parts = cast("tuple[Any, ...]", value)
        return Structure(kind="", parts={i: _structured(one, persistent=persistent) for i, one in enumerate(parts)})
    return Settable(value) if persistent and type(value) is float else value


def structured(value: Any) -> Any:
    """A value as the interpreter keeps it: the inverse of `plain`."""
    return _structured(value)


def plain(value: Any) -> Any:
    """Values in tuples, as functions and motions take them."""
    if not isinstance(value, Structure):
        return value
    parts = value.parts
    if isinstance(parts, Listed):
        return parts.node.values
    if value.rest is not None and not parts:
        return value.rest
    return tuple([plain(part) for part in parts.values()])


@lru_cache(maxsize=256)
def plain_once(value: Structure) -> Any:
    """The same of what many motions have in common."""
    return plain(value)


@dataclass(frozen=True, eq=False, kw_only=True)
class PassedArgument:
    """Argument of a call that a parameter holds, and the references by which it is passed on."""

    argument: Span
    """Of the first call, where what is passed on is written."""
    reads: frozenset[tuple[int, int]] = frozenset()
    """Files and first characters of the arguments by which routines hand it on."""
    parameters: tuple[Symbol, ...] = ()
    """Those that it has come through."""
    selected: bool = False
    """A part of it is handed on."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PassedArgument):
            return NotImplemented
        return (self.argument, self.parameters) == (other.argument, other.parameters)

    def __hash__(self) -> int:
        return hash((self.argument, self.parameters))


@dataclass(frozen=True, kw_only=True)
class TracedOrigin(Origin):
    """Where the numbers of a value stand, and how it came from there."""

    name: str = ""
    """Of the data whose value it is."""
    literal: AggregateText | None = None
    """What holds it in the text, all of its numbers written out."""
    assigned: bool = False
    """It was assigned to a variable, of whose name other numbers may be read: nothing is said but the name."""
    passed: PassedArgument | None = None
    """How a parameter got it."""
    base: Structure | None = None
    """What Offs or RelTool shifts."""

    @property
    def place(self) -> tuple[int, ...]:
        """The part of them, counted from 0."""
        return cast("tuple[int, ...]", self.path)

    @property
    def symbol(self) -> Symbol:
        """The data that are declared there."""
        return cast("Symbol", self.owner)


# The text of RAPID numbers, which the controller keeps in single precision.

MM_DECIMALS = 5
DEG_DECIMALS = 6
QUATERNION_DECIMALS = 9
"""Smaller digits are rounding errors."""

MIN_EXPONENT_VALUE = 1e7
"""From here on numbers are written with an exponent, as the controller writes its 9E+09."""


def real(value: float, decimals: int) -> str:
    """The shortest text that gives a value back in single precision, rounded to so many decimals before."""
    return reals([value], decimals)[0]


def reals(values: Sequence[float], decimals: int) -> list[str]:
    """The same of several values."""
    rounded = [round(v, decimals) if abs(v) < MIN_EXPONENT_VALUE else 0.0 for v in values]
    texts = np.array(rounded, dtype=np.float32).astype(str).tolist()
    return [
        text.removesuffix(".0")
        if "e" not in text and text != "-0.0" and abs(v) < MIN_EXPONENT_VALUE
        else _scaled(v, decimals)
        for text, v in zip(texts, values, strict=True)
    ]


def _scaled(value: float, decimals: int) -> str:
    """The same of one that is very small or large, or zero."""
    if abs(value) >= MIN_EXPONENT_VALUE:
        mantissa, exponent = f"{np.format_float_scientific(np.float32(value), trim='-', exp_digits=2)}".split("e")
        return f"{mantissa}E{exponent}"
    return np.format_float_positional(np.float32(round(value, decimals) + 0.0), unique=True, trim="-")


def quaternion_texts(wxyz: tuple[float, ...]) -> tuple[str, ...]:
    """Texts of a unit quaternion's components whose largest makes up for the rounding of the others."""
    return quaternions_texts(np.array([wxyz]))[0]


def quaternions_texts(wxyz: Float[np.ndarray, "n 4"]) -> list[tuple[str, ...]]:
    """The same of several quaternions."""
    texts = reals(wxyz.ravel().tolist(), QUATERNION_DECIMALS)
    read = np.array(list(map(float, texts))).reshape(-1, 4)
    rows, largest = np.arange(len(wxyz)), np.abs(wxyz).argmax(axis=1)
    read[rows, largest] = 0.0
    length = np.copysign(np.sqrt(np.maximum(1.0 - (read**2).sum(axis=1), 0.0)), wxyz[rows, largest])
    for k, text in zip((4 * rows + largest).tolist(), reals(length.tolist(), QUATERNION_DECIMALS), strict=True):
        texts[k] = text
    return list(zip(*[iter(texts)] * 4, strict=True))
