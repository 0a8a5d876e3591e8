"""Programs of a small language with its own evaluator, written out in every language, and made at random.

What a reader understands of them is compared with what the evaluator does: it runs a program, statement by statement, and
knows nothing of how programs are read.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any, ClassVar

import numpy as np

from robot_programs.core.source import Source
from tests.robot_programs.written import (
    krl_frame,
    krl_joints,
    millimetres,
    rapid_pose,
    tp_angles,
    urscript_joints,
    urscript_pose,
)

POINTS, NUMBERS, COUNTERS, ELEMENTS = ("p1", "p2"), ("n1", "n2"), ("c1", "c2"), 3
FIXED = {"k1": (11, 22, 33), "k2": (44, 55, 66)}
"""Targets that are declared and never change."""
AXES = "xyz"
FRAMES = {1: (0, 0, 0), 2: (100, 0, 50)}
TOOLS = {1: (0, 0, 0), 2: (0, 0, 30)}
"""Frames and tools that are declared, by their numbers; tools in the tool of the writer."""


# Expressions: tuples that name what they are.
#
# ("number", 3), ("read", "n1"), ("part", target, "x"), (sign, a, b), ("asks", function, target, number), ("sensor",);
# targets: ("point", "p1"), ("element", index), ("beside", target, number), ("calls", …).

Node = tuple[Any, ...]


@dataclass
class Statement:
    """One line, with the blocks in it."""

    kind: str
    given: tuple[Any, ...] = ()
    blocks: tuple[list["Statement"], ...] = ()
    line: int = 0
    """Of a motion, in the text written last."""


@dataclass
class Routine:
    """A procedure or a function of a target and a number."""

    name: str
    body: list[Statement]
    result: Node | None = None
    """What a function returns at its end: a target, or a number."""
    gives: str = ""
    """Function of a number where it is not of a target."""

    @property
    def computes(self) -> bool:
        """Whether it is a function that does nothing else."""
        return self.result is not None and all(one.given[0] == ("point", "q") for one in self.body)

    @property
    def kind(self) -> str:
        """Of its head and its end."""
        own = self.name if self.name in ("main", "side") else ""
        return own or ("procedure" if self.result is None else f"{self.gives}function")


@dataclass
class Program:
    """Procedures and functions, the main one last."""

    routines: list[Routine]
    beside: Routine | None = None
    """Runs between any two statements, or not: an interrupt."""

    @property
    def all(self) -> list[Routine]:
        return [*([] if self.beside is None else [self.beside]), *self.routines]


def statements(block: Sequence[Statement]) -> Iterator[Statement]:
    """All of a block, those inside others included."""
    for one in block:
        yield one
        for inner in one.blocks:
            yield from statements(inner)


# Making them at random.


@dataclass
class Maker:
    """Makes statements."""

    rng: Random
    sensors: bool
    """Whether anything is read that a text cannot tell."""
    callable: list[Routine] = field(default_factory=list[Routine])
    inside: bool = False
    """In a routine that is given a target ``q`` and a number ``d``."""
    jumps: bool = False
    """Loops are written by labels, too."""

    def pick(self, *ways: Callable[[], Any]) -> Any:
        return self.rng.choice(ways)()

    def number(self, depth: int = 2) -> Node:
        ways = [
            lambda: ("number", self.rng.randint(1, 60)),
            lambda: ("read", self.rng.choice((*NUMBERS, *COUNTERS, *(["d"] if self.inside else [])))),
            lambda: ("part", self.variable(), self.rng.choice(AXES)),
        ]
        asked = [one for one in self.callable if one.gives and one.computes]
        if asked and depth and not self.inside:
            ways.append(lambda: ("asks", self.rng.choice(asked), self.variable(), self.number(0)))
        if depth:
            ways += [lambda: (self.rng.choice("+-"), self.number(depth - 1), self.number(depth - 1))] * 2
        return self.pick(*ways)

    def index(self) -> Node:
        return self.pick(
            lambda: ("number", self.rng.randint(1, ELEMENTS)), lambda: ("wrapped", self.rng.choice(COUNTERS))
        )

    def variable(self) -> Node:
        ways = [lambda: ("point", self.rng.choice(POINTS)), lambda: ("element", self.rng.randint(1, ELEMENTS))]
        return self.pick(*ways, *([lambda: ("point", "q")] if self.inside else []))

    def target(self, *, moves: bool = False) -> Node:
        """A target.

        Args:
            moves: of a motion: functions that do more than compute it are not asked, and a declared one may be named, by which
                nothing is decided where an operator may change it.
        """
        functions = [
            one for one in self.callable if not one.gives and (one.computes or (one.result is not None and not moves))
        ]
        ways = [self.variable, self.variable, lambda: ("beside", self.variable(), self.number(0))]
        if moves:
            ways += [self.fixed, lambda: ("beside", self.fixed(), self.number(0))]
        if functions and not self.inside:
            ways.append(lambda: ("calls", self.rng.choice(functions), self.variable(), self.number(0)))
            if computing := [one for one in functions if one.computes]:
                called = ("calls", self.rng.choice(computing), self.variable(), self.number(0))
                ways.append(lambda: ("beside", called, self.number(0)))
                ways.append(lambda: ("calls", self.rng.choice(computing), called, self.number(0)))
        return self.pick(*ways, lambda: ("literal", *(self.rng.randint(0, 90) for _ in AXES)))

    def fixed(self) -> Node:
        return ("point", self.rng.choice(list(FIXED)))

    def condition(self) -> Node:
        if self.sensors and self.rng.random() < 0.4:
            return ("input",)
        return (self.rng.choice(("<", ">=", "=")), self.number(1), self.number(0))

    def block(self, size: int, *, loops: int = 2) -> list[Statement]:
        return [self.statement(loops) for _ in range(self.rng.randint(1, size))]

    def statement(self, loops: int) -> Statement:
        procedures = [routine for routine in self.callable if routine.result is None]
        ways: list[Callable[[], Statement]] = [
            lambda: Statement("move", (self.target(moves=True),)),
            lambda: Statement("move", (self.target(moves=True),)),
            lambda: Statement("set number", (self.rng.choice(NUMBERS), self.number())),
            lambda: Statement("set part", (self.variable(), self.rng.choice(AXES), self.number())),
            lambda: Statement("set point", (self.variable(), self.target())),
            lambda: Statement("set element", (self.index(), self.variable())),
            lambda: Statement("set frame", (self.rng.choice(AXES), self.number())),
            lambda: Statement("if", (self.condition(),), (self.block(2, loops=0), self.block(2, loops=0))),
            lambda: Statement("case", (self.rng.choice(COUNTERS),), (self.block(2, loops=0), self.block(2, loops=0))),
        ]
        if self.sensors:
            ways += [lambda: Statement("set part", (self.variable(), self.rng.choice(AXES), ("sensor",)))] * 2
            ways += [lambda: Statement("set number", (self.rng.choice(NUMBERS), ("sensor",)))]
            ways += [lambda: Statement("set frame", (self.rng.choice(AXES), ("sensor",)))]
            ways += [lambda: Statement("strange", (("point", self.rng.choice(POINTS)),))]
        if procedures and not self.inside:
            ways += [lambda: Statement("call", (self.rng.choice(procedures), self.variable(), self.number(0)))] * 2
        if loops:
            counter = COUNTERS[loops - 1]
            ways += [lambda: Statement("for", (counter, self.rng.randint(1, 3)), (self.block(3, loops=loops - 1),))] * 2
            for kind in ("while", *(("repeat", "jumps") if self.jumps else ())):
                ways += [
                    lambda kind=kind: Statement(
                        kind, (counter, self.rng.randint(1, 3)), (self.block(3, loops=loops - 1),)
                    )
                ]
        return self.pick(*ways)


def random_program(rng: Random, *, sensors: bool, jumps: bool = False) -> Program:
    """A program; its loops end, and it needs no data that are not set before."""
    maker = Maker(rng=rng, sensors=sensors, jumps=jumps)
    routines: list[Routine] = []
    for k in range(rng.randint(0, 3)):
        inside = replace(maker, inside=True)
        moves = rng.random() < 0.5
        body = [one for one in inside.block(4, loops=0) if moves or one.kind in ("set part", "set number")]
        number = not moves and rng.random() < 0.4
        result = None if moves else inside.number() if number else inside.variable()
        routines.append(Routine(f"r{k}", body, result, "number " if number else ""))
    main = Routine("main", replace(maker, callable=list(routines)).block(9))
    beside = [one for one in maker.block(3, loops=0) if one.kind in ("set part", "set number", "set frame")]
    return Program([*routines, main], Routine("side", beside) if sensors and beside and rng.random() < 0.4 else None)


# Running them.


@dataclass
class Machine:
    """A robot that notes where each line sends it."""

    sensor: Callable[[], int]
    data: dict[Any, Any] = field(default_factory=dict[Any, Any])
    went: set[tuple[int, tuple[int, ...]]] = field(default_factory=set[tuple[int, tuple[int, ...]]])
    """Line and place outside of any frame, of the tool as the writer has it."""
    before: dict[tuple[int, tuple[int, ...]], set[tuple[int, tuple[int, ...]] | None]] = field(default_factory=dict)
    """What it went to before each of them; None at the start."""
    last: tuple[int, tuple[int, ...]] | None = None
    beside: list[Statement] = field(default_factory=list[Statement])

    class Returned(Exception):
        """A routine is left."""

    def run(self, program: Program) -> None:
        self.data = {name: [10 * k, 20 * k, 30 * k] for k, name in enumerate(POINTS, 1)}
        self.data |= {name: list(xyz) for name, xyz in FIXED.items()}
        self.data |= {k: [k, 2 * k, 3 * k] for k in range(1, ELEMENTS + 1)}
        self.data |= {name: k for k, name in enumerate((*NUMBERS, *COUNTERS), 1)} | {
            "frame": [0, 0, 0],
            "tool": TOOLS[1],
        }
        self.beside = [] if program.beside is None else program.beside.body
        self.block(program.routines[-1].body)

    def value(self, node: Node) -> int:
        match node:
            case ("number", value):
                return value
            case ("read", name):
                return self.data[name]
            case ("part", target, axis):
                return self.target(target)[AXES.index(axis)]
            case ("sensor",):
                return self.sensor()
            case ("asks", routine, target, number):
                return self.call(routine, target, number)
            case ("+", a, b):
                return self.value(a) + self.value(b)
            case (_, a, b):
                return self.value(a) - self.value(b)
            case _:
                raise AssertionError(node)

    def index(self, node: Node) -> int:
        if node[0] == "read":
            return self.data[node[1]]
        return node[1] if node[0] == "number" else self.data[node[1]] % ELEMENTS + 1

    def holds(self, node: Node) -> bool:
        match node:
            case ("input",):
                return self.sensor() % 2 == 0
            case (sign, a, b):
                left, right = self.value(a), self.value(b)
                return {"<": left < right, ">=": left >= right, "=": left == right}[sign]
            case _:
                raise AssertionError(node)

    def key(self, node: Node) -> Any:
        return node[1] if node[0] == "point" else self.index(node[1]) if isinstance(node[1], tuple) else node[1]

    def target(self, node: Node) -> list[int]:
        match node:
            case ("beside", target, by):
                x, y, z = self.target(target)
                return [x, y, z + self.value(by)]
            case ("literal", *xyz):
                return list(xyz)
            case ("calls", routine, target, number):
                return self.call(routine, target, number)
            case _:
                return list(self.data[self.key(node)])

    def call(self, routine: Routine, target: Node, number: Node) -> Any:
        outside = {name: self.data.get(name) for name in ("q", "d")}
        self.data["q"], self.data["d"] = self.target(target), self.value(number)
        with suppress(self.Returned):
            self.block(routine.body)
        result = [] if routine.result is None else (self.value if routine.gives else self.target)(routine.result)
        self.data |= outside
        return result

    def block(self, block: Sequence[Statement]) -> None:
        for statement in block:
            if self.beside and self.sensor() % 3 == 0:
                beside, self.beside = self.beside, []
                self.block(beside)
                self.beside = beside
            self.step(statement)

    def step(self, one: Statement) -> None:
        match one.kind, one.given:
            case "move", (target,):
                places = zip(self.target(target), self.data["frame"], self.data["tool"], strict=True)
                now = one.line, tuple(at + frame - tool for at, frame, tool in places)
                self.went.add(now)
                self.before.setdefault(now, set()).add(self.last)
                self.last = now
            case "return", ():
                raise self.Returned
            case "as long as", (condition,):
                while self.holds(condition):
                    self.block(one.blocks[0])
            case "if", (condition,):
                self.block(one.blocks[not self.holds(condition)])
            case "case", (name,):
                self.block(one.blocks[self.data[name] not in (1, 2)])
            case "call", (routine, target, number):
                self.call(routine, target, number)
            case "for" | "while" | "repeat" | "jumps", (name, count):
                self.turns(name, count, one.blocks[0])
            case _:
                self.set(one)

    def set(self, one: Statement) -> None:
        match one.kind, one.given:
            case "set number", (name, node):
                self.data[name] = self.value(node)
            case "set part", (target, axis, node):
                self.data[self.key(target)][AXES.index(axis)] = self.value(node)
            case "set point", (target, source):
                self.data[self.key(target)] = self.target(source)
            case "set element", (index, source):
                self.data[self.index(index)] = self.target(source)
            case "strange", (target,):
                self.data[self.key(target)] = [self.sensor() for _ in AXES]
            case "set frame", (axis, node):
                self.data["frame"][AXES.index(axis)] = self.value(node)
            case "select frame", (number,):
                self.data["frame"] = list(FRAMES[number])
            case "select tool", (number,):
                self.data["tool"] = TOOLS[number]
            case _:
                raise AssertionError(one)

    def turns(self, name: str, count: int, block: Sequence[Statement]) -> None:
        self.data[name] = 1
        while self.data[name] <= count:
            self.block(block)
            self.data[name] += 1


# Writing them.


class Writer:
    """Writes a program in a language, one statement or more a line."""

    FORMS: ClassVar[Mapping[str, str]]
    """Lines of each statement, with what it is given; those that begin and end a block, and that stand between two."""
    NODES: ClassVar[Mapping[str, str]]
    """Of each expression."""

    def __init__(self, tool: np.ndarray | None = None, home: Sequence[float] = ()) -> None:
        """Write for a robot.

        Args:
            tool: tool 1 in the flange, metres.
            home: joint positions to which a program goes first, degrees; none where empty.
        """
        self.lines: list[str] = []
        self.tool = np.eye(4) if tool is None else tool
        self.home = tuple(home)

    def pose(self, T: np.ndarray) -> str:
        """A tool."""
        raise NotImplementedError

    def tools(self) -> dict[int, str]:
        """All tools."""
        poses = {number: self.tool.copy() for number in TOOLS}
        for number, xyz in TOOLS.items():
            poses[number][:3, 3] += self.tool[:3, :3] @ xyz * 1e-3
        return {number: self.pose(T) for number, T in poses.items()}

    @staticmethod
    def takes(program: Program) -> bool:
        """Whether the language can say what a program does."""
        return True

    def add(self, kind: str, *given: object) -> None:
        self.lines += self.FORMS[kind].format(*given).split("|")

    def text(self, node: object) -> str:
        """An expression, or a part of one."""
        match node:
            case Routine(name=name):
                return name
            case tuple() if node[0] in self.NODES:
                return self.NODES[node[0]].format(*map(self.text, node[1:]))
            case tuple():
                return self.NODES["sign"].format(*map(self.text, (node[1], node[0], node[2])))
            case _:
                return str(node)

    def routine(self, routine: Routine, *, beside: bool = False) -> None:
        """Write a routine; the main one may start what runs beside it."""
        kind = routine.kind
        self.add(f"begin {kind}", routine.name)
        if kind == "main":
            for k, name in enumerate(POINTS, 1):
                self.step(Statement("set point", (("point", name), ("literal", 10 * k, 20 * k, 30 * k))))
            for k in range(1, ELEMENTS + 1):
                self.step(Statement("set point", (("element", k), ("literal", k, 2 * k, 3 * k))))
            for k, name in enumerate((*NUMBERS, *COUNTERS), 1):
                self.step(Statement("set number", (name, ("number", k))))
            self.add("first frame")
            if self.home:
                self.add("home", ",".join(f"{angle:.9f}" for angle in self.home))
            if beside:
                self.add("start side")
        self.block(routine.body)
        self.add(f"end {kind}", self.text(routine.result))

    def block(self, block: Sequence[Statement]) -> None:
        for one in block:
            self.step(one)

    def step(self, one: Statement) -> None:
        kind, given = one.kind, [self.text(node) for node in one.given]
        if kind in ("for", "while", "repeat", "jumps"):
            given += [str(one.given[1] + 1), str(len(self.lines))]
        if kind == "case":
            given.append(str(len(self.lines)))
        if kind == "set element":
            return self.element(one.given[0], *given)
        self.add(kind, *given)
        one.line = len(self.lines)
        for k, block in enumerate(one.blocks):
            self.block(block)
            self.add(f"{kind} {('else', 'end')[k + 2 - len(one.blocks)]}", *given)
        return None

    def element(self, index: Node, number: str, source: str) -> None:
        self.add("set element", number, source)


class Rapid(Writer):
    """RAPID."""

    FORMS: ClassVar = {
        "begin main": "PROC {0}()", "begin procedure": "PROC {0}(robtarget q,num d)", "end main": "ENDPROC",
        "end procedure": "ENDPROC",
        "begin function": "FUNC robtarget {0}(robtarget q,num d)", "end function": "RETURN {0};|ENDFUNC",
        "begin number function": "FUNC num {0}(robtarget q,num d)", "end number function": "RETURN {0};|ENDFUNC",
        "first frame": "w:=w1;|t:=t1;", "move": "MoveL {0},v100,fine,t\\WObj:=w;", "set number": "{0}:={1};",
        "set part": "{0}.trans.{1}:={2};", "set point": "{0}:={1};", "set element": "a{{{0}}}:={1};",
        "set frame": "w.oframe.trans.{0}:={1};", "if": "IF {0} THEN", "if else": "ELSE", "if end": "ENDIF",
        "case": "TEST {0}|CASE 1,2:", "case else": "DEFAULT:", "case end": "ENDTEST", "call": "{0} {1},{2};",
        "home": "MoveAbsJ [[{0}],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v100,fine,t;", "select frame": "w:=w{0};",
        "select tool": "t:=t{0};", "return": "RETURN;", "as long as": "WHILE {0} DO", "as long as end": "ENDWHILE",
        # the counter of a FOR is not seen outside of it
        "for": "FOR i FROM 1 TO {1} DO|{0}:=i;", "for end": "ENDFOR|{0}:={2};",
        "while": "{0}:=1;|WHILE {0}<={1} DO", "while end": "Incr {0};|ENDWHILE",
        "repeat": "{0}:=1;|L{3}:", "repeat end": "Incr {0};|IF {0}<={1} GOTO L{3};",
        "jumps": "{0}:=1;|L{3}:|IF {0}>{1} THEN|GOTO E{3};|ENDIF", "jumps end": "{0}:={0}+1;|GOTO L{3};|E{3}:",
        "begin side": "TRAP {0}", "end side": "ENDTRAP", "start side": "CONNECT iSide WITH side;", "strange": "Elsewhere {0};",
    }  # fmt: skip
    NODES: ClassVar = {
        "number": "{0}", "read": "{0}", "part": "{0}.trans.{1}", "sensor": "AInput(aiAny)", "input": "DInput(diAny)=1",
        "wrapped": f"({{0}} MOD {ELEMENTS})+1", "sign": "{0}{1}({2})", "point": "{0}", "element": "a{{{0}}}",
        "beside": "Offs({0},0,0,{1})", "calls": "{0}({1},{2})", "asks": "{0}({1},{2})",
        "literal": "[[{0},{1},{2}],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
    }  # fmt: skip

    def program(self, program: Program) -> list[Source]:
        fixed = [f"CONST robtarget {name}:={self.text(('literal', *xyz))};" for name, xyz in FIXED.items()]
        points = [f"VAR robtarget {name};" for name in (*POINTS, f"a{{{ELEMENTS}}}")]
        numbers = [f"VAR num {name};" for name in (*NUMBERS, *COUNTERS)]
        frame = 'PERS wobjdata w{}:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[{},[1,0,0,0]]];'
        tool = "PERS tooldata t{}:=[TRUE,{},[1,[0,0,1],[1,0,0,0],0,0,0]];"
        frames = [frame.format(number, list(xyz)) for number, xyz in {"": (7, 7, 7), **FRAMES}.items()]
        tools = self.tools()
        frames += [tool.format(number, text) for number, text in {"": tools[1], **tools}.items()]
        self.lines = ["MODULE m", *fixed, *points, *numbers, *frames]
        for routine in program.all:
            self.routine(routine, beside=program.beside is not None)
        return [Source.of(Path("m.mod"), "\n".join((*self.lines, "ENDMODULE")).encode())]

    def pose(self, T: np.ndarray) -> str:
        return rapid_pose(T)


class Krl(Writer):
    """KRL, which has no remainder among its operators."""

    FILES: ClassVar = True
    """Whether each routine has one of its own."""

    FORMS: ClassVar = {
        "begin main": "DEF {0}()", "end main": "END", "end procedure": "END", "end function": "RETURN {0}|ENDFCT",
        "begin procedure": "DEF {0}(Q:IN,D:IN)|DECL E6POS Q|DECL REAL D",
        "begin function": "DEFFCT E6POS {0}(Q:IN,D:IN)|DECL E6POS Q|DECL REAL D",
        "begin number function": "DEFFCT REAL {0}(Q:IN,D:IN)|DECL E6POS Q|DECL REAL D", "end number function": "RETURN {0}|ENDFCT",
        "first frame": "W={{X 0,Y 0,Z 0,A 0,B 0,C 0}}|$BASE=W|$TOOL=TOOL_DATA[1]", "move": "LIN {0}", "set number": "{0}={1}",
        "set part": "{0}.{1}={2}", "set point": "{0}={1}", "set frame": "W.{0}={1}|$BASE=W", "if": "IF {0} THEN", "if else": "ELSE",
        "if end": "ENDIF", "case": "SWITCH {0}|CASE 1,2", "case else": "DEFAULT", "case end": "ENDSWITCH", "call": "{0}({1},{2})",
        "for": "FOR {0}=1 TO {1}", "for end": "ENDFOR|{0}={2}", "while": "{0}=1|WHILE {0}<={1}", "while end": "{0}={0}+1|ENDWHILE",
        "repeat": "{0}=1|L{3}:", "repeat end": "{0}={0}+1|IF {0}<={1} THEN|GOTO L{3}|ENDIF",
        "jumps": "{0}=1|L{3}:|IF {0}>{1} THEN|GOTO E{3}|ENDIF", "jumps end": "{0}={0}+1|GOTO L{3}|E{3}:",
        "begin side": "DEF {0}()", "end side": "END", "strange": "ELSEWHERE({0})", "select frame": "$BASE=BASE_DATA[{0}]",
        "select tool": "$TOOL=TOOL_DATA[{0}]", "return": "RETURN", "as long as": "WHILE {0}", "as long as end": "ENDWHILE",
        "start side": "INTERRUPT DECL 5 WHEN $IN[1] DO SIDE()|INTERRUPT ON 5",
    }  # fmt: skip
    NODES: ClassVar = {
        "number": "{0}", "read": "{0}", "part": "{0}.{1}", "sensor": "$ANIN[1]", "input": "$IN[1]", "wrapped": "{0}",
        "sign": "{0}{1}({2})", "=": "{0}==({1})", "point": "{0}", "element": "A[{0}]",
        "beside": "{0}:{{X 0,Y 0,Z {1},A 0,B 0,C 0}}", "calls": "{0}({1},{2})", "asks": "{0}({1},{2})",
        "literal": "{{X {0},Y {1},Z {2},A 0,B 0,C 0}}",
    }  # fmt: skip

    def program(self, program: Program) -> list[Source]:
        """Each routine in a file of its own, behind as many empty lines as the others have, so that a line has one number."""
        texts: dict[str, list[str]] = {}
        for routine in reversed(program.all):
            start = len(self.lines)
            self.routine(routine, beside=program.beside is not None)
            texts[f"{routine.name}.src"] = [*[""] * start, *self.lines[start:]]
        if not self.FILES:
            texts = {"main.src": self.lines}
        data = [
            "DEFDAT $CONFIG PUBLIC",
            *(f"DECL E6POS {name}" for name in (*POINTS, f"A[{ELEMENTS}]")),
            "DECL FRAME W",
        ]
        data += [f"DECL E6POS {name}={self.text(('literal', *xyz))}" for name, xyz in FIXED.items()]
        for kind, frames in (
            ("TOOL", self.tools()),
            ("BASE", {k: self.text(("literal", *xyz)) for k, xyz in FRAMES.items()}),
        ):
            data += [
                f"DECL FRAME {kind}_DATA[16]",
                *(f"{kind}_DATA[{number}]={text}" for number, text in frames.items()),
            ]
        data += [f"DECL REAL {name}" for name in NUMBERS] + [f"DECL INT {name}" for name in COUNTERS] + ["ENDDAT"]
        texts["$config.dat"] = data
        return [Source.of(Path(name), "\n".join(lines).encode()) for name, lines in texts.items()]

    def pose(self, T: np.ndarray) -> str:
        return krl_frame(T)

    def add(self, kind: str, *given: object) -> None:
        if kind == "home":
            self.lines.append(f"PTP {krl_joints(np.radians(self.home))}")
        else:
            super().add(kind, *given)

    def element(self, index: Node, number: str, source: str) -> None:
        if index[0] == "number":
            self.lines.append(f"A[{number}]={source}")
            return
        self.lines.append(f"SWITCH {number}")
        for k in range(9):
            self.lines += [f"CASE {k}", f"A[{k % ELEMENTS + 1}]={source}"]
        self.lines.append("ENDSWITCH")


class KrlInOneFile(Krl):
    """The same with all routines behind the main one."""

    FILES: ClassVar = False


class Urscript(Writer):
    """URScript, whose loops are all of one kind, and whose elements are counted from 0."""

    _LOOPS = ("for", "while", "repeat", "jumps")
    FORMS: ClassVar = {
        "begin main": "def {0}():", "end main": "end", "begin procedure": "def {0}(q, d):", "end procedure": "end",
        "begin function": "def {0}(q, d):", "end function": "return {0}|end",
        "begin number function": "def {0}(q, d):", "end number function": "return {0}|end",
        "first frame": "w = p[0,0,0,0,0,0]", "move": "movel(pose_trans(w, {0}))", "set number": "{0} = {1}",
        "set part": "{0}[{1}] = ({2})*0.001", "set point": "{0} = {1}", "set element": "a[{0}] = {1}",
        "set frame": "w[{0}] = ({1})*0.001", "home": "movej({0})", "select frame": "w = w{0}",
        "select tool": "set_tcp(t{0})", "return": "return", "as long as": "while {0}:", "as long as end": "end",
        "if": "if {0}:", "if else": "else:", "if end": "end",
        "case": "if {0} == 1 or {0} == 2:", "case else": "else:", "case end": "end", "call": "{0}({1}, {2})",
        **dict.fromkeys(_LOOPS, "{0} = 1|while {0} <= {1}:"),
        **{f"{kind} end": "{0} = {0} + 1|end" for kind in _LOOPS},
        "begin side": "thread {0}():", "end side": "end", "start side": "run side()", "strange": "{0} = elsewhere()",
    }  # fmt: skip
    NODES: ClassVar = {
        "number": "{0}", "read": "{0}", "part": "{0}[{1}]*1000", "sensor": "read_port_register(1)", "input": "read_port_bit(1)",
        "wrapped": f"{{0}} % {ELEMENTS}", "sign": "{0}{1}({2})", "=": "{0}==({1})", "point": "{0}", "element": "a[{0}]",
        "beside": "pose_add({0}, p[0,0,({1})*0.001,0,0,0])", "calls": "{0}({1}, {2})", "asks": "{0}({1}, {2})",
    }  # fmt: skip

    def text(self, node: object) -> str:
        match node:
            case str() if node in AXES:
                return str(AXES.index(node))
            case ("element", int(index)):
                return super().text(("element", index - 1))
            case ("element", ("read", counter)):
                return super().text(("element", f"{counter} - 1"))
            case ("literal", *xyz):
                return f"p[{','.join(repr(value / 1000) for value in xyz)},0,0,0]"
            case _:
                return super().text(node)

    def pose(self, T: np.ndarray) -> str:
        return urscript_pose(T)

    def add(self, kind: str, *given: object) -> None:
        super().add(kind, *((urscript_joints(np.radians(self.home)),) if kind == "home" else given))

    def program(self, program: Program) -> list[Source]:
        zero = self.text(("literal", 0, 0, 0))
        self.lines = [f"t{number} = {text}" for number, text in self.tools().items()]
        self.lines += [f"w{number} = {self.text(('literal', *xyz))}" for number, xyz in FRAMES.items()]
        self.lines += ["set_tcp(t1)", f"w = {zero}", f"a = [{', '.join([zero] * ELEMENTS)}]"]
        self.lines += [f"{name} = {self.text(('literal', *xyz))}" for name, xyz in FIXED.items()]
        self.lines += [*(f"{name} = {zero}" for name in POINTS), *(f"{name} = 0" for name in (*NUMBERS, *COUNTERS))]
        for routine in program.all:
            self.routine(routine, beside=program.beside is not None)
        return [Source.of(Path("m.script"), "\n".join(self.lines).encode())]

    def element(self, index: Node, number: str, source: str) -> None:
        super().element(index, str(index[1] - 1) if index[0] == "number" else number, source)


class Tp(Writer):
    """TP, whose targets are position registers and whose numbers are registers; what is computed of them stands in lines before.

    A procedure is given the number of a register, so that it can change no target; there are no functions.
    """

    REGISTERS: ClassVar = {name: k for k, name in enumerate((*NUMBERS, *COUNTERS), 1)}
    POSITIONS: ClassVar = {name: k for k, name in enumerate((*POINTS, *FIXED), 1)}
    FRAME, COMPUTED, ELEMENT, ZERO, INDEX, PARTS = 8, 9, 10, 99, 9, 20
    """Position registers of the frame, of what is computed, of the element before the first, and of zero; registers of an index,
    and of parts of targets, from there."""
    FORMS: ClassVar = {
        "begin main": "UFRAME_NUM=1|UTOOL_NUM=1", "begin procedure": "!{0}", "end main": "END", "end procedure": "END",
        "home": "J P[1] 50% FINE", "select frame": "UFRAME_NUM={0}", "select tool": "UTOOL_NUM={0}", "return": "END",
        "begin side": "!{0}", "end side": "END", "start side": "RUN SIDE",
        "as long as": "WHILE ({0})", "as long as end": "ENDWHILE",
        "first frame": f"PR[{FRAME}]=PR[{ZERO}]|UFRAME[1]=PR[{FRAME}]", "move": "L PR[{0}] 100mm/sec FINE",
        "set frame": f"PR[{FRAME},{{0}}]=({{1}})|UFRAME[1]=PR[{FRAME}]", "set number": "{0}=({1})",
        "set part": "PR[{0},{1}]=({2})", "set point": "PR[{0}]=PR[{1}]",
        "if": "IF ({0}) THEN", "if else": "ELSE", "if end": "ENDIF",
        "case": "SELECT {0}=1,JMP LBL[{1}1]|       =2,JMP LBL[{1}1]|       ELSE,JMP LBL[{1}2]|LBL[{1}1]",
        "case else": "JMP LBL[{1}3]|LBL[{1}2]", "case end": "LBL[{1}3]", "call": "CALL {0}({1},{2})",
        "for": "FOR {0}=1 TO {1}", "for end": "ENDFOR|{0}={2}",
        "repeat": "{0}=1|LBL[{3}1]", "repeat end": "{0}={0}+1|IF {0}<={1},JMP LBL[{3}1]",
        **dict.fromkeys(("while", "jumps"), "{0}=1|LBL[{3}1]|IF {0}>{1},JMP LBL[{3}2]"),
        **dict.fromkeys(("while end", "jumps end"), "{0}={0}+1|JMP LBL[{3}1]|LBL[{3}2]"), "strange": "PR[{0}]=LPOS",
    }  # fmt: skip
    NODES: ClassVar = {
        "number": "{0}", "read": "{0}", "sensor": "GI[1]", "input": "DI[1]", "wrapped": "{0}", "sign": "({0}{1}({2}))",
    }  # fmt: skip

    @staticmethod
    def takes(program: Program) -> bool:
        *procedures, main = program.routines
        given = [one.given for one in statements(main.body) if one.kind == "call"]
        return all(
            one.result is None
            and not any(
                step.kind == "set element"
                or step.given[0] in (("point", "q"), *(at for of, at, _ in given if of is one))
                for step in statements(one.body)
                if step.kind in ("set part", "set point", "set element", "strange")
            )
            for one in procedures
        )

    def text(self, node: object) -> str:
        """A number or a condition; of a target the number of its register."""
        match node:
            case str() if node in AXES:
                return str(AXES.index(node) + 1)
            case str() if node in self.REGISTERS:
                return f"R[{self.REGISTERS[node]}]"
            case ("read", "d"):
                return "AR[2]"
            case ("point", "q"):
                return "AR[1]"
            case ("point", name):
                return str(self.POSITIONS[name])
            case ("element", int(index)) | ("element", ("number", index)):
                return str(self.ELEMENT + index)
            case ("element", ("read", counter)):
                self.lines.append(f"R[{self.INDEX}]=({self.ELEMENT}+{self.text(counter)})")
                return f"R[{self.INDEX}]"
            case ("element", (_, counter)):
                self.lines.append(f"R[{self.INDEX}]=({self.ELEMENT + 1}+({self.text(counter)} MOD {ELEMENTS}))")
                return f"R[{self.INDEX}]"
            case ("part", target, axis):
                part = f"R[{self.PARTS + len(self.lines) % 100}]"
                self.lines.append(f"{part}=PR[{self.text(target)},{self.text(axis)}]")
                return part
            case ("beside", target, by):
                own, by = self.text(target), self.text(by)
                self.lines += [
                    f"PR[{self.COMPUTED}]=PR[{own}]",
                    f"PR[{self.COMPUTED},3]=(PR[{self.COMPUTED},3]+({by}))",
                ]
                return str(self.COMPUTED)
            case ("literal", *xyz):
                self.lines += [f"PR[{self.COMPUTED},{k}]={value}" for k, value in enumerate(xyz, 1)]
                return str(self.COMPUTED)
            case Routine(name=name):
                return name.upper()
            case _:
                return super().text(node)

    def program(self, program: Program) -> list[Source]:
        """Each routine in a file of its own, as those of `Krl`; with the registers and frames of a backup, all of them zero."""
        files: dict[str, list[str]] = {}
        for routine in reversed(program.all):
            start = len(self.lines)
            self.lines += [f"/PROG {routine.name.upper()}", "/MN"]
            if routine.name == "main":
                places = [*self.POSITIONS.values(), self.COMPUTED, *(self.ELEMENT + k for k in range(1, ELEMENTS + 1))]
                self.lines += [f"PR[{k}]=PR[{self.ZERO}]" for k in places]
                for name, xyz in FIXED.items():
                    self.step(Statement("set point", (("point", name), ("literal", *xyz))))
            self.routine(routine, beside=program.beside is not None)
            lines = [f"{number:4}:{line} ;" for number, line in enumerate(self.lines[start + 2 :], 1)]
            axes = ",".join(f"J{k}= {angle:.7f} deg" for k, angle in enumerate(self.home, 1))
            home = [f"P[1]{{\n  GP1:\n UF : 1, UT : 1,\n {axes}\n}};"] if routine.name == "main" and self.home else []
            files[f"{routine.name}.ls"] = [*[""] * start, *self.lines[start : start + 2], *lines, "/POS", *home, "/END"]
        zero = "  Group: 1   Config: N U T, 0, 0, 0\n  X: 0.0   Y: 0.0   Z: 0.0\n  W: 0.0   P: 0.0   R: 0.0"
        registers = [
            *self.POSITIONS.values(),
            self.FRAME,
            self.COMPUTED,
            *(self.ELEMENT + k for k in range(1, ELEMENTS + 1)),
        ]
        files["posreg.va"] = ["[*POSREG*]$POSREG  Storage: SHADOW  Access: RW  : ARRAY[1,100] OF Position Reg"]
        files["posreg.va"] += [f"    [1,{k}] =   ''\n{zero}" for k in (*registers, self.ZERO)]
        flat = np.eye(4)
        frames = {number: flat.copy() for number in FRAMES}
        for number, xyz in FRAMES.items():
            frames[number][:3, 3] = np.array(xyz) * 1e-3
        both = {"$MNUFRAME": {number: self.pose(T) for number, T in frames.items()}, "$MNUTOOL": self.tools()}
        files["sysframe.va"] = [
            line
            for name, poses in both.items()
            for line in (
                f"[*SYSTEM*]{name}  Storage: CMOS  Access: RW  : ARRAY[1,9] OF POSITION",
                *(f"     [1,{number}] =\n{text}" for number, text in poses.items()),
            )
        ]
        return [Source.of(Path(name), "\n".join(lines).encode()) for name, lines in files.items()]

    def pose(self, T: np.ndarray) -> str:
        x, y, z, w, p, r = millimetres(T, tp_angles(T))
        return f"  Group: 1   Config: N U T, 0, 0, 0\n  X: {x}   Y: {y}   Z: {z}\n  W: {w}   P: {p}   R: {r}"

    def element(self, index: Node, number: str, source: str) -> None:
        self.add("set point", self.text(("element", index)), source)


class Points(Writer):
    """A list of points, without frames, names or anything else."""

    @staticmethod
    def takes(program: Program) -> bool:
        (main, *others) = program.all
        return not others and all(one.kind == "move" and one.given[0][0] == "literal" for one in main.body)

    def program(self, program: Program) -> list[Source]:
        self.lines = [*self.FORMS["head"].split("|")]
        for one in program.routines[-1].body:
            self.add("move", *one.given[0][1:])
            one.line = len(self.lines)
        return [Source.of(Path(self.FORMS["file"]), "\n".join([*self.lines, *self.FORMS["end"].split("|")]).encode())]


class Apt(Points):
    """APT."""

    FORMS: ClassVar = {
        "file": "m.apt",
        "head": "PARTNO/M|UNITS/MM|LOADTL/1",
        "move": "GOTO/{0}.,{1}.,{2}.,0.,0.,1.",
        "end": "FINI|",
    }


class Csv(Points):
    """CSV."""

    FORMS: ClassVar = {
        "file": "m.csv", "head": "x_mm,y_mm,z_mm,qx,qy,qz,qw,move", "move": "{0},{1},{2},0,0,0,1,linear", "end": "",
    }  # fmt: skip
