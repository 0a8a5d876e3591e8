"""Expressions that the languages have in common: how operands are joined, and what operators and functions make of values.

A language says by a table how its operators bind, and reads operands itself.
"""

import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar, cast

from robot_programs.core.program import Unresolved

V = TypeVar("V")
"""What a language makes of an expression: its tree, or its value."""

MAX_DEPTH = 60
"""Brackets and blocks nested deeper than this are no program."""


class OperandReader(ABC, Generic[V]):
    """Reads operands that operators join, those that bind tighter first (precedence climbing)."""

    BINDING: ClassVar[Mapping[str, int]]
    """Operators between two values; those with higher numbers bind tighter."""
    PREFIXES: ClassVar[Mapping[str, int]]
    """Operators in front of one."""

    depth = 0
    """Brackets and blocks that are open."""
    height = 0
    """Values inside values of the expression read last."""

    @property
    @abstractmethod
    def sign(self) -> str:
        """The next word as an operator; anything else is none."""

    @abstractmethod
    def single(self) -> V:
        """Read a value in which no operator is outside of brackets; sets `height`."""

    @abstractmethod
    def operation(self, start: int, sign: str, *operands: V) -> V:
        """What an operator makes of operands.

        Args:
            start: first character of the first of them, or of the operator in front of it; the last one ends before the next word.
            sign: the operator.
            operands: one or two.
        """

    @abstractmethod
    def take(self) -> Any:
        """Read a word."""

    @abstractmethod
    def problem(self, what: str) -> Exception:
        """An error at the next word."""

    @property
    @abstractmethod
    def place(self) -> int:
        """First character of the next word."""

    def enter(self) -> None:
        """Count a bracket or block that opens."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self.problem(f"brackets or blocks are nested deeper than {MAX_DEPTH} at")

    def grow(self, height: int) -> None:
        """Note that the expression read last contains others of some height."""
        self.height = height + 1
        if self.height > MAX_DEPTH:
            raise self.problem(f"an expression is nested deeper than {MAX_DEPTH} at")

    def expression(self, weakest: int = 0) -> V:
        """Read operands joined by operators that bind tighter than the weakest."""
        self.enter()
        try:
            return self._joined(weakest)
        finally:
            self.depth -= 1

    def _joined(self, weakest: int) -> V:
        start, sign = self.place, self.sign
        if self.PREFIXES.get(sign, -1) >= weakest:
            self.take()
            left = self.operation(start, sign, self.expression(self.PREFIXES[sign]))
            self.grow(self.height)
        else:
            left = self.single()
        height = self.height
        while self.BINDING.get(sign := self.sign, 0) > weakest:
            self.take()
            right = self._joined(self.BINDING[sign])
            left = self.operation(start, sign, left, right)
            self.grow(max(height, self.height))
            height = self.height
        return left


# Values.


@dataclass(frozen=True, kw_only=True, slots=True)
class Lost:
    """In place of a value, or of a component of one, that the text does not give."""

    reason: str = field(compare=False)


def whole(value: Any) -> Any:
    """A value of which everything is known.

    Raises:
        Unresolved: it, or a component of it, is not.
    """
    if isinstance(value, Lost):
        raise Unresolved(value.reason)
    if isinstance(value, tuple):
        for part in cast("tuple[Any, ...]", value):
            whole(part)
    return value


COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
EQUAL, UNEQUAL = ("=", "=="), ("<>", "!=")

_OF_TRUTHS: Mapping[tuple[str, int], Callable[..., bool]] = {
    ("not", 1): operator.not_, ("and", 2): operator.and_, ("or", 2): operator.or_, ("xor", 2): operator.ne,
    ("exor", 2): operator.ne,
}  # fmt: skip
_OF_NUMBERS: Mapping[tuple[str, int], Callable[..., Any]] = {
    ("-", 1): operator.neg, ("+", 1): operator.pos,
    ("+", 2): operator.add, ("-", 2): operator.sub, ("*", 2): operator.mul, ("/", 2): operator.truediv,
    **{(sign, 2): compare for sign, compare in COMPARISONS.items()},
}  # fmt: skip
"""Operators, with how many operands they have."""

Operators = Mapping[tuple[str, int], Callable[..., Any]]


def operated(sign: str, values: Sequence[Any], own: Operators | None = None) -> Any:
    """Value of an operator applied to its operands.

    Args:
        sign: the operator, in lower case.
        values: one or two: numbers, truth values, texts, or records, which can only be compared.
        own: operators of numbers that a language has for itself, or with a meaning of its own.

    Raises:
        Unresolved: they are not known, or not of the types it needs, or it is not evaluated.
    """
    key = sign, len(values)
    for value in values:
        whole(value)
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    if sign in (*EQUAL, *UNEQUAL):
        a, b = values
        if not numbers and type(a) is not type(b):
            raise Unresolved(f"the operator {sign} compares things of different types")
        return (a == b) == (sign in EQUAL)
    if key in _OF_TRUTHS and all(isinstance(v, bool) for v in values):
        return _OF_TRUTHS[key](*values)
    if not numbers:
        raise Unresolved(f"a {'truth value' if key in _OF_TRUTHS else 'number'} is expected where there is none")
    try:
        return ((own or {}).get(key) or _OF_NUMBERS[key])(*values)
    except (KeyError, ValueError, ArithmeticError):
        raise Unresolved(f"the operator {sign.upper()} is not evaluated") from None


FUNCTIONS: Mapping[str, tuple[int, Callable[..., float]]] = {
    "ABS": (1, math.fabs), "SQRT": (1, math.sqrt), "EXP": (1, math.exp), "POW": (2, math.pow),
    "SIN": (1, lambda a: math.sin(math.radians(a))), "COS": (1, lambda a: math.cos(math.radians(a))),
    "TAN": (1, lambda a: math.tan(math.radians(a))),
    "ASIN": (1, lambda x: math.degrees(math.asin(x))), "ACOS": (1, lambda x: math.degrees(math.acos(x))),
    "ATAN": (1, lambda x: math.degrees(math.atan(x))), "ATAN2": (2, lambda y, x: math.degrees(math.atan2(y, x))),
}  # fmt: skip
"""Functions of numbers, angles in degrees, by their names in capitals, with how many numbers they are given."""


def applied(name: str, given: Sequence[float]) -> float:
    """Value of one of `FUNCTIONS`.

    Args:
        name: as the program writes it.
        given: as many numbers as it takes.

    Raises:
        Unresolved: it has none, or one that is not finite.
    """
    try:
        value = float(FUNCTIONS[name.upper()][1](*given))
    except (ValueError, ArithmeticError):
        value = math.nan
    if not math.isfinite(value):
        raise Unresolved(f"{name}({', '.join(f'{v:g}' for v in given)}) has no value")
    return value
