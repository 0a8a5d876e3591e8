"""Values of data while a program runs, with the place in the text where their numbers stand; and what operators make of them."""

import math
import operator
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, cast

from robot_programs.core.form import Key, Span
from robot_programs.core.program import Unresolved

MAX_DEPTH = 60
"""Brackets and blocks nested deeper than this are no program."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Lost:
    """In place of a value, or of a component of one, that the text does not give."""

    reason: str = field(compare=False)
    """What is to be said behind the name of the datum that holds it."""
    told: bool = field(default=False, compare=False)
    """The reason is a whole sentence, whatever holds it."""


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


# Values with the place in the text where their numbers stand.

MAX_SIZE = 1_000_000
"""Values in a value; an array of points has some ten thousand. One that is put into itself again and again has no end."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Origin:
    """Where the numbers of a value stand."""

    at: Span
    owner: Key
    """The datum that is declared there."""
    path: tuple[Hashable, ...] = ()
    """The part of it."""


class Settable(float):
    """A number of the controller's memory, which an operator may change by hand: it decides no branch."""

    __slots__ = ()
    plain: ClassVar[type[float]] = float
    """Type of the same number elsewhere."""


@dataclass(frozen=True, slots=True)
class ByHand:
    """A truth value or text of the controller's memory, as `Settable` is a number."""

    value: bool | str


@dataclass(frozen=True, slots=True)
class Here:
    """Where the robot is, whatever that is, in place of a value; no longer known once the robot has moved."""

    name: str
    """In the words of the language."""


@dataclass(frozen=True, kw_only=True)
class Structure:
    """A value of parts: components by their names, or elements by their indices."""

    kind: str
    """Its type, in the words of the language."""
    parts: Mapping[Hashable, Any]
    rest: Any = None
    """What each other part is, where any may be asked for."""
    origin: Origin | None = None
    """None where its numbers stand in several places, or none."""

    @cached_property
    def settable(self) -> frozenset[Hashable]:
        """Parts in which an operator may change a number."""
        return frozenset(name for name, part in self.parts.items() if is_settable(part))

    @cached_property
    def size(self) -> int:
        """Values in it, those in its parts included."""
        inner = [part for part in self.parts.values() if isinstance(part, Structure)]
        return 1 + len(self.parts) - len(inner) + sum(part.size for part in inner)

    @cached_property
    def depth(self) -> int:
        """Structures in structures."""
        return 1 + max((part.depth for part in self.parts.values() if isinstance(part, Structure)), default=0)

    def bounded(self) -> "Structure":
        """Itself.

        Raises:
            Unresolved: it is too large.
        """
        if self.size > MAX_SIZE or self.depth > MAX_DEPTH:
            raise Unresolved("it is too large to be followed")
        return self

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Structure):
            return NotImplemented
        mine, others = ((one.kind, one.rest, one.origin) for one in (self, other))
        return self is other or (mine == others and self.parts == other.parts and self.settable == other.settable)

    @cached_property
    def _hash(self) -> int:
        return hash((self.kind, tuple(self.parts.items()), self.origin))

    def __hash__(self) -> int:
        return self._hash

    def part(self, name: Hashable) -> Any:
        """A part; `Lost` where it is not known.

        Raises:
            Unresolved: it has none of this name.
        """
        found = self.parts.get(name, self.rest)
        if found is None:
            raise Unresolved(f"it has no part {name}")
        return found

    def with_part(self, path: Sequence[Hashable], value: Any, *, grows: bool = False) -> "Structure":
        """The same with another value in a part of parts.

        Args:
            path: names of the parts.
            value: the value.
            grows: whether it may be one that is not there yet.

        Raises:
            Unresolved: there is no such part, or it would be too large.
        """
        name, *inner = path
        if inner:
            before = self.part(name)
            if isinstance(before, Lost):  # a part of what is not known
                return self
            if not isinstance(before, Structure):
                raise Unresolved(f"it has no parts {inner}")
            value = before.with_part(inner, value, grows=grows)
        elif name not in self.parts and self.rest is None and not grows:
            raise Unresolved(f"it has no part {name}")
        found = Structure(kind=self.kind, parts={**self.parts, name: value}, rest=self.rest)
        before, after = (
            one if isinstance(one, Structure) else None for one in (self.parts.get(name, self.rest), value)
        )
        # told by what changes: an array that is filled in a loop would take time by its square
        found.__dict__["size"] = (
            self.size + (after.size if after else 1) - (before.size if before else name in self.parts)
        )
        found.__dict__["depth"] = max(self.depth, 1 + after.depth if after else 1)
        return found.bounded()


def is_settable(value: Any) -> bool:
    """Whether an operator may change a value by hand."""
    return isinstance(value, Settable | ByHand) or (isinstance(value, Structure) and bool(value.settable))


def by_hand(value: Any) -> Any:
    """A number, truth value or text as one that an operator may change."""
    match value:
        case Settable():
            return value
        case float():
            return Settable(value)
        case bool() | str():
            return ByHand(value)
        case _:
            return value


def plain(value: Any) -> Any:
    """A truth value or text, whoever may change it; anything else as it is."""
    return value.value if isinstance(value, ByHand) else value


def blurred(value: Any, paths: Iterable[Sequence[Hashable]], why: Mapping[Any, str]) -> Any:
    """A value some of whose parts are not known.

    Args:
        value: as it is declared.
        paths: to these parts, as far as they are stated.
        why: of each of them, what is to be said behind its name.
    """
    for path in paths:
        lost = Lost(reason=why[path])
        if not path:
            return replace(value, parts={}, rest=lost, origin=None) if isinstance(value, Structure) else lost
        if isinstance(value, Structure):
            value = value.with_part(path, lost)
    return value


def common(values: Sequence[Any], why: str) -> Any:
    """What is known of a datum that holds one of several values; parts in which they agree are kept.

    Args:
        values: that it may hold.
        why: why what differs is not known.
    """
    first, *others = values
    for other in others:
        if other is not first and (type(other) is not type(first) or other != first):
            break
    else:
        return first
    alike = not isinstance(first, Structure) and len({_plain_type(v) for v in values}) == 1
    if alike and all(plain(v) == plain(first) for v in values):
        settable = next(
            (v for v in values if isinstance(v, Settable | ByHand)), None
        )  # some of them in the controller's memory
        if settable is not None:
            return settable
    if not all(_of_one_form(first, v) for v in values):
        return next((v for v in values if isinstance(v, Lost)), Lost(reason=why))
    names = dict.fromkeys(name for v in values for name in v.parts)
    parts = {name: common([v.part(name) for v in values], why) for name in names}
    return Structure(
        kind=first.kind,
        parts=parts,
        rest=None if first.rest is None else common([v.rest for v in values], why),
        origin=first.origin if parts == first.parts and all(v.origin == first.origin for v in others) else None,
    )


def _plain_type(value: Any) -> Any:
    """Type of a value, whoever may change it."""
    return value.plain if isinstance(value, Settable) else type(plain(value))


def _of_one_form(a: Any, b: Any) -> bool:
    """Whether two values have parts of the same names."""
    if not isinstance(a, Structure) or not isinstance(b, Structure) or a.kind != b.kind:
        return False
    return a.parts.keys() == b.parts.keys() if a.rest is None or b.rest is None else True
