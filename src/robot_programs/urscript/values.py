"""Values of a URScript program's variables and expressions, and where the text states the poses and joint positions among them.

Universal Robots, *Script manual, e-Series*: modules internals and urmath.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.program import Motion, MotionKind, Unresolved, angled_pose
from robot_programs.core.values import Lost, Operators, operated
from robot_programs.urscript.syntax import Expression, plain_name

T = TypeVar("T")

Six = tuple[float, ...]
"""Position, metres, and rotation vector, radians; or joint positions, radians."""


class Literal(NamedTuple):
    """Six values in brackets: number of their file, first character, and where each value stands."""

    file: int
    start: int
    items: tuple[tuple[int, int], ...]


@dataclass(frozen=True, kw_only=True)
class Pose:
    """A pose."""

    stated: Six
    """Its values, in the feature if it has one, else in the robot's base."""
    literal: Literal | None = None
    """That states them; None where they are computed."""
    feature: tuple[str, Six] | None = None
    """Variable, and its pose, with which ``pose_trans`` moved it."""

    @property
    def values(self) -> Six:
        """Its values in the robot's base."""
        if self.feature is None:
            return self.stated
        return six_of(matrix(self.feature[1]) @ matrix(self.stated))


@dataclass(frozen=True, kw_only=True)
class Array:
    """A list."""

    items: "tuple[Value, ...]"
    literal: Literal | None = None
    size: int = 0
    """Of its elements, twice for each list around them."""

    @staticmethod
    def of(items: "Sequence[Value]", literal: Literal | None = None) -> "Array | Lost":
        """A list, unless it is one that grows without an end."""
        size = 2 * sum(item.size if isinstance(item, Array) else 1 for item in items)
        if size > MAX_SIZE:
            return Lost(reason="a list is too large to be followed")
        return Array(items=tuple(items), literal=literal, size=size)


MAX_SIZE = 100_000
"""A list of points has some thousand numbers."""


@dataclass(frozen=True, kw_only=True)
class Inverse:
    """Joint positions that reach a pose: those nearest to some, or to where the robot is."""

    pose: Pose
    near: Six | None


Value = int | float | bool | str | Pose | Array | Inverse | Lost


def matrix(values: Six) -> Float[np.ndarray, "4 4"]:
    """The transform of a pose, metres."""
    x, y, z, *w = values
    half = 0.5 * math.hypot(*w)
    scale = 0.5 * math.sin(half) / half if half else 0.5
    return se3.pose_of((x, y, z), (scale * w[0], scale * w[1], scale * w[2], math.cos(half)))


def literal_poses(rows: Float[np.ndarray, "n 6"], like: Motion) -> Float[np.ndarray, "n 4 4"] | None:
    """The same of many; see `LiteralForm.poses`."""
    return se3.pose(se3.exp(rows[:, 3:]), rows[:, :3]) if np.isfinite(rows).all() else None


def six_of(T: Float[np.ndarray, "4 4"], near: Six = (0.0,) * 6) -> Six:
    """Values of a pose: of its rotation vectors, which whole turns tell apart, the one nearest to another's."""
    w, before = se3.log(T[:3, :3]), np.array(near[3:])
    angle, turned = float(np.linalg.norm(w)), float(np.linalg.norm(before))
    axis = w / angle if angle > MIN_ANGLE_RAD else before / turned if turned > MIN_ANGLE_RAD else np.zeros(3)
    whole = 2.0 * np.pi * round((float(axis @ before) - angle) / (2.0 * np.pi))
    return tuple(float(v) for v in (*T[:3, 3], *(w + whole * axis)))


MIN_ANGLE_RAD = 1e-12
"""A rotation by less has no axis."""


def computed(T: Float[np.ndarray, "4 4"]) -> Pose:
    """A pose that the text states nowhere."""
    return Pose(stated=six_of(T))


def numbers(value: Value, count: int) -> Six | None:
    """The numbers of a list or a pose; None where it is anything else."""
    if isinstance(value, Pose):
        return value.values if count == 6 else None
    if not isinstance(value, Array) or len(value.items) != count:
        return None
    found = [float(v) for v in value.items if isinstance(v, int | float) and not isinstance(v, bool)]
    return tuple(found) if len(found) == count else None


def signature(call: Expression, names: Sequence[str]) -> dict[str, Expression] | None:
    """Arguments of a call by their names; None where there are others."""
    return _by_name(call.keys, call.parts, names)


def _by_name(keys: Sequence[str], values: Sequence[T], names: Sequence[str]) -> dict[str, T] | None:
    given = {
        key or (names[k] if k < len(names) else ""): value
        for k, (key, value) in enumerate(zip(keys, values, strict=True))
    }
    return given if len(given) == len(keys) and given.keys() <= set(names) else None


# Functions whose value follows from their arguments.


def _pose_trans(a: Pose, b: Pose) -> Pose:
    return computed(matrix(a.values) @ matrix(b.values))


def _pose_add(a: Pose, b: Pose) -> Pose:
    return _apart(a, b, lambda p, q: p + q, lambda R, S: R @ S)


def _pose_sub(a: Pose, b: Pose) -> Pose:
    """What `_pose_add` takes from b to a (Universal Robots, forum: "pose_sub usage and meaning")."""
    return _apart(a, b, lambda p, q: p - q, lambda R, S: R @ S.T)


def _apart(a: Pose, b: Pose, position: Callable[..., np.ndarray], rotation: Callable[..., np.ndarray]) -> Pose:
    A, B = matrix(a.values), matrix(b.values)
    return computed(se3.pose(rotation(A[:3, :3], B[:3, :3]), position(A[:3, 3], B[:3, 3])))


def _interpolate(a: Pose, b: Pose, share: float) -> Pose:
    A, B = matrix(a.values), matrix(b.values)
    turn = se3.log(A[:3, :3].T @ B[:3, :3])
    if np.linalg.norm(turn) > MAX_TURN_RAD:
        raise ValueError("half a turn may be gone either way round")
    return computed(se3.pose(A[:3, :3] @ se3.exp(turn * share), A[:3, 3] + share * (B[:3, 3] - A[:3, 3])))


MAX_TURN_RAD = math.pi - 1e-6

P, N = Pose, (int, float)
FUNCTIONS: Mapping[str, tuple[tuple[str, ...], tuple[object, ...], Callable[..., Value]]] = {
    "pose_trans": (("p_from", "p_from_to"), (P, P), _pose_trans),
    "pose_inv": (("p_from",), (P,), lambda a: computed(se3.inverse(matrix(a.values)))),
    "pose_add": (("p_1", "p_2"), (P, P), _pose_add),
    "pose_sub": (("p_to", "p_from"), (P, P), _pose_sub),
    "interpolate_pose": (("p_from", "p_to", "alpha"), (P, P, N), _interpolate),
    "d2r": (("d",), (N,), math.radians), "r2d": (("r",), (N,), math.degrees),
    "sqrt": (("f",), (N,), math.sqrt), "pow": (("base", "exponent"), (N, N), math.pow),
    "sin": (("f",), (N,), math.sin), "cos": (("f",), (N,), math.cos), "tan": (("f",), (N,), math.tan),
    "asin": (("f",), (N,), math.asin), "acos": (("f",), (N,), math.acos), "atan": (("f",), (N,), math.atan),
    "atan2": (("x", "y"), (N, N), math.atan2), "floor": (("f",), (N,), math.floor), "ceil": (("f",), (N,), math.ceil),
    "length": (("list_",), ((Array,),), lambda a: len(a.items)),
    "point_dist": (
        ("p_from", "p_to"), (P, P), lambda a, b: float(np.linalg.norm(np.subtract(a.values[:3], b.values[:3])))
    ),
    "rpy2rotvec": (("rpy_vector",), ((Array,),), lambda a: _rotation_vector(numbers(a, 3))),
}  # fmt: skip
"""Names of the arguments, what they are, and the function; positions of arguments are as in the manual."""

MOTIONS: Mapping[str, tuple[MotionKind, tuple[str, ...]]] = {
    "movej": ("joint", ("q", "a", "v", "t", "r")),
    "movel": ("linear", ("pose", "a", "v", "t", "r")),
    "movep": ("linear", ("pose", "a", "v", "r")),
    "movec": ("circular", ("pose_via", "pose_to", "a", "v", "r", "mode")),
}
"""Motions that are read, and what they are given."""

POINTS = {name: names[: 2 if kind == "circular" else 1] for name, (kind, names) in MOTIONS.items()}
"""Names of the arguments that are targets, which come first."""

CONSTANTS: Mapping[str, Value] = {"PI": math.pi}


def _rotation_vector(rpy: Six | None) -> Value:
    if rpy is None:
        raise ValueError("it takes three angles")
    R = angled_pose(0.0, 0.0, 0.0, *(math.degrees(angle) for angle in reversed(rpy)))
    return Array.of([float(v) for v in se3.log(R[:3, :3])])


def applied(call: Expression, given: Sequence[Value]) -> Value:
    """Value of a call of one of the language's own functions.

    Args:
        call: the call.
        given: its arguments, in their order.
    """
    if call.name not in FUNCTIONS:
        return Lost(reason=f"what {call.name} returns is known only at run time")
    lost = next((value for value in given if isinstance(value, Lost)), None)
    if lost is not None:
        return lost
    names, kinds, function = FUNCTIONS[call.name]
    by_name = _by_name(call.keys, given, names) or {}
    arguments = [by_name.get(name) for name in names]
    fitting = all(
        isinstance(value, kind) and not isinstance(value, bool)  # pyright: ignore[reportArgumentType]
        for value, kind in zip(arguments, kinds, strict=True)
    )
    try:
        return _finite(function(*arguments)) if fitting else Lost(reason=f"{call.name} is not given what it takes")
    except (ValueError, ArithmeticError) as why:
        return Lost(reason=f"{call.name} has no value: {why}")


def _finite(value: Value) -> Value:
    if isinstance(value, float) and not math.isfinite(value):
        return Lost(reason="a number is out of range")
    return value


# Operators.

MAX_WHOLE = 2**31
"""Whole numbers have 32 bits."""


def _quotient(a: float, b: float) -> float:
    whole = isinstance(a, int) and isinstance(b, int)
    if not b:
        raise Unresolved(f"{a:g} is divided by zero")
    if whole and a % b:
        raise Unresolved(f"the manual does not say whether the quotient of the whole numbers {a:g} / {b:g} is cut off")
    return a // b if whole else a / b


def _remainder(a: float, b: float) -> float:
    if not (isinstance(a, int) and isinstance(b, int) and a >= 0 and b > 0):
        raise Unresolved(f"what {a:g} % {b:g} is, the manual does not tell")
    return a % b


OPERATORS: Operators = {("/", 2): _quotient, ("%", 2): _remainder}


def _operated(sign: str, values: Sequence[Value]) -> Value:
    """Value of an operator; lists are added element by element, and multiplied by a number."""
    match sign, values:
        case "-", [Array() as a]:
            return _operated("*", [-1, a])
        case ("and", [False, _] | [_, False]) | ("or", [True, _] | [_, True]):
            return sign == "or"
        case "+" | "-", [Array() as a, Array() as b] if len(a.items) == len(b.items):
            return Array.of([_operated(sign, pair) for pair in zip(a.items, b.items, strict=True)])
        case "*", [Array() as a, int() | float() as b] | [int() | float() as b, Array() as a]:
            return Array.of([_operated(sign, [b, item]) for item in a.items])
        case _ if any(isinstance(value, Pose | Array | Inverse) for value in values):
            return Lost(reason=f"what '{sign}' makes of these values is not known")
        case _:
            pass
    try:
        value = operated(sign, values, OPERATORS)
    except Unresolved as why:
        return Lost(reason=str(why))
    if isinstance(value, int) and abs(value) >= MAX_WHOLE:
        return Lost(reason="a whole number is out of range")
    return _finite(value)


# Expressions.

INVERSE = ("x", "qnear", "maxPositionError", "maxOrientationError", "tcp")
"""What ``get_inverse_kin`` is given."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluator:
    """What is asked of the place at which an expression stands."""

    file: int
    variable: Callable[[str], Value]
    called: Callable[[Expression], Value | None]
    """Value of a call of a function of the program; None of one of the language's own."""
    forward: Callable[[Six, Expression | None], Value] | None = None
    """Value of ``get_forward_kin`` of joint positions."""

    def __call__(self, expression: Expression) -> Value:
        """Value of an expression."""
        match expression.kind:
            case "value":
                return expression.value
            case "name":
                if expression.name in CONSTANTS:
                    return CONSTANTS[expression.name]
                value = self.variable(plain_name(expression.name))
                if "." not in expression.name or isinstance(value, Lost):
                    return value
                return Lost(reason=f"fields of structures, such as {expression.name}, are not followed")
            case "list" | "pose":
                return self._listed(expression)
            case "index":
                return self._element(*(self(part) for part in expression.parts))
            case "call":
                return self._call(expression)
            case "operation":
                return _operated(expression.name, [self(part) for part in expression.parts])

    def _listed(self, listed: Expression) -> Value:
        items = tuple(self(item) for item in listed.parts)
        places = tuple((item.start, item.end) for item in listed.parts)
        literal = Literal(self.file, listed.start, places) if len(items) == 6 else None
        array = Array.of(items, literal)
        if listed.kind == "list":
            return array
        values = numbers(array, 6)
        if values is None:
            lost = next((item for item in items if isinstance(item, Lost)), None)
            return lost or Lost(reason="what stands in p[…] is not six numbers")
        return Pose(stated=values, literal=literal)

    def _element(self, of: Value, index: Value) -> Value:
        if isinstance(of, Lost) or isinstance(index, Lost):
            return of if isinstance(of, Lost) else index
        items = of.items if isinstance(of, Array) else of.values if isinstance(of, Pose) else ()
        if isinstance(index, int) and not isinstance(index, bool) and 0 <= index < len(items):
            return items[index]
        return Lost(reason="an element of a list is not known")

    def _call(self, call: Expression) -> Value:
        value = self.called(call)
        if value is not None:
            return value
        if call.name in ("get_inverse_kin", "get_forward_kin"):
            return self._kinematics(call)
        given = [self(argument) for argument in call.parts]
        match given:
            case [Pose() as frame, Pose() as point] if call.name == "pose_trans" and call.parts[0].kind == "name":
                literal = None if point.feature else point.literal
                return Pose(stated=point.values, literal=literal, feature=(call.parts[0].name, frame.values))
            case _:
                return applied(call, given)

    def _kinematics(self, call: Expression) -> Value:
        inverse = call.name == "get_inverse_kin"
        names = INVERSE if inverse else ("q", "tcp")
        given = signature(call, names) or {}
        if names[0] not in given:
            return Lost(reason=f"what {call.name} returns is known only at run time")
        value = self(given[names[0]])
        if isinstance(value, Lost):
            return value
        if not inverse:
            q = numbers(value, 6) if isinstance(value, Array) else None
            if q is None or self.forward is None:
                return Lost(reason="get_forward_kin is not given six joint positions")
            return self.forward(q, given.get("tcp"))
        if "tcp" in given and self(given["tcp"]) != "active_tcp":
            return Lost(reason="get_inverse_kin is given a TCP of its own")
        near = self(given["qnear"]) if "qnear" in given else None
        q = None if near is None else numbers(near, 6)
        if isinstance(near, Lost) and not _asks_for_here(given["qnear"]):
            return Lost(reason=f"qnear is not known: {near.reason}")
        if not isinstance(value, Pose) or (near is not None and q is None and not isinstance(near, Lost)):
            return Lost(reason="get_inverse_kin is not given a pose, and six joint positions to be near to")
        return Inverse(pose=value, near=q)


def _asks_for_here(expression: Expression) -> bool:
    """Whether joint positions are those of the robot where it is, by which the nearest solution is chosen without them, too."""
    here = ("get_actual_joint_positions", "get_target_joint_positions")
    return expression.kind == "call" and expression.name in here
