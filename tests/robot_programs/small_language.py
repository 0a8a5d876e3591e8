"""Random programs of a small language with its own evaluator, written out in RAPID and KRL.

What a reader understands of them is compared with what the evaluator does: it runs a program, statement by statement, and
knows nothing of how programs are read.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any, ClassVar

from robot_programs.core.source import Source

POINTS, NUMBERS, COUNTERS, ELEMENTS = ("p1", "p2"), ("n1", "n2"), ("c1", "c2"), 3
FIXED = {"k1": (11, 22, 33), "k2": (44, 55, 66)}
"""Targets that are declared and never change."""
AXES = "xyz"


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
    """Line and place in the frame's outside."""
    beside: list[Statement] = field(default_factory=list[Statement])

    def run(self, program: Program) -> None:
        self.data = {name: [10 * k, 20 * k, 30 * k] for k, name in enumerate(POINTS, 1)}
        self.data |= {name: list(xyz) for name, xyz in FIXED.items()}
        self.data |= {k: [k, 2 * k, 3 * k] for k in range(1, ELEMENTS + 1)}
        self.data |= {name: k for k, name in enumerate((*NUMBERS, *COUNTERS), 1)} | {"frame": [0, 0, 0]}
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
                place = self.target(target)
                self.went.add((one.line, tuple(a + b for a, b in zip(place, self.data["frame"], strict=True))))
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
            case "if", (condition,):
                self.block(one.blocks[not self.holds(condition)])
            case "case", (name,):
                self.block(one.blocks[self.data[name] not in (1, 2)])
            case "call", (routine, target, number):
                self.call(routine, target, number)
            case "for" | "while" | "repeat" | "jumps", (name, count):
                self.turns(name, count, one.blocks[0])
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

    def __init__(self) -> None:
        self.lines: list[str] = []

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
        "first frame": "w.oframe.trans:=[0,0,0];", "move": "MoveL {0},v100,fine,tool0\\WObj:=w;", "set number": "{0}:={1};",
        "set part": "{0}.trans.{1}:={2};", "set point": "{0}:={1};", "set element": "a{{{0}}}:={1};",
        "set frame": "w.oframe.trans.{0}:={1};", "if": "IF {0} THEN", "if else": "ELSE", "if end": "ENDIF",
        "case": "TEST {0}|CASE 1,2:", "case else": "DEFAULT:", "case end": "ENDTEST", "call": "{0} {1},{2};",
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
        frame = 'PERS wobjdata w:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[7,7,7],[1,0,0,0]]];'
        self.lines = ["MODULE m", *fixed, *points, *numbers, frame]
        for routine in program.all:
            self.routine(routine, beside=program.beside is not None)
        return [Source.of(Path("m.mod"), "\n".join((*self.lines, "ENDMODULE")).encode())]


class Krl(Writer):
    """KRL, which has no remainder among its operators."""

    FORMS: ClassVar = {
        "begin main": "DEF {0}()", "end main": "END", "end procedure": "END", "end function": "RETURN {0}|ENDFCT",
        "begin procedure": "DEF {0}(Q:IN,D:IN)|DECL E6POS Q|DECL REAL D",
        "begin function": "DEFFCT E6POS {0}(Q:IN,D:IN)|DECL E6POS Q|DECL REAL D",
        "begin number function": "DEFFCT REAL {0}(Q:IN,D:IN)|DECL E6POS Q|DECL REAL D", "end number function": "RETURN {0}|ENDFCT",
        "first frame": "W={{X 0,Y 0,Z 0,A 0,B 0,C 0}}|$BASE=W|$TOOL=$NULLFRAME", "move": "LIN {0}", "set number": "{0}={1}",
        "set part": "{0}.{1}={2}", "set point": "{0}={1}", "set frame": "W.{0}={1}|$BASE=W", "if": "IF {0} THEN", "if else": "ELSE",
        "if end": "ENDIF", "case": "SWITCH {0}|CASE 1,2", "case else": "DEFAULT", "case end": "ENDSWITCH", "call": "{0}({1},{2})",
        "for": "FOR {0}=1 TO {1}", "for end": "ENDFOR|{0}={2}", "while": "{0}=1|WHILE {0}<={1}", "while end": "{0}={0}+1|ENDWHILE",
        "repeat": "{0}=1|L{3}:", "repeat end": "{0}={0}+1|IF {0}<={1} THEN|GOTO L{3}|ENDIF",
        "jumps": "{0}=1|L{3}:|IF {0}>{1} THEN|GOTO E{3}|ENDIF", "jumps end": "{0}={0}+1|GOTO L{3}|E{3}:",
        "begin side": "DEF {0}()", "end side": "END", "strange": "ELSEWHERE({0})",
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
        data = [
            "DEFDAT $CONFIG PUBLIC",
            *(f"DECL E6POS {name}" for name in (*POINTS, f"A[{ELEMENTS}]")),
            "DECL FRAME W",
        ]
        data += [f"DECL E6POS {name}={self.text(('literal', *xyz))}" for name, xyz in FIXED.items()]
        data += [f"DECL REAL {name}" for name in NUMBERS] + [f"DECL INT {name}" for name in COUNTERS] + ["ENDDAT"]
        texts["$config.dat"] = data
        return [Source.of(Path(name), "\n".join(lines).encode()) for name, lines in texts.items()]

    def element(self, index: Node, number: str, source: str) -> None:
        if index[0] == "number":
            self.lines.append(f"A[{number}]={source}")
            return
        self.lines.append(f"SWITCH {number}")
        for k in range(9):
            self.lines += [f"CASE {k}", f"A[{k % ELEMENTS + 1}]={source}"]
        self.lines.append("ENDSWITCH")
