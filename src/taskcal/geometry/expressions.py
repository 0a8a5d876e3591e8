"""Expressions in place of numbers: what NumPy computes of them is noted, differentiated, and written as lines of C.

Arrays of them have the type object, through which NumPy's sums, products and analytic functions pass. Equal expressions are one,
so that whatever is computed twice is written once.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from robot_programs.core.helper import Computed, Dialect
from taskcal.geometry.se3 import error_transform
from taskcal.kernels.chain import ERROR_FRAME, FIXED, REVOLUTE, Chain

Key = tuple[Any, ...]

HALF_TURN = 0.5 * np.pi

MAX_MULTIPLE = 200
"""Of an angle whose cosine is found from those of smaller multiples; each costs two products, and a digit in a hundred."""


class Expression:
    """A number that is not known yet; hashed by what it is made of."""

    __slots__ = ("key", "number", "pool")

    def __init__(self, pool: "Pool", number: int, key: Key) -> None:
        self.pool, self.number, self.key = pool, number, key

    def __repr__(self) -> str:
        return f"Expression({self.key[0]}, {len(self.key) - 1} arguments)"

    def __add__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else self.pool.sum(self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self.pool.sum(self, -1.0 * other)

    def __rsub__(self, other: Any) -> Any:
        return self.pool.sum(other, -1.0 * self)

    def __mul__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else self.pool.product(self, other)

    __rmul__ = __mul__

    def __neg__(self) -> Any:
        return self.pool.product(-1.0, self)

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Expression):
            return self.pool.make("/", self, other)
        return self.pool.product(self, 1.0 / other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.pool.make("/", self.pool.constant(other), self)

    def __pow__(self, power: int) -> Any:
        if power not in (2, 3):
            raise TypeError(f"a power of {power} cannot be written; write products")
        return self * self if power == 2 else self * self * self

    def __abs__(self) -> Any:
        return self.pool.make("fabs", self)

    def __bool__(self) -> bool:
        raise TypeError("it decides by comparisons")

    def __lt__(self, other: Any) -> bool:
        return bool(self)

    __le__ = __gt__ = __ge__ = __lt__

    def sin(self) -> Any:
        """Sine."""
        return self.pool.wave(self, of_cosine=False)

    def cos(self) -> Any:
        """Cosine."""
        return self.pool.wave(self, of_cosine=True)

    def sqrt(self) -> Any:
        """Root."""
        return self.pool.make("sqrt", self)

    def exp(self) -> Any:
        """Exponential."""
        return self.pool.make("exp", self)

    def arctan2(self, other: Any) -> Any:
        """Angle of a point (other, self)."""
        return self.pool.make("atan2", self, self.pool.constant(other))


def is_zero(value: Any) -> bool:
    """Whether a number, or an expression, is known to be zero."""
    return value.key == ("constant", 0.0) if isinstance(value, Expression) else value == 0.0


def of_largest(moves: Any, least: float) -> Any:
    """Each of some numbers over the largest of them in each row, all without their signs; zero where that is not above `least`."""
    pool, largest = moves[0, 0].pool, 0.0
    for move in moves[0]:
        largest = pool.make("fmax", pool.constant(largest), pool.make("fabs", move))
    shares = [pool.make("above", largest, pool.constant(least), move / largest) for move in moves[0]]
    return np.array([shares], dtype=object)


def or_zero(values: Any) -> Any:
    """Numbers, or zero where they are not known."""
    known = [one.pool.make("known", one) if isinstance(one, Expression) else one for one in values]
    return np.array(known, dtype=object)


def _slope(of: Expression, slopes: Sequence[Any]) -> Any:
    """Derivative of an expression, given those of its parts."""
    name, *parts = of.key
    if all(slope.key == ("constant", 0.0) for slope in slopes):
        return 0.0
    match name:
        case "+":
            return slopes[0] + slopes[1]
        case "*":
            return slopes[0] * parts[1] + parts[0] * slopes[1]
        case "/":
            return (slopes[0] - of * slopes[1]) / parts[1]
        case "sin":
            return parts[0].cos() * slopes[0]
        case "cos":
            return -parts[0].sin() * slopes[0]
        case "sqrt":
            return 0.5 * slopes[0] / of
        case "exp":
            return of * slopes[0]
        case "atan2":
            y, x = parts
            return (x * slopes[0] - y * slopes[1]) / (x * x + y * y)
        case _:
            raise TypeError(f"{name} has no derivative")


class Pool:
    """All expressions of one function, each once, in the order in which they can be computed."""

    def __init__(self) -> None:
        self._known: dict[Key, Expression] = {}

    def make(self, name: str, *parts: Any) -> Expression:
        """The expression of a function and its arguments."""
        key = (name, *parts)
        if key not in self._known:
            self._known[key] = Expression(self, len(self._known), key)
        return self._known[key]

    def input(self, text: str) -> Expression:
        """What the caller gives, by its name in C."""
        return self.make("input", text)

    def inputs(self, name: str, count: int) -> Any:
        """Elements of an array that the caller gives: (1, count)."""
        return np.array([[self.input(f"{name}[{k}]") for k in range(count)]], dtype=object)

    def constant(self, value: Any) -> Expression:
        """A number that is known."""
        return value if isinstance(value, Expression) else self.make("constant", float(value))

    def sum(self, one: Any, other: Any) -> Expression:
        """Sum, without what adds nothing; nothing where one takes the other away."""
        a, b = self.constant(one), self.constant(other)
        if b.key[0] == "*" and b.key[1].key == ("constant", -1.0) and b.key[2] is a:
            return self.constant(0.0)
        if a.key[0] == b.key[0] == "constant":
            return self.constant(a.key[1] + b.key[1])
        if a.key[0] == "constant":
            a, b = b, a
        return a if b.key == ("constant", 0.0) else self.make("+", a, b)

    def product(self, one: Any, other: Any) -> Expression:
        """Product, a factor that is known in front; without factors of one, and nothing where one is zero."""
        a, b = self.constant(one), self.constant(other)
        if b.key[0] == "constant":
            a, b = b, a
        if a.key[0] != "constant":
            return self.make("*", *sorted((a, b), key=lambda part: part.number))
        factor = a.key[1]
        if b.key[0] == "constant":
            return self.constant(factor * b.key[1])
        if b.key[0] == "*" and b.key[1].key[0] == "constant":
            factor, b = factor * b.key[1].key[1], b.key[2]
        if factor in (0.0, 1.0):
            return b if factor else self.constant(0.0)
        return self.make("*", self.constant(factor), b)

    def wave(self, angle: Expression, *, of_cosine: bool) -> Expression:
        """Cosine or sine; a quarter turn makes one of the other, and multiples follow from smaller ones."""
        if angle.key[0] == "constant":
            return self.constant(math.cos(angle.key[1]) if of_cosine else math.sin(angle.key[1]))
        if angle.key[0] == "+" and angle.key[2].key == ("constant", -HALF_TURN):
            inner = angle.key[1]
            return inner.sin() if of_cosine else -inner.cos()
        factor = angle.key[1].key[1] if angle.key[0] == "*" and angle.key[1].key[0] == "constant" else 1.0
        if factor < 0.0:
            return self.wave(-angle, of_cosine=True) if of_cosine else -self.wave(-angle, of_cosine=False)
        if not 2.0 <= factor <= MAX_MULTIPLE or factor != int(factor):
            return self.make("cos" if of_cosine else "sin", angle)
        base = angle.key[2]
        cosine, sine = base.cos(), base.sin()
        waves = [cosine, sine]
        for _ in range(int(factor) - 1):
            waves = [waves[0] * cosine - waves[1] * sine, waves[1] * cosine + waves[0] * sine]
        return waves[0] if of_cosine else waves[1]

    def derivatives(self, of: Sequence[Any], by: Expression) -> list[Expression]:
        """Derivatives of some expressions by an input."""
        wanted = [self.constant(one) for one in of]
        slopes: dict[int, Expression] = {}
        for one in _needed(wanted):
            name, *parts = one.key
            known = name in ("constant", "input")
            slopes[one.number] = self.constant(
                float(one is by) if known else _slope(one, [slopes[part.number] for part in parts])
            )
        return [slopes[one.number] for one in wanted]


def _needed(wanted: Iterable[Expression]) -> list[Expression]:
    """Some expressions and all that they are made of, in the order in which they can be computed."""
    found: dict[int, Expression] = {}
    waiting = list(wanted)
    while waiting:
        one = waiting.pop()
        if one.number not in found:
            found[one.number] = one
            waiting += [part for part in one.key[1:] if isinstance(part, Expression)]
    return [found[number] for number in sorted(found)]


_WRITTEN: Mapping[str, Callable[..., str]] = {
    "+": "{0} + {1}".format,
    "*": "{0} * {1}".format,
    "/": "{0} / {1}".format,
}


def statements(pool: Pool, results: Mapping[str, Any] | Sequence[tuple[str, Any]]) -> Iterator[str]:
    """Lines of C that compute some expressions and assign them.

    Args:
        pool: whose expressions they are.
        results: what each is assigned to, and the expression or number.
    """
    pairs = list(results.items()) if isinstance(results, Mapping) else list(results)
    wanted = [(place, pool.constant(value)) for place, value in pairs]
    names: dict[int, str] = {}
    for one in _needed(value for _, value in wanted):
        name, *parts = one.key
        if name == "constant":
            text = repr(parts[0])
            names[one.number] = f"({text})" if parts[0] < 0.0 else text
        elif name == "input":
            names[one.number] = parts[0]
        else:
            given = [names[part.number] for part in parts]
            made = _WRITTEN[name](*given) if name in _WRITTEN else f"{name}({', '.join(given)})"
            names[one.number] = f"t{len(names)}"
            yield f"const double {names[one.number]} = {made};"
    yield from (f"{place} = {names[value.number]};" for place, value in wanted)


# The same in languages of robot controllers: short lines, few variables, angles in degrees.


def _applied(dialect: Dialect, name: str, pieces: "Sequence[_Piece]") -> str:
    """A function of some arguments.

    Raises:
        TypeError: the language does not have it.
    """
    if name not in dialect.functions:
        raise TypeError(f"it takes {name}, which the language does not have")
    texts = [piece.text for piece in pieces]
    if dialect.degrees is not None and name in ("sin", "cos"):
        (piece,) = pieces
        texts = [dialect.degrees.get(piece.text, f"{dialect.number(math.degrees(1.0))}*{piece.within(2)}")]
    text = dialect.functions[name].format(*texts)
    if dialect.degrees is not None and name == "atan2":
        text = f"({dialect.number(math.radians(1.0))}*{text})"
    return text


MAX_TEXT = 96
"""Characters of a value; controllers' editors show lines of some 120."""


def straight_line(pool: Pool, results: Mapping[str, Any], dialect: Dialect) -> Computed:
    """Write expressions in a language of few variables: what is used once stands where it is used.

    Args:
        pool: whose expressions they are.
        results: what each is assigned to, and the expression or number.
        dialect: how the language writes them.

    Raises:
        TypeError: the language has no such function.
    """
    wanted = {place: pool.constant(value) for place, value in results.items()}
    needed = _needed(wanted.values())
    uses: dict[int, int] = dict.fromkeys((one.number for one in needed), 0)
    for part in (part for one in needed for part in one.key[1:] if isinstance(part, Expression)):
        uses[part.number] += 1
    for value in wanted.values():
        uses[value.number] += 1
    texts: dict[int, _Piece] = {}
    free, lines, variables = list[int](), list[str](), 0

    def write(place: str, piece: _Piece) -> None:
        lines.append(dialect.assignment.format(place, piece.text))

    def released(piece: _Piece) -> None:
        for number, variable in piece.reads:
            uses[number] -= 1
            if not uses[number]:
                free.append(variable)

    for one in needed:
        piece = _piece(one, texts, dialect)
        if one.key[0] not in ("constant", "input") and (uses[one.number] > 1 or len(piece.text) > MAX_TEXT // 3):
            released(piece)
            variables += not free
            variable = free.pop() if free else variables
            name = dialect.variable.format(variable)
            write(name, piece)
            piece = _Piece(name, 2, ((one.number, variable),))
        texts[one.number] = piece
    for place, value in wanted.items():
        write(place, texts[value.number])
    operations = sum(one.key[0] not in ("constant", "input") for one in needed)
    return Computed(lines=lines, variables=variables, operations=operations)


class _Piece(NamedTuple):
    """Text of an expression."""

    text: str
    rank: int
    """0 of a sum, 1 of a product or quotient, 2 of what needs no brackets."""
    reads: tuple[tuple[int, int], ...]
    """Numbers of expressions that it reads from variables, and those."""

    def within(self, rank: int) -> str:
        """In brackets where the operation around it binds as tightly or more."""
        return self.text if self.rank >= rank else f"({self.text})"


def _piece(one: Expression, texts: Mapping[int, _Piece], dialect: Dialect) -> _Piece:
    name, *parts = one.key
    if name == "constant":
        text = dialect.number(parts[0])
        return _Piece(f"({text})" if parts[0] < 0.0 else text, 2, ())
    if name == "input":
        return _Piece(parts[0], 2, ())
    pieces = [texts[part.number] for part in parts]
    reads = tuple(read for piece in pieces for read in piece.reads)
    if name == "+":
        return _Piece(f"{pieces[0].within(0)}+{pieces[1].within(1)}", 0, reads)
    if name in "*/":
        return _Piece(f"{pieces[0].within(1)}{name}{pieces[1].within(2)}", 1, reads)
    return _Piece(_applied(dialect, name, pieces), 2, reads)


# A chain gone through in expressions; `walk` says what is computed, here it is noted.


class SymbolicChain(NamedTuple):
    """A chain at coordinates that are expressions."""

    T: Any
    """Pose of its end, (4, 4)."""
    axes: Any
    """Of each joint, by its coordinate: (coordinates, 3)."""
    origins: Any
    frames: list[Any]
    """Where each error frame begins, (4, 4)."""
    slides: tuple[bool, ...]

    def columns(self, point: Any, *, angular: bool = True) -> Any:
        """Movement of a point of the end for each coordinate: (6 or 3, coordinates), as `walk.columns`."""
        along = np.cross(self.axes, point - self.origins)
        slides = np.array(self.slides)[:, None]
        rows = np.where(slides, self.axes, along)
        return (np.concatenate([rows, np.where(slides, 0.0, self.axes)], axis=1) if angular else rows).T


def trace(chain: Chain, s: Any, e: Float[np.ndarray, "frames 6"]) -> SymbolicChain:
    """Go through a chain.

    Args:
        chain: the chain.
        s: its coordinates, expressions.
        e: values of its error frames, metres and radians.
    """
    T = np.eye(4).astype(object)
    axes, origins = np.zeros((2, len(s), 3)).astype(object)
    slides, frames = [False] * len(s), list[Any]()
    errors = error_transform(e)
    for kind, number in zip(chain.kind, chain.index, strict=True):
        if kind == FIXED:
            T = T @ np.vstack([chain.fixed[number], [0.0, 0.0, 0.0, 1.0]])
        elif kind == ERROR_FRAME:
            frames.append(T)
            T = T @ errors[number]
        else:
            axes[number], origins[number], slides[number] = T[:3, 2], T[:3, 3], kind != REVOLUTE
            moved = np.eye(4).astype(object)
            if kind == REVOLUTE:
                cosine, sine = s[number].cos(), s[number].sin()
                moved[:2, :2] = [[cosine, -sine], [sine, cosine]]
            else:
                moved[2, 3] = s[number]
            T = T @ moved
    return SymbolicChain(T, axes, origins, frames, tuple(slides))
