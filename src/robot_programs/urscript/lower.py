"""URScript lowered to the one form: the statements of functions, from their words to the nodes of routines.

What a function of the language does beside returning a value stands as a line of its own before the statement: ``set_tcp`` is an
assignment of the TCP, ``force_mode`` one of a truth value.
"""

import math
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar

from robot_programs.core import flow
from robot_programs.core.form import (
    HERE,
    Arming,
    Ask,
    Assign,
    Check,
    Do,
    Expression,
    Hole,
    Key,
    Lit,
    MoveLine,
    Op,
    Rec,
    Ref,
    Routine,
    Span,
    inside,
)
from robot_programs.core.kit import Cursor, Token, parted
from robot_programs.core.program import Frame, MotionKind, Unresolved
from robot_programs.core.values import Origin, Structure
from robot_programs.urscript.syntax import (
    KEYWORDS,
    MAX_BLOCKS,
    OPERATORS,
    PREFIXES,
    ScriptStatement,
    ScriptUnit,
    not_understood,
    plain_name,
)
from robot_programs.urscript.values import (
    ACTIVE_TCP,
    ELEMENT,
    FUNCTIONS,
    IN_FEATURE,
    LIST,
    NEAR_HERE,
    POSE,
    RESTING,
    Whole,
)

TCP = Ref(at=(0, 0, 0), name="the TCP", key="the TCP")

MOTIONS: Mapping[str, tuple[MotionKind, tuple[str, ...]]] = {
    "movej": ("joint", ("q", "a", "v", "t", "r")),
    "movel": ("linear", ("pose", "a", "v", "t", "r")),
    "movep": ("linear", ("pose", "a", "v", "r")),
    "movec": ("circular", ("pose_via", "pose_to", "a", "v", "r", "mode")),
}
"""Motions that are read, and what they are given."""

POINTS = {name: names[: 2 if kind == "circular" else 1] for name, (kind, names) in MOTIONS.items()}
"""Names of the arguments that are targets, which come first."""

STEERED = frozenset({"servoc", "servoj", "servol", "speedj", "speedl", "move_until_contact", "screw_driving"})
"""Motions that are steered while they go."""

_MODES = {
    "force_mode": "force mode", "freedrive_mode": "freedrive mode", "teach_mode": "teach mode",
    "track_conveyor_linear": "conveyor tracking", "track_conveyor_circular": "conveyor tracking",
    "path_offset_enable": "a path offset",
}  # fmt: skip
"""What moves the tool away from its targets, by the function that switches it on."""
_ENDS = {
    "end_force_mode": "force mode", "end_freedrive_mode": "freedrive mode", "end_teach_mode": "teach mode",
    "stop_conveyor_tracking": "conveyor tracking", "path_offset_disable": "a path offset",
}  # fmt: skip
_BY_HAND = frozenset({"freedrive mode", "teach mode"})
"""What lets a person move the arm, which then follows no motion: where motions lead stays as it is."""

_HALTING = frozenset({"stopj", "stopl", "reset_revolution_counter", "powerdown", "set_pos", "interpreter_mode"})
"""Behind which it is not known where the robot is: it stops, is led by what is sent to it, or is simulated elsewhere."""

_INVERSE = ("x", "qnear", "maxPositionError", "maxOrientationError", "tcp")
_WHERE_IT_IS = ("get_actual_joint_positions", "get_target_joint_positions")
"""Joint positions by which the nearest solution is chosen without them, too."""

NO_TCP = (
    "no set_tcp stands before it: the TCP is that of the robot's installation; name it in a cell file (--tool), or set it "
    "in the program"
)
FEATURE = "feature {}"
"""Name of a motion's setting: what a variable holds by which poses are moved."""
CORRECTED = "a target corrected at run time"
"""Operator of a function that does so."""


@dataclass(eq=False, kw_only=True)
class Function(Routine):
    """A routine with its text."""

    unit: ScriptUnit


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionCall(MoveLine):
    """A motion as it is called."""

    name: str
    scope: "FunctionScope"
    """Of the function that it stands in."""
    given: Mapping[str, Expression] = field(default_factory=dict[str, Expression])
    """Arguments by their names."""


class Return(Check):
    """What a function returns."""


def by_name(names: Sequence[str], items: Sequence[Expression], keys: Sequence[str]) -> dict[str, Expression] | None:
    """Arguments of a call by their names; None where there are others."""
    given = {
        key or (names[k] if k < len(names) else ""): one for k, (key, one) in enumerate(zip(keys, items, strict=True))
    }
    return given if len(given) == len(keys) and given.keys() <= set(names) else None


class _UrscriptReader(Cursor):
    """Expressions of URScript."""

    BINDING: ClassVar = OPERATORS
    PREFIXES: ClassVar = PREFIXES

    def __init__(self, found: Sequence[Token], scope: "FunctionScope"):
        super().__init__(found, scope.unit.file)
        self.scope = scope
        self.bracketed = list[Expression]()
        routines = scope.others.by_name
        calls = (
            [k for k in range(len(found) - 1) if found[k + 1].text == "(" and found[k].text in routines]
            if routines
            else []
        )
        self.last_call = calls[-1] if calls else -1
        """Number of the word that calls a function of the program last: what is read before it is held."""

    def all(self) -> Expression:
        """The expression that all words are.

        Raises:
            Unresolved: they are none.
        """
        found = self.expression()
        if not self.done:
            raise self.problem(f"'{self.next.text}' is not evaluated")
        return found

    @property
    def sign(self) -> str:
        return self.next.text

    def operation(self, start: int, sign: str, *operands: Expression) -> Expression:
        first, compares = operands[0], OPERATORS["=="]
        chained = isinstance(first, Op) and OPERATORS.get(sign) == compares == OPERATORS.get(first.sign)
        if chained and first not in self.bracketed:
            raise self.problem("the manual does not tell what a < b < c is")
        if sign == "-" and len(operands) == 1 and isinstance(first, Lit) and isinstance(first.value, Whole):
            return Lit(at=self.span(start), value=Whole(-first.value))
        return super().operation(start, sign, *operands)

    def single(self) -> Expression:
        start, self.height = self.place, 0
        value = self._single()
        while self.accept("["):
            height, index = self.height, self.expression()
            self.grow(max(height, self.height))
            self.expect("]")
            at = self.span(start)
            if isinstance(value, Ref):
                value = replace(value, at=at, path=(*value.path, (index,)))
            else:
                value = Op(at=at, sign=ELEMENT, operands=(value, index))
        return value

    def _single(self) -> Expression:
        start, number, word = self.place, self.number, self.take()
        match word.kind, word.text:
            case "number", text:
                return Lit(at=self.span(start), value=_number(text))
            case "text", text:
                return Lit(at=self.span(start), value=text[1:-1])
            case "name", "True" | "False":
                return Lit(at=self.span(start), value=word.text == "True")
            case "name", "PI":
                return Lit(at=self.span(start), value=math.pi)
            case "name", "p" if self.sticks and self.accept("["):
                items, _ = self.items("]")
                if len(items) != 6:
                    return Hole(at=self.span(start), why="what stands in p[…] is not six numbers")
                return self._listed(POSE, items, start)
            case "name", name if name not in KEYWORDS:
                if self.accept("("):
                    return self.scope.call(name, *self.items(")"), self.span(start))
                ref = self.scope.ref(name, self.span(start))
                return self.scope.hold(ref) if number < self.last_call else ref
            case "mark", "[":
                return self._listed(LIST, self.items("]")[0], start)
            case "mark", "(":
                value = self.expression()
                self.expect(")")
                self.bracketed.append(value)
                return value
            case _:
                raise self.problem(f"'{word.text}' is not evaluated")

    def _listed(self, kind: str, items: Sequence[Expression], start: int) -> Expression:
        at = self.span(start)
        if all(isinstance(item, Lit) for item in items):
            values: dict[Hashable, Any] = {k: item.value for k, item in enumerate(items) if isinstance(item, Lit)}
            return Lit(at=at, value=Structure(kind=kind, parts=values, origin=Origin(at=at, owner=None)))
        return Rec(at=at, kind=kind, parts=dict(enumerate(items)))

    def items(self, closing: str) -> tuple[tuple[Expression, ...], tuple[str, ...]]:
        """Values up to a closing bracket, and the names by which those of a call are given."""
        items: list[Expression] = []
        keys: list[str] = []
        height = 0
        while not self.accept(closing):
            key = ""
            if closing == ")" and self.next.kind == "name" and self.behind_next.text == "=":
                key = self.take().text
                self.take()
            elif any(keys):
                raise self.problem("an argument without a name stands behind one with a name")
            items.append(self.expression())
            keys.append(key)
            height = max(height, self.height)
            if self.next.text != closing:
                self.expect(",")
        self.height = height
        self.grow(height)
        return tuple(items), tuple(keys)


def _number(text: str) -> float:
    if text[:2] in ("0x", "0X"):
        return Whole(int(text, 16))
    return Whole(int(text)) if text.isdecimal() and len(text) < 16 else float(text)


@dataclass(eq=False, kw_only=True)
class LoweredUrscript:
    """A program that is lowered."""

    routines: Sequence[Function]
    """In the order of the text."""
    strange: dict[str, list[tuple[int, int]]] = field(default_factory=dict[str, list[tuple[int, int]]])
    """Functions that no file has, and where they are called: file and place."""
    by_hand: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    """Where a thread lets a person move the arm."""
    corrects: str = ""
    """How functions begin that correct a target at run time, to which motions are left out; empty where there are none."""
    shared: frozenset[str] = frozenset()
    """Global variables: those that are said to be anywhere, or are set outside of all functions."""
    features: Sequence[str] = ()
    """Variables by which poses are moved."""
    servers: frozenset[str] = frozenset()
    """Variables that are servers, whose functions do not move the robot."""
    modes: tuple[Ref, ...] = ()
    """What the program switches on that moves the tool away from its targets, as data."""
    by_name: dict[str, list[Function]] = field(default_factory=dict[str, list[Function]])
    """Functions by name."""
    moved_by_hand: frozenset[ScriptUnit] = frozenset()
    """Functions of threads alone."""
    settings: dict[object, Mapping[str, Expression]] = field(default_factory=dict[object, Mapping[str, Expression]])
    """On what motions depend beside their points, shared by those that say the same."""

    def reached(self, units: Iterable[ScriptUnit]) -> set[ScriptUnit]:
        """Some units, and all that they call."""
        return flow.reached(units, lambda unit: (one.unit for name in unit.calls for one in self.by_name.get(name, ())))


_BESIDE = ("thread", "sec")
"""Kinds of units that run beside the lines of others."""


def lowered(units: Sequence[ScriptUnit], tool: Frame | None, corrects: str) -> LoweredUrscript:
    """Routines of a program.

    Args:
        units: of all files.
        tool: the TCP that is active before the first ``set_tcp``.
        corrects: how functions begin that correct a target at run time.

    Raises:
        FileError: a header is not understood.
    """
    outside = {unit.file: Function(name=unit.name, unit=unit) for unit in units if not unit.kind}
    routines = [
        outside[unit.file] if not unit.kind
        else Function(
            name=unit.name, unit=unit, beside=unit.kind in _BESIDE,
            behind=None if unit.kind == "thread" else outside[unit.file],
        )
        for unit in units
    ]  # fmt: skip
    called = {name for unit in units for name in unit.calls}
    modes = sorted({_MODES[name] for name in called & _MODES.keys()})
    found = LoweredUrscript(
        routines=routines,
        corrects=corrects,
        shared=frozenset(name for unit in units for name in unit.shared),
        features=sorted({name for unit in units for name in unit.features}),
        servers=frozenset(name for unit in units for name in unit.servers),
        modes=tuple(Ref(at=(0, 0, 0), name=mode, key=mode) for mode in modes),
    )
    for routine in routines:
        if routine.unit.kind:
            found.by_name.setdefault(routine.name, []).append(routine)
    of_threads = found.reached(unit for unit in units if unit.kind in _BESIDE)
    found.moved_by_hand = frozenset(of_threads - found.reached(unit for unit in units if unit not in of_threads))
    scopes = {routine: FunctionScope(routine=routine, others=found) for routine in routines}
    for routine, scope in scopes.items():
        routine.parameters = tuple(scope.key(name) for name, _ in routine.unit.parameters)
    for routine, scope in scopes.items():
        own = [*scope.beginning(tool)] if not routine.unit.kind else []
        routine.nodes = (*own, *scope.block(routine.unit.head.body))
        routine.unit.head.body.clear()  # its words take more memory than its nodes
    return found


@dataclass(eq=False, kw_only=True)
class FunctionScope:
    """A function that is lowered, and what names mean in it."""

    routine: Function
    others: LoweredUrscript
    steps: list[flow.Node] = field(default_factory=list[flow.Node])
    """What functions of the language do in the statement that is read."""
    loops: list[str] = field(default_factory=list[str])
    """Labels of the loops around it, the innermost last."""
    keys: dict[str, Key] = field(default_factory=dict[str, Key])

    @property
    def unit(self) -> ScriptUnit:
        """Its text."""
        return self.routine.unit

    # Names.

    def key(self, name: str) -> Key:
        """The variable that a name means: a global one, or that of the innermost function around that sets it.

        Universal Robots, *Script manual, e-Series*: scoping rules.
        """
        if name not in self.keys:
            own, around = self.unit, self.unit.parent
            if name not in own.own and name not in self.others.shared:
                while around is not None and around.kind:
                    if name in around.own or name in around.assigned:
                        own = around
                        break
                    around = around.parent
            is_global = name in self.others.shared and name not in own.own
            self.keys[name] = name if is_global else (name, own.file, own.head.start, own.kind)
        return self.keys[name]

    def ref(self, name: str, at: Span) -> Ref:
        """A variable, or a field of it."""
        plain, *fields = name.split(".")
        return Ref(at=at, name=name, key=self.key(plain), path=tuple(fields))

    def hold(self, ref: Ref) -> Ref:
        """What a variable holds before a function is called that may set it."""
        held = Ref(at=ref.at, name=ref.name, key=("held", *ref.at))
        self.steps.append(flow.FlowStep(line=Assign(at=ref.at, target=held, value=ref)))
        return held

    # Calls.

    def call(self, name: str, items: tuple[Expression, ...], keys: tuple[str, ...], at: Span) -> Expression:
        """The value of a call; what it does otherwise becomes a line."""
        if self.others.corrects and name.startswith(self.others.corrects):
            return Op(at=at, sign=CORRECTED, operands=items)
        if name in self.others.by_name:
            return self._own(name, items, keys, at)
        if name == "struct" and all(keys):
            return Rec(at=at, kind="struct", parts=dict(zip(keys, items, strict=True)))
        if self._does(name, items, keys, at):
            return Hole(at=at, why=f"what {name} returns is known only at run time")
        if name in FUNCTIONS:
            names = FUNCTIONS[name][0]
            given = by_name(names, items, keys)
            if given is None or len(given) != len(names):
                return Hole(at=at, why=f"{name} is not given what it takes")
            items = tuple(given[one] for one in names)
            frame = items[0]
            if name == "pose_trans" and isinstance(frame, Ref) and all(isinstance(step, str) for step in frame.path):
                return Op(at=at, sign=IN_FEATURE, operands=(Lit(at=frame.at, value=(frame.name, frame.key)), *items))
        elif name == "get_inverse_kin":
            given = by_name(_INVERSE, items, keys) or {}
            near = given.get("qnear", Lit(at=at, value=NEAR_HERE))
            if isinstance(near, Op) and near.sign in _WHERE_IT_IS:
                near = Lit(at=near.at, value=NEAR_HERE)
            pose = given.get("x", Hole(at=at, why=f"what {name} returns is known only at run time"))
            items = (pose, near, given.get("tcp", Lit(at=at, value=ACTIVE_TCP)))
        elif name == "get_forward_kin" and "q" in (given := by_name(("q", "tcp"), items, keys) or {}):
            why = "the TCP of get_forward_kin is not known"
            items = (given["q"], Hole(at=at, why=why) if "tcp" in given else TCP)
        return Op(at=at, sign=name, operands=items)

    def _own(self, name: str, items: Sequence[Expression], keys: Sequence[str], at: Span) -> Expression:
        """The value of a function of the program."""
        found = self.others.by_name[name]
        routines = [one for one in found if one.unit.file == self.unit.file] or found
        parameters = routines[0].unit.parameters
        names = [name for name, _ in parameters]
        given = {
            key or (names[k] if k < len(names) else ""): one
            for k, (key, one) in enumerate(zip(keys, items, strict=True))
        }
        arguments = [given.get(one) or self._default(routines[0], one, words, at) for one, words in parameters]
        return Ask(at=at, name=name, arguments=tuple(arguments), routines=tuple(routines))

    def _default(self, routine: Function, name: str, words: Sequence[Token], at: Span) -> Expression:
        if not words:
            return Hole(at=at, why=f"{routine.name} is not given {name}")
        try:
            return _UrscriptReader(words, FunctionScope(routine=routine, others=self.others)).all()
        except Unresolved as why:
            return Hole(at=at, why=str(why))

    def _does(self, name: str, items: Sequence[Expression], keys: Sequence[str], at: Span) -> bool:
        """Add what a function of the language does beside returning a value; whether it does anything."""
        if name == "set_tcp":
            self._add(self._tcp(by_name(("pose", "tcp_name"), items, keys) or {}, at))
        elif (mode := _MODES.get(name) or _ENDS.get(name)) is not None:
            if mode in _BY_HAND and self.unit in self.others.moved_by_hand:
                self.others.by_hand += [at[:2]] if name in _MODES else []
                return True
            for one in self.others.modes:
                if one.key == mode:
                    self._add(Assign(at=at, target=one, value=Lit(at=at, value=name in _MODES)))
            self._add(Do(at=at, arguments=tuple(items), moves=True))
        elif name in STEERED or name in MOTIONS:
            why = "is steered while it goes" if name in STEERED else "is part of an expression"
            given = {str(k): item for k, item in enumerate(items)}
            self._add(MotionCall(at=at, name=name, scope=self, given=given, points=tuple(items), why=f"it {why}"))
        elif name in RESTING or name in FUNCTIONS or plain_name(name) in self.others.servers:
            return False
        else:
            if name not in _HALTING:
                self.others.strange.setdefault(name, []).append(at[:2])
            self._add(Do(at=at, arguments=tuple(items), moves=True))
        return True

    def _tcp(self, given: Mapping[str, Expression], at: Span) -> Assign:
        pose = given.get("pose", Hole(at=at, why="it is given no pose"))
        stated = Lit(at=at, value=pose.name if isinstance(pose, Ref) and not pose.path else None)
        operands = (pose, given.get("tcp_name", stated))
        return Assign(at=at, target=TCP, value=Op(at=at, sign="set_tcp", operands=operands))

    def _add(self, line: Assign | Do | MoveLine) -> None:
        self.steps.append(flow.FlowStep(line=line))

    # Statements.

    def beginning(self, tool: Frame | None) -> Iterator[flow.Node]:
        """What holds before the statements outside of all functions."""
        at = (self.unit.file, 0, 0)
        value = Hole(at=at, why=NO_TCP) if tool is None else Lit(at=at, value=tool)
        yield flow.FlowStep(line=Assign(at=at, target=TCP, value=value))
        for mode in self.others.modes:
            yield flow.FlowStep(line=Assign(at=at, target=mode, value=Lit(at=at, value=False)))
        programs = tuple(one for one in self.others.routines if one.unit.kind == "sec")
        if programs:
            yield flow.FlowStep(line=Arming(at=at, routines=programs))

    def block(self, statements: Iterable[ScriptStatement]) -> tuple[flow.Node, ...]:
        """Nodes of some statements."""
        return tuple(node for statement in statements for node in self._statement(statement))

    def _statement(self, statement: ScriptStatement) -> list[flow.Node]:
        found, at = statement.words, (self.unit.file, statement.start, statement.begins)
        match statement.first:
            case "if":
                return self._branches([statement, *statement.others])
            case "while":
                return self._loop(statement)
            case _:
                pass
        self.steps = []
        try:
            nodes = list(self._nodes(found, at))
        except Unresolved:
            self.steps, nodes = [], self._broken(found, at)
        return [*self.steps, *nodes]

    def _broken(self, found: Sequence[Token], at: Span) -> list[flow.Node]:
        """What is not understood: it may be motions, also in lines behind a bracket that is open, and may call what it names."""
        called = [word.text for word, behind in pairwise(found) if behind.text == "("]
        routines = tuple(one for name in dict.fromkeys(called) for one in self.others.by_name.get(name, ()))
        motions = (
            MotionCall(at=(self.unit.file, word.start, at[2]), name=word.text, scope=self, why="its statement is not understood")
            for word in found if word.kind == "name" and (word.text in MOTIONS or word.text in STEERED)
        )  # fmt: skip
        return [
            *(flow.FlowStep(line=one) for one in motions),
            flow.Unknown(line=Do(at=at, routines=routines, moves=True)),
        ]

    def _head(self, statement: ScriptStatement) -> tuple[Expression, list[flow.Node]]:
        """The condition of a header, and what functions in it do.

        Raises:
            FileError: it is not understood, so that what stands in its block is not either; but for ``elif``.
        """
        self.steps = []
        try:
            if statement.words[-1].text != ":":
                raise Unresolved("its colon is missing")
            return _UrscriptReader(statement.words[1:-1], self).all(), self.steps
        except Unresolved:
            if statement.first == "elif":
                raise
            raise not_understood(self.unit.source, statement) from None

    def _arm(self, head: ScriptStatement) -> tuple[flow.Arm, list[flow.Node]]:
        """A branch, and what functions in its condition do."""
        broken: list[flow.Node] = []
        try:
            condition, steps = self._head(head)
        except Unresolved:
            at = (self.unit.file, head.start, head.begins)
            condition, steps, broken = (
                Hole(at=at, why="it is not understood"),
                list[flow.Node](),
                self._broken(head.words, at),
            )
        return flow.Arm(condition=condition, body=(*broken, *self.block(head.body))), steps

    def _branches(
        self, arms: Sequence[ScriptStatement], read: tuple[flow.Arm, list[flow.Node]] | None = None, depth: int = 0
    ) -> list[flow.Node]:
        """Nodes of some branches, of which the first may have been read already."""
        first, *others = arms
        if first.first == "else":
            nodes = self.block(first.body)
            if len(first.words) == 2:
                return list(nodes)
            return [*self._broken(first.words, (self.unit.file, first.start, first.begins)), *nodes]
        arm, before = read or self._arm(first)
        found, read = [arm], None
        while others and others[0].first == "elif":
            read = self._arm(others[0])
            calls = read[1] or any(isinstance(one, Ask) for one in inside(read[0].condition))
            if calls and depth < MAX_BLOCKS:  # only where no branch before is taken
                break
            found.append(read[0])
            before, read = [*before, *read[1]], None
            del others[0]
        conditions = tuple(one.condition for one in found)
        if others:
            found.append(flow.Arm(condition=None, body=tuple(self._branches(others, read, depth + 1))))
        at = (self.unit.file, first.start, first.begins)
        line = Check(at=at, conditions=conditions)
        return [*before, flow.Branches(line=line, name="if", arms=tuple(found))]

    def _loop(self, statement: ScriptStatement) -> list[flow.Node]:
        condition, before = self._head(statement)
        at, label = (self.unit.file, statement.start, statement.begins), str(statement.start)
        self.loops.append(label)
        body = self.block(statement.body)
        self.loops.pop()
        if statement.continued:
            body = (*body, flow.Label(line=None, name=label))
        kind = "endless" if isinstance(condition, Lit) and condition.value is True else "while"
        assert statement.end is not None
        loop = flow.Loop(
            line=Check(at=at, conditions=(condition,)),
            name="while",
            kind=kind,
            condition=condition,
            body=(*body, *before),
            end=Check(at=(self.unit.file, statement.end.start, statement.end.end)),
        )
        return [*before, loop]

    def _nodes(self, found: Sequence[Token], at: Span) -> Iterator[flow.Node]:
        match [word.text for word in found]:
            case ["break"]:
                yield flow.Leave(line=None, way="exit")
            case ["continue"]:
                yield flow.Leave(line=None, way="jump", label=self.loops[-1])
            case ["halt"] | ["halt", "(", ")"]:
                yield flow.Leave(line=None, way="stop")
            case ["return"]:
                yield flow.Leave(line=None, way="return")
            case ["return", *_]:
                yield flow.Leave(line=Return(at=at, conditions=(_UrscriptReader(found[1:], self).all(),)), way="return")
            case ["pass"]:
                pass
            case ["kill" | "join" | "enter_critical" | "exit_critical", behind, *_] if behind != "=":
                pass
            case _:
                yield from self._other(found, at)

    def _other(self, found: Sequence[Token], at: Span) -> Iterator[flow.Node]:
        """An assignment, a declaration, the start of a thread, or what is called for what it does."""
        target, *value = parted(found, "=")
        scope = found[0].text in ("global", "local")
        last = value[0] if value else target
        if last and last[0].text == "run":
            call = _UrscriptReader(
                found[len(found) - len(last) + 1 :], self
            ).all()  # the handle of a thread is no value
            if not isinstance(call, Ask | Op | Hole):
                raise Unresolved("what is run is not called")
            if isinstance(call, Ask):
                yield flow.FlowStep(line=Arming(at=at, routines=call.routines))
        elif value:
            ref = _UrscriptReader(target[scope:], self).all()
            if not isinstance(ref, Ref):
                raise Unresolved("what is set is no variable")
            expression = _UrscriptReader(found[len(target) + 1 :], self).all()
            yield flow.FlowStep(line=Assign(at=at, target=ref, value=expression))
        elif scope:
            if not isinstance(_UrscriptReader(found[1:], self).all(), Ref):
                raise Unresolved("what is declared is no variable")
        else:
            yield from self._evaluated(found, at)

    def _evaluated(self, found: Sequence[Token], at: Span) -> Iterator[flow.Node]:
        reader = _UrscriptReader(found, self)
        first = reader.next.text
        if first in MOTIONS and first not in self.others.by_name and reader.behind_next.text == "(":
            name, _ = reader.take().text, reader.take()
            items, keys = reader.items(")")
            if not reader.done:
                raise reader.problem("a motion is part of an expression")
            yield flow.FlowStep(line=self._motion(name, items, keys, at))
            return
        match reader.all():
            case Ask() as call:
                yield flow.FlowStep(line=Do(at=call.at, routines=call.routines, arguments=call.arguments))
            case Lit() | Hole():
                pass
            case expression if any(isinstance(one, Ref | Ask) for one in inside(expression)):
                yield flow.FlowStep(line=Check(at=at, conditions=(expression,)))
            case _:
                pass

    def _motion(self, name: str, items: Sequence[Expression], keys: Sequence[str], at: Span) -> MoveLine | Do:
        _, names = MOTIONS[name]
        if any(isinstance(one, Op) and one.sign == CORRECTED for item in items for one in inside(item)):
            return Do(at=at, arguments=tuple(items), moves=True)
        given = by_name(names, items, keys)
        if given is None or not given.keys() >= set(POINTS[name]):
            why = f"its arguments are not those of {name}({', '.join(names)})"
            return MotionCall(at=at, name=name, scope=self, points=tuple(items), why=why)
        own = {one: given[one] for one in ("r", "t", "v", "mode") if one in given}
        if "mode" in given:
            own["before"] = Ref(at=at, name="the motion before", key=HERE)
        if not isinstance(given[POINTS[name][-1]], Lit):  # what it computes may count in any of them
            own |= {FEATURE.format(one): Ref(at=at, name=one, key=self.key(one)) for one in self.others.features}
        constants = {one: value.value if isinstance(value, Lit) else value for one, value in own.items()}
        key = tuple(
            (one, type(value), value.key if isinstance(value, Ref) and not value.path else value)
            for one, value in constants.items()
        )
        if key not in self.others.settings:
            self.others.settings[key] = {"tcp": TCP, **{mode.name: mode for mode in self.others.modes}, **own}
        points = tuple(given[one] for one in POINTS[name])
        return MotionCall(at=at, name=name, scope=self, given=given, points=points, settings=self.others.settings[key])
