"""The grammar of KRL: words, lines and blocks, as far as they matter for where the robot goes; other lines are passed over."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise, starmap
from math import isfinite
from sys import intern
from typing import NamedTuple

from robot_programs.core import kit
from robot_programs.core.kit import Token, Words, opens, parted
from robot_programs.core.program import MotionKind, Unresolved

# The words of KRL, line by line; comments and file headers have none.

# KRL is ASCII outside of comments and strings; whatever else occurs is one symbol, so that every text has words.
_WORD = re.compile(
    r"""
    (?P<space>  [ \t\r\f\v\xa0\ufeff]+ | ;.* )
  | (?P<number> (?: [0-9]+ (?: \.[0-9]* )? | \.[0-9]+ ) (?: [Ee][+-]?[0-9]+ )? )
  | (?P<name>   [A-Za-z_$] [A-Za-z0-9_$]* )
  | (?P<enum>   \# [A-Za-z_] [A-Za-z0-9_]* )
  | (?P<string> "[^"]*" | '[^']*' )
  | (?P<symbol> == | <> | <= | >= | . )
    """,
    re.VERBOSE,
)


def lines_of_words(text: str) -> Iterator[list[Token]]:
    """The words of every line that has some."""
    start = 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        words = words_of(text, start, end)
        if words and not text.startswith("&", start):
            yield words
        start = end + 1


def words_of(text: str, start: int, end: int) -> list[Token]:
    """The words of a part of a text, in one line."""
    return list(kit.words(_WORD, text[start:end], start))


def bit_string(text: str) -> float | None:
    """The number that a bit string such as ``'B1010'`` or ``'HFF'`` means, in capitals; None where it is none."""
    digits, base = text[2:-1], {"'B": 2, "'H": 16}.get(text[:2])
    if base is None or not digits or len(digits) > 32 or not set(digits) <= set("0123456789ABCDEF"[:base]):
        return None
    return float(int(digits, base))


POINT_MOTIONS: Mapping[str, MotionKind] = {
    "PTP": "joint", "SPTP": "joint", "LIN": "linear", "SLIN": "linear", "CIRC": "circular", "SCIRC": "circular",
    "SPL": "linear", "PTP_REL": "joint", "SPTP_REL": "joint", "LIN_REL": "linear", "SLIN_REL": "linear",
    "CIRC_REL": "circular", "SCIRC_REL": "circular",
}  # fmt: skip
"""Motions to one point, or through one to another."""

RELATIVE_MOTIONS = frozenset(word for word in POINT_MOTIONS if word.endswith("_REL"))
"""Motions by a distance."""

OTHER_MOTIONS = frozenset({"SPL_REL"})
"""Motions that are not read."""

FRAMES_OF_DISTANCES = frozenset({"#BASE", "#TOOL"})
"""Behind a motion by a distance: along whose axes it is."""


class Field(NamedTuple):
    """A component of a structure, such as ``X 12.5``."""

    name: str
    """In capitals."""
    start: int
    """First character of its value."""
    end: int
    text: str
    """Its value as written, words that no symbol parts with a blank between them."""
    value: float | None
    """None where it is not a number."""
    touches: bool
    """No blank stands before the value."""
    words: Sequence[Token] = ()
    """Its value; none where it is a number, which long programs are made of."""


class Aggregate(NamedTuple):
    """Values in braces, such as ``{E6POS: X 12.5, Y 0}``."""

    type: str
    """As written before the colon, in capitals; empty without."""
    fields: Sequence[Field]
    start: int
    end: int


class Operand(NamedTuple):
    """A point of a motion."""

    words: Sequence[Token]
    """None where its numbers are stated: long programs have little else."""
    start: int
    end: int
    stated: Aggregate | None = None
    """All of it, if that is a structure of numbers."""


@dataclass(frozen=True, kw_only=True, slots=True)
class KrlLine:
    """A line of no consequence, and what all lines have."""

    start: int
    """First character."""
    end: int
    """Behind the last character, a comment not included."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Begin(KrlLine):
    """Start of a routine or data list."""

    name: str
    """In capitals."""
    parameters: tuple[str, ...] = ()
    """What the routine is given, in capitals."""
    by_value: tuple[bool, ...] = ()
    """Of each, whether it is given by value, so that the caller's own variable stays."""


@dataclass(frozen=True, kw_only=True, slots=True)
class End(KrlLine):
    """End of a routine or data list."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Declared:
    """A variable in a declaration."""

    name: str
    """In capitals; of an array without its size."""
    words: tuple[Token, ...]
    """The value with which it starts; none without."""
    start: int
    """First character of the name."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Declaration(KrlLine):
    """Variables of one type."""

    type: str
    shared: bool
    """Declared GLOBAL."""
    variables: tuple[Declared, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Assignment(KrlLine):
    """A value for a variable."""

    name: str
    """Of what is assigned, in capitals, with index and components: ``$VEL.CP``, ``TOOL_DATA[1]``."""
    variable: str
    """The variable itself."""
    index: tuple[Token, ...] | None
    """Of an element: what stands between the brackets."""
    component: str
    """Of a structure, in capitals; empty where all of it is assigned."""
    words: tuple[Token, ...]
    """The value."""

    @property
    def text(self) -> str:
        """The value as written, in capitals and without blanks."""
        return joined(self.words)


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionLine(KrlLine):
    """A motion instruction."""

    keyword: str
    """In capitals."""
    operands: tuple[Operand, ...]
    passing: tuple[str, ...]
    """Its words for passing by, such as ``C_DIS``."""
    settings: dict[str, tuple[Token, ...]] = field(default_factory=dict[str, tuple[Token, ...]])
    """What it sets for itself behind WITH."""
    angle: tuple[Token, ...] = ()
    """Of an arc: the angle CA at which it ends, on the circle through its points."""
    along: str = ""
    """Of a motion by a distance: along whose axes, ``#BASE`` or ``#TOOL``; empty where it does not say."""
    trouble: str = ""
    """What is not understood of it; empty where all is."""
    words: tuple[Token, ...] = ()
    """What stands behind the keyword, if functions are called there."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Call(KrlLine):
    """A call of a routine."""

    name: str
    """In capitals."""
    arguments: tuple[tuple[Token, ...], ...]

    @property
    def command(self) -> str:
        """The first argument, in capitals."""
        return joined(self.arguments[0])


@dataclass(frozen=True, kw_only=True, slots=True)
class Beside(KrlLine):
    """A line of an action that runs beside the lines after it: an interrupt, a TRIGGER or a cyclic analog signal."""

    keyword: str
    """INTERRUPT, TRIGGER, ANIN or ANOUT."""
    verb: str
    """DECL, ON or OFF; a TRIGGER is ON."""
    number: tuple[Token, ...]
    """Expression of the interrupt's number, empty for all; words of the analog signal."""
    shared: bool
    """Declared GLOBAL."""
    action: KrlLine | None = None
    """The call or the assignment of DECL, TRIGGER and ANIN ON."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Control(KrlLine):
    """A line that steers where the program goes on, by its first word; ``LABEL`` for a label."""

    keyword: str
    words: tuple[Token, ...] = ()
    """What stands behind it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Counting(Control):
    """The head of a FOR."""

    counter: Token | None
    """None where it has no words."""
    bounds: tuple[tuple[Token, ...], ...]
    """First and last count, and the step if it is stated; none where they are not understood."""


# Parts of a line: structures, points, and what WITH sets.

PASSING = {"C_PTP", "C_DIS", "C_VEL", "C_ORI", "C_SPL"}
_BEHIND_OPERANDS = (",", *PASSING, *FRAMES_OF_DISTANCES, "WITH")
QUOTES = frozenset("'\"")


def joined(words: Iterable[Token]) -> str:
    """Words as one, in capitals."""
    return "".join(word.upper for word in words)


def structure(line: Words) -> Aggregate:
    """Read values in braces.

    Raises:
        Unresolved: they are none.
    """
    opening, kind, fields = line.take(), "", dict[str, Field]()
    if line.next.kind == "name" and line.behind_next.text == ":":
        kind = line.take().upper
        line.take()
    while not line.accept("}"):
        field = _field(line)
        if field.name in fields:
            raise line.problem(f"the component {field.name} is stated twice")
        fields[field.name] = field
        if not line.accept(",") and not line.at("}"):
            raise line.problem("a structure is not understood")
    return Aggregate(type=kind, fields=tuple(fields.values()), start=opening.start, end=line.end)


def _field(line: Words) -> Field:
    name = line.take()
    start, found = line.number, line.words
    number = start + line.at("+", "-")
    if number + 1 < len(found) and found[number].kind == "number" and found[number + 1].text in (",", "}"):
        line.number = number + 1  # nearly all
        behind, words, odd = name.end, found[start : number + 1], False
    else:
        if line.accept("["):
            line.taken_to("]")
            line.accept("]")
        behind, words = line.end, line.taken_to(",", "}")
        # a quote that is a word has no other end
        odd = line.done or not words or not QUOTES.isdisjoint([word.text for word in words])
    if odd or name.kind != "name":
        raise line.problem(f"the component {name.text} is not understood")
    value, first = number_of(words), words[0]
    text = first.text if len(words) == 1 else first.text + "".join(starmap(_joined_behind, pairwise(words)))
    return Field(
        name=intern(name.upper), start=first.start, end=words[-1].end, text=text, value=value,
        touches=behind == first.start, words=words if value is None else (),
    )  # fmt: skip


def _joined_behind(before: Token, word: Token) -> str:
    """A word with the blank before it where no symbol parts it from the one before."""
    return word.text if "symbol" in (before.kind, word.kind) else f" {word.text}"


def number_of(words: Sequence[Token]) -> float | None:
    """The number that words are: with a sign or without, or a bit string such as ``'B1010'``; None where they are none."""
    if len(words) == 1 and words[0].kind == "string":
        return bit_string(words[0].upper)
    if not 0 < len(words) < 3 or words[-1].kind != "number" or (len(words) == 2 and words[0].text not in ("+", "-")):
        return None
    value = float(words[-1].text) * (-1.0 if words[0].text == "-" else 1.0)
    return value if isfinite(value) else None


def value_of(words: Sequence[Token]) -> Aggregate | float | bool | None:
    """The structure, number or truth value that words are; None where they are none."""
    match [word.upper for word in words[:2]]:
        case ["{", *_]:
            line = Words(words)
            with suppress(Unresolved):
                found = structure(line)
                return found if line.done else None
            return None
        case ["TRUE" | "FALSE" as truth]:
            return truth == "TRUE"
        case _:
            return number_of(words)


def _operand(line: Words) -> Operand:
    """A structure of numbers, or words up to what may stand behind a point."""
    start = line.number
    if line.at("{"):
        with suppress(Unresolved):
            found = structure(line)
            ends = line.done or line.at(*_BEHIND_OPERANDS)
            if ends and all(one.value is not None for one in found.fields):
                return Operand(words=(), start=found.start, end=found.end, stated=found)
    line.number = start
    words = line.taken_to(*_BEHIND_OPERANDS)
    none = line.words[-1].end
    return Operand(words=words, start=words[0].start if words else none, end=words[-1].end if words else none)


def _settings(line: Words) -> dict[str, tuple[Token, ...]]:
    """Assignments behind WITH, by the name of what they set."""
    out: dict[str, tuple[Token, ...]] = {}
    while not line.done and not line.at(*PASSING):
        name = joined(line.taken_to("=", *PASSING))
        line.accept("=")
        out[name] = line.taken_to(",", *PASSING)
        line.accept(",")
    return out


def split_at_commas(words: Sequence[Token]) -> tuple[tuple[Token, ...], ...]:
    """Words between commas that are in no bracket."""
    return tuple(map(tuple, parted(words, ",")))


def closing(words: Sequence[Token]) -> int:
    """Position at which the bracket closes with which words begin; behind the last one where it does not."""
    depth = 0
    for i, word in enumerate(words):
        depth += opens(word)
        if depth == 0:
            return i
    return len(words)


def arguments_of(words: Sequence[Token]) -> tuple[tuple[Token, ...], ...]:
    """Arguments between the commas of a pair of parentheses; one without words where there is none."""
    return split_at_commas(words[1 : closing(words)])


# From the words of a file to its statements: declarations, assignments, calls and motions.

BLOCKS = {
    "IF": "ENDIF", "FOR": "ENDFOR", "WHILE": "ENDWHILE", "REPEAT": "UNTIL", "LOOP": "ENDLOOP", "SWITCH": "ENDSWITCH",
    "SPLINE": "ENDSPLINE", "PTP_SPLINE": "ENDSPLINE",
}  # fmt: skip
"""What opens a block, and what closes it."""

_STEERING = {*BLOCKS, *BLOCKS.values(), "ELSE", "CASE", "DEFAULT", "GOTO", "EXIT", "RETURN", "RESUME"}
_HARMLESS = {
    "WAIT", "EXT", "EXTFCT", "EXTP", "EXTFCTP", "IMPORT", "SIGNAL", "ENUM", "STRUC", "PULSE", "HALT", "BRAKE",
    "CONTINUE", "ASYPTP", "ASYCONT", "ASYSTOP", "CONST_VEL", "TIME_BLOCK", "STOP", "CHANNEL",
}  # fmt: skip
_BESIDE = {"INTERRUPT", "TRIGGER", "ANIN", "ANOUT"}
_VERBS = {"ON": "ON", "ENABLE": "ON", "OFF": "OFF", "DISABLE": "OFF"}
_OPERATORS = {"AND", "OR", "EXOR", "NOT", "B_AND", "B_OR", "B_EXOR", "B_NOT"}
_BY_VALUE = {"ABS", "SQRT", "SIN", "COS", "TAN", "ACOS", "ATAN2", "INV_POS", "VARSTATE", "EK", "LK", "EB"}
"""Functions of the controller, which change nothing that they are given."""
_TYPES = {"INT", "REAL", "BOOL", "CHAR", "FRAME", "POS", "E3POS", "E6POS", "AXIS", "E3AXIS", "E6AXIS"}
"""Types that need no DECL before them (KUKA System Software, declaration of variables)."""
_ENDS = {"END", "ENDFCT", "ENDDAT"}
_BEGINS = {"DEF", "DEFFCT", "DEFDAT"}


def parse(text: str, read: set[str] | None = None) -> list[KrlLine]:
    """The statements of a file, in order.

    Args:
        text: the file.
        read: names that the lines read are added here.
    """
    statements: list[KrlLine] = []
    for words in lines_of_words(text):
        statements.append(_statement(words))
        if read is not None:
            assigns = len(words) > 1 and words[1].text in ("=", "[", ".") and words[0].kind == "name"
            read.update([word.text.upper() for word in words[assigns:] if word.kind == "name"])
    return statements


def _statement(words: list[Token]) -> KrlLine:
    span = {"start": words[0].start, "end": words[-1].end}
    shared = declares = False
    while len(words) > 1 and words[0].upper in {"GLOBAL", "DECL", "CONST"}:
        shared, declares = shared or words[0].upper == "GLOBAL", True
        words = words[1:]
    first = words[0]
    keyword = first.upper
    if first.kind != "name" or keyword in _HARMLESS:
        return KrlLine(**span)
    if keyword in _BESIDE:
        return _beside(words, shared)
    if keyword in _BEGINS:
        names = [word for word in words[1:] if word.kind == "name"]
        chosen = names[min(len(names) - 1, 1 if keyword == "DEFFCT" else 0)] if names else first
        given = _parameters(words)
        parameters, by_value = tuple(name for name, _ in given), tuple(value for _, value in given)
        return Begin(**span, name=chosen.upper, parameters=parameters, by_value=by_value)
    if keyword in _ENDS:
        return End(**span)
    if keyword in POINT_MOTIONS or keyword in OTHER_MOTIONS or [word.text for word in words[1:2]] == ["{"]:
        return _motion(words)
    if keyword == "FOR":
        counter, bounds = words[1] if len(words) > 1 else None, _bounds(words[1:])
        return Counting(**span, keyword=keyword, words=tuple(words[1:]), counter=counter, bounds=bounds)
    if keyword in _STEERING:
        return Control(**span, keyword=keyword, words=tuple(words[1:]))
    if len(words) == 2 and words[1].text == ":":
        return Control(**span, keyword="LABEL", words=(first,))
    if len(words) > 1 and words[1].kind == "name" and (declares or keyword in _TYPES):
        return _declaration(words, shared)
    if len(words) > 1 and words[1].kind != "symbol":
        return _motion(words)
    if len(words) > 1 and words[1].text == "(":
        return Call(**span, name=keyword, arguments=arguments_of(words[1:]))
    return _assignment(words)


def _bounds(words: Sequence[Token]) -> tuple[tuple[Token, ...], ...]:
    """Between what words a FOR counts, and by which step."""
    upper = [word.upper for word in words]
    if len(words) < 5 or upper[1] != "=" or "TO" not in upper:
        return ()
    to, by = upper.index("TO"), upper.index("STEP") if "STEP" in upper else len(words)
    return tuple(words[2:to]), tuple(words[to + 1 : by]), *([tuple(words[by + 1 :])] if by < len(words) else [])


def _beside(words: list[Token], shared: bool) -> Beside:
    upper = [word.upper for word in words]
    keyword, verb, number, action = upper[0], "".join(upper[1:2]), words[2:], None
    if keyword in ("ANIN", "ANOUT"):
        action = _assignment(number) if verb == "ON" and number else None
    elif keyword == "TRIGGER" or "DECL" in upper:
        first = upper.index("DECL") + 1 if "DECL" in upper else len(words)
        number = words[first : upper.index("WHEN", first)] if "WHEN" in upper[first:] else words[first:]
        verb = "ON" if keyword == "TRIGGER" else "DECL"
        rest = words[upper.index("DO") + 1 :] if "DO" in upper else []
        action = _action(rest) if rest else None
    else:
        verb = _VERBS.get(verb, "")
    return Beside(
        start=words[0].start,
        end=words[-1].end,
        keyword=keyword,
        verb=verb,
        number=tuple(number),
        shared=shared,
        action=action,
    )


def _action(words: list[Token]) -> KrlLine:
    """The statement after DO, without its priority; a name alone is called."""
    words = words[: next((i for i, word in enumerate(words) if i and word.upper == "PRIO"), len(words))]
    if len(words) == 1 and words[0].kind == "name":
        return Call(start=words[0].start, end=words[0].end, name=words[0].upper, arguments=((),))
    return _statement(words)


def _assignment(words: list[Token]) -> KrlLine:
    start, end = words[0].start, words[-1].end
    equals = next((i for i, word in enumerate(words) if word.text == "="), None)
    if equals is None or equals + 1 == len(words):
        return KrlLine(start=start, end=end)
    index, component = _behind_name(words[1:equals])
    return Assignment(
        start=start,
        end=end,
        name=joined(words[:equals]),
        variable=words[0].upper,
        index=index,
        component=component,
        words=tuple(words[equals + 1 :]),
    )


def _behind_name(words: list[Token]) -> tuple[tuple[Token, ...] | None, str]:
    """Index and components of what is assigned to, such as ``[N].X``."""
    if not words or words[0].text != "[":
        return None, joined(words).removeprefix(".")
    end = closing(words)
    return tuple(words[1:end]), joined(words[end + 1 :]).removeprefix(".")


def _declaration(words: list[Token], shared: bool) -> Declaration:
    variables = [
        Declared(name=name.upper, words=_start_value(behind), start=name.start)
        for name, *behind in filter(None, parted(words[1:], ","))
        if name.kind == "name"
    ]
    return Declaration(
        start=words[0].start, end=words[-1].end, type=words[0].upper, shared=shared, variables=tuple(variables)
    )


def _start_value(words: Sequence[Token]) -> tuple[Token, ...]:
    """What stands behind the equals sign, which follows a name or its size."""
    equals = closing(words) + 1 if words and words[0].text == "[" else 0
    return tuple(words[equals + 1 :]) if [word.text for word in words[equals : equals + 1]] == ["="] else ()


def _motion(words: list[Token]) -> MotionLine:
    keyword = intern(words[0].upper)
    cursor = Words(words)
    cursor.take()
    operands, passing = [_operand(cursor)], list[str]()
    instead = "SPL to a complete point" if keyword in OTHER_MOTIONS else "PTP, LIN or CIRC, or DECL before a type"
    trouble = "" if keyword in POINT_MOTIONS else f"{keyword} is not read; write {instead}"
    arc, along, angle = keyword.removesuffix("_REL").endswith("CIRC"), "", tuple[Token, ...]()
    while cursor.accept(","):
        if arc and not angle and cursor.accept("CA"):
            cursor.accept("=")
            angle = cursor.taken_to(",", *PASSING, "WITH")
        else:
            operands.append(_operand(cursor))
    settings: dict[str, tuple[Token, ...]] = {}
    while not cursor.done:
        word = cursor.take()
        if word.upper in PASSING:
            passing.append(intern(word.upper))
        elif keyword in RELATIVE_MOTIONS and not (arc and word.upper == "#TOOL") and word.upper in FRAMES_OF_DISTANCES:
            along = word.upper
        elif word.upper == "WITH":
            settings = _settings(cursor)
        elif word.text != ",":
            trouble = trouble or f"'{word.text}' is not understood behind {keyword}"
    if keyword in POINT_MOTIONS and len(operands) != (2 if arc else 1):
        trouble = trouble or f"{keyword} is given {len(operands)} points"
    return MotionLine(
        start=words[0].start,
        end=words[-1].end,
        keyword=keyword,
        operands=tuple(operands),
        passing=tuple(passing),
        settings=settings,
        angle=angle,
        along=along,
        trouble=trouble,
        words=tuple(words[1:]) if any(word.text == "(" for word in words) else (),
    )


def _parameters(words: list[Token]) -> tuple[tuple[str, bool], ...]:
    """Names in the parentheses of a routine's head, such as ``(N :IN, P :OUT)``, and whether each is given by value."""
    opening = next((i for i, word in enumerate(words) if word.text == "("), len(words))
    groups = arguments_of(words[opening:])
    return tuple((group[0].upper, group[-1].upper == "IN") for group in groups if group and group[0].kind == "name")


SPLINES = {"SPLINE", "PTP_SPLINE"}
LOOPS = {"FOR", "WHILE", "REPEAT", "LOOP"}


# What routines are given by value, and functions that change nothing.


def given_by_value(lines: Iterable[KrlLine]) -> Mapping[str, tuple[bool, ...]]:
    """By name of a routine: which of its parameters are given by value; only where all routines of the name agree."""
    out: dict[str, tuple[bool, ...]] = {}
    for line in lines:
        if isinstance(line, Begin):
            same = out.setdefault(line.name, line.by_value)
            if same != line.by_value:
                out[line.name] = ()
    return out


def changes_nothing(function: str) -> bool:
    """Whether a function is one of the controller's that change nothing that they are given."""
    return function in _BY_VALUE or function in _OPERATORS


def is_call(words: Sequence[Token]) -> bool:
    """Whether an expression is a function and nothing else, with none in its arguments."""
    called = len(words) > 2 and words[0].kind == "name" and words[1].text == "("
    return called and closing(words[1:]) == len(words) - 2 and all(word.text != "(" for word in words[2:])
