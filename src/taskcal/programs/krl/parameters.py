"""What routines are given by value, and what they may change of their caller's."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.parser import arguments_of
from taskcal.programs.krl.syntax import Assignment, Begin, Call, Motion, Statement


def given_by_value(lines: Iterable[Statement]) -> Mapping[str, tuple[bool, ...]]:
    """By name of a routine: which of its parameters are given by value; only where all routines of the name agree."""
    out: dict[str, tuple[bool, ...]] = {}
    for line in lines:
        if isinstance(line, Begin):
            same = out.setdefault(line.name, line.by_value)
            if same != line.by_value:
                out[line.name] = ()
    return out


def handed_over(line: Call, by_value: Mapping[str, tuple[bool, ...]]) -> tuple[str, ...]:
    """Variables that a call may change: those given to parameters that are not by value, or to functions on the way.

    A parameter that does not say how it is given may be changed (KUKA System Software, transfer of parameters).
    """
    modes = by_value.get(line.name, ())
    out: list[str] = []
    for i, words in enumerate(line.arguments):
        if i < len(modes) and modes[i] and not any(word.text == "(" for word in words):
            continue
        out += [word.upper for word in words if word.kind == "name"]
    return tuple(out)


def whole_call(words: Sequence[Word]) -> Call | None:
    """The function whose value is all of an expression; None where it is anything else."""
    if len(words) < 3 or words[0].kind != "name" or words[1].text != "(":
        return None
    depth = 0
    for i, word in enumerate(words[1:]):
        depth += (word.text == "(") - (word.text == ")")
        if depth == 0 and i + 2 < len(words):
            return None
    given = arguments_of(words[1:])
    if any(word.text == "(" for group in given for word in group):
        return None
    return Call(start=words[0].start, end=words[-1].end, name=words[0].upper, arguments=given)


def handed_in(line: Assignment, by_value: Mapping[str, tuple[bool, ...]]) -> tuple[str, ...]:
    """Variables that the functions in an assignment may change."""
    called = whole_call(line.words)
    return line.changed if called is None or called.name not in by_value else handed_over(called, by_value)


def handed_in_motion(line: Motion, by_value: Mapping[str, tuple[bool, ...]]) -> tuple[str, ...]:
    """Variables that the program's functions in a motion may change; the controller's own change nothing."""
    out: list[str] = []
    for i, (name, behind) in enumerate(pairwise(line.words)):
        if name.kind == "name" and behind.text == "(" and name.upper in by_value:
            given = arguments_of(line.words[i + 1 :])
            out += handed_over(Call(start=line.start, end=line.end, name=name.upper, arguments=given), by_value)
    return tuple(out)
