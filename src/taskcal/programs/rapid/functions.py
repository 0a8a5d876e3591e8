"""Functions of RAPID whose value the text gives: shifts of targets, poses and orientations, and of numbers, angles in degrees.

Source: Technical reference manual, RAPID instructions, functions and data types (3HAC050917).
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from taskcal.programs.rapid.computed import pose_numbers, shifted
from taskcal.programs.rapid.frames import numbers, parts, pose_of, position, quaternion
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.unresolved import Unresolved
from taskcal.programs.zyx_angles import rotation

Options = Mapping[str, Value]
Function = Callable[[Sequence[Value], Options], Value]

TIE = 1e-6
"""So near to halfway between two rounded numbers, the controller's 32-bit numbers may lie on either side."""


def _shifted_target(name: str, given: Sequence[Value], options: Options) -> Value:
    if len(given) != 4:
        raise Unresolved(f"{name}() is not given a target and three distances")
    trans, rot, conf, extax = parts(given[0], 4, "the target")
    T = pose_of(position(trans, "the target"), quaternion(rot, "the target"))
    own = pose_numbers(shifted(name, T, given[1:], options))
    return (own[:3], own[3:], conf, extax)


def _offs(given: Sequence[Value], options: Options) -> Value:
    return _shifted_target("Offs", given, options)


def _rel_tool(given: Sequence[Value], options: Options) -> Value:
    return _shifted_target("RelTool", given, options)


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


def _pose(value: Value, what: str) -> Float[np.ndarray, "4 4"]:
    trans, rot = parts(value, 2, what)
    return pose_of(position(trans, what), quaternion(rot, what))


def _as_pose(T: Float[np.ndarray, "4 4"]) -> Value:
    own = pose_numbers(T)
    return (own[:3], own[3:])


def _pose_mult(given: Sequence[Value], options: Options) -> Value:
    """PoseMult(a, b): b, counted in a."""
    a, b = parts(tuple(given), 2, "what PoseMult() is given")
    return _as_pose(_pose(a, "the first pose") @ _pose(b, "the second pose"))


def _pose_inv(given: Sequence[Value], options: Options) -> Value:
    (pose,) = parts(tuple(given), 1, "what PoseInv() is given")
    return _as_pose(np.linalg.inv(_pose(pose, "the pose")))


def _pose_vect(given: Sequence[Value], options: Options) -> Value:
    """PoseVect(pose, pos): the point, counted in what the pose is counted in."""
    pose, point = parts(tuple(given), 2, "what PoseVect() is given")
    T = _pose(pose, "the pose")
    x, y, z = T[:3, :3] @ np.array(position(point, "the point")) + T[:3, 3] * 1e3
    return (float(x), float(y), float(z))


def _orient_zyx(given: Sequence[Value], options: Options) -> Value:
    """OrientZYX(z, y, x): turned about z, the new y and the new x."""
    z, y, x = numbers(tuple(given), 3, "what OrientZYX() is given")
    T = np.eye(4)
    T[:3, :3] = rotation(z, y, x)
    return pose_numbers(T)[3:]


def _n_orient(given: Sequence[Value], options: Options) -> Value:
    (rot,) = parts(tuple(given), 1, "what NOrient() is given")
    return quaternion(rot, "the orientation")


def _distance(given: Sequence[Value], options: Options) -> Value:
    a, b = parts(tuple(given), 2, "what Distance() is given")
    return math.dist(position(a, "the first point"), position(b, "the second point"))


def _magnitude(given: Sequence[Value], options: Options) -> Value:
    (vector,) = parts(tuple(given), 1, "what VectMagn() is given")
    return math.hypot(*position(vector, "the vector"))


def _dot_product(given: Sequence[Value], options: Options) -> Value:
    a, b = parts(tuple(given), 2, "what DotProd() is given")
    return float(np.dot(position(a, "the first vector"), position(b, "the second vector")))


def _cut(name: str, to_whole: Callable[[float], float], ties: float) -> Function:
    """Round or Trunc, to a number of decimals."""

    def function(given: Sequence[Value], options: Options) -> Value:
        (value,) = numbers(tuple(given), 1, f"what {name}() is given")
        decimals = options.get("dec", 0.0)
        if not options.keys() <= {"dec"} or not isinstance(decimals, float) or decimals not in range(7):
            raise Unresolved(f"{name}() is not given a number of decimals from 0 to 6")
        scaled = value * 10.0**decimals
        if abs((scaled - ties) - round(scaled - ties)) < TIE * max(1.0, abs(scaled)) and scaled != round(scaled):
            raise Unresolved(f"{name}() is given a number that lies between two others")
        return to_whole(scaled) / 10.0**decimals

    return function


def _of_numbers(name: str, count: int, function: Callable[..., float]) -> Function:
    """A function of numbers."""

    def checked(given: Sequence[Value], options: Options) -> Value:
        if options:
            raise Unresolved(f"{name}() has no option '{min(options)}'")
        own = numbers(tuple(given), count, f"what {name}() is given")
        try:
            value = float(function(*own))
        except (ValueError, OverflowError, ZeroDivisionError):
            raise Unresolved(f"{name}({', '.join(f'{v:g}' for v in own)}) has no value") from None
        if not math.isfinite(value):
            raise Unresolved(f"{name}({', '.join(f'{v:g}' for v in own)}) has no value")
        return value

    return checked


NUMERIC: Mapping[str, tuple[int, Callable[..., float]]] = {
    "Abs": (1, math.fabs), "Sqrt": (1, math.sqrt), "Exp": (1, math.exp), "Pow": (2, math.pow),
    "Sin": (1, lambda a: math.sin(math.radians(a))), "Cos": (1, lambda a: math.cos(math.radians(a))),
    "Tan": (1, lambda a: math.tan(math.radians(a))),
    "ASin": (1, lambda x: math.degrees(math.asin(x))), "ACos": (1, lambda x: math.degrees(math.acos(x))),
    "ATan": (1, lambda x: math.degrees(math.atan(x))), "ATan2": (2, lambda y, x: math.degrees(math.atan2(y, x))),
}  # fmt: skip
"""Functions of numbers, with how many they are given."""

COMPUTED: Mapping[str, Function] = {
    **{name.lower(): _of_numbers(name, count, function) for name, (count, function) in NUMERIC.items()},
    "offs": _offs, "reltool": _rel_tool, "dim": _size, "posemult": _pose_mult, "poseinv": _pose_inv, "posevect": _pose_vect,
    "orientzyx": _orient_zyx, "norient": _n_orient, "distance": _distance, "vectmagn": _magnitude,
    "dotprod": _dot_product, "round": _cut("Round", round, 0.5), "trunc": _cut("Trunc", math.trunc, 0.0),
}  # fmt: skip
"""Functions of the system by their keys, of what they are given in order and by name."""
