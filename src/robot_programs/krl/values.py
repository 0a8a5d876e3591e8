"""Values of KRL's data: numbers, truth values, enumeration constants and structures; operators and functions of them.

Positions are structures of X Y Z in millimetres, A B C or A1 … A6 in degrees, S and T.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import Cause, Motion, Unresolved, angled_pose, pose_numbers, rotations
from robot_programs.core.source import TextEdit, renumbered
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
from robot_programs.krl.syntax import Aggregate, Field, Token, value_of
from taskcal_groundwork import se3

POSE = ("X", "Y", "Z", "A", "B", "C")
AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
EXTERNAL = ("E1", "E2", "E3", "E4", "E5", "E6")
STATUS = ("S", "T")

# KRL's REAL is a 32-bit float: nine digits in all, so 0.1 µm within metres and 1e-6° within a turn.
DECIMALS = {**dict.fromkeys("XYZ", 5), **dict.fromkeys("ABC", 6), **dict.fromkeys((*AXES, *EXTERNAL), 6)}


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
class StatedStructure(Origin):
    """A structure as the text writes it, and the datum that a data list states so."""

    fields: Sequence[Field] = field(compare=False)


def real(value: float) -> float:
    """A number as a REAL."""
    return SettableReal(value) if isinstance(value, Settable) else Real(value)


def structured(aggregate: Aggregate, file: int, *, listed: bool = False) -> Structure:
    """A structure of the text whose components are all values.

    Args:
        aggregate: as it is written.
        file: number of the file.
        listed: whether a data list states it, in which an operator may change it.
    """
    parts: dict[Hashable, Any] = {one.name: _part(one, listed=listed) for one in aggregate.fields}
    origin = StatedStructure(at=(file, aggregate.start, aggregate.end), owner=None, fields=aggregate.fields)
    return Structure(kind=aggregate.type, parts=parts, origin=origin)


def _part(one: Field, *, listed: bool) -> Any:
    if one.value is None:
        if one.name in LENGTHS:
            return Lost(reason=f"{one.name} is '{one.text}', which is not a number", told=True)
        return ByHand(one.text.upper()) if listed else one.text.upper()
    if one.name in LENGTHS:
        return SettableReal(one.value) if listed else Real(one.value)
    return Settable(one.value) if listed else one.value


def value_in(file: int, words: Sequence[Token], *, listed: bool = False) -> Structure | float | bool | None:
    """The structure, number or truth value that words are, of which a data list may hold each; None where they are none."""
    found = value_of(words)
    return structured(found, file, listed=listed) if isinstance(found, Aggregate) else found


def position(kind: str, values: Mapping[str, Any]) -> Structure:
    """A structure that stands nowhere in the text."""
    return Structure(kind=kind, parts={**values})


def as_position(value: Any, said: Callable[[str], str] | None = None) -> Structure:
    """A structure with the numbers and texts that it states or that were computed.

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
    if isinstance(value.origin, StatedStructure):
        return value
    parts = dict[str, Any]()
    for name, part in value.parts.items():
        if isinstance(part, Lost) and name in NUMBERS:
            if part.told:
                raise Unresolved(part.reason)
            raise Unresolved(said(part.reason) if said else Cause(f"its {name} {part.reason}", of=[part.reason]))
        if isinstance(own := plain(part), float | str):
            parts[str(name)] = own
    return position(value.kind, parts)


def frame_of(value: Any) -> Float[np.ndarray, "4 4"]:
    """Pose of a complete frame.

    Raises:
        Unresolved: it is none.
    """
    return pose(as_position(value))


def has_any(value: Any, names: Sequence[str]) -> bool:
    """Whether a structure has any of some components."""
    return isinstance(value, Structure) and value.kind != ARRAY and any(name in value.parts for name in names)


# Positions: from text to numbers and back.


def pose(value: Structure, *, needed: tuple[str, ...] = POSE) -> Float[np.ndarray, "4 4"]:
    """The pose that a complete position states, metres.

    Raises:
        Unresolved: a needed component is missing or no number.
    """
    return angled_pose(*(_stated(value, name, needed) for name in POSE))


def frame(value: Structure) -> Float[np.ndarray, "4 4"]:
    """A frame that is added by ``:``; what it leaves out is zero.

    Raises:
        Unresolved: it is none.
    """
    if not has_any(value, POSE):
        raise Unresolved("what is added by ':' is not a frame")
    return pose(value, needed=())


def literal_poses(rows: Float[np.ndarray, "n 6"], like: Motion) -> Float[np.ndarray, "n 4 4"] | None:
    """The poses of X Y Z A B C; see `LiteralForm.poses`."""
    return se3.pose(rotations(rows[:, 3:]), rows[:, :3] * 1e-3) if np.isfinite(rows).all() else None


def rotation_stated(value: Structure) -> bool:
    """Whether the angles are stated.

    Raises:
        Unresolved: some are, and others not.
    """
    stated = [name for name in "ABC" if name in value.parts]
    if len(stated) in (1, 2):
        raise Unresolved(f"of its angles it states {' and '.join(stated)} only")
    return bool(stated)


def axes(value: Structure, *, needed: tuple[str, ...] = AXES) -> Float[np.ndarray, " joints"]:
    """The joint positions that a complete axis position states, radians; zero for what is neither stated nor needed.

    Raises:
        Unresolved: a needed axis is missing or no number.
    """
    return np.radians([_stated(value, name, needed) for name in AXES])


def _stated(value: Structure, name: str, needed: tuple[str, ...]) -> float:
    part = value.parts.get(name)
    if part is None and name not in needed:
        return 0.0
    if part is None:
        raise Unresolved(f"{name} is not stated, so it keeps its value of before")
    if not isinstance(part, float):
        raise Unresolved(part.reason if isinstance(part, Lost) else f"{name} is '{plain(part)}', which is not a number")
    return float(part)


def number_in(value: Any, name: str) -> float | None:
    """The number in a component; None where there is none."""
    found = value.parts.get(name) if isinstance(value, Structure) else None
    return found if isinstance(found, float) else None


def numbers_in(value: Structure) -> dict[str, float]:
    """Components that are numbers."""
    return {str(name): part for name, part in value.parts.items() if isinstance(part, float)}


def texts_in(value: Structure) -> dict[str, str]:
    """Components as they are written, or would be."""
    if isinstance(value.origin, StatedStructure):
        return {one.name: one.text for one in value.origin.fields}
    return {str(name): str(part) for name, part in value.parts.items()}


def whole(value: Structure, name: str) -> int | None:
    """The whole number of 31 bits in a component; None where there is none."""
    number = number_in(value, name)
    return int(number) if number is not None and 0 <= number < 2**31 and number == int(number) else None


def external(value: Structure) -> tuple[float, ...]:
    """Positions of the external axes, millimetres or degrees; NaN where none is stated.

    Raises:
        Unresolved: one is not a number.
    """
    return tuple(_stated(value, name, ()) if name in value.parts else nan for name in EXTERNAL)


def pose_values(T: Float[np.ndarray, "4 4"], near: Structure | None = None) -> dict[str, float]:
    """Values of X Y Z A B C of a pose, millimetres and degrees; angles near those of a position."""
    old = tuple(number_in(near, name) or 0.0 for name in "ABC")
    return dict(zip(POSE, pose_numbers(T, (old[0], old[1], old[2])), strict=True))


def axis_values(q: Float[np.ndarray, " joints"]) -> dict[str, float]:
    """Values of A1 … of joint positions, degrees."""
    return dict(zip(AXES, np.degrees(q).tolist(), strict=False))


def _field_text(name: str, text: str, was: float, value: float) -> str:
    """A component's text with a value: as it is where that is its value already, to the digits that KRL holds."""
    if name in STATUS:
        return text if was == value else _integer(text, int(value))
    return renumbered(text, was, value, DECIMALS[name])


def _integer(old: str, value: int) -> str:
    base = {"'B": "b", "'H": "X"}.get(old[:2].upper())
    return str(value) if base is None else f"{old[:2]}{value:0{len(old) - 3}{base}}'"


def edits_for(value: Structure, values: Mapping[str, float]) -> list[TextEdit]:
    """The edits that give components of a position in the text other values; those without a number of their own stay."""
    assert isinstance(value.origin, StatedStructure)
    out: list[TextEdit] = []
    for one in value.origin.fields:
        number = values.get(one.name, one.value)
        if number is not None and one.value is not None and number != one.value:
            text = _field_text(one.name, one.text, one.value, number)
            if text != one.text:
                blank = " " if one.touches else ""
                out.append(TextEdit(start=one.start, end=one.end, text=blank + text))
    return out


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
        raise Unresolved(part.reason if part.told else Cause(f"{own}.{component} {part.reason}", of=[part.reason]))
    return real(part) if isinstance(part, float) and component in LENGTHS and _is_position(value) else plain(part)


def _is_position(value: Structure) -> bool:
    return any(all(name in value.parts for name in names) for names in (POSE[:3], AXES))


def without_origin(value: Any) -> Any:
    """A value as data hold it that were assigned: its numbers stand nowhere in the text."""
    return replace(value, origin=None) if isinstance(value, Structure) and value.origin is not None else value
