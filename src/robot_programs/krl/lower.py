"""KRL lowered to the one form: the statements of routines, from their words to nodes, with the names resolved.

What the controller's own BAS does, and what tool, base and the other settings are set to, are assignments of data by the names of
the system variables; see `KrlMeaning` for what their operators make of frames.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, pairwise, starmap
from typing import Any, ClassVar, Literal

from robot_programs.core import flow
from robot_programs.core.flow import Block, Node
from robot_programs.core.form import (
    Arming,
    Ask,
    Assign,
    Check,
    Do,
    Expression,
    Hole,
    Lit,
    MoveLine,
    Op,
    Rec,
    Ref,
    Routine,
    Span,
    Text,
    asks_in,
    inside,
)
from robot_programs.core.kit import Cursor, Token
from robot_programs.core.program import Cause
from robot_programs.core.values import Structure
from robot_programs.krl.data import (
    BASE,
    BUILT_IN,
    MODE,
    ORIENTATION,
    PARAMETERS,
    ROBROOT,
    SETTINGS,
    STATE,
    TOOL,
    Actions,
    KrlFile,
    KrlRoutine,
    Names,
    actions_of,
    calls_of,
    only_computes,
)
from robot_programs.krl.syntax import (
    BLOCKS,
    LOOPS,
    OTHER_MOTIONS,
    POINT_MOTIONS,
    SPLINES,
    Assignment,
    Beside,
    Call,
    Control,
    Counting,
    Field,
    KrlLine,
    MotionLine,
    Operand,
    bit_string,
    changes_nothing,
    is_call,
    split_at_commas,
    structure,
)
from robot_programs.krl.values import (
    COMPONENT,
    FIELD,
    FUNCTIONS_OF_NUMBERS,
    IN,
    LENGTHS,
    NUMBERS,
    WHOLE,
    Real,
    in_range,
    structured,
)

FRAME, NUMBERED, OF_PARAMETERS, MODE_OF, CARRIED, STANDING, WITH, ORIENTED, PASSED = (
    "frame", "numbered", "of parameters", "mode of", "carried", "standing", "with", "oriented", "passed",
)  # fmt: skip
"""Operators by which tool, base and other settings are set: a frame by its name, an element of a table, the frame and the mode of
a set of parameters, a frame on an external kinematic system and one that is on none, a frame with one component, and $ORI_TYPE and
$APO by sets of motion parameters."""

TABLE_OF = {TOOL: "TOOL_DATA", BASE: "BASE_DATA"}
_SETTING_OF = {key: name for name, key in SETTINGS.items()}
_STRUCTURES = {
    "$VEL": {"CP": "speed", "ORI1": "turn speed"},
    "$APO": {"CDIS": "distance", "CPTP": "share"},
}
"""Settings that are components of a structure."""
_BY_SETS = {"SIPO_MODE": MODE_OF, "SORI_TYP": ORIENTED}
"""Functions of the inline forms that take a setting from a set of parameters."""

MAX_DEPTH = 24
"""Blocks in each other, in one routine, and labels to which a GOTO behind them leads."""

_ON_MECHANISMS = ("MACHINE_FRAME_DAT", "MACHINE_DEF")
_OF_INLINE_FORMS = frozenset({"STOOL", "STOOL2", "SBASE", "SVEL_CP", "SAPO", "SAPO_PTP", *_BY_SETS})
"""Functions whose first argument is a set of parameters."""
CARRYING = frozenset({"EK", "LK", "EB"})
"""Functions by which a base moves with an external axis, another robot or a conveyor; the controller's own BAS has them all."""
_COUPLED = {
    "LK": "$BASE is linked by LK to another robot, and where that is this program does not tell",
    "EB": "$BASE is linked by EB to a conveyor, and where that is this program does not tell",
}
_EK = "$BASE is set by EK in a way that is not understood; write EK(root, kinematic system, frame)"


@dataclass(eq=False, kw_only=True)
class Coded(Routine):
    """A routine with its text."""

    section: KrlRoutine


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionStep(MoveLine):
    """A motion instruction."""

    statement: MotionLine
    routine: KrlRoutine
    counts: tuple[int, ...]
    """How many of the points of the form each point of the text is made of; they are joined by ``:``."""
    triggered: bool = False
    """A TRIGGER acts along it."""
    in_spline: bool = False

    @property
    def operands(self) -> Iterator[tuple[Operand, slice]]:
        """The points of the text, and which of the form's they are."""
        ends = list(accumulate(self.counts, initial=0))
        return zip(self.statement.operands, starmap(slice, pairwise(ends)), strict=True)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Steered(Check):
    """A line that steers where the program goes on."""

    statement: Control


@dataclass(eq=False, kw_only=True)
class LoweredKrl:
    """A program in the one form."""

    files: Sequence[KrlFile]
    names: Names
    routines: dict[KrlRoutine, Coded] = field(default_factory=dict[KrlRoutine, Coded])
    """In the order of the text."""
    stray: list[Routine] = field(default_factory=list[Routine])
    """In place of lines outside of any routine, what these set."""
    actions: dict[Text, Routine] = field(default_factory=dict[Text, Routine])
    """What runs beside the lines, by the place where it is declared."""
    ran_by: dict[Routine, tuple[str, str]] = field(default_factory=dict[Routine, tuple[str, str]])
    """What runs these, and what would end that, for messages."""
    said: dict[tuple[int, int, str], None] = field(default_factory=dict[tuple[int, int, str], None])
    """Diagnostics: number of the file, position and text."""
    settings: dict[str, Expression] = field(default_factory=dict[str, Expression])
    """On what motions depend beside their points that say nothing of it themselves."""

    @cached_property
    def read(self) -> frozenset[str]:
        """Names that code reads anywhere, and those that BAS and motions read."""
        own = frozenset({"LDAT_ACT", "PDAT_ACT", ROBROOT, *TABLE_OF.values(), *STATE, *_STRUCTURES})
        return own.union(*(file.read for file in self.files if not file.holds_data))

    @property
    def all(self) -> tuple[Routine, ...]:
        """All that is lowered."""
        return (*self.routines.values(), *self.stray, *self.actions.values())

    def routine(self, name: str) -> tuple[Routine, ...]:
        """Routines of a name."""
        return tuple(self.routines[one] for one in self.names.routines.get(name, ()))

    def computes(self, name: str) -> bool:
        """Whether all routines of a name only compute a value."""
        return all(only_computes(one, self.names.routines) for one in self.names.routines[name])

    def say(self, file: KrlFile, position: int, text: str) -> None:
        """Note something about a place."""
        self.said[file.number, position, text] = None


def lowered(names: Names) -> LoweredKrl:
    """A program in the one form, given what names mean in its files."""
    files, found = names.files, LoweredKrl(files=names.files, names=names)
    for file in files:
        for section in file.sections:
            if section in names.routines.get(section.name, ()):
                found.routines[section] = _header(section, names, submits=file.submits)
    outside = (
        one
        for file in files
        if not file.holds_data and file.module != BUILT_IN
        for one in file.sections
        if one.head is None
    )
    found.stray += [Routine(name="", nodes=RoutineScope(section, found).sets()) for section in outside if section.lines]
    actions = actions_of(names)
    for text, (section, line) in actions.declared.items():
        assert line.action is not None
        routine = Routine(name=section.name, nodes=RoutineScope(section, found).action(line.action))
        found.ran_by[routine] = _source(section, line)
        found.actions[text] = routine
        if text in actions.resuming.get(section.name, ()):
            routine.resumes = found.routines[section]
        for called in calls_of(line.action):
            for one in found.routine(called):
                one.beside = True
    for section, routine in found.routines.items():
        own = actions.local.get(section.name, frozenset())
        routine.disarms = frozenset(found.actions[text] for text in own)
        routine.nodes = RoutineScope(section, found, actions).nodes()
    return found


def _source(section: KrlRoutine, line: Beside) -> tuple[str, str]:
    place = section.file.source.place(line.start)
    match line.keyword, line.action:
        case "INTERRUPT", Call(name=name):
            source = f"{name}, which the interrupt of {place} calls"
        case "TRIGGER", Call(name=name):
            source = f"{name}, which the TRIGGER of {place} calls"
        case keyword, _:
            source = f"the {keyword} of {place}"
    return source, "take it out" if line.keyword == "TRIGGER" else "turn that off"


def _header(section: KrlRoutine, names: Names, *, submits: bool) -> Coded:
    keys = tuple(names.key(section, name) for name in section.parameters)
    assert section.head is not None
    return Coded(
        section=section, name=section.name, parameters=keys,
        returning=frozenset(key for key, by_value in zip(keys, section.head.by_value, strict=True) if not by_value),
        variables=tuple(sorted({names.key(section, name) for name in section.declared}.difference(keys))),
        beside=submits,
    )  # fmt: skip


class KrlReader(Cursor):
    """Expressions of KRL."""

    # KUKA System Software, priority of operators
    BINDING: ClassVar = {
        "OR": 1, "EXOR": 2, "AND": 3, "==": 4, "<>": 4, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6, ":": 7,
    }  # fmt: skip
    PREFIXES: ClassVar = {"NOT": 8, "-": 8, "+": 8}

    def __init__(self, found: Sequence[Token], scope: "RoutineScope", *, follows: bool = False, moves: bool = False):
        """Read words of a routine.

        Args:
            found: the words.
            scope: the routine.
            follows: whether a function can be followed whose call is all of them.
            moves: whether they are of a motion, in which functions change nothing that the files do not have.
        """
        super().__init__(found, scope.file)
        self.scope, self.moves = scope, moves
        self.follows = follows and is_call(found)

    def operation(self, start: int, sign: str, *operands: Expression) -> Expression:
        """What an operator makes of operands; a sign before a number belongs to it."""
        (first, *others) = operands
        if not others and sign in "+-" and isinstance(first, Lit) and type(first.value) is Real:
            return Lit(at=self.span(start), value=Real(-first.value) if sign == "-" else first.value)
        return super().operation(start, sign, *operands)

    def single(self) -> Expression:
        """Read a value in which no operator is outside of brackets."""
        start, word = self.place, self.take()
        self.height = 0
        match word.kind, word.upper:
            case "number", text:
                value = in_range(float(text))
                return Lit(at=self.span(start), value=value if text.isdecimal() else Real(value))
            case "enum", text:
                return Lit(at=self.span(start), value=text)
            case "string", _ if (bits := bit_string(word.upper)) is not None:
                return Lit(at=self.span(start), value=bits)
            case "symbol", "(":
                value = self.expression()
                self.expect(")")
                return value
            case "symbol", "{":
                return self._structure(start)
            case "name", "TRUE" | "FALSE":
                return Lit(at=self.span(start), value=word.upper == "TRUE")
            case "name", name:
                return self._function(name, start) if self.accept("(") else self._variable(name, start)
            case _:
                raise self.problem(f"'{word.text}' is not evaluated")

    def _inner(self) -> Expression:
        """An expression inside of another one."""
        before = self.height
        found = self.expression()
        self.grow(max(before, self.height))
        return found

    def _variable(self, name: str, start: int) -> Expression:
        path, called = (), name
        if self.accept("["):
            indices = [self._inner()]
            while self.accept(","):
                indices.append(self._inner())
            self.expect("]")
            path = (tuple(indices),)
        value: Expression = self.scope.ref(name, self.span(start), path)
        while self.accept("."):
            component = self.take().upper
            lit = Lit(at=self.span(start), value=(called, component))
            value, called = Op(at=self.span(start), sign=COMPONENT, operands=(value, lit)), f"{called}.{component}"
        return value

    def _structure(self, start: int) -> Expression:
        self.number -= 1
        found = structure(self)
        if all(map(self._is_plain, found.fields)):
            return Lit(at=self.span(start), value=structured(found, self.file))
        return Rec(at=self.span(start), kind=found.type, parts={one.name: self._component(one) for one in found.fields})

    def _is_plain(self, one: Field) -> bool:
        """Whether nothing is computed of a component; in a point those count alone that positions have."""
        if one.value is not None or (self.moves and one.name not in NUMBERS):
            return True
        return one.words[0].kind in ("enum", "string") or one.words[0].upper in ("TRUE", "FALSE")

    def _component(self, one: Field) -> Expression:
        """A component as it is written, of a structure of which some are computed."""
        if one.value is not None:
            number: Expression = Lit(at=(self.file, one.start, one.end), value=one.value)
            return self.scope.part(one, number)
        if one.words[0].text == "{":
            raise self.problem(f"the component {one.name} is not evaluated")
        inner = KrlReader(one.words, self.scope, moves=self.moves)
        inner.depth, before = self.depth + 1, self.height
        value = self.scope.read(inner)
        self.grow(max(before, inner.height))
        return self.scope.part(one, value)

    def _function(self, name: str, start: int) -> Expression:
        arguments, ranges = list[Expression](), list[tuple[int, int]]()
        while not self.accept(")"):
            begins = self.number
            if self.next.text == ",":
                arguments.append(Hole(at=self.span(start), why="it is left out"))
            else:
                arguments.append(self._inner())
            ranges.append((begins, self.number))
            if not self.accept(",") and self.next.text != ")":
                raise self.problem("')' is missing in an expression")
        given = [self.words[begins:ends] for begins, ends in ranges]
        return self.scope.asked(name, tuple(arguments), given, self.span(start), follows=self.follows, moves=self.moves)


class RoutineScope:
    """A routine that is lowered."""

    def __init__(self, section: KrlRoutine, found: LoweredKrl, actions: Actions | None = None):
        """Lower a section of a file; what runs beside the lines is none where it is lowered itself."""
        self.section, self.found, self.actions = section, found, actions or Actions()
        self.file = section.file.number
        self.keys = dict[str, str]()
        self.here = (self.file, 0, 0)
        """Place of the line that is lowered."""
        self.called = set[str]()
        """Routines that the line calls which is lowered, as far as its expressions do."""

    def at(self, line: KrlLine) -> Span:
        """Place of a line."""
        return self.file, line.start, line.end

    # Names and expressions.

    def ref(self, name: str, at: Span = (0, 0, 0), path: tuple[Any, ...] = ()) -> Ref:
        """A variable, or a part of it."""
        if name not in self.keys:
            self.keys[name] = self.found.names.key(self.section, name)
        return Ref(at=at, name=name, key=self.keys[name], path=path)

    def named(self, words: Iterable[Token], at: Span) -> tuple[Ref, ...]:
        """Variables that some words name."""
        return tuple(self.ref(word.upper, at) for word in words if word.kind == "name")

    def expression(self, words: Sequence[Token], *, follows: bool = False, moves: bool = False) -> Expression:
        """The expression that some words are; a hole where they are none."""
        if not words:
            return Hole(at=(self.file, 0, 0), why="an expression ends too early")
        return self.read(KrlReader(words, self, follows=follows, moves=moves))

    def read(self, reader: KrlReader) -> Expression:
        """All words of a reader; what they may call if they are not understood."""
        called = set(self.called)
        found = reader.whole()
        if not isinstance(found, Hole):
            return found
        self.called, names = called, self.named(reader.words, found.at)
        if any(word.text == "(" for word in reader.words):
            return Ask(at=found.at, name="", arguments=(found,), changes=names)
        return replace(found, named=names)

    def rest(self, line: KrlLine, *others: KrlLine) -> Block:
        """Calls of lines that expressions do not make, since they are not understood, or are of no consequence otherwise.

        What stands behind an unknown word may be changed by it.
        """
        called = (name for one in (line, *others) for name in calls_of(one))
        names = [name for name in called if name in self.found.names.routines and name not in self.called]
        routines = tuple(one for name in dict.fromkeys(names) for one in self.found.routine(name))
        self.called.clear()
        at, changes = self.at(line), tuple[Ref, ...]()
        if isinstance(line, MotionLine) and line.keyword not in (*POINT_MOTIONS, *OTHER_MOTIONS):
            changes = tuple(ref for operand in line.operands for ref in self.named(operand.words, at))
        if not routines and not changes:
            return ()
        return (
            flow.FlowStep(line=Do(at=at, routines=routines, sure=False, changes=changes, why=self._changed_at(line))),
        )

    def _changed_at(self, line: KrlLine) -> str:
        return f"is changed by the program, at {self.section.file.source.place(line.start)}"

    def part(self, one: Field, value: Expression) -> Expression:
        """A component of a structure as it is written."""
        if one.name not in NUMBERS:
            return value
        if isinstance(value, Lit) and isinstance(value.value, float):
            return Lit(at=value.at, value=Real(value.value)) if one.name in LENGTHS else value
        return Op(at=value.at, sign=FIELD, operands=(value, Lit(at=value.at, value=(one.name, one.text))))

    def asked(
        self, name: str, arguments: tuple[Expression, ...], given: Sequence[Sequence[Token]], at: Span, *, follows: bool,
        moves: bool,
    ) -> Expression:  # fmt: skip
        """The value of a function."""
        if name in self.found.names.routines:
            self.called.add(name)
            by_value = self.found.names.by_value.get(name, ())
            alone = not self._by_reference(arguments, by_value) and self.found.computes(name)
            return Ask(
                at=at, name=name, arguments=arguments, routines=self.found.routine(name),
                changes=self._changed(arguments, given, by_value, at), sure=follows or alone,
            )  # fmt: skip
        if name == "INV_POS" or name in FUNCTIONS_OF_NUMBERS:
            return Op(at=at, sign=name, operands=arguments)
        words = () if moves or changes_nothing(name) else (word for one in given for word in one)
        return Ask(at=at, name=name, arguments=arguments, changes=self.named(words, at))

    @staticmethod
    def _by_reference(arguments: Sequence[Expression], by_value: Sequence[bool]) -> bool:
        return any(
            isinstance(inner, Ref) for k, one in enumerate(arguments)
            if not (k < len(by_value) and by_value[k]) for inner in inside(one)
        )  # fmt: skip

    def _changed(
        self, arguments: Sequence[Expression], given: Sequence[Sequence[Token]], by_value: Sequence[bool], at: Span
    ) -> tuple[Ref, ...]:
        """What a call may change beside variables that it is given as a whole, which stand for its parameters.

        A parameter that does not say how it is given may be changed (KUKA System Software, transfer of parameters).
        """
        found = list[Ref]()
        for k, (argument, words) in enumerate(zip(arguments, given, strict=True)):
            if not (k < len(by_value) and by_value[k]) and not isinstance(argument, Ref):
                found += self.named(words, at)
        return tuple(found)

    # Lines.

    def nodes(self) -> Block:
        """All lines of the routine."""
        kept = [line for line in self.section.lines if self._matters(line)]
        blocks = _Blocks(lines=kept, scope=self)
        nodes = blocks.body(None)
        if blocks.odd is not None:
            text = f"{blocks.odd.keyword} does not match the blocks of {self.section.name}; what holds behind it is not known"
            self.found.say(self.section.file, blocks.odd.start, text)
            nodes = tuple(node for line in kept for node in self.single(line, loops=0))  # side by side
        return nodes

    def _matters(self, line: KrlLine) -> bool:
        """Whether a line is of any consequence for motions: not what sets a variable that nothing reads."""
        match line:
            case Assignment():
                return line.variable in self.found.read or any(word.text == "(" for word in line.words)
            case MotionLine() | Call() | Control() | Beside():
                return True
            case _:
                return False

    def single(self, line: KrlLine, *, loops: int) -> Block:
        """A line that is no block.

        Args:
            line: the line.
            loops: how many loops it stands in.
        """
        nodes = self._single(line, loops=loops) if isinstance(line, Control) else self.steps_of(line)
        return (*self.rest(line), *nodes)

    def _single(self, line: Control, *, loops: int) -> Block:
        name = line.words[0].upper if line.words else ""
        match line.keyword:
            case "LABEL":
                return (flow.Label(line=self.check(line), name=name),)
            case "GOTO":
                return (flow.Leave(line=self.check(line), way="jump", label=name),)
            case "EXIT" if loops:
                return (flow.Leave(line=self.check(line), way="exit"),)
            case "RETURN":
                own = (self.expression(line.words),) if line.words else ()
                return (flow.Leave(line=self.check(line, *own), way="return"),)
            case "RESUME":
                return (flow.Leave(line=self.check(line), way="stop"),)
            case _:
                routines = tuple(one for called in calls_of(line) for one in self.found.routine(called))
                return (flow.Unknown(line=Do(at=self.at(line), routines=routines, moves=True)),)

    def check(self, line: Control, *conditions: Expression) -> Steered:
        """A line that steers."""
        return Steered(at=self.at(line), conditions=conditions, statement=line)

    def steps_of(self, line: KrlLine) -> Block:
        """An assignment, a call, a motion, or a line of what runs beside the lines."""
        self.here = self.at(line)
        match line:
            case MotionLine():
                return (flow.FlowStep(line=self.motion(line)),)
            case Assignment():
                return tuple(flow.FlowStep(line=one) for one in self._assignments(line))
            case Call(name="BAS"):
                return tuple(flow.FlowStep(line=one) for one in self._bas(line))
            case Call():
                return (flow.FlowStep(line=self._call(line)),)
            case Beside():
                return tuple(flow.FlowStep(line=one) for one in self._beside(line))
            case _:
                return ()

    def _call(self, line: Call) -> Do:
        at, name = self.at(line), line.name
        by_value = self.found.names.by_value.get(name, ())
        arguments = tuple(
            self.expression(words) if words else Hole(at=at, why="it is left out") for words in line.arguments
        )
        if name in self.found.names.routines:
            self.called.add(name)
            changes = self._changed(arguments, line.arguments, by_value, at)
            return Do(at=at, routines=self.found.routine(name), arguments=arguments, changes=changes)
        text = f"{name} is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are"
        self.found.say(self.section.file, line.start, Cause(text, (name, "other")))
        changes = tuple(ref for words in line.arguments for ref in self.named(words, at))
        return Do(at=at, arguments=arguments, changes=changes, why=self._changed_at(line), moves=True)

    def sets(self) -> Block:
        """What lines set, whenever they may run."""
        own = (line for line in self.section.lines if isinstance(line, Assignment | Call) and self._matters(line))
        return tuple(
            node
            for line in own
            for node in (self.steps_of(line) if isinstance(line, Assignment) else self.strange(line))
        )

    def strange(self, line: Call) -> Block:
        """What a call may change of a routine that the files do not have, and that does not move the robot."""
        changes = tuple(ref for words in line.arguments for ref in self.named(words, self.at(line)))
        return (flow.FlowStep(line=Do(at=self.at(line), changes=changes)),) if changes else ()

    def action(self, line: KrlLine) -> Block:
        """What runs beside the lines."""
        if not self._matters(line):
            return ()
        if isinstance(line, Call) and line.name not in (*self.found.names.routines, "BAS"):
            return self.strange(line)
        return self.steps_of(line)

    def _beside(self, line: Beside) -> Iterator[Arming]:
        text = (self.file, line.start)
        for said in self.actions.missing.get(text, ()):
            self.found.say(self.section.file, line.start, said)
        for texts, on in ((self.actions.ended.get(text), False), (self.actions.started.get(text), True)):
            routines = tuple(self.found.actions[one] for one in sorted(texts or ()) if self.found.actions[one].nodes)
            if routines:
                yield Arming(at=self.at(line), routines=routines, on=on)

    # Assignments.

    def _assignments(self, line: Assignment) -> Iterator[Assign]:
        name, component = line.variable, line.component
        if line.index is None and (name in TABLE_OF or name in (MODE, ORIENTATION, *_STRUCTURES)):
            yield from self._set(self.setting(f"{name}.{component}" if component else name, line.words))
            return
        path = () if line.index is None else (tuple(self.expression(one) for one in split_at_commas(line.index)),)
        target = self.ref(name, self.here, (*path, *component.split(".")) if component else path)
        yield Assign(at=self.here, target=target, value=self.expression(line.words, follows=True))

    def _set(self, settings: Mapping[str, Expression]) -> Iterator[Assign]:
        for name, value in settings.items():
            yield Assign(at=self.here, target=self.ref(SETTINGS[name], self.here), value=value)

    def _op(self, sign: str, *operands: Expression) -> Op:
        return Op(at=self.here, sign=sign, operands=operands)

    def _lit(self, value: object) -> Lit:
        return Lit(at=self.here, value=value)

    def _unknown(self, why: str = "it is not known") -> Hole:
        return Hole(at=self.here, why=why)

    def setting(self, name: str, words: Sequence[Token]) -> dict[str, Expression]:
        """What settings become by a value for a variable of the controller: of a line, or of one motion behind WITH.

        Args:
            name: of the variable, with its component.
            words: the value.
        """
        called, value = set(self.called), self.expression(words, follows=True)
        function, given = "", value
        if isinstance(value, Ask) and value.arguments and value.name in _OF_INLINE_FORMS:
            self.called, function, given = called, value.name, value.arguments[0]
            while isinstance(given, Op) and given.sign == COMPONENT:  # of the set of parameters
                (given, _) = given.operands
        variable, _, component = name.partition(".")
        if variable in TABLE_OF and component:
            return {
                _SETTING_OF[variable]: self._op(
                    WITH, self.ref(variable, self.here), value, self._lit((variable, component))
                )
            }
        if variable in TABLE_OF:
            return {_SETTING_OF[variable]: self._frame(variable, function, given, value)}
        if function == "SVEL_CP":
            return {"speed": given}
        if function in ("SAPO", "SAPO_PTP"):
            return {"distance": self._op(PASSED, self._lit(""), given), "share": self._unknown()}
        if name in _SETTING_OF:
            return {_SETTING_OF[name]: self._op(_BY_SETS[function], given) if function in _BY_SETS else value}
        if name not in _STRUCTURES:
            return {}
        match value:
            case Rec(parts=parts):
                stated = {one: part for one, part in parts.items() if one in _STRUCTURES[name]}
            case Lit(value=Structure(parts=parts)):
                stated = {one: Lit(at=value.at, value=part) for one, part in parts.items() if one in _STRUCTURES[name]}
            case _:
                return {one: self._unknown() for one in _STRUCTURES[name].values()}
        if name == "$APO":  # what it does not state stays
            return {_STRUCTURES[name][str(one)]: part for one, part in stated.items()}
        return {setting: stated.get(one, self._unknown()) for one, setting in _STRUCTURES[name].items()}

    def _frame(self, name: str, function: str, given: Expression, value: Expression) -> Expression:
        """What $TOOL or $BASE is set to, perhaps by a function of the inline forms or of the controller.

        Args:
            name: the one or the other.
            function: of the inline forms.
            given: to it.
            value: with the function.
        """
        asks = tuple(asks_in(value)) if name == BASE else ()
        named = [one for ask in asks for one in (ask.name, *(ref.name for ref in ask.changes)) if one in CARRYING]
        match name, function, named:
            case "$TOOL", "STOOL" | "STOOL2", _:
                return self._of_parameters(name, given)
            case "$BASE", "SBASE", _:
                return self._op(STANDING, self._of_parameters(name, given))
            case _, _, ["LK" | "EB" as carrying, *_]:
                return self._unknown(_COUPLED[carrying])
            case _, _, ["EK", *_]:
                if not isinstance(value, Ask) or value.name != "EK" or len(value.arguments) not in (2, 3):
                    return self._unknown(_EK)
                frame = value.arguments[2] if len(value.arguments) == 3 else self.ref("$NULLFRAME", self.here)
                return self._op(CARRIED, self._named(name, frame))
            case _:
                return self._named(name, value)

    def _named(self, name: str, value: Expression) -> Expression:
        """A frame with the name by which it is called."""
        own, indices = "", tuple[Expression, ...]()
        if isinstance(value, Ref):
            own, indices = value.name, tuple(one for step in value.path if isinstance(step, tuple) for one in step)
        return self._op(FRAME, self._lit((name, own)), value, *indices)

    def _of_parameters(self, name: str, parameters: Expression) -> Expression:
        """Tool or base of a set of frame parameters."""
        others = () if name == TOOL else tuple(self.ref(one, self.here) for one in _ON_MECHANISMS)
        table = self.ref(TABLE_OF[name], self.here)
        return self._op(OF_PARAMETERS, self._lit(TABLE_OF[name]), parameters, table, *others)

    def _numbered(self, name: str, number: Expression) -> Expression:
        return self._op(NUMBERED, self._lit(TABLE_OF[name]), number, self.ref(TABLE_OF[name], self.here))

    # The controller's own routine for motion parameters (KUKA's bas.src).

    def _bas(self, line: Call) -> Iterator[Assign]:
        """What a call of BAS sets."""
        command, ref = line.command, lambda name: self.ref(name, self.here)
        given = line.arguments[1] if len(line.arguments) > 1 else ()
        along, joints = ("#CP_PARAMS", "#CP_DAT"), ("#PTP_PARAMS", "#PTP_DAT")
        if command in (*along, *joints, "#FRAMES"):
            own = {_SETTING_OF[name]: self._of_parameters(name, ref(PARAMETERS)) for name in TABLE_OF}
            yield from self._set({**own, "mode": self._op(MODE_OF, ref(PARAMETERS))})
        if command in joints:  # one of the two, by the kind of approximation
            names = {"distance": "#CDIS", "share": "#CPTP"}
            passed = {
                name: self._op(PASSED, self._lit(kind), ref("PDAT_ACT"), ref(SETTINGS[name]))
                for name, kind in names.items()
            }
            yield from self._set(passed)
        elif command in along:
            distance = self._op(PASSED, self._lit(""), ref("LDAT_ACT"))
            orientation = self._op(ORIENTED, ref("LDAT_ACT"))
            yield from self._set({"distance": distance, "turn speed": self._unknown(), "orientation": orientation})
        match command:
            case "#CP_PARAMS" | "#VEL_CP":
                yield from self._set({"speed": self.expression(given)})
            case "#TOOL":
                yield from self._set({"tool": self._numbered(TOOL, self.expression(given))})
            case "#BASE":
                yield from self._set({"base": self._numbered(BASE, self.expression(given))})
            case "#EX_BASE":
                yield from self._set({"base": self._op(CARRIED, self._numbered(BASE, self.expression(given)))})
            case "#INITMOV":
                yield from self._initial()
            case _:
                pass

    def _initial(self) -> Iterator[Assign]:
        """What BAS(#INITMOV) sets, by the bas.src that was passed; tool and base are not known where it does not say."""
        lost = self._unknown("BAS(#INITMOV) resets tool and base before it")
        numbers = zip(TABLE_OF, self.found.names.initial_frames, strict=True)
        own = {_SETTING_OF[name]: lost if n is None else self._numbered(name, self._lit(n)) for name, n in numbers}
        yield Assign(at=self.here, target=self.ref(PARAMETERS, self.here), value=lost)
        yield from self._set({
            **own, "speed": lost, "turn speed": lost, "mode": self._lit("#BASE"), "orientation": self._lit("#VAR"),
            "distance": self.ref("DEF_APO_CDIS", self.here), "share": self.ref("DEF_APO_CPTP", self.here),
        })  # fmt: skip

    # Motions.

    def motion(self, line: MotionLine, *, in_spline: bool = False, triggered: bool = False) -> MotionStep:
        """A motion instruction."""
        self.here = self.at(line)
        points, counts, why = list[Expression](), list[int](), line.trouble
        if line.keyword == "SPL" and not in_spline:
            why = why or "it is part of no SPLINE block"
        for operand in line.operands:
            own = self._point(operand)
            points += own
            counts.append(len(own))
            for one in own:
                if isinstance(one, Ask) and one.routines and not self.found.computes(one.name):
                    why = why or f"its point comes from {one.name}, which does more than compute it"
        return MotionStep(
            at=self.at(line), points=tuple(points), settings=self._settings(line), why=why, leans=True, linked=not in_spline,
            statement=line, routine=self.section, counts=tuple(counts), triggered=triggered, in_spline=in_spline,
        )  # fmt: skip

    def _point(self, operand: Operand) -> Sequence[Expression]:
        """A point: structures and variables that are joined by ``:``, or one that is computed."""
        if operand.stated is not None:
            at = (self.file, operand.start, operand.end)
            return (Lit(at=at, value=structured(operand.stated, self.file)),)
        found = self.expression(operand.words, follows=True, moves=True)
        parts = _factors(found)
        return parts if all(map(is_stated, parts)) else (found,)

    def _settings(self, line: MotionLine) -> Mapping[str, Expression]:
        """On what a motion depends beside its points."""
        if not self.found.settings:
            orients = self.found.names.orients
            self.found.settings |= {
                name: Ref(at=(0, 0, 0), name=key, key=key)
                for name, key in SETTINGS.items()
                if name != "orientation" or orients
            }
        if not line.settings and not line.angle:
            return self.found.settings
        own = {**self.found.settings, **({"angle": self.expression(line.angle)} if line.angle else {})}
        for name, words in line.settings.items():
            own |= {one: value for one, value in self.setting(name, words).items() if one in own}
        return own


def _factors(found: Expression) -> tuple[Expression, ...]:
    if isinstance(found, Op) and found.sign == ":":
        left, right = found.operands
        return (*_factors(left), right)
    return (found,)


def is_stated(point: Expression) -> bool:
    """Whether a point is a structure or a variable, and not computed."""
    return isinstance(point, Ref | Rec) or (isinstance(point, Lit) and isinstance(point.value, Structure))


class _Blocks:
    """The blocks of a routine: branches, loops and splines with the lines inside."""

    _INNER: ClassVar = {"IF": {"ELSE"}, "SWITCH": {"CASE", "DEFAULT"}}
    _CLOSING: ClassVar = frozenset(BLOCKS.values())
    _KINDS: ClassVar[Mapping[str, Literal["counted", "while", "until", "endless"]]] = {
        "FOR": "counted",
        "WHILE": "while",
        "REPEAT": "until",
        "LOOP": "endless",
    }

    def __init__(self, lines: Sequence[KrlLine], scope: RoutineScope):
        self.lines, self.scope, self.at = lines, scope, 0
        self.odd: Control | None = None
        """The line at which blocks do not match; None where all match."""
        self.depth = self.loops = self.splines = 0
        self.triggered = False

    def body(self, opening: Control | None) -> Block:
        """Lines up to the one that ends the block, or its branch; that one is not taken."""
        nodes: list[Node] = []
        own = set[str]() if opening is None else {BLOCKS[opening.keyword], *self._INNER.get(opening.keyword, ())}
        while self.at < len(self.lines) and self.odd is None:
            line = self.lines[self.at]
            keyword = line.keyword if isinstance(line, Control) else ""
            if keyword in own:
                return tuple(nodes)
            self.at += 1
            if isinstance(line, Control) and (keyword in self._CLOSING or keyword in ("ELSE", "CASE", "DEFAULT")):
                self.odd = line
            elif isinstance(line, Control) and keyword in BLOCKS:
                nodes += self._block(line)
            elif isinstance(line, MotionLine):
                motion = self.scope.motion(line, in_spline=bool(self.splines), triggered=self.triggered)
                nodes += [*self.scope.rest(line), flow.FlowStep(line=motion)]
                self.triggered = False
            else:
                self.triggered = self.triggered or (isinstance(line, Beside) and line.keyword == "TRIGGER")
                nodes += self.scope.single(line, loops=self.loops)
        if opening is not None:
            self.odd = self.odd or opening
        return tuple(nodes)

    def _block(self, opening: Control) -> Block:
        begins, branches = opening, list[tuple[Control, Block]]()
        self.depth += 1
        self.loops += opening.keyword in LOOPS
        self.splines += opening.keyword in SPLINES
        if self.depth > MAX_DEPTH:
            self.odd = opening
        while True:
            branches.append((begins, self.body(opening)))
            if self.odd is not None:
                return ()
            end = self.lines[self.at]
            assert isinstance(end, Control)
            self.at += 1
            if end.keyword == BLOCKS[opening.keyword]:
                break
            begins = end
        self.depth -= 1
        self.loops -= opening.keyword in LOOPS
        self.splines -= opening.keyword in SPLINES
        (_, body) = branches[0]
        if opening.keyword in LOOPS:
            loop = self._loop(opening, body, end)
            return (*self.scope.rest(opening, end), loop)
        if opening.keyword in SPLINES:  # where the robot is where it begins, no point of it counts from
            return (flow.FlowStep(line=Do(at=self.scope.at(opening), moves=True)), *body)
        # before the first CASE there is no branch
        value = self.scope.expression(opening.words) if opening.keyword == "SWITCH" else None
        arms = [self._arm(line, own, value) for line, own in branches[opening.keyword == "SWITCH" :]]
        conditions = tuple(arm.condition for arm in arms if arm.condition is not None)
        line = self.scope.check(opening, *conditions)
        rest = self.scope.rest(*(one for one, _ in branches))
        return (*rest, flow.Branches(line=line, name=opening.keyword, arms=tuple(arms)))

    def _loop(self, opening: Control, body: Block, end: Control) -> Node:
        scope, kind = self.scope, self._KINDS[opening.keyword]
        if kind == "counted":
            return self._counted(opening, body, end)
        closing = scope.check(end)
        condition = None
        if kind == "while":
            condition = scope.expression(opening.words)
        elif kind == "until":
            condition = scope.expression(end.words)
            closing = scope.check(end, condition)
        if not body:  # without any line of consequence
            if kind == "endless":
                return flow.Leave(line=scope.check(opening), way="stop")
            return flow.FlowStep(
                line=Check(at=scope.at(opening), conditions=(condition,) if condition is not None else ())
            )
        line = scope.check(opening, *((condition,) if kind == "while" and condition is not None else ()))
        return flow.Loop(line=line, name=opening.keyword, kind=kind, condition=condition, body=body, end=closing)

    def _counted(self, opening: Control, body: Block, end: Control) -> Node:
        assert isinstance(opening, Counting)
        scope, at = self.scope, self.scope.at(opening)
        counter = scope.ref("" if opening.counter is None else opening.counter.upper, at)
        step = () if len(opening.bounds) > 2 else (Lit(at=at, value=1.0),)
        bounds: tuple[Expression, ...] = (*map(scope.expression, opening.bounds), *step)
        if not opening.bounds:
            bounds = (Hole(at=at, why="how often the FOR is gone through is not understood"),) * 3
        bounds = tuple(Op(at=at, sign=WHOLE, operands=(one,)) for one in bounds)
        line = Steered(at=at, conditions=bounds, counter=counter, statement=opening)
        if not body:
            return flow.FlowStep(line=Do(at=at, arguments=bounds, changes=(counter,)))
        return flow.Loop(line=line, name="FOR", kind="counted", body=body, end=scope.check(end))

    def _arm(self, line: Control, body: Block, value: Expression | None) -> flow.Arm:
        """A branch.

        Args:
            line: with which it begins.
            body: its lines.
            value: of a SWITCH.
        """
        if line.keyword in ("ELSE", "DEFAULT"):
            return flow.Arm(condition=None, body=body)
        words = line.words
        if value is not None:
            cases = tuple(self.scope.expression(case) for case in split_at_commas(line.words))
            condition: Expression = Op(at=self.scope.at(line), sign=IN, operands=(value, *cases))
        else:
            words = words[:-1] if words and words[-1].upper == "THEN" else words
            condition = self.scope.expression(words)
        return flow.Arm(condition=condition, body=body)
