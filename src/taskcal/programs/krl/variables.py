"""What code has assigned to variables, as far as the text tells it: constants are followed from line to line.

A variable of which nothing is known here has the value of its data list, if no line of the program ever changes it: the
controller keeps data lists from one run to the next.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from taskcal.programs.krl.cursor import split_at_commas
from taskcal.programs.krl.data import Data
from taskcal.programs.krl.expressions import Value, evaluated, is_whole, name_of, structure, values_of
from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.syntax import Aggregate, Assignment, Reference
from taskcal.programs.unresolved import Unresolved

Variables = Mapping[str, Value]
"""Known values by key, see `Names.key`; an element has its index behind that: ``TOOL_DATA[3]``."""

HERE = ("$POS_ACT", "$AXIS_ACT", "$POS_ACT_MES", "$AXIS_ACT_MES", "$AXIS_ACT_MEAS", "$POS_ACT_MEAS")
"""Where the robot is."""

ZERO = structure("FRAME", dict.fromkeys(("X", "Y", "Z", "A", "B", "C"), 0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Names:
    """What names of variables mean in a routine."""

    prefix: str
    """Of keys of the routine's own variables."""
    routine: str
    module: str
    own: frozenset[str]
    """Declared in the routine, its parameters included."""
    listed: frozenset[str]
    """Declared in the data list of the module, for it alone."""
    whole_numbers: frozenset[str]
    """Declared as INT, in the routine or a data list."""
    volatile: frozenset[str]
    """Keys of variables that may change at any time: interrupts and the submit interpreter assign them."""

    def key(self, variable: str) -> str:
        """What a variable is called among all variables of the program."""
        if variable in self.own:
            return f"{self.prefix}{variable}"
        return f"{self.module}:{variable}" if variable in self.listed else variable


@dataclass(frozen=True, eq=False, kw_only=True)
class Known:
    """The values of variables at a line: what code has assigned, or else what the data lists say."""

    names: Names
    data: Data
    variables: Variables

    def assigned(self, name: str) -> Value | None:
        """What code has assigned to a variable or an element; None where that is not known, or nothing was."""
        variable, bracket, index = name.partition("[")
        return self.variables.get(f"{self.names.key(variable)}{bracket}{index}")

    def value(self, name: str) -> Value:
        """The value of a variable or an element.

        Raises:
            Unresolved: the text does not tell.
        """
        if name in ("$NULLFRAME", "$WORLD"):
            return ZERO
        if name in HERE:
            return name
        value = self.assigned(name)
        if value is not None:
            return value
        number = self.data.number(name, self.names.module)
        if number is not None:
            return number
        aggregate = self.data.find(name, self.names.module, self.names.routine).aggregate
        return structure(aggregate.type, values_of(aggregate))


def after_assignment(known: Known, line: Assignment) -> Variables:
    """Variables behind an assignment."""
    variables = forgotten(known.variables, (known.names.key(name) for name in line.changed))
    variable, index, component = _parts(line.left)
    key = known.names.key(variable)
    known = Known(names=known.names, data=known.data, variables=variables)
    try:
        element = key if index is None else f"{key}{_element(index, known)}"
    except Unresolved:
        return forgotten(variables, [key])
    value = _assigned(known, line, f"{variable}{element[len(key) :]}", component)
    if value is None or key in known.names.volatile:
        return _without(variables, element)
    return {**_without(variables, element), element: value}


def _assigned(known: Known, line: Assignment, name: str, component: str) -> Value | None:
    """What a line makes of a variable or an element; None where the text does not tell."""
    try:
        value = evaluated(line.words, known)
        if not component:
            if isinstance(value, Aggregate):
                return value if is_whole(value) else None
            whole = name.partition("[")[0] in known.names.whole_numbers
            rounded = whole and isinstance(value, float) and not value.is_integer()
            return None if rounded else value
        before = known.value(name)
    except Unresolved:
        return None
    if not isinstance(before, Aggregate) or isinstance(value, Aggregate) or "." in component:
        return None
    values = {**values_of(before), component: str(value).upper() if isinstance(value, bool) else value}
    return structure(before.type, values)


def bound(known: Known, line: Iterable[tuple[str, tuple[Word, ...]]], names: Names) -> Variables:
    """Variables at the start of a routine that is called: its parameters have the values that they are given.

    Args:
        known: what is known where it is called.
        line: its parameters with what the call gives for each.
        names: of the routine.
    """
    variables = {key: value for key, value in known.variables.items() if not key.startswith(names.prefix)}
    for parameter, words in line:
        try:
            value = evaluated(words, known)
        except Unresolved:
            continue
        if isinstance(value, str) and value in HERE:
            continue
        variables[names.key(parameter)] = value
    return variables


def forgotten(variables: Variables, keys: Iterable[str]) -> Variables:
    """Without some variables and their elements."""
    lost = set(keys)
    if not lost:
        return variables
    return {key: value for key, value in variables.items() if key.partition("[")[0] not in lost}


def without_own(variables: Variables, prefix: str) -> Variables:
    """Without a routine's own variables, behind its end."""
    return {key: value for key, value in variables.items() if not key.startswith(prefix)}


def without_places(variables: Variables) -> Variables:
    """Without variables that say where the robot is, behind a motion."""
    if not any(isinstance(value, str) and value in HERE for value in variables.values()):
        return variables
    return {key: value for key, value in variables.items() if not (isinstance(value, str) and value in HERE)}


def common(states: Iterable[Variables]) -> Variables:
    """What is the same after all of some ways through the program."""
    first, *others = states
    if all(other is first for other in others):
        return first
    return {k: v for k, v in first.items() if all(k in o and o[k] == v and type(o[k]) is type(v) for o in others)}


def _without(variables: Variables, element: str) -> Variables:
    """Without a variable with all its elements, or one element."""
    if "[" in element:
        array = element.partition("[")[0]
        return {key: value for key, value in variables.items() if key not in (element, array)}
    return forgotten(variables, [element])


def _parts(left: tuple[Word, ...]) -> tuple[str, tuple[Word, ...] | None, str]:
    """Variable, index and components of what is assigned to: ``P[N].X``."""
    rest = left[1:]
    index: tuple[Word, ...] | None = None
    if rest and rest[0].text == "[":
        depth, end = 0, len(rest)
        for i, word in enumerate(rest):
            depth += (word.text == "[") - (word.text == "]")
            if depth == 0:
                end = i
                break
        index, rest = rest[: end + 1], rest[end + 1 :]
    return left[0].upper, index, "".join(word.upper for word in rest).removeprefix(".")


def _element(index: tuple[Word, ...], known: Known) -> str:
    """An index in brackets, as numbers.

    Raises:
        Unresolved: it is not known.
    """
    reference = Reference(name="", start=0, end=0, index=split_at_commas(index[1:-1]))
    return name_of(reference, known)
