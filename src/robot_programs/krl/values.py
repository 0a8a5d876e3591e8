"""Values of KRL's data: numbers, truth values, enumeration constants and structures; operators and functions of them."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import Reason, Unresolved
from robot_programs.core.values import (
    FUNCTIONS,
    ByHand,
    Lost,
    Operators,
    Origin,
    Settable,
    Structure,
    applied,
    is_settable,
    operated,
    plain,
)
from robot_programs.krl.data import AXES, EXTERNAL, POSE, STATUS, Datum, pose, pose_values
from robot_programs.krl.syntax import Aggregate, Field
from taskcal_groundwork import se3


class Real(float):
    """A number that is REAL by the text, and not INT: its quotients are not cut off."""

    __slots__ = ()


class SettableReal(Real, Settable):
    """One of a data list."""

    __slots__ = ()
    plain: ClassVar[type[float]] = Real


ARRAY = "array"
"""Kind of a structure of elements, by their index or the indices; whatever else that is no structure of the program."""
NUMBERS = frozenset({*POSE, *AXES, *EXTERNAL, *STATUS})
"""Components of positions."""
LENGTHS = frozenset({*POSE, *AXES, *EXTERNAL})
"""Those of them that are REAL."""
FUNCTIONS_OF_NUMBERS = {"ABS", "SQRT", "SIN", "COS", "TAN", "ACOS", "ATAN2"}
"""Functions of numbers that KRL has, angles in degrees (KUKA System Software, standard functions)."""

IN, COMPONENT, FIELD, WHOLE = "in", "component", "field", "whole"
"""Operators of the form beside KRL's own: one of several values, a component, one as it is written, and a whole number."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Stated(Origin):
    """A structure of numbers as the text writes it, or a data list."""

    by: Aggregate | Datum

    @property
    def aggregate(self) -> Aggregate:
        """As it is written."""
        return self.by.aggregate if isinstance(self.by, Datum) else self.by


def real(value: float) -> float:
    """A number as a REAL."""
    return SettableReal(value) if isinstance(value, Settable) else Real(value)


def structured(aggregate: Aggregate, at: tuple[int, int, int], by: Datum | None = None) -> Structure:
    """A structure whose components are all values, or that a data list states.

    Args:
        aggregate: as it is written.
        at: where.
        by: what a data list states so.
    """
    parts: dict[Hashable, Any] = {field.name: _field(field, listed=by is not None) for field in aggregate.fields}
    return Structure(kind=aggregate.type, parts=parts, origin=Stated(at=at, owner=None, by=by or aggregate))


def _field(field: Field, *, listed: bool) -> Any:
    if field.value is None:
        if field.name in LENGTHS:
            return Lost(reason=f"{field.name} is '{field.text}', which is not a number", told=True)
        return ByHand(field.text.upper()) if listed else field.text.upper()
    if field.name in LENGTHS:
        return SettableReal(field.value) if listed else Real(field.value)
    return Settable(field.value) if listed else field.value


def position(kind: str, values: Mapping[str, Any]) -> Structure:
    """A structure that stands nowhere in the text."""
    return Structure(kind=kind, parts={**values})


def aggregate_with(type_: str, values: Mapping[str, float | str]) -> Aggregate:
    """The same as something that was read."""
    fields = tuple(
        Field(
            name=name, text=str(value), value=None if isinstance(value, str) else value, start=0, end=0, touches=False
        )
        for name, value in values.items()
    )
    return Aggregate(type=type_, fields=fields, start=0, end=0)


def as_aggregate(value: Any, said: Callable[[str], str] | None = None) -> Aggregate:
    """A structure as it is written, or would be.

    Args:
        value: the structure.
        said: what is said of what holds it where a component is not known, by what is said behind its name.

    Raises:
        Unresolved: a component of a position is not known; or it is none.
    """
    if isinstance(value, Structure) and isinstance(value.rest, Lost):
        reason = value.rest.reason
        raise Unresolved(reason if value.rest.told else said(reason) if said else f"what stands for its point {reason}")
    if not isinstance(value, Structure) or value.kind == ARRAY:
        raise Unresolved("what stands for its point is not a position")
    if isinstance(value.origin, Stated):
        return value.origin.aggregate
    values = dict[str, float | str]()
    for name, part in value.parts.items():
        if isinstance(part, Lost):
            if name in NUMBERS:
                if part.told:
                    raise Unresolved(part.reason)
                raise Unresolved(said(part.reason) if said else Reason(f"its {name} {part.reason}", of=[part.reason]))
            continue
        part = plain(part)
        if isinstance(part, float | str) and not isinstance(part, bool):
            values[str(name)] = float(part) if isinstance(part, float) else part
    return aggregate_with(value.kind, values)


def frame_of(value: Any) -> Float[np.ndarray, "4 4"]:
    """Pose of a complete frame.

    Raises:
        Unresolved: it is none.
    """
    return pose(as_aggregate(value))


def has_any(value: Any, names: Sequence[str]) -> bool:
    """Whether a structure has any of some components."""
    return isinstance(value, Structure) and value.kind != ARRAY and any(name in value.parts for name in names)


ZERO = position("FRAME", dict.fromkeys(POSE, Real(0.0)))


def framed(T: Float[np.ndarray, "4 4"], kind: str, *given: Any, like: Structure | None = None) -> Structure:
    """A frame as a value; its numbers may be set by hand where those that it is made of may be.

    Args:
        T: the frame.
        kind: its type.
        given: of what it is made.
        like: whose status and turn it has, if any.
    """
    type_ = SettableReal if any(map(is_settable, given)) else Real
    values: dict[str, Any] = {name: type_(value) for name, value in pose_values(T).items()}
    if like is not None:
        values |= {name: one for name in STATUS if isinstance(one := like.parts.get(name), float)}
    return position(kind, values)


def _checked(value: Structure) -> None:
    for name in POSE:
        one = value.parts.get(name, 0.0)
        in_range(one if isinstance(one, float) else 0.0)


def product(left: Any, right: Any) -> Structure:
    """Product of two frames by the geometric operator: the right one, counted in the left; status and turn are the right one's.

    Raises:
        Unresolved: one is not a complete frame, or states external axes away from zero.
    """
    if not isinstance(left, Structure) or not isinstance(right, Structure):
        raise Unresolved("both operands of ':' must be FRAME or POS")
    if any(one.parts.get(name) for one in (left, right) for name in EXTERNAL):
        raise Unresolved("a frame with external axes is multiplied")
    if not has_any(left, POSE) or not has_any(right, POSE):
        raise Unresolved("both operands of ':' must be FRAME or POS")
    _checked(left)
    _checked(right)
    T = frame_of(left) @ frame_of(right)
    # from where the robot is, it still is
    return framed(T, left.kind if left.kind == "$POS_ACT" else right.kind, left, right, like=right)


def inverse(frame: Any) -> Structure:
    """Inverse of a frame by INV_POS: F : INV_POS(F) is the zero frame.

    Raises:
        Unresolved: it is not a complete frame, or states external axes away from zero.
    """
    if not has_any(frame, POSE) or any(frame.parts.get(name) for name in EXTERNAL):
        raise Unresolved("what INV_POS is given is not a frame alone")
    _checked(frame)
    return framed(se3.inverse(frame_of(frame)), frame.kind, frame)


def is_whole(value: Structure) -> bool:
    """Whether a structure states all components of a pose or all axes, if it states any: others then say all they mean."""
    for names in (POSE, AXES):
        stated = [name for name in names if name in value.parts]
        if stated and len(stated) < len(names):
            return False
    return True


def in_range(value: float) -> float:
    """A number.

    Raises:
        Unresolved: it is larger than any that a controller holds.
    """
    if not abs(value) < 1e12:
        raise Unresolved("a number is out of any range")
    return value


def _quotient(a: float, b: float) -> float:
    """Quotient of two numbers: of whole ones, which may be INT or REAL, it is cut off or not.

    Raises:
        Unresolved: the text does not tell which they are.
    """
    is_real = isinstance(a, Real) or isinstance(b, Real)
    if b == 0.0 or (not is_real and a / b != int(a / b) and a == int(a) and b == int(b)):
        raise Unresolved("a quotient of whole numbers depends on their type")
    return a / b


_OPERATORS: Operators = {("/", 2): _quotient}


def operate(sign: str, values: Sequence[Any]) -> Any:
    """Value of an operator, or of a function of the language.

    Raises:
        Unresolved: it has none.
    """
    match sign, values:
        case ":", [left, right]:
            return product(left, right)
        case "INV_POS", [frame]:
            return inverse(frame)
        case "component", [value, name]:
            return _component(value, name)
        case "in", [value, *cases]:
            return _is_one(value, cases)
        case "whole", [value]:
            if not isinstance(value, float) or not value.is_integer():
                raise Unresolved("a whole number is expected where there is none")
            return value
        case _ if sign in FUNCTIONS_OF_NUMBERS:
            if len(values) != FUNCTIONS[sign][0] or not all(isinstance(value, float) for value in values):
                raise Unresolved("a number is expected where there is none")
            return Real(in_range(applied(sign, values)))
        case _:
            value = operated(sign, values, _OPERATORS)
            if isinstance(value, bool):
                return value
            is_real = isinstance(value, Real) or any(isinstance(one, Real) for one in values)
            return Real(in_range(value)) if is_real else in_range(float(value))


def _is_one(value: Any, cases: Sequence[Any]) -> bool:
    if not isinstance(value, float | bool | str) or any(_kind(case) is not _kind(value) for case in cases):
        raise Unresolved("a value and the cases of a SWITCH are of different types")
    return value in cases


def _kind(value: Any) -> type:
    return float if isinstance(value, float) else type(value)


def _component(value: Any, name: tuple[str, str]) -> Any:
    """Component of a structure.

    Args:
        value: the structure.
        name: of the component, and of what it is one.
    """
    own, component = name
    part = value.parts.get(component, value.rest) if isinstance(value, Structure) else None
    if part is None:
        raise Unresolved(f"{own}.{component} is not stated")
    if isinstance(part, Lost):
        raise Unresolved(part.reason if part.told else Reason(f"{own}.{component} {part.reason}", of=[part.reason]))
    return real(part) if isinstance(part, float) and component in LENGTHS and _is_position(value) else plain(part)


def _is_position(value: Structure) -> bool:
    return any(all(name in value.parts for name in names) for names in (POSE[:3], AXES))


def without_origin(value: Any) -> Any:
    """A value as data hold it that were assigned: its numbers stand nowhere in the text."""
    return replace(value, origin=None) if isinstance(value, Structure) and value.origin is not None else value
