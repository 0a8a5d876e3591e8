"""What calls of KRL routines are given, and what they give back."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.parameters import handed_over, whole_call
from taskcal.programs.krl.routines import Routine
from taskcal.programs.krl.variables import HERE, Adjustable, Names, Variables, forgotten, without_own


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """A call of a routine."""

    name: str
    """In capitals."""
    words: tuple[tuple[Word, ...], ...]
    """What each parameter is given."""
    handed: tuple[str, ...]
    """Variables that it may change, because they are not given by value."""


def function_called(
    words: Sequence[Word], routines: Container[str], by_value: Mapping[str, tuple[bool, ...]]
) -> Arguments | None:
    """The function of the program whose value is all of an expression; None where it is anything else."""
    called = whole_call(words)
    if called is None or called.name not in routines:
        return None
    return Arguments(name=called.name, words=called.arguments, handed=handed_over(called, by_value))


def behind_call(
    call: Arguments, routine: Routine, variables: Variables, names: Names, changed: Container[str]
) -> Variables:
    """Variables of the caller behind a call: those that it handed over as a whole hold what the parameters held at the end.

    Args:
        call: the call.
        routine: what is called.
        variables: behind its last line.
        names: of the caller.
        changed: keys of variables that the routine changes under their own names.
    """
    back = forgotten(without_own(variables, routine.prefix), map(names.key, call.handed))
    for parameter, words in zip(routine.parameters, call.words, strict=False):
        if len(words) != 1 or call.handed.count(words[0].upper) != 1:
            continue
        key, value = names.key(words[0].upper), variables.get(f"{routine.prefix}{parameter}")
        if value is None or key in changed or key in names.volatile or (isinstance(value, str) and value in HERE):
            continue
        plain = value.value if isinstance(value, Adjustable) else value
        if isinstance(plain, float) and not plain.is_integer() and words[0].upper in names.whole_numbers:
            continue
        back = {**back, key: value}
    return back
