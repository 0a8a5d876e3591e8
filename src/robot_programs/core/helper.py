"""Targets that are corrected while a program runs: which may be, what is computed there, and how languages write it."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import NamedTuple

from robot_programs.core.flow import Leave, nodes_in, unread_in
from robot_programs.core.form import Ask, Assign, Do, Expression, Hole, Key, Line, Op, Ref, Routine, calls_in, parts_of
from robot_programs.core.source import Source

# Which data are made of which, and which come from where the robot stood.

MEASURED: Key = "where the robot stood"
"""In place of a datum: numbers of the nominal robot for where the true one stands."""


class Gift(NamedTuple):
    """A datum to which a line gives a value, and the data of which that is made."""

    routine: Routine
    line: Line
    to: Key
    of: frozenset[Key]


def returned(routine: Routine) -> Key:
    """What a function returns, as a datum."""
    return "what is returned", routine


def values_in(routine: Routine) -> Iterator[tuple[Line, Key, Expression]]:
    """Data to which lines give an expression: what they assign, parameters of what they call, and what the routine returns."""
    for line in routine.lines:
        if isinstance(line, Assign):
            yield line, line.target.key, line.value
        for call in calls_in(line):
            for one in call.routines:
                for key, value in zip(one.parameters, call.arguments, strict=False):
                    yield line, key, value
    for node in nodes_in(routine.all_nodes):
        if isinstance(node, Leave) and node.way == "return" and node.line is not None:
            for value in node.line.conditions:
                yield node.line, returned(routine), value


@dataclass(frozen=True, kw_only=True)
class Makings:
    """Of what the values of a language are made, whatever the order of the lines."""

    measures: Callable[[Expression], bool]
    """Whether an expression by itself says where the robot is or was."""
    operands: Mapping[str, int] = field(default_factory=dict[str, int])
    """Of operators, how many of the first operands make the value; the others choose among several."""

    def of(self, *expressions: Expression) -> Iterator[Key]:
        """Data of which expressions are made; `MEASURED` among them."""
        waiting = list(expressions)
        while waiting:
            one = waiting.pop()
            if self.measures(one):
                yield MEASURED
            match one:
                case Ref():
                    yield one.key
                case Ask():
                    yield from map(returned, one.routines)
                    yield from (ref.key for ref in one.changes)
                case Hole():
                    yield from (ref.key for ref in one.named)
                case _:
                    pass
            if isinstance(one, Ask) and one.routines:
                continue  # what is given counts as far as what is returned is made of it
            waiting += parts_of(one)[: self.operands.get(one.sign) if isinstance(one, Op) else None]

    def gifts(self, routines: Iterable[Routine]) -> Iterator[Gift]:
        """What the lines of some routines give; one that is not understood may return whatever its routine is given."""
        for routine in routines:
            for line, to, value in values_in(routine):
                yield Gift(routine, line, to, frozenset(self.of(value)))
            for line in unread_in(routine.all_nodes):
                yield Gift(routine, line, returned(routine), frozenset(routine.parameters))
            for line in routine.lines:
                for call in calls_in(line):
                    for back, given in _handed_back(call):
                        for to in self.of(given):
                            yield Gift(routine, line, to, frozenset({back}))


def _handed_back(call: Do | Ask) -> Iterator[tuple[Key, Expression]]:
    """Parameters that change what a call gives to them, and what it gives."""
    for routine in call.routines:
        for key, value in zip(routine.parameters, call.arguments, strict=False):
            if key in routine.returning:
                yield key, value


def measured(
    gifts: Iterable[Gift], sees: Callable[[Key, Routine, Routine], bool] = lambda key, by, other: True
) -> dict[Key, list[Gift]]:
    """By datum: what gives it a value that may come from where the robot stood.

    Args:
        gifts: of a program.
        sees: whether a routine may meet in a datum what another one gave it: the datum, that one, and the routine.
    """
    reading, found = defaultdict[Key, list[Gift]](list), defaultdict[Key, list[Gift]](list)
    for gift in gifts:
        for key in gift.of:
            reading[key].append(gift)
    waiting, seen = list(reading[MEASURED]), set[Gift]()
    while waiting:
        gift = waiting.pop()
        if gift not in seen:
            seen.add(gift)
            found[gift.to].append(gift)
            waiting += [one for one in reading[gift.to] if sees(gift.to, gift.routine, one.routine)]
    return found


# Modules that correct targets: what is computed there, and how languages write it.


class Dialect(NamedTuple):
    """How a language writes arithmetic."""

    number: Callable[[float], str]
    functions: Mapping[str, str]
    """By name of the expression; a format of the arguments."""
    variable: str
    """A format of its number, from 1 on."""
    assignment: str
    """A format of variable and value."""
    degrees: Mapping[str, str] | None = None
    """Where functions take and give degrees: inputs that are angles in radians, and what they are called in degrees."""


def single(value: float) -> str:
    """A number in the digits that single precision has."""
    text = f"{value:.9g}".upper()
    return text if any(mark in text for mark in ".E") else f"{text}.0"


def indented(lines: Iterable[str], by: int) -> str:
    """Lines behind so many blanks."""
    return "\n".join(" " * by + line for line in lines)


@dataclass(frozen=True, kw_only=True)
class Computed:
    """Lines of a language that compute something."""

    lines: Sequence[str]
    variables: int
    operations: int
    """Sums, products, quotients and functions."""


@dataclass(frozen=True, eq=False, kw_only=True)
class HelperModule:
    """A module that moves a target until the robot's joint positions there no longer change by it."""

    name: str
    function: str
    title: str
    robot: str
    shift: float
    """By which a target may be moved at most, metres."""
    turn: float
    """The same of its orientation, radians."""
    joint: float
    """By which a joint may move at most, radians."""
    usual_rounds: int
    rounds: int
    """Of the repetition, at most."""
    settled: float
    """Change of the shift, with that of half the turn on a lever, metres, at which it ends."""
    lever: float
    """Metres."""
    correction: Computed
    """Of the shift and the turn at joint positions."""

    def written(self, language: str, suffix: str, first: Source, words: Mapping[str, str], *, inside: bool) -> Source:
        """The module, as a file beside the first one of a program, or to be written into that.

        Args:
            language: whose folder has the text.
            suffix: of its file.
            first: file of the program.
            words: of the text, and what stands for them.
            inside: whether it has no file of its own.
        """
        known = {
            "MODULE": self.name, "FUNCTION": self.function, "TITLE": self.title, "OPERATIONS": str(self.correction.operations),
            "USUAL": str(self.usual_rounds), "ROUNDS": str(self.rounds), "VARIABLES": str(max(self.correction.variables, 1)),
            **words,
        }  # fmt: skip
        text = resources.files(f"robot_programs.{language}").joinpath(f"helper{suffix}").read_text(encoding="utf-8")
        for name, value in known.items():
            text = text.replace(f"@{name}@", value)
        path = first.path if inside else first.path.with_name(f"{self.name}{suffix}")
        return Source(path=path, text=text.replace("\n", first.newline), encoding="utf-8")
