"""Linear expressions in joint names, such as ``-(J2 + J3)`` or ``J3 - 0.5*J2``."""

import ast
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from taskcal.errors import RobotError, UnknownName, shown

MAX_CHARACTERS = 200
"""Characters; so that brackets and signs are never nested deeper than Python follows."""


def parse_linear(text: str, names: Sequence[str]) -> Float[np.ndarray, " names"]:
    """Coefficients of a linear expression over the given names.

    Raises:
        RobotError: the text is not a linear expression without a constant.
        UnknownName: it uses a name that is not among `names`.
    """
    if len(text) > MAX_CHARACTERS:
        raise RobotError(f"'{shown(text)}' is longer than {MAX_CHARACTERS} characters; write for example '-(J2 + J3)'")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError) as error:  # of the parser: syntax, NUL, nesting
        raise RobotError(f"'{shown(text)}' is not an expression; write for example '-(J2 + J3)'") from error
    terms = _terms(tree, text)
    if "" in terms:
        raise RobotError(f"'{shown(text)}' has a constant {terms['']:g}; put it into the joint's offset")
    out = np.zeros(len(names))
    for name, value in terms.items():
        if name not in names:
            raise UnknownName("joint", name, names, f"(in '{shown(text)}')")
        out[list(names).index(name)] = value
    return out


def _terms(node: ast.expr, text: str) -> dict[str, float]:
    """Coefficient of each name; the constant under the empty name."""
    match node:
        case ast.Name(id=name):
            return {name: 1.0}
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as value):
            return {"": float(value)} if value else {}
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return {name: -value for name, value in _terms(inner, text).items()}
        case ast.UnaryOp(op=ast.UAdd(), operand=inner):
            return _terms(inner, text)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            sign = 1.0 if isinstance(op, ast.Add) else -1.0
            out = _terms(left, text)
            for name, value in _terms(right, text).items():
                out[name] = out.get(name, 0.0) + sign * value
            return out
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            a, b = _terms(left, text), _terms(right, text)
            if isinstance(op, ast.Mult) and set(a) <= {""}:
                a, b = b, a
            factor = b.get("", 0.0)
            if set(b) <= {""} and (factor or isinstance(op, ast.Mult)):
                return {
                    name: value * factor if isinstance(op, ast.Mult) else value / factor for name, value in a.items()
                }
        case _:
            pass
    raise RobotError(f"'{shown(text)}' is not linear in joint names; write for example '-(J2 + J3)'")
