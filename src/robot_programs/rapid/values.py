"""Values of data that the text gives: constants, variables that nothing assigns to, and what the flow of the program tells."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import cast

import numpy as np
from jaxtyping import Float

from robot_programs.core import flow, se3
from robot_programs.core.program import Frame, Unresolved, rotation
from robot_programs.core.values import FUNCTIONS, Lost, Operators, applied, operated, whole
from robot_programs.rapid.names import File, Scope, Symbol, Value
from robot_programs.rapid.syntax import (
    Aggregate,
    Argument,
    Call,
    Component,
    Constant,
    Expression,
    Index,
    Number,
    Operation,
    Reference,
)
from robot_programs.rapid.syntax import parts as parts_of

# Operators of RAPID, and shifts of targets.
#
# Source: Technical reference manual, RAPID overview (expressions), and RAPID instructions, functions and data types
# (Offs, RelTool).

Types = Mapping[str, tuple[tuple[str, str], ...]]
"""Components of records, each with its type."""

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


def replaced(value: Value, path: Sequence[tuple[int, str]], by: Value, types: Types) -> Value:
    """A record or an array with another component or element.

    Args:
        value: it.
        path: which one, step by step, with the type of the record that has it; empty where it is that of an array.
        by: what it becomes.
        types: components of records.

    Raises:
        Unresolved: there is no such component, or it is not known how many elements there are.
    """
    if not path:
        return by
    (at, record), *inner = path
    if isinstance(value, Lost):
        value = (value,) * len(types.get(record, ()))
    if not isinstance(value, tuple) or at >= len(value):
        raise Unresolved("there is no such component")
    return (*value[:at], replaced(value[at], inner, by, types), *value[at + 1 :])


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


@dataclass(frozen=True, eq=False, kw_only=True)
class Frames:
    """Which tool moves in which frame."""

    tool: Frame
    part: Frame
    part_in_hand: bool
    carrier: str = ""
    """Mechanical unit that moves the work object; empty where it stands still."""

    def on(self, T_world_base: Float[np.ndarray, "4 4"]) -> "Frames":
        """Frames with the fixed one counted in the robot's base instead of the world, which RAPID counts in."""
        if self.part_in_hand:
            return replace(self, tool=_seen_from(T_world_base, self.tool))
        return self if self.carrier else replace(self, part=_seen_from(T_world_base, self.part))


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
def frames_of(tool: tuple[str, Value], work_object: tuple[str, Value]) -> Frames:
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
    return Frames(
        tool=Frame(name=tool_name, T=_frame_pose(tframe, tool_name)),
        part=Frame(name=wobj_name, T=user @ inner),
        part_in_hand=wobj_held,
        carrier="" if fixed else str(unit),
    )


def _frame_pose(value: Value, name: str) -> Float[np.ndarray, "4 4"]:
    return pose(value, f"'{name}'", f"the frame of '{name}'")


def _seen_from(T_world_base: Float[np.ndarray, "4 4"], frame: Frame) -> Frame:
    return Frame(name=frame.name, T=se3.inverse(T_world_base) @ frame.T)


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


# What data hold at some place of a program, as far as its flow tells.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Origin:
    """Declaration of a value."""

    symbol: Symbol
    path: tuple[int, ...]
    """Which component or element of it, counted from 0."""
    type: str
    node: Expression | None
    """What is written there; None where only a larger whole is written."""
    selectors: tuple[Component | Index, ...]
    """How the reference says the path."""

    @property
    def name(self) -> str:
        """Name as ``p{3}`` or ``st{2}.pick``, with the value of each index."""
        items, text = iter(self.path), self.symbol.name
        for selector in self.selectors:
            match selector:
                case Index():
                    text += "{" + ",".join(str(next(items) + 1) for _ in selector.items) + "}"
                case Component():
                    next(items)
                    text += f".{selector.key}"
        return text


@dataclass(frozen=True, eq=False, kw_only=True)
class PassedArgument:
    """Argument of a call that a parameter holds, and the references by which it is passed on."""

    argument: Argument
    """Of the first call, where what is passed on is written."""
    file: File
    """Of that call."""
    origin: Origin | None
    """Declaration of what the argument names; None where it names none."""
    literal: Aggregate | None
    """What the argument writes out; None where it does not."""
    reads: frozenset[tuple[File, int]] = frozenset()
    """Files and first characters of the arguments by which routines hand it on."""
    parameters: tuple[Symbol, ...] = ()
    """Those that it has come through."""

    @property
    def source(self) -> tuple[object, ...]:
        """Equal for what comes from the same argument to the same parameters."""
        return (self.argument, self.parameters)


@dataclass(frozen=True, eq=False, kw_only=True)
class AbstractValue:
    """Abstract value of data."""

    value: Value
    """Of no meaning where it is the declared one."""
    declared: bool = False
    """It is the value of their declaration, which still stands."""
    passed: PassedArgument | None = None
    """How a parameter got it."""
    name: str = ""
    """Of the data whose value it is, where it was assigned as a whole; empty otherwise."""
    settable: bool = False
    """It comes from persistent data, which an operator may set by hand: nothing is decided by it."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, AbstractValue):
            return False
        source = None if self.passed is None else self.passed.source
        others = None if other.passed is None else other.passed.source
        mine = (self.declared, self.name, source, self.settable)
        same = mine == (other.declared, other.name, others, other.settable)
        return self is other or (same and identical(self.value, other.value))


def identical(a: Value, b: Value) -> bool:
    """Whether two values are the same and of one type: a truth is not a number."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        return a is b or (len(a) == len(b) and all(map(identical, a, b)))
    return type(a) is type(b) and a == b


def common(a: Value, b: Value, why: str) -> Value:
    """What two values agree in."""
    if identical(a, b):
        return a
    if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
        return tuple(common(*both, why) for both in zip(a, b, strict=True))
    return Lost(reason=why)


Variables = Mapping[Symbol, AbstractValue]
"""What is known of variables; those that are missing hold their declared value, or nobody knows what."""


@dataclass(frozen=True, eq=False, kw_only=True)
class State(flow.State):
    """State at a place of a program."""

    variables: Variables = field(default_factory=dict[Symbol, AbstractValue])

    def common(self, values: Sequence[AbstractValue | None], why: str) -> AbstractValue | None:
        """What several ways have left of a value, by component; see `flow.State.common`."""
        known = [value for value in values if value is not None]
        if len(known) < len(values) or all(value == known[0] for value in known):
            return known[0] if len(known) == len(values) else None
        own = known[0].value
        for value in known[1:]:
            own = common(own, value.value, why)
        if isinstance(own, Lost) or any(value.declared for value in known):
            return None
        return AbstractValue(value=own, settable=any(value.settable for value in known))


UNREACHED = State(reached=False)
"""Where control does not come."""


MAX_REFERENCES = 100
"""Values that lead to others through more steps than this probably lead to themselves."""

MAX_RECORDS = 10
"""Records in each other; a record that holds itself is an error."""

MAX_BLANK = 10_000
"""Elements of an array that is followed although it is declared without a value."""

MAX_ELEMENTS = 1e7
"""No array has more."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Found:
    """Data that a reference names."""

    value: Value
    type: str
    origin: Origin | None
    """Where it is declared; None where it was assigned or computed."""
    passed: PassedArgument | None
    """How the parameter got it that the reference names; None where it names none, or what it holds was assigned to it."""
    literal: Expression | None
    """What holds it in the text: of its declaration, or of the argument that a parameter was given."""
    name: str
    """Of the data that are meant, such as a parameter's argument."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Values:
    """Reads values, given what is assigned to somewhere in the program."""

    assigned: Mapping[Symbol, Mapping[tuple[int, ...], str]]
    """Which components of each symbol, and how: "is assigned to in part.mod:4"; all of it by the empty path."""
    variables: Variables = field(default_factory=dict[Symbol, AbstractValue])
    """What the flow of the program tells of variables and parameters at the place where values are read."""
    returned: Mapping[Call, AbstractValue] = field(default_factory=dict[Call, AbstractValue])
    """What functions of the program return there."""
    _known: dict[Expression, Value] = field(default_factory=dict[Expression, Value])
    """Values of what is declared, so that each is computed once."""
    _named: dict[Symbol, Found] = field(default_factory=dict[Symbol, Found])
    """What names of declared data stand for where the flow says nothing of them, the same."""

    def at(self, variables: Variables, returned: Mapping[Call, AbstractValue]) -> "Values":
        """Values where the flow of the program tells these."""
        return Values(
            assigned=self.assigned, variables=variables, returned=returned, _known=self._known, _named=self._named
        )

    def of(self, expression: Expression, scope: Scope, depth: int = 0) -> Value:
        """The value of an expression.

        Raises:
            Unresolved: the text does not give it.
        """
        if depth > MAX_REFERENCES:
            raise Unresolved("data refer to each other in a circle, or too deeply")
        match expression:
            case Number() | Constant():
                return expression.value
            case Aggregate() if expression.is_literal and depth < MAX_REFERENCES - 1:
                return expression.values
            case Aggregate():
                return tuple(self.of(item, scope, depth + 1) for item in expression.items)
            case Reference():
                return self.found(expression, scope, depth).value
            case Operation(operator="()"):
                return self.of(expression.operands[0], scope, depth + 1)
            case Operation():
                values = [self.of(operand, scope, depth + 1) for operand in expression.operands]
                return operated(expression.operator, values, OPERATORS)
            case Call():
                return self._of_call(expression, scope, depth)

    def number(self, expression: Expression, scope: Scope, depth: int = 0) -> float:
        """The value of an expression that has to be a number.

        Raises:
            Unresolved: the text does not give it, or it is none.
        """
        value = self.of(expression, scope, depth)
        if not isinstance(whole(value), float):
            raise Unresolved("a number is expected where there is none")
        return cast("float", value)

    def partly(self, expression: Expression, scope: Scope) -> Value:
        """The value of an expression, as far as the text gives it."""
        if isinstance(expression, Aggregate) and not expression.is_literal:
            return tuple(self.partly(item, scope) for item in expression.items)
        try:
            return self.of(expression, scope)
        except Unresolved as reason:
            return Lost(reason=str(reason))

    def settable(self, expression: Expression, scope: Scope) -> bool:
        """Whether an operator may change what an expression gives by hand: it reads persistent data."""
        return any(
            self._is_settable(part, scope) if isinstance(part, Reference) else self.returned[part].settable
            for part in parts_of(expression)
            if isinstance(part, Reference) or (isinstance(part, Call) and part in self.returned)
        )

    def _is_settable(self, reference: Reference, scope: Scope) -> bool:
        symbol = scope.find(reference.name.text)
        known = None if symbol is None else self.variables.get(symbol)
        declaration = None if symbol is None else symbol.declaration
        return declaration is not None and declaration.storage == "pers" if known is None else known.settable

    def found(self, reference: Reference, scope: Scope, depth: int = 0) -> Found:
        """Data that a reference names.

        Raises:
            Unresolved: it is not declared in the files, or its value is not known from the text.
        """
        symbol = scope.find(reference.name.text)
        if symbol is None:
            raise Unresolved(f"'{reference.name.text}' is not declared in the files; pass the module that declares it")
        known = self.variables.get(symbol)
        if known is None and not reference.selectors and symbol in self._named:
            return self._named[symbol]
        lost = self.assigned.get(symbol, {}) if known is None else {}
        path, type_ = ((), symbol.type) if () in lost else self.path(reference, symbol, scope, depth)
        for at, how in lost.items():
            if path[: len(at)] == at or symbol.obstacle:
                raise Unresolved(f"'{symbol.name}' {how}, so its value is not known")
        if known is None and symbol.obstacle:
            raise Unresolved(symbol.obstacle)
        if known is None or known.declared:
            node = _inside(symbol.declaration.value if symbol.declaration else None, path)
            origin = Origin(symbol=symbol, path=path, type=type_, node=node, selectors=reference.selectors)
            value = self._declared(origin, depth)
            for at, how in lost.items():
                if at[: len(path)] == path:
                    because = Lost(reason=f"'{symbol.name}' {how}, so its value is not known")
                    value = replaced(value, [(step, "") for step in at[len(path) :]], because, {})
            found = Found(value=value, type=type_, origin=origin, passed=None, literal=origin.node, name=origin.name)
            if known is None and not reference.selectors and depth == 0 and symbol.declaration is not None:
                self._named[symbol] = found
            return found
        value = _component(known.value, path, symbol)
        if known.passed is None:
            name = known.name if known.name and not path else symbol.name
            return Found(value=value, type=type_, origin=None, passed=None, literal=None, name=name)
        return _through(known.passed, value, path, type_, reference)

    def blank(self, symbol: Symbol, leaf: Callable[[str], Value]) -> Value:
        """A value of the type of data, without any that is declared.

        Args:
            symbol: the data.
            leaf: what stands for a type that has no components.

        Raises:
            Unresolved: it is not known how many elements there are, or there are very many.
        """
        declaration, scope = symbol.declaration, symbol.scope
        if declaration is None or scope is None:
            raise Unresolved(symbol.obstacle)
        value = _blank(symbol.type, scope.types, leaf)
        count = 1.0
        for expression in reversed(declaration.dimensions):
            size = self.number(expression, scope)
            count *= size
            if not 1.0 <= count <= MAX_BLANK or size != int(size):
                raise Unresolved(f"'{symbol.name}' has too many elements")
            value = (value,) * int(size)
        return value

    def path(self, reference: Reference, symbol: Symbol, scope: Scope, depth: int = 0) -> tuple[tuple[int, ...], str]:
        """Which component or element of its data a reference means, and the type of that.

        Raises:
            Unresolved: an index is not known, or there is no such component.
        """
        found = list(steps(reference, symbol, scope, lambda item: self.number(item, scope, depth + 1)))
        return tuple(at for at, _, _ in found), found[-1][2] if found else symbol.type

    def _declared(self, origin: Origin, depth: int) -> Value:
        """The declared value of data, which does not follow what its parts hold later."""
        symbol = origin.symbol
        if origin.node is not None:
            return self._written(origin.node, symbol, depth)
        if symbol.declaration is not None and symbol.declaration.value is not None:
            value = self._written(symbol.declaration.value, symbol, depth)
        elif symbol.value is not None:
            value = symbol.value
        else:
            raise Unresolved(f"'{symbol.name}' is declared without a value")
        return _component(value, origin.path, symbol)

    def _written(self, node: Expression, symbol: Symbol, depth: int) -> Value:
        if symbol.scope is None:
            raise Unresolved(f"'{symbol.name}' is declared without a value")
        if isinstance(node, Number) and depth < MAX_REFERENCES:
            return node.value
        if isinstance(node, Aggregate) and node.is_literal:
            return node.values
        if node not in self._known:
            self._known[node] = Values(assigned=self.assigned, _known=self._known).of(node, symbol.scope, depth + 1)
        return self._known[node]

    def _of_call(self, call: Call, scope: Scope, depth: int) -> Value:
        key = call.name.key
        if key in scope.routines and call in self.returned:
            return self.returned[call].value
        if key in scope.routines or key not in COMPUTED:
            raise Unresolved(f"the value of {call.name.text}() is known only at run time")
        required = [a.value for a in call.arguments if not a.option and a.value is not None]
        options = {a.option: a.value for a in call.arguments if a.option and not a.conditional and a.value is not None}
        if len(required) + len(options) != len(call.arguments):
            raise Unresolved(f"the value of {call.name.text}() is known only at run time")
        given = [self.of(node, scope, depth + 1) for node in required]
        return COMPUTED[key](given, {name: self.of(node, scope, depth + 1) for name, node in options.items()})


def steps(
    reference: Reference, symbol: Symbol, scope: Scope, number: Callable[[Expression], float]
) -> Iterator[tuple[int, str, str]]:
    """Steps of a reference into its data: which component or element, the type of the record that has it, and its own.

    Args:
        reference: it.
        symbol: the data.
        scope: what names mean there.
        number: value of an index.

    Raises:
        Unresolved: an index is not known, or there is no such component.
    """
    type_ = symbol.type
    for selector in reference.selectors:
        match selector:
            case Index():
                for item in selector.items:
                    index = number(item)
                    if not 1.0 <= index <= MAX_ELEMENTS or index != int(index):
                        raise Unresolved(f"{index:g} is not an index of '{symbol.name}'")
                    yield int(index) - 1, "", type_
            case Component():
                record, names = type_, [name for name, _ in scope.types.get(type_, ())]
                if selector.key not in names:
                    raise Unresolved(f"'{symbol.name}' has no component '{selector.key}'")
                at = names.index(selector.key)
                type_ = scope.types[record][at][1]
                yield at, record, type_


def _blank(type_: str, types: Types, leaf: Callable[[str], Value], depth: int = 0) -> Value:
    if type_ not in types or depth > MAX_RECORDS:
        return leaf(type_)
    return tuple(_blank(component, types, leaf, depth + 1) for _, component in types[type_])


def _inside(node: Expression | None, path: tuple[int, ...]) -> Expression | None:
    """Expression at a path of another one; None where only a larger whole is written."""
    for item in path:
        if not isinstance(node, Aggregate) or item >= len(node.items):
            return None
        node = node.items[item]
    return node


def _component(value: Value, path: tuple[int, ...], symbol: Symbol) -> Value:
    for item in path:
        if isinstance(value, Lost):
            break
        if not isinstance(value, tuple) or item >= len(value):
            raise Unresolved(f"'{symbol.name}' has no element {item + 1}")
        value = value[item]
    if isinstance(value, Lost):
        raise Unresolved(value.reason)
    return value


def _through(passed: PassedArgument, value: Value, path: tuple[int, ...], type_: str, reference: Reference) -> Found:
    """Data that a reference to a parameter names, whose argument is written in a call."""
    literal, origin = _inside(passed.literal, path), passed.origin
    if origin is not None:
        origin = replace(
            origin,
            path=(*origin.path, *path),
            type=type_,
            node=_inside(origin.node, path) if origin.node is not None else None,
            selectors=(*origin.selectors, *reference.selectors),
        )
        literal = origin.node
    name = reference.name.text if origin is None else origin.name
    return Found(value=value, type=type_, origin=origin, passed=passed, literal=literal, name=name)


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
