"""What routines are given by value, and what they may change of their caller's."""

from collections.abc import Iterable, Mapping

from taskcal.programs.krl.syntax import Begin, Call, Statement


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
