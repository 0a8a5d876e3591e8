"""Expressions of KRL whose value the text alone gives: numbers, comparisons, frames and their products."""

import operator
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from taskcal.programs.krl.lexer import Word, bit_string, lines_of_words
from taskcal.programs.krl.position import AXES, EXTERNAL, POSE, has_pose, pose, pose_values
from taskcal.programs.krl.syntax import Aggregate, Field, Reference
from taskcal.programs.unresolved import Unresolved

Value = float | bool | str | Aggregate
"""A number, a truth value, an enumeration constant in capitals, or a structure."""

DEEPEST = 12
"""Parentheses in each other in one line."""

NUMBERS = frozenset({*POSE, *AXES, *EXTERNAL, "S", "T"})
"""Components of positions."""

_COMPARE: dict[str, Callable[[float, float], bool]] = {
    "==": operator.eq, "<>": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_LEVELS = (("OR",), ("EXOR",), ("AND",), tuple(_COMPARE), ("+", "-"), ("*", "/"), (":",))
"""Operators from the loosest to the tightest (KUKA System Software, priority of operators)."""


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
    return value


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
            except Unresolved:
                continue
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
    return structure(right.type, values)


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

    def level(self, level: int) -> Value:
        """Operators of one priority, the left ones first."""
        if level == len(_LEVELS):
            return self._single()
        value = self.level(level + 1)
        while self.next() in _LEVELS[level]:
            value = _applied(self.take().upper, value, self.level(level + 1))
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
                return _in_range(float(text))
            case "enum", text:
                return text
            case "string", _ if (bits := bit_string(word.upper)) is not None:
                return bits
            case "symbol", "-" | "+":
                value = _number(self._single())
                return -value if word.text == "-" else value
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
        if self.next() == "(":
            raise Unresolved(f"what {name}() gives is known only at run time")
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
    if sign == "/":
        # two whole numbers may be INT, whose quotient is cut off, or REAL; the text of a value does not tell which
        if b == 0.0 or (a / b != int(a / b) and a == int(a) and b == int(b)):
            raise Unresolved("a quotient of whole numbers depends on their type")
        return a / b
    return _in_range({"+": a + b, "-": a - b, "*": a * b}[sign])


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
    return field.text.upper() if field.value is None else field.value
