"""What code has assigned to variables, as far as the text tells it: constants are followed from line to line.

A variable of which nothing is known here has the value of its data list, if no line of the program ever changes it: the
controller keeps data lists from one run to the next.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from robot_programs.core import se3
from robot_programs.core.program import Frame, Unresolved
from robot_programs.core.values import FUNCTIONS, Lost, OperandReader, Operators, applied, operated
from robot_programs.krl.data import AXES, EXTERNAL, POSE, Data, Routine, has_pose, pose, pose_values
from robot_programs.krl.syntax import (
    Aggregate,
    Assignment,
    Cursor,
    Field,
    Reference,
    Word,
    bit_string,
    lines_of_words,
    split_at_commas,
)

# Expressions of KRL whose value the text alone gives: numbers, comparisons, frames and their products.


class Real(float):
    """A number that is REAL by the text, and not INT: its quotients are not cut off."""


Value = float | bool | str | Aggregate
"""A number, a truth value, an enumeration constant in capitals, or a structure."""

NUMBERS = frozenset({*POSE, *AXES, *EXTERNAL, "S", "T"})
"""Components of positions."""

_FUNCTIONS = {"ABS", "SQRT", "SIN", "COS", "TAN", "ACOS", "ATAN2"}
"""Functions of numbers that KRL has, angles in degrees (KUKA System Software, standard functions)."""


@runtime_checkable
class Lookup(Protocol):
    """Source of the values of variables."""

    def value(self, name: str) -> Value:
        """The value of a variable or an element, by its name in capitals with its index as a number.

        Raises:
            Unresolved: the text does not tell.
        """
        ...


def evaluated(words: Sequence[Word], lookup: Lookup) -> Value:
    """The value of an expression.

    Raises:
        Unresolved: the text does not give it.
    """
    reader = _Reader(words, lookup)
    value = reader.expression()
    if not reader.done:
        raise Unresolved(f"'{reader.take().text}' is not evaluated")
    return value


def number_of(words: Sequence[Word], lookup: Lookup) -> float:
    """The value of an expression that has to be a number.

    Raises:
        Unresolved: the text does not give it, or it is none.
    """
    value = evaluated(words, lookup)
    if isinstance(value, bool) or not isinstance(value, float) or not np.isfinite(value):
        raise Unresolved(f"'{''.join(word.text for word in words)}' is not a number")
    return float(value)


def structure(type_: str, values: dict[str, float | str]) -> Aggregate:
    """A structure that stands nowhere in the text."""
    fields = tuple(
        Field(
            name=name, text=str(value), value=None if isinstance(value, str) else value, start=0, end=0, touches=False
        )
        for name, value in values.items()
    )
    return Aggregate(type=type_, fields=fields, start=0, end=0)


def values_of(aggregate: Aggregate) -> dict[str, float | str]:
    """The components of a structure: numbers, or the text of what is none."""
    return {field.name: field.text.upper() if field.value is None else field.value for field in aggregate.fields}


def name_of(reference: Reference, lookup: Lookup) -> str:
    """The name of a variable or an element, its index as a number.

    Raises:
        Unresolved: which element is meant is not known from the text.
    """
    if not reference.index:
        return reference.name
    try:
        indices = [f"{number_of(words, lookup):g}" for words in reference.index]
    except Unresolved as trouble:
        variable = reference.name.partition("[")[0]
        raise Unresolved(f"which element of {variable} is meant is known only at run time: {trouble}") from None
    return f"{reference.name.partition('[')[0]}[{','.join(indices)}]"


def with_values(aggregate: Aggregate, lookup: Lookup) -> Aggregate:
    """A structure whose components are all numbers, as far as the text tells those that are written as expressions.

    Returns:
        The structure itself where it has no such components.
    """
    if all(stated.value is not None or stated.name not in NUMBERS for stated in aggregate.fields):
        return aggregate
    values = values_of(aggregate)
    for stated in aggregate.fields:
        if stated.value is None and stated.name in NUMBERS:
            try:
                values[stated.name] = number_of(next(lines_of_words(stated.text), []), lookup)
            except Unresolved as trouble:
                if stated.name in (*POSE, *AXES):
                    raise Unresolved(f"{stated.name} is '{stated.text}', and {trouble}") from None
    return structure(aggregate.type, values)


def product(left: Aggregate, right: Aggregate) -> Aggregate:
    """Product of two frames by the geometric operator: the right one, counted in the left; status and turn are the right one's.

    Raises:
        Unresolved: one is not a complete frame, or states external axes away from zero.
    """
    if any(part.value(name) for part in (left, right) for name in EXTERNAL):
        raise Unresolved("a frame with external axes is multiplied")
    if not has_pose(left) or not has_pose(right):
        raise Unresolved("both operands of ':' must be FRAME or POS")
    for value in (part.value(name) for part in (left, right) for name in POSE):
        _in_range(value or 0.0)
    values: dict[str, float | str] = dict(pose_values(pose(left) @ pose(right)))
    values |= {name: value for name in ("S", "T") if (value := right.value(name)) is not None}
    return structure(
        left.type if left.type == "$POS_ACT" else right.type, values
    )  # from where the robot is, it still is


def inverse(frame: Value) -> Aggregate:
    """Inverse of a frame by INV_POS: F : INV_POS(F) is the zero frame.

    Raises:
        Unresolved: it is not a complete frame, or states external axes away from zero.
    """
    if not isinstance(frame, Aggregate) or not has_pose(frame) or any(frame.value(name) for name in EXTERNAL):
        raise Unresolved("what INV_POS is given is not a frame alone")
    for name in POSE:
        _in_range(frame.value(name) or 0.0)
    return structure(frame.type, dict(pose_values(se3.inverse(pose(frame)))))


def is_whole(aggregate: Aggregate) -> bool:
    """Whether a structure states all components of a pose or all axes, if it states any: others then say all they mean."""
    for names in (POSE, AXES):
        stated = [name for name in names if aggregate.field(name)]
        if stated and (len(stated) < len(names) or any(aggregate.value(name) is None for name in stated)):
            return False
    return True


class _Reader(Cursor, OperandReader[Value]):
    """The words of an expression, from left to right, each operator applied as it is read."""

    # KUKA System Software, priority of operators
    BINDING: ClassVar = {
        "OR": 1, "EXOR": 2, "AND": 3, "==": 4, "<>": 4, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6, ":": 7,
    }  # fmt: skip
    PREFIXES: ClassVar = {"NOT": 8, "-": 8, "+": 8}

    def __init__(self, words: Sequence[Word], lookup: Lookup):
        super().__init__(words)
        self.lookup = lookup

    def take(self) -> Word:
        if self.done:
            raise Unresolved("an expression ends too early")
        return super().take()

    def expect(self, text: str) -> None:
        if not self.accept(text):
            raise Unresolved(f"'{text}' is missing in an expression")

    @property
    def place(self) -> int:
        return 0

    @property
    def sign(self) -> str:
        return self.next

    def problem(self, what: str) -> Unresolved:
        return Unresolved("an expression is nested too deeply")

    def grow(self, height: int) -> None:
        """Nothing is kept of what an expression contains."""

    def operation(self, start: int, sign: str, *operands: Value) -> Value:
        if sign == ":":
            left, right = operands
            if isinstance(left, Aggregate) and isinstance(right, Aggregate):
                return product(left, right)
            raise Unresolved("both operands of ':' must be FRAME or POS")
        value = operated(sign.lower(), operands, _OPERATORS)
        if isinstance(value, bool):
            return value
        real = isinstance(value, Real) or any(isinstance(one, Real) for one in operands)
        return Real(_in_range(value)) if real else _in_range(value)

    def single(self) -> Value:
        word = self.take()
        match word.kind, word.upper:
            case "number", text:
                value = _in_range(float(text))
                return value if text.isdecimal() else Real(value)
            case "enum", text:
                return text
            case "string", _ if (bits := bit_string(word.upper)) is not None:
                return bits
            case "symbol", "(":
                value = self.expression()
                self.expect(")")
                return value
            case "symbol", "{":
                return self._structure()
            case "name", "TRUE" | "FALSE":
                return word.upper == "TRUE"
            case "name", name:
                return self._variable(name)
            case _:
                raise Unresolved(f"'{word.text}' is not evaluated")

    def _variable(self, name: str) -> Value:
        if self.accept("("):
            return self._function(name)
        if self.accept("["):
            indices = [_index(self.expression())]
            while self.accept(","):
                indices.append(_index(self.expression()))
            self.expect("]")
            name = f"{name}[{','.join(indices)}]"
        value = self.lookup.value(name)
        while self.accept("."):
            value = _component(value, self.take().upper, name)
        return value

    def _function(self, name: str) -> Value:
        """One of KRL's own functions; those of the program are asked elsewhere."""
        if name == "INV_POS":
            frame = self.expression()
            self.expect(")")
            return inverse(frame)
        if name not in _FUNCTIONS:
            raise Unresolved(f"what {name}() gives is known only at run time")
        given = [_number(self.expression())]
        while len(given) < FUNCTIONS[name][0]:
            self.expect(",")
            given.append(_number(self.expression()))
        self.expect(")")
        return Real(_in_range(applied(name, given)))

    def _structure(self) -> Aggregate:
        type_ = ""
        if self.behind == ":":
            type_ = self.take().upper
            self.take()
        values: dict[str, float | str] = {}
        while not self.accept("}"):
            component = self.take().upper
            if self.next in ("[", "{") or component in values:
                raise Unresolved(f"the component {component} is not evaluated")
            value = self.expression()
            if isinstance(value, Aggregate):
                raise Unresolved(f"the component {component} is a structure")
            values[component] = str(value).upper() if isinstance(value, bool) else value
            if not self.accept(",") and self.next != "}":
                raise Unresolved("a structure is not understood")
        return structure(type_, values)


def _quotient(a: float, b: float) -> float:
    """Quotient of two numbers: of whole ones, which may be INT or REAL, it is cut off or not.

    Raises:
        Unresolved: the text does not tell which they are.
    """
    real = isinstance(a, Real) or isinstance(b, Real)
    if b == 0.0 or (not real and a / b != int(a / b) and a == int(a) and b == int(b)):
        raise Unresolved("a quotient of whole numbers depends on their type")
    return a / b


_OPERATORS: Operators = {("/", 2): _quotient}


def _in_range(value: float) -> float:
    if not abs(value) < 1e12:
        raise Unresolved("a number is out of any range")
    return value


def _number(value: Value) -> float:
    if isinstance(value, bool) or not isinstance(value, float):
        raise Unresolved("a number is expected where there is none")
    return value


def _index(value: Value) -> str:
    number = _number(value)
    if number != int(number) or not 0 < number < 1e6:
        raise Unresolved(f"{number:g} is not an index")
    return str(int(number))


def _component(value: Value, component: str, name: str) -> float | str:
    field = value.field(component) if isinstance(value, Aggregate) else None
    if field is None:
        raise Unresolved(f"{name}.{component} is not stated")
    if field.value is None:
        return field.text.upper()
    position = isinstance(value, Aggregate) and any(all(map(value.field, names)) for names in (POSE[:3], AXES))
    return Real(field.value) if position and component in (*POSE, *AXES, *EXTERNAL) else field.value


@dataclass(frozen=True, kw_only=True, slots=True)
class Adjustable:
    """A value that code has assigned, and that comes from a data list: it decides nothing."""

    value: Value
    reason: str


AbstractValue = Value | Lost | Adjustable
"""What a variable holds."""

Variables = Mapping[str, AbstractValue]
"""Known values by key, see `Names.key`; an element has its index behind that: ``TOOL_DATA[3]``."""

HERE = ("$POS_ACT", "$AXIS_ACT", "$POS_ACT_MES", "$AXIS_ACT_MES", "$AXIS_ACT_MEAS", "$POS_ACT_MEAS")
"""Where the robot is."""

ZERO = structure("FRAME", dict.fromkeys(("X", "Y", "Z", "A", "B", "C"), 0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Names:
    """Meaning of the names of variables in a routine."""

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

    @classmethod
    def of(cls, routine: Routine, data: Data, volatile: frozenset[str] = frozenset()) -> "Names":
        """Meaning of the names of variables in a routine."""
        return cls(
            prefix=routine.prefix,
            routine=routine.name,
            module=routine.file.module,
            own=routine.own,
            listed=data.listed.get(routine.file.module, frozenset()),
            whole_numbers=data.whole_numbers,
            real_numbers=data.real_numbers,
            volatile=volatile,
        )

    def key(self, variable: str) -> str:
        """Key of a variable among all variables of the program."""
        if variable in self.own:
            return f"{self.prefix}{variable}"
        return f"{self.module}:{variable}" if variable in self.listed else variable


@dataclass(frozen=True, eq=False, kw_only=True)
class Known:
    """The values of variables at a line: what code has assigned, or else what the data lists say."""

    names: Names
    data: Data
    variables: Variables
    place: Callable[[], Aggregate | None] = lambda: None
    """Finds the position of the robot, where it is known and of consequence."""
    frames: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    """$TOOL and $BASE, where they are known and stand still."""
    deciding: bool = False
    """The value chooses a way: what data lists state does not, since an operator may set it by hand."""

    @property
    def here(self) -> Aggregate | None:
        """The position of the robot, where it is known and of consequence."""
        return self.place()

    def assigned(self, name: str) -> Value | None:
        """Value that code has assigned to a variable or an element; None where nothing was, or nobody knows.

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
            return (self.here or name) if name == "$POS_ACT" else name
        value = self.assigned(name)
        if value == "$POS_ACT":
            return self.here or value
        if value is None:
            value = self.data.number(name, self.names.module, self.names.routine)
            if value is not None:
                self._decided_by(name)
        if isinstance(value, float) and name.partition("[")[0] in self.names.real_numbers:
            return Real(value)
        if value is not None:
            return value
        if name in self.frames:
            self._decided_by(name)
            return structure("FRAME", dict(pose_values(self.frames[name].T)))
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


def given_by(words: Sequence[Word], known: Known) -> AbstractValue:
    """Abstract value of an expression."""
    try:
        return evaluated(words, replace(known, deciding=True))
    except Unresolved as trouble:
        undecided = str(trouble)
    try:
        return Adjustable(value=evaluated(words, known), reason=undecided)
    except Unresolved as trouble:
        return Lost(reason=str(trouble))


def after_assignment(known: Known, line: Assignment, returned: AbstractValue | None = None) -> Variables:
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


def _assigned(
    known: Known, line: Assignment, name: str, component: str, returned: AbstractValue | None
) -> AbstractValue:
    """Abstract value that a line assigns to a variable or an element."""
    given = given_by(line.words, known) if returned is None else returned
    if isinstance(given, Lost):
        return given
    value = given.value if isinstance(given, Adjustable) else given
    reason = given.reason if isinstance(given, Adjustable) else ""
    if component:
        old = known.variables.get(f"{known.names.key(line.variable)}{name[len(line.variable) :]}")
        reason = reason or (old.reason if isinstance(old, Adjustable) else "")
        whole = _with_component(known, name, component, value)
    else:
        whole = _whole(known, name, value)
    return Adjustable(value=whole, reason=reason) if reason and not isinstance(whole, Lost) else whole


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


def _as_declared(given: AbstractValue, parameter: str, names: Names) -> AbstractValue:
    """Abstract value of a parameter that is given something."""
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


def of_both(one: AbstractValue | None, other: AbstractValue | None) -> AbstractValue | None:
    """A value that two ways give; None where they differ. It decides nothing where it comes from a data list in one of them."""
    if one is other or one is None:
        return one
    if isinstance(one, Adjustable):
        plain = other.value if isinstance(other, Adjustable) else other
        return one if of_both(one.value, plain) is not None else None
    if isinstance(other, Adjustable):
        return of_both(other, one)
    if isinstance(one, Aggregate) and isinstance(other, Aggregate):
        return one if one.type == other.type and values_of(one) == values_of(other) else None
    return one if one == other and type(one) is type(other) else None


def _without(variables: Variables, element: str) -> dict[str, AbstractValue]:
    """Without a variable with all its elements, or one element."""
    array, bracket, _ = element.partition("[")
    out = dict(variables) if bracket else {key: v for key, v in variables.items() if not key.startswith(f"{element}[")}
    out.pop(element, None)
    out.pop(array, None)
    return out


def _holding(variables: Variables, element: str, value: AbstractValue) -> Variables:
    """Variables with a value for one variable or element."""
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
