"""Operators of RAPID, and shifts of targets.

Source: Technical reference manual, RAPID overview (expressions), and RAPID instructions, functions and data types (Offs, RelTool).
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.unresolved import Unresolved

FARTHEST_SHIFT_MM = 1e6
"""No shift is farther."""


def operated(operator: str, values: Sequence[Value]) -> Value:
    """What an operator makes of its operands.

    Raises:
        Unresolved: they are not of the types it needs, or it is not evaluated.
    """
    truths = [v for v in values if isinstance(v, bool)]
    if len(truths) == len(values):
        return _of_truths(operator, truths)
    if operator in ("=", "<>"):
        a, b = values
        if type(a) is not type(b):
            raise Unresolved(f"the operator {operator} compares things of different types")
        return (a == b) == (operator == "=")
    if not all(isinstance(v, float) for v in values):
        raise Unresolved("a number is expected where there is none")
    return _of_numbers(operator, [v for v in values if isinstance(v, float)])


def _of_truths(operator: str, truths: Sequence[bool]) -> bool:
    match operator, truths:
        case "not", [a]:
            return not a
        case "and", [a, b]:
            return a and b
        case "or", [a, b]:
            return a or b
        case (("xor" | "<>"), [a, b]):
            return a != b
        case "=", [a, b]:
            return a == b
        case _:
            raise Unresolved("a number is expected where there is none")


def _of_numbers(operator: str, given: Sequence[float]) -> Value:
    match operator, given:
        case "-", [a]:
            return -a
        case "+", [a]:
            return a
        case "+", [a, b]:
            return a + b
        case "-", [a, b]:
            return a - b
        case "*", [a, b]:
            return a * b
        case "/", [a, b] if b != 0.0:
            return a / b
        case (("div" | "mod"), [a, b]) if b != 0.0 and a == int(a) and b == int(b):
            quotient = float(int(a / b))  # towards zero, and the remainder has the sign of the dividend
            return quotient if operator == "div" else a - quotient * b
        case "<", [a, b]:
            return a < b
        case ">", [a, b]:
            return a > b
        case "<=", [a, b]:
            return a <= b
        case ">=", [a, b]:
            return a >= b
        case _:
            raise Unresolved(f"the operator {operator.upper()} is not evaluated")


def shifted(name: str, T: Float[np.ndarray, "4 4"], by: Sequence[Value], options: Mapping[str, Value]) -> np.ndarray:
    """What Offs or RelTool makes of a pose.

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
    if not all(abs(v) <= FARTHEST_SHIFT_MM for v in xyz):
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
    x, y, z, w = se3.to_quaternion(T[:3, :3])
    return (*(float(v) for v in T[:3, 3] * 1e3), float(w), float(x), float(y), float(z))
