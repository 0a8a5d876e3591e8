"""Expressions of KRL whose value the text alone gives: numbers, comparisons, frames and their products."""

import math
import operator
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from taskcal.geometry import se3
from taskcal.programs.krl.lexer import Word, bit_string, lines_of_words
from taskcal.programs.krl.position import AXES, EXTERNAL, POSE, has_pose, pose, pose_values
from taskcal.programs.krl.syntax import Aggregate, Field, Reference
from taskcal.programs.unresolved import Unresolved


class Real(float):
    """A number that is REAL by the text, and not INT: its quotients are not cut off."""


Value = float | bool | str | Aggregate
"""A number, a truth value, an enumeration constant in capitals, or a structure."""

DEEPEST = 12
"""Parentheses in each other in one line."""

NUMBERS = frozenset({*POSE, *AXES, *EXTERNAL, "S", "T"})
"""Components of positions."""

_COMPARE: dict[str, Callable[[float, float], bool]] = {
    "==": operator.eq, "<>": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_FUNCTIONS: dict[str, tuple[int, Callable[..., float]]] = {
    "ABS": (1, math.fabs), "SQRT": (1, math.sqrt),
    "SIN": (1, lambda a: math.sin(math.radians(a))), "COS": (1, lambda a: math.cos(math.radians(a))),
    "TAN": (1, lambda a: math.tan(math.radians(a))), "ACOS": (1, lambda x: math.degrees(math.acos(x))),
    "ATAN2": (2, lambda y, x: math.degrees(math.atan2(y, x))),
}  # fmt: skip
"""Functions of KRL with how many numbers they are given, angles in degrees (KUKA System Software, standard functions)."""

_LEVELS = (("OR",), ("EXOR",), ("AND",), tuple(_COMPARE), ("+", "-"), ("*", "/"), (":",))
"""Operators from the loosest to the tightest (KUKA System Software, priority of operators)."""
_PRIORITY = {sign: level for level, signs in enumerate(_LEVELS) for sign in signs}


@runtime_checkable
class Lookup(Protocol):
    """Where the values of variables come from."""

    def value(self, name: str) -> Value:
        """The value of a variable or an element, by its name in capitals with its index as a number.

        Raises:
            Unresolved: the text does not tell.
        """
        ...


def evaluated(words: Sequence[Word], lookup: Lookup) -> Value:
    """The value of an expression.

    Raises:
        Unresolved: the text does not give it.
    """
    reader = _Reader(words, lookup)
    value = reader.level(0)
    if reader.at < len(words):
        raise Unresolved(f"'{words[reader.at].text}' is not evaluated")
    return value


def number_of(words: Sequence[Word], lookup: Lookup) -> float:
    """The value of an expression that has to be a number.

    Raises:
        Unresolved: the text does not give it, or it is none.
    """
    value = evaluated(words, lookup)
    if isinstance(value, bool) or not isinstance(value, float) or not np.isfinite(value):
        raise Unresolved(f"'{''.join(word.text for word in words)}' is not a number")
    return float(value)


def structure(type_: str, values: dict[str, float | str]) -> Aggregate:
    """A structure that stands nowhere in the text."""
    fields = tuple(
        Field(
            name=name, text=str(value), value=None if isinstance(value, str) else value, start=0, end=0, touches=False
        )
        for name, value in values.items()
    )
    return Aggregate(type=type_, fields=fields, start=0, end=0)


def values_of(aggregate: Aggregate) -> dict[str, float | str]:
    """The components of a structure: numbers, or the text of what is none."""
    return {field.name: field.text.upper() if field.value is None else field.value for field in aggregate.fields}


def name_of(reference: Reference, lookup: Lookup) -> str:
    """The name of a variable or an element, its index as a number.

    Raises:
        Unresolved: which element is meant is not known from the text.
    """
    if not reference.index:
        return reference.name
    try:
        indices = [f"{number_of(words, lookup):g}" for words in reference.index]
    except Unresolved as trouble:
        variable = reference.name.partition("[")[0]
        raise Unresolved(f"which element of {variable} is meant is known only at run time: {trouble}") from None
    return f"{reference.name.partition('[')[0]}[{','.join(indices)}]"


def with_values(aggregate: Aggregate, lookup: Lookup) -> Aggregate:
    """A structure whose components are all numbers, as far as the text tells those that are written as expressions.

    Returns:
        The structure itself where it has no such components.
    """
    if all(field.value is not None or field.name not in NUMBERS for field in aggregate.fields):
        return aggregate
    values = values_of(aggregate)
    for field in aggregate.fields:
        if field.value is None and field.name in NUMBERS:
            try:
                values[field.name] = number_of(next(lines_of_words(field.text), []), lookup)
            except Unresolved as trouble:
                if field.name in (*POSE, *AXES):
                    raise Unresolved(f"{field.name} is '{field.text}', and {trouble}") from None
    return structure(aggregate.type, values)


def product(left: Aggregate, right: Aggregate) -> Aggregate:
    """What the geometric operator makes of two frames: the right one, counted in the left; status and turn are the right one's.

    Raises:
        Unresolved: one is not a complete frame, or states external axes away from zero.
    """
    if any(part.value(name) for part in (left, right) for name in EXTERNAL):
        raise Unresolved("a frame with external axes is multiplied")
    if not has_pose(left) or not has_pose(right):
        raise Unresolved("what ':' joins is not a frame")
    for value in (part.value(name) for part in (left, right) for name in POSE):
        _in_range(value or 0.0)
    values: dict[str, float | str] = dict(pose_values(pose(left) @ pose(right)))
    values |= {name: value for name in ("S", "T") if (value := right.value(name)) is not None}
    return structure(
        left.type if left.type == "$POS_ACT" else right.type, values
    )  # from where the robot is, it still is


def inverse(frame: Value) -> Aggregate:
    """What INV_POS makes of a frame: F : INV_POS(F) is the zero frame.

    Raises:
        Unresolved: it is not a complete frame, or states external axes away from zero.
    """
    if not isinstance(frame, Aggregate) or not has_pose(frame) or any(frame.value(name) for name in EXTERNAL):
        raise Unresolved("what INV_POS is given is not a frame alone")
    for name in POSE:
        _in_range(frame.value(name) or 0.0)
    return structure(frame.type, dict(pose_values(se3.inverse(pose(frame)))))


def is_whole(aggregate: Aggregate) -> bool:
    """Whether a structure states all components of a pose or all axes, if it states any: others then say all they mean."""
    for names in (POSE, AXES):
        stated = [name for name in names if aggregate.field(name)]
        if stated and (len(stated) < len(names) or any(aggregate.value(name) is None for name in stated)):
            return False
    return True


class _Reader:
    """The words of an expression, from left to right."""

    def __init__(self, words: Sequence[Word], lookup: Lookup):
        self.words, self.lookup, self.at, self.depth = words, lookup, 0, 0

    def next(self) -> str:
        return self.words[self.at].upper if self.at < len(self.words) else ""

    def take(self) -> Word:
        if self.at >= len(self.words):
            raise Unresolved("an expression ends too early")
        self.at += 1
        return self.words[self.at - 1]

    def accept(self, text: str) -> bool:
        matches = self.next() == text
        self.at += matches
        return matches

    def expect(self, text: str) -> None:
        if not self.accept(text):
            raise Unresolved(f"'{text}' is missing in an expression")

    def level(self, lowest: int) -> Value:
        """Operators of a priority and of higher ones, of one priority the left ones first."""
        value = self._single()
        while (priority := _PRIORITY.get(self.next(), -1)) >= lowest:
            value = _applied(self.take().upper, value, self.level(priority + 1))
        return value

    def _single(self) -> Value:
        self.depth += 1
        if self.depth > DEEPEST:
            raise Unresolved("an expression is nested too deeply")
        value = self._unnested()
        self.depth -= 1
        return value

    def _unnested(self) -> Value:
        word = self.take()
        match word.kind, word.upper:
            case "number", text:
                value = _in_range(float(text))
                return value if text.isdecimal() else Real(value)
            case "enum", text:
                return text
            case "string", _ if (bits := bit_string(word.upper)) is not None:
                return bits
            case "symbol", "-" | "+":
                value = _number(self._single())
                return value if word.text == "+" else Real(-value) if isinstance(value, Real) else -value
            case "symbol", "(":
                value = self.level(0)
                self.expect(")")
                return value
            case "symbol", "{":
                return self._structure()
            case "name", "NOT":
                return not _truth(self._single())
            case "name", "TRUE" | "FALSE":
                return word.upper == "TRUE"
            case "name", name:
                return self._variable(name)
            case _:
                raise Unresolved(f"'{word.text}' is not evaluated")

    def _variable(self, name: str) -> Value:
        if self.accept("("):
            return self._function(name)
        if self.accept("["):
            indices = [_index(self.level(0))]
            while self.accept(","):
                indices.append(_index(self.level(0)))
            self.expect("]")
            name = f"{name}[{','.join(indices)}]"
        value = self.lookup.value(name)
        while self.accept("."):
            value = _component(value, self.take().upper, name)
        return value

    def _function(self, name: str) -> Value:
        """One of KRL's own functions; those of the program are asked elsewhere."""
        if name == "INV_POS":
            frame = self.level(0)
            self.expect(")")
            return inverse(frame)
        count, function = _FUNCTIONS.get(name, (0, math.sqrt))
        if not count:
            raise Unresolved(f"what {name}() gives is known only at run time")
        given = [_number(self.level(0))]
        while len(given) < count:
            self.expect(",")
            given.append(_number(self.level(0)))
        self.expect(")")
        try:
            return Real(_in_range(function(*given)))
        except ValueError:
            raise Unresolved(f"{name}({', '.join(f'{value:g}' for value in given)}) has no value") from None

    def _structure(self) -> Aggregate:
        type_ = ""
        if self.at + 1 < len(self.words) and self.words[self.at + 1].text == ":":
            type_ = self.take().upper
            self.take()
        values: dict[str, float | str] = {}
        while not self.accept("}"):
            component = self.take().upper
            if self.next() in ("[", "{") or component in values:
                raise Unresolved(f"the component {component} is not evaluated")
            value = self.level(0)
            if isinstance(value, Aggregate):
                raise Unresolved(f"the component {component} is a structure")
            values[component] = str(value).upper() if isinstance(value, bool) else value
            if not self.accept(",") and self.next() != "}":
                raise Unresolved("a structure is not understood")
        return structure(type_, values)


def _applied(sign: str, left: Value, right: Value) -> Value:
    if sign == ":":
        if isinstance(left, Aggregate) and isinstance(right, Aggregate):
            return product(left, right)
        raise Unresolved("what ':' joins is not a frame")
    if sign in ("AND", "OR", "EXOR"):
        a, b = _truth(left), _truth(right)
        return (a and b) if sign == "AND" else (a or b) if sign == "OR" else a != b
    if sign in ("==", "<>") and type(left) is type(right) and isinstance(left, bool | str):
        return (left == right) == (sign == "==")
    a, b = _number(left), _number(right)
    if sign in _COMPARE:
        return _COMPARE[sign](a, b)
    real = isinstance(a, Real) or isinstance(b, Real)
    if sign == "/":
        # two whole numbers may be INT, whose quotient is cut off, or REAL; the text of a value does not always tell which
        if b == 0.0 or (not real and a / b != int(a / b) and a == int(a) and b == int(b)):
            raise Unresolved("a quotient of whole numbers depends on their type")
        return Real(_in_range(a / b)) if real else a / b
    value = _in_range({"+": a + b, "-": a - b, "*": a * b}[sign])
    return Real(value) if real else value


def _in_range(value: float) -> float:
    if not abs(value) < 1e12:
        raise Unresolved("a number is out of any range")
    return value


def _number(value: Value) -> float:
    if isinstance(value, bool) or not isinstance(value, float):
        raise Unresolved("a number is expected where there is none")
    return value


def _truth(value: Value) -> bool:
    if not isinstance(value, bool):
        raise Unresolved("a truth value is expected where there is none")
    return value


def _index(value: Value) -> str:
    number = _number(value)
    if number != int(number) or not 0 < number < 1e6:
        raise Unresolved(f"{number:g} is not an index")
    return str(int(number))


def _component(value: Value, component: str, name: str) -> float | str:
    field = value.field(component) if isinstance(value, Aggregate) else None
    if field is None:
        raise Unresolved(f"{name}.{component} is not stated")
    if field.value is None:
        return field.text.upper()
    position = isinstance(value, Aggregate) and any(all(map(value.field, names)) for names in (POSE[:3], AXES))
    return Real(field.value) if position and component in (*POSE, *AXES, *EXTERNAL) else field.value
