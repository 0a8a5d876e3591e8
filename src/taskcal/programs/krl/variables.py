"""What code has assigned to variables, as far as the text tells it: constants are followed from line to line.

A variable of which nothing is known here has the value of its data list, if no line of the program ever changes it: the
controller keeps data lists from one run to the next.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from taskcal.programs.krl.cursor import split_at_commas
from taskcal.programs.krl.data import Data
from taskcal.programs.krl.expressions import Real, Value, evaluated, is_whole, name_of, structure, values_of
from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.position import pose_values
from taskcal.programs.krl.syntax import Aggregate, Assignment, Reference
from taskcal.programs.program import Frame
from taskcal.programs.unresolved import Unresolved


@dataclass(frozen=True, kw_only=True)
class Lost:
    """The value of a variable that code has assigned, and that the text does not give."""

    reason: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Adjustable:
    """A value that code has assigned, and that comes from a data list: it decides nothing."""

    value: Value
    reason: str


Holding = Value | Lost | Adjustable
"""What a variable holds."""

Variables = Mapping[str, Holding]
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
    real_numbers: frozenset[str]
    """Declared as REAL, and nowhere as INT."""
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
    here: Aggregate | None = None
    """The position of the robot, where it is known and of consequence."""
    held: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    """$TOOL and $BASE, where they are known and stand still."""
    deciding: bool = False
    """The value chooses a way: what data lists state does not, since an operator may set it by hand."""

    def assigned(self, name: str) -> Value | None:
        """What code has assigned to a variable or an element; None where nothing was, or nobody knows.

        Raises:
            Unresolved: something was that the text does not give.
        """
        variable, bracket, index = name.partition("[")
        key = self.names.key(variable)
        value = self.variables.get(f"{key}{bracket}{index}")
        if value is None and bracket and isinstance(whole := self.variables.get(key), Lost):
            value = whole
        if isinstance(value, Lost):
            raise Unresolved(value.reason)
        if isinstance(value, Adjustable):
            if self.deciding:
                raise Unresolved(value.reason)
            return value.value
        return value

    def value(self, name: str) -> Value:
        """The value of a variable or an element.

        Raises:
            Unresolved: the text does not tell.
        """
        if name in ("$NULLFRAME", "$WORLD"):
            return ZERO
        if name in HERE:
            return self.here if self.here is not None and name == "$POS_ACT" else name
        value = self.assigned(name)
        if value == "$POS_ACT" and self.here is not None:
            return self.here
        if value is None:
            value = self.data.number(name, self.names.module, self.names.routine)
            if value is not None:
                self._decided_by(name)
        if isinstance(value, float) and name.partition("[")[0] in self.names.real_numbers:
            return Real(value)
        if value is not None:
            return value
        if name in self.held:
            self._decided_by(name)
            return structure("FRAME", dict(pose_values(self.held[name].T)))
        aggregate = self.data.find(name, self.names.module, self.names.routine).aggregate
        self._decided_by(name)
        return structure(aggregate.type, values_of(aggregate))

    def _decided_by(self, name: str) -> None:
        """Let no way be chosen by what a data list states.

        Raises:
            Unresolved: one would be.
        """
        if self.deciding:
            raise Unresolved(
                f"{name} is in a data list, where an operator may set it, so that nothing is decided by it"
            )


def given_by(words: Sequence[Word], known: Known) -> Holding:
    """What an expression gives."""
    try:
        value = evaluated(words, known)
    except Unresolved as trouble:
        return Lost(reason=str(trouble))
    try:
        evaluated(words, replace(known, deciding=True))
    except Unresolved as trouble:
        return Adjustable(value=value, reason=str(trouble))
    return value


def after_assignment(known: Known, line: Assignment, returned: Holding | None = None) -> Variables:
    """Variables behind an assignment.

    Args:
        known: what is known before it, and behind the functions that it calls.
        line: the assignment.
        returned: the value, where a function of the program gives it.
    """
    variables, variable = known.variables, line.variable
    key = known.names.key(variable)
    element = element_assigned(known, line)
    if element is None:
        trouble = f"which element of {variable} is set before it is known only at run time"
        return {**forgotten(variables, [key]), key: Lost(reason=trouble)}
    if key in known.names.volatile:
        return _without(variables, element)
    value = _assigned(known, line, f"{variable}{element[len(key) :]}", line.component, returned)
    return _holding(variables, element, value)


def element_assigned(known: Known, line: Assignment) -> str | None:
    """Key of what a line assigns, with the index of an element as a number; None where which one is not known."""
    key = known.names.key(line.variable)
    try:
        return key if line.index is None else f"{key}{_element(line.index, known)}"
    except Unresolved:
        return None


def _assigned(known: Known, line: Assignment, name: str, component: str, returned: Holding | None) -> Holding:
    """What a line makes of a variable or an element."""
    given = given_by(line.words, known) if returned is None else returned
    if isinstance(given, Lost):
        return given
    value = given.value if isinstance(given, Adjustable) else given
    reason = given.reason if isinstance(given, Adjustable) else ""
    if component:
        old = known.variables.get(f"{known.names.key(line.variable)}{name[len(line.variable) :]}")
        reason = reason or (old.reason if isinstance(old, Adjustable) else "")
        held = _with_component(known, name, component, value)
    else:
        held = _whole(known, name, value)
    return Adjustable(value=held, reason=reason) if reason and not isinstance(held, Lost) else held


def _with_component(known: Known, name: str, component: str, value: Value) -> Value | Lost:
    """A structure with one component that is assigned."""
    try:
        before = known.value(name)
    except Unresolved as trouble:
        return Lost(reason=str(trouble))
    if not isinstance(before, Aggregate) or isinstance(value, Aggregate) or "." in component:
        return Lost(reason=f"what {name}.{component} is set to is not evaluated")
    values = {**values_of(before), component: str(value).upper() if isinstance(value, bool) else value}
    return structure(before.type, values)


def _whole(known: Known, name: str, value: Value) -> Value | Lost:
    """A value as a variable holds it that is assigned as a whole."""
    if isinstance(value, Aggregate):
        return value if is_whole(value) else Lost(reason=f"{name} keeps components of before")
    if name.partition("[")[0] in known.names.whole_numbers and isinstance(value, float) and not value.is_integer():
        return Lost(reason=f"{name} is INT and set to {value:g}, which the controller rounds")
    return float(value) if isinstance(value, Real) else value  # what it then is, its declaration says


def bound(known: Known, line: Iterable[tuple[str, tuple[Word, ...]]], names: Names) -> Variables:
    """Variables at the start of a routine that is called: its parameters have the values that they are given.

    Args:
        known: what is known where it is called.
        line: its parameters with what the call gives for each.
        names: of the routine.
    """
    variables = {key: value for key, value in known.variables.items() if not key.startswith(names.prefix)}
    for parameter, words in line:
        if not words:
            continue  # left out: what it then holds, VARSTATE asks
        given = given_by(words, known)
        if isinstance(given, str) and given in HERE:
            continue
        variables[names.key(parameter)] = _as_declared(given, parameter, names)
    return variables


def _as_declared(given: Holding, parameter: str, names: Names) -> Holding:
    """What a parameter holds that is given something."""
    if isinstance(given, Lost):
        return given
    value = given.value if isinstance(given, Adjustable) else given
    if isinstance(value, float) and not value.is_integer() and parameter in names.whole_numbers:
        return Lost(reason=f"{parameter} is INT and given {value:g}")
    value = float(value) if isinstance(value, Real) else value
    return replace(given, value=value) if isinstance(given, Adjustable) else value


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


def _without(variables: Variables, element: str) -> dict[str, Holding]:
    """Without a variable with all its elements, or one element."""
    out = dict(variables)
    array, bracket, _ = element.partition("[")
    for key in [] if bracket else [key for key in out if key.startswith(f"{element}[")]:
        del out[key]
    out.pop(element, None)
    out.pop(array, None)
    return out


def _holding(variables: Variables, element: str, value: Holding) -> Variables:
    """Where a variable, or one element, holds a value."""
    out = _without(variables, element)
    out[element] = value
    return out


def _element(index: tuple[Word, ...], known: Known) -> str:
    """An index in brackets, as numbers.

    Raises:
        Unresolved: it is not known.
    """
    reference = Reference(name="", start=0, end=0, index=split_at_commas(index))
    return name_of(reference, known)
