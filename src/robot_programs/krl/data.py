"""What the files of a KRL program state: the points, frames and parameter sets that it names; its routines, and what these call."""

import re
from collections import defaultdict
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path

from robot_programs.core.flow import Effects, Thing, with_called
from robot_programs.core.form import Text
from robot_programs.core.program import Cause, MissingKind
from robot_programs.core.source import Place, Source
from robot_programs.core.values import Structure
from robot_programs.krl.syntax import (
    Assignment,
    Begin,
    Beside,
    Call,
    Control,
    Declaration,
    End,
    KrlLine,
    MotionLine,
    Token,
    given_by_value,
    lines_of_words,
    number_of,
    parse,
)
from robot_programs.krl.values import value_in
from taskcal_groundwork.errors import InputError, shown

# What the data lists of a KRL program state: points, frames, parameter sets and numbers.


@dataclass(frozen=True, eq=False, kw_only=True)
class KrlFile:
    """A file of a program."""

    number: int
    """Its place among the program's files."""
    source: Source
    statements: tuple[KrlLine, ...]
    read: frozenset[str] = frozenset()
    """Names of variables, and others, that its lines read."""

    @classmethod
    def of(cls, number: int, source: Source) -> "KrlFile":
        """The statements of a text."""
        read = set[str]()
        statements = tuple(parse(source.text, read))
        return cls(number=number, source=source, statements=statements, read=frozenset(read))

    @cached_property
    def module(self) -> str:
        """Name of the program to which it belongs: ``.src`` and ``.dat`` of one name are one module."""
        return self.source.path.stem.upper()

    @property
    def holds_data(self) -> bool:
        """Whether it is a data list."""
        return self.source.path.suffix.lower() == ".dat"

    @property
    def submits(self) -> bool:
        """Whether its routines run in the submit interpreter."""
        return self.source.path.suffix.lower() == ".sub"

    @property
    def heads(self) -> tuple[Begin, ...]:
        """The lines that begin its routines or data lists."""
        return tuple(line for line in self.statements if isinstance(line, Begin))

    @cached_property
    def serves_all(self) -> bool:
        """Whether it is a data list of the system, which every program sees."""
        return any(line.name.startswith("$") for line in self.heads)

    @cached_property
    def mentions(self) -> dict[str, list[int]]:
        """First characters at which each name stands in its text, in capitals."""
        out: dict[str, list[int]] = defaultdict(list)
        for words in lines_of_words(self.source.text):
            for word in words:
                if word.kind == "name":
                    out[word.upper].append(word.start)
        return out

    @cached_property
    def stated(self) -> tuple["Datum", ...]:
        """Variables to which it gives a structure, a number or a truth value, if it is a data list."""
        shared, out = set[str](), list[Datum]()
        for line in self.statements if self.holds_data else ():
            match line:
                case Declaration(variables=variables):
                    shared.update(v.name for v in variables if line.shared)
                    own = [(v.name, v.words, v.start, line) for v in variables]
                case Assignment():
                    own = [(line.name, line.words, line.start, None)]
                case _:
                    continue
            for name, words, start, declaration in own:
                value = value_in(self.number, words, listed=True)
                if value is None:
                    continue
                # of an array that others may use, only structures are taken for theirs
                whole = declaration is not None or isinstance(value, Structure)
                for_all = self.serves_all or (name.partition("[")[0] in shared and whole)
                out.append(
                    Datum(file=self, name=name, value=value, shared=for_all, declaration=declaration, start=start)
                )
        return tuple(out)

    @cached_property
    def sections(self) -> tuple["KrlRoutine", ...]:
        """Its routines, or data lists, and the lines outside of any."""
        out: list[KrlRoutine] = []
        start, head = 0, None
        for i, line in enumerate((*self.statements, None)):
            if line is None or isinstance(line, Begin | End):
                out.append(KrlRoutine(file=self, head=head, lines=self.statements[start:i]))
                start, head = i + 1, line if isinstance(line, Begin) else None
        return tuple(out)


@dataclass(frozen=True, eq=False, kw_only=True)
class KrlRoutine:
    """A routine, local or global; or a data list, or lines outside of any."""

    file: KrlFile
    head: Begin | None
    """The line that begins it; None of lines outside of any."""
    lines: tuple[KrlLine, ...]
    """Those inside."""

    @property
    def name(self) -> str:
        """In capitals; empty of lines outside of any."""
        return "" if self.head is None else self.head.name

    @property
    def parameters(self) -> tuple[str, ...]:
        """In capitals."""
        return () if self.head is None else self.head.parameters

    @property
    def prefix(self) -> str:
        """Prefix of the keys of its own variables."""
        return f"{self.name}@{self.file.number}:"

    @cached_property
    def declared(self) -> frozenset[str]:
        """Variables that it declares."""
        return frozenset(v.name for line in self.lines if isinstance(line, Declaration) for v in line.variables)

    @cached_property
    def own(self) -> frozenset[str]:
        """Variables that no other knows: its parameters and those that it declares."""
        return self.declared.union(self.parameters)


@dataclass(frozen=True, eq=False, kw_only=True)
class Datum:
    """A variable with the value that its data list states."""

    file: KrlFile
    name: str
    """In capitals, with its index."""
    value: Structure | float | bool
    shared: bool
    """Other programs may use it, too."""
    declaration: Declaration | None
    """None for an element of an array, which has no declaration of its own."""
    start: int
    """First character of its name."""
    beside: Set[int] = frozenset()
    """First characters at which a routine declares arrays of its own, and sets elements of this one."""

    @property
    def variable(self) -> str:
        """Its name without an index."""
        return self.name.partition("[")[0]

    @property
    def place(self) -> Place:
        """Place of its declaration."""
        return self.file.source.place(self.start)


def set_once(routine: KrlRoutine) -> Iterator[Datum]:
    """Elements of a routine's own arrays whose lines set each of them once, to a structure of numbers."""
    lines = defaultdict[str, list[Assignment]](list)
    for line in routine.lines:
        if isinstance(line, Assignment) and line.index is not None and line.variable in routine.declared:
            lines[line.variable].append(line)
    declared = {v.start for line in routine.lines if isinstance(line, Declaration) for v in line.variables}
    for own in lines.values():
        known = all(word.text == "," or word.text.isdecimal() for line in own for word in line.index or ())
        found = ((line.name, value_in(routine.file.number, line.words)) for line in own if known)
        values = {name: value for name, value in found if isinstance(value, Structure)}
        if len(values) < len(own):
            continue
        for line in own:
            yield Datum(
                file=routine.file, name=line.name, value=values[line.name], shared=False, declaration=None,
                start=line.start, beside=declared.union(one.start for one in own),
            )  # fmt: skip


GIVEN = Path("given.dat")
"""In place of a data list whose values are stated beside the files."""


def given_data(number: int, values: Mapping[str, str]) -> KrlFile:
    """A data list of the system with values that no file states; those with a type are declared, too.

    Args:
        number: of the file.
        values: by name, with its index where it is an element.

    Raises:
        InputError: one is no value.
    """
    lines = ["DEFDAT $GIVEN"]
    for name, value in values.items():
        own = KrlFile.of(number, Source.of(GIVEN, f"DEFDAT $GIVEN\n{name}={value}\nENDDAT\n".encode()))
        if [datum.name for datum in own.stated] != ["".join(name.upper().split())] or len(own.statements) != 3:
            raise InputError(
                f"'{shown(value)}' is no value for {shown(name)}; give a structure such as "
                "{E6POS: X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 35}, or a number"
            )
        (datum,) = own.stated
        type_ = datum.value.kind if isinstance(datum.value, Structure) else ""
        lines += [f"DECL {type_} {name}"] if type_ else []
        lines.append(f"{name}={value}")
    return KrlFile.of(number, Source.of(GIVEN, "\n".join([*lines, "ENDDAT", ""]).encode()))


BUILT_IN = "BAS"
"""KUKA's own routine for motion parameters, and its module: what it does is known, whether or not its text is passed."""

TABLES: Mapping[str, MissingKind] = {"TOOL_DATA": "tool", "BASE_DATA": "part"}
"""The controller's tools and bases."""

PLACES = ("$POS_ACT", "$AXIS_ACT", "$POS_ACT_MES", "$AXIS_ACT_MES", "$AXIS_ACT_MEAS", "$POS_ACT_MEAS")
"""Where the robot is."""

ROBROOT = "$ROBROOT"
TOOL, BASE, MODE, ORIENTATION, PARAMETERS = "$TOOL", "$BASE", "$IPO_MODE", "$ORI_TYPE", "FDAT_ACT"
SETTINGS = {
    "tool": TOOL, "base": BASE, "mode": MODE, "orientation": ORIENTATION, "speed": "$VEL.CP", "turn speed": "$VEL.ORI1",
    "distance": "$APO.CDIS", "share": "$APO.CPTP",
}  # fmt: skip
"""On what motions depend beside their points, by the controller's names."""
STATE = frozenset({PARAMETERS, *SETTINGS.values()})
"""What of the controller's state is followed from line to line, whatever a data list says of it."""

_ORIENTS = re.compile(r"#(?:CONSTANT|JOINT|IGNORE)\b|\$ORI_TYPE\s*=(?!\s*(?:#VAR|SORI_TYP)\b)", re.IGNORECASE)


@dataclass(frozen=True, eq=False, kw_only=True)
class Names:
    """What names of variables mean in the routines of a program, and what data lists state of them."""

    files: tuple[KrlFile, ...]

    @cached_property
    def routines(self) -> "Routines":
        """The routines by name, which routines of several files may share."""
        out: dict[str, list[KrlRoutine]] = {}
        for file in self.files:
            for routine in file.sections if not file.holds_data and file.module != BUILT_IN else ():
                if routine.head is not None:
                    out.setdefault(routine.name, []).append(routine)
        return out

    @cached_property
    def roots(self) -> Mapping[str, frozenset[str]]:
        """By name of routines: those that nothing calls, from which they are reached; themselves where nothing calls them."""
        calls = {name: _called(same, self.routines) for name, same in self.routines.items()}
        for routine, line in declared_in(self.routines).values():  # what runs beside its lines may call some, too
            calls[routine.name] |= frozenset(_called_by_action(line))
        callers = Effects(own=dict.fromkeys(calls, frozenset[str]()), calls=calls).callers
        own = {name: frozenset() if others else frozenset({name}) for name, others in callers.items()}
        return with_called({name: (own[name], others) for name, others in callers.items()})

    @cached_property
    def always(self) -> frozenset[str]:
        """Routines of the submit interpreter, which runs beside every program."""
        return frozenset(line.name for file in self.files if file.submits for line in file.heads)

    def is_apart(self, routine: str, other: str) -> bool:
        """Whether no run of the program comes through both of two routines."""
        roots, others = (self.roots.get(name, frozenset[str]()) for name in (routine, other))
        return bool(roots) and bool(others) and not roots & others and not others & self.always

    @cached_property
    def orients(self) -> bool:
        """Whether lines and arcs may turn the tool otherwise than to the orientation of their end, by $ORI_TYPE."""
        return any(_ORIENTS.search(file.source.text) for file in self.files if file.module != BUILT_IN)

    @cached_property
    def by_value(self) -> Mapping[str, tuple[bool, ...]]:
        """By name of a routine: which of its parameters are given by value."""
        return given_by_value(line for file in self.files for line in file.statements)

    @cached_property
    def whole_numbers(self) -> frozenset[str]:
        """Variables that a data list or a routine declares as INT."""
        return self._declared_as("INT")

    @cached_property
    def real_numbers(self) -> frozenset[str]:
        """Variables that data lists and routines declare as REAL, and none as INT."""
        return self._declared_as("REAL") - self.whole_numbers

    def _declared_as(self, type_: str) -> frozenset[str]:
        return frozenset(key.rpartition(":")[2] for key, types in self.types.items() if type_ in types)

    @cached_property
    def types(self) -> Mapping[str, Set[str]]:
        """By key of a variable that data lists or routines declare: its type, or several where it is declared so."""
        out: dict[str, set[str]] = defaultdict(set)
        for routine in (routine for file in self.files for routine in file.sections):
            for line in (line for line in routine.lines if isinstance(line, Declaration)):
                for name in (variable.name for variable in line.variables):
                    listed = routine.file.holds_data
                    key = self.key_in(routine.file.module, name) if listed else self.key(routine, name)
                    out[key].add(line.type)
        return out

    @cached_property
    def listed(self) -> Mapping[str, frozenset[str]]:
        """By module: variables of its own data list, of which other programs know nothing."""
        out: dict[str, set[str]] = {}
        for file in self.files:
            if not file.holds_data or file.serves_all:
                continue
            own, shared = set[str](), set[str]()
            for line in file.statements:
                if isinstance(line, Declaration):
                    (shared if line.shared else own).update(variable.name for variable in line.variables)
            own.update(datum.variable for datum in file.stated)
            out.setdefault(file.module, set()).update(own - shared)
        return {module: frozenset(names) for module, names in out.items()}

    @cached_property
    def data(self) -> Mapping[str, Mapping[str, Datum]]:
        """What data lists state, by key of a variable and index; the index of a variable itself is empty."""
        out: dict[str, dict[str, Datum]] = {}
        for file in self.files:
            for datum in file.stated:
                index = datum.name[len(datum.variable) :].strip("[]")
                out.setdefault(self.key_in(file.module, datum.variable), {})[index] = datum
        return out

    @cached_property
    def set_once(self) -> Mapping[Text, Datum]:
        """Elements of arrays that routines set once, by the place of the value."""
        routines = [routine for file in self.files if not file.holds_data for routine in file.sections]
        data = (datum for routine in routines for datum in set_once(routine))
        return {
            datum.value.origin.at[:2]: datum
            for datum in data
            if isinstance(datum.value, Structure) and datum.value.origin
        }

    def key(self, routine: KrlRoutine, name: str) -> str:
        """Key of a variable among all variables of the program, by its name in a routine."""
        return f"{routine.prefix}{name}" if name in routine.own else self.key_in(routine.file.module, name)

    def key_in(self, module: str, name: str) -> str:
        """Key of a variable by its name in a module."""
        own = name not in STATE and name in self.listed.get(module, ())
        return f"{module}:{name}" if own else name

    @cached_property
    def handled(self) -> frozenset[str]:
        """Names to which code assigns something, or that it gives to a routine or function."""
        files = (file for file in self.files if not file.holds_data and file.module != BUILT_IN)
        return frozenset(name for file in files for line in file.statements for name in _handled(line))

    def number(self, routine: KrlRoutine, name: str) -> float | bool | None:
        """The number or truth value that a data list states for a variable, if no line of code may ever change it."""
        datum = self.data.get(self.key(routine, name), {}).get("")
        if datum is None or name in self.handled or isinstance(datum.value, Structure):
            return None
        return datum.value

    @cached_property
    def initial_frames(self) -> tuple[float | None, float | None]:
        """Numbers of the tool and the base that BAS(#INITMOV) sets, by the bas.src of the files; None where it does not say."""
        tool: float | None = None
        base: float | None = None
        files = (file for file in self.files if file.module == BUILT_IN and not file.holds_data)
        routines = (routine for file in files for routine in file.sections if routine.name == "INITMOV")
        for line in (line for routine in routines for line in routine.lines):
            match line:
                case Assignment(name="$TOOL", words=[Token(text=name), Token(text="["), *index, Token(text="]")]) if (
                    name.upper() == "TOOL_DATA"
                ):
                    tool = number_of(index)
                case Call(name="TOOL", arguments=(words,)):
                    tool = number_of(words)
                case Call(name="BASE", arguments=(words,)):
                    base = number_of(words)
                case _:
                    pass
        return tool, base


def _handled(line: KrlLine | None) -> Iterator[str]:
    words: Iterable[Token] = ()
    match line:
        case Beside(action=action):
            yield from _handled(action)
        case Call() if line.name != BUILT_IN:
            words = (word for argument in line.arguments for word in argument)
        case Assignment() | Control() | MotionLine():
            words = line.words if calls_of(line) else line.words[:1] if isinstance(line, Control) else ()
            yield from (line.variable,) if isinstance(line, Assignment) else ()
        case _:
            pass
    yield from (word.upper for word in words)


# Routines: what each alters, which calls which, and what may run beside their lines.

Routines = Mapping[str, Sequence[KrlRoutine]]
"""The routines of each name, which several files may have."""
Declared = Mapping[Text, tuple[KrlRoutine, Beside]]
"""By file and first character, the lines that declare an action, with their routines."""


def calls_of(line: KrlLine) -> tuple[str, ...]:
    """Names that a line calls: of a routine, or of functions in its expressions."""
    match line:
        case Call():
            words = (word for argument in line.arguments for word in (*argument, None))
            return (line.name, *_before_parentheses(tuple(words)))
        case Assignment() | Control() | MotionLine():
            return _before_parentheses(line.words)
        case _:
            return ()


def _before_parentheses(words: Sequence[Token | None]) -> tuple[str, ...]:
    return tuple(
        a.upper for a, b in pairwise(words) if a is not None and b is not None and a.kind == "name" and b.text == "("
    )


def only_computes(routine: KrlRoutine, routines: Container[str]) -> bool:
    """Whether a call of a routine can be left out, once its value is known: it sets variables of its own and nothing else."""
    for line in routine.lines:
        match line:
            case Declaration():
                continue
            case Assignment() if line.variable in routine.declared:
                pass
            case Control():
                pass
            case _:
                return False
        if any(name in routines for name in calls_of(line)):
            return False
    return True


def _through_calls(routines: Routines, own: Callable[[KrlRoutine], Iterable[Thing]]) -> dict[str, frozenset[Thing]]:
    """What the routines of each name have, by themselves or by those that they call."""
    return with_called(
        {
            name: (frozenset(thing for r in same for thing in own(r)), _called(same, routines))
            for name, same in routines.items()
        }
    )


def _called(same: Sequence[KrlRoutine], routines: Mapping[str, object]) -> frozenset[str]:
    return frozenset(name for r in same for line in r.lines for name in calls_of(line) if name in routines)


def _resuming(routines: Routines, declared: Declared) -> dict[str, frozenset[Text]]:
    """By name of a routine: interrupts that it declares whose routine resumes, which leaves what it calls."""
    resumes = _through_calls(
        routines, lambda r: (x.start for x in r.lines if isinstance(x, Control) and x.keyword == "RESUME")
    )
    return {
        name: frozenset(
            text
            for text, (routine, line) in declared.items()
            if routine.name == name
            and line.keyword == "INTERRUPT"
            and any(resumes.get(called) for called in _called_by_action(line))
        )
        for name in {routine.name for routine, _ in declared.values()}
    }


# Actions that run beside the lines of a KRL program: interrupts, TRIGGER, and analog signals that are followed.
#
# From the line that starts an action (INTERRUPT ON, TRIGGER, ANIN ON) to the one that ends it (INTERRUPT OFF, ANIN
# OFF), it may run between any two lines (KUKA System Software, interrupt programming; cyclic analog inputs and
# outputs; path-related switching actions). A TRIGGER runs once, but the advance run does not tell before which
# line.

HARMLESS = frozenset({"IR_STOPM"})
"""Routines of KUKA's own interrupts, which every controller has; as delivered they set neither frames nor points."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Actions:
    """The actions of a program, by number of the file and first character of the line that declares them."""

    declared: Declared = field(default_factory=dict[Text, tuple[KrlRoutine, Beside]])
    resuming: Mapping[str, frozenset[Text]] = field(default_factory=dict[str, frozenset[Text]])
    """By name of a routine: interrupts that it declares, and that leave what it calls."""
    started: Mapping[Text, frozenset[Text]] = field(default_factory=dict[Text, frozenset[Text]])
    """By line that starts some: those, and those that they start themselves."""
    ended: Mapping[Text, frozenset[Text]] = field(default_factory=dict[Text, frozenset[Text]])
    """By line that ends some."""
    local: Mapping[str, frozenset[Text]] = field(default_factory=dict[str, frozenset[Text]])
    """By name of a routine: interrupts that it declares for itself and those it calls, which end where it ends."""
    missing: Mapping[Text, tuple[str, ...]] = field(default_factory=dict[Text, tuple[str, ...]])
    """By line that starts some: diagnostics of routines and interrupts that the files do not have."""


def declared_in(routines: Routines) -> Declared:
    """The lines that declare an action, with their routines."""
    return {
        _text(routine, line): (routine, line)
        for same in routines.values()
        for routine in same
        for line in routine.lines
        if isinstance(line, Beside) and line.action is not None
    }


def actions_of(names: Names) -> Actions:
    """The actions of a program."""
    routines = names.routines
    declared = declared_in(routines)
    lines = [(r, line) for same in routines.values() for r in same for line in r.lines if isinstance(line, Beside)]
    if not lines:
        return Actions()
    meant = _Meant(names=names, declared=declared)
    started: dict[Text, frozenset[Text]] = {}
    ended: dict[Text, frozenset[Text]] = {}
    missing: dict[Text, tuple[str, ...]] = {}
    for routine, line in lines:
        found, text = meant.by(routine, line), _text(routine, line)
        if line.verb == "ON":
            started[text] = found
            missing[text] = tuple(_missing(line, [declared[of][1].action for of in sorted(found)], routines))
        elif line.verb == "OFF":
            ended[text] = (
                found if not line.number else frozenset(of for of in found if meant.certain(routine, line, of))
            )
    local = {
        name: frozenset(
            text for text, (r, line) in declared.items() if r.name == name and line.verb == "DECL" and not line.shared
        )
        for name in routines
    }
    return Actions(
        declared=declared,
        resuming=_resuming(routines, declared),
        started=started,
        ended=ended,
        local=local,
        missing={text: said for text, said in missing.items() if said},
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Meant:
    """Which declarations a line that starts or ends actions may mean."""

    names: Names
    declared: Declared

    @cached_property
    def reachable(self) -> dict[str, frozenset[Text]]:
        """By name of a routine: interrupts that it and those that it calls declare."""
        declares = {text for text, (_, line) in self.declared.items() if line.verb == "DECL"}
        return _through_calls(self.names.routines, lambda r: declares.intersection(_text(r, line) for line in r.lines))

    def by(self, routine: KrlRoutine, line: Beside) -> frozenset[Text]:
        """Declarations of an interrupt in the routine and the ones it calls, else any of that number."""
        if line.keyword != "INTERRUPT":
            if line.verb == "ON":
                return frozenset({_text(routine, line)}).intersection(self.declared)
            names = _spelled(line)
            return frozenset(
                text
                for text, (_, other) in self.declared.items()
                if other.keyword == line.keyword and _within(names, _spelled(other))
            )
        everywhere = frozenset(text for text, (_, other) in self.declared.items() if other.verb == "DECL")
        number = self._number(routine, line)
        for texts in (self.reachable[routine.name], everywhere):
            if not line.number or number is None:
                found = texts
            else:
                found = frozenset(text for text in texts if self._number(*self.declared[text]) in (number, None))
            if found:
                return found
        return frozenset()

    def certain(self, routine: KrlRoutine, line: Beside, text: Text) -> bool:
        """Whether a line that ends actions ends that one for sure."""
        if line.keyword != "INTERRUPT":
            return True
        number = self._number(routine, line)
        return number is not None and self._number(*self.declared[text]) == number

    def _number(self, routine: KrlRoutine, line: Beside) -> float | bool | None:
        """The number of an interrupt; None where the text does not give it."""
        if len(line.number) != 1 or line.number[0].kind == "number":
            return number_of(line.number)
        return self.names.number(routine, line.number[0].upper)


def _text(routine: KrlRoutine, line: KrlLine) -> Text:
    return routine.file.number, line.start


def _called_by_action(line: Beside) -> tuple[str, ...]:
    return () if line.action is None else calls_of(line.action)


def _spelled(line: Beside) -> list[str]:
    return [word.upper for word in line.number]


def _within(names: Sequence[str], words: Sequence[str]) -> bool:
    """Whether the words of a signal's name stand in a row among those of the line that follows it."""
    return any(list(words[i : i + len(names)]) == list(names) for i in range(len(words) - len(names) + 1))


def _missing(line: Beside, actions: Sequence[KrlLine | None], routines: Routines) -> Iterable[str]:
    """Diagnostics of what a line starts and the files do not have."""
    leaves = "is taken to leave $TOOL, $BASE and $IPO_MODE as they are"
    names = dict.fromkeys(action.name for action in actions if isinstance(action, Call))
    for name in names:
        if name not in routines and name not in HARMLESS:
            yield Cause(f"{name} is not in the files given; the {line.keyword} that calls it {leaves}", (name, "other"))
    if not actions and line.keyword == "INTERRUPT" and line.number:
        number = "".join(word.text for word in line.number)
        yield f"interrupt {number} is declared in none of the files given; it {leaves}"
