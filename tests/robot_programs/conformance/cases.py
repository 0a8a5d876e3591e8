"""The conformance set: what programs do in every language, each as one program of the small language.

The truth is that of its machine: where each line sends the robot, over many values of the sensors.
"""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from random import Random

from tests.robot_programs import small_language as small
from tests.robot_programs.small_language import Node, Routine, Statement

RUNS = 60
"""Of the machine, which get other values of the sensors each."""

P1, P2, Q = ("point", "p1"), ("point", "p2"), ("point", "q")
K1, K2 = ("point", "k1"), ("point", "k2")
C1, C2, N1, D = ("read", "c1"), ("read", "c2"), ("read", "n1"), ("read", "d")
SENSOR, INPUT = ("sensor",), ("input",)


def number(value: int) -> Node:
    return ("number", value)


def times(node: Node, factor: int) -> Node:
    if factor == 1:
        return node
    half = times(node, factor // 2)
    return ("+", ("+", half, half), node) if factor % 2 else ("+", half, half)


def above(target: Node, by: Node) -> Node:
    return ("beside", target, by)


def literal(x: int, y: int, z: int) -> Node:
    return ("literal", x, y, z)


def move(target: Node) -> Statement:
    return Statement("move", (target,))


def put(target: Node, axis: str, value: Node) -> Statement:
    return Statement("set part", (target, axis, value))


def copy(target: Node, source: Node) -> Statement:
    return Statement("set point", (target, source))


def let(name: str, value: Node) -> Statement:
    return Statement("set number", (name, value))


def when(condition: Node, then: Sequence[Statement], otherwise: Sequence[Statement] = ()) -> Statement:
    return Statement("if", (condition,), (list(then), list(otherwise) or [let("n2", number(0))]))


def loop(kind: str, counter: str, count: int, *body: Statement) -> Statement:
    return Statement(kind, (counter, count), (list(body),))


def as_long_as(condition: Node, *body: Statement) -> Statement:
    return Statement("as long as", (condition,), (list(body),))


def call(routine: Routine, target: Node, value: Node) -> Statement:
    return Statement("call", (routine, target, value))


def procedure(*body: Statement) -> Routine:
    return Routine("r0", list(body))


def function(result: Node, *body: Statement, of: str = "") -> Routine:
    return Routine("r0", list(body), result, of)


def program(*body: Statement, routines: Sequence[Routine] = (), side: Sequence[Statement] = ()) -> small.Program:
    return small.Program([*routines, Routine("main", list(body))], Routine("side", list(side)) if side else None)


def pallet(kind: str) -> small.Program:
    row = [put(P1, "x", times(C2, 20)), put(P1, "y", times(C1, 30)), move(above(P1, number(40))), move(P1)]
    return program(loop(kind, "c1", 2, loop(kind, "c2", 3, *row)), move(K1))


def picking() -> small.Program:
    pick = procedure(move(above(Q, D)), move(Q), move(above(Q, number(60))))
    return program(call(pick, K1, number(40)), call(pick, K2, number(25)), routines=[pick])


def two_ways(one: int, other: int) -> small.Program:
    return program(
        when(INPUT, [let("n1", number(one))], [let("n1", number(other))]), put(P1, "x", N1), move(P1), move(K1)
    )


def leaving(condition: Node) -> small.Program:
    leave = procedure(when(condition, [move(Q), Statement("return")]), move(above(Q, D)))
    return program(call(leave, K1, number(20)), move(K1), call(leave, K2, number(50)), move(K2), routines=[leave])


def nested() -> small.Program:
    inner = Routine("r0", [move(above(Q, D))])
    outer = Routine("r1", [move(Q), call(inner, Q, D), move(above(Q, number(70)))])
    return program(
        move(P1), call(outer, K1, number(9)), move(P1), call(outer, K2, number(8)), call(inner, K1, number(7)),
        routines=[inner, outer],
    )  # fmt: skip


def calling_itself() -> small.Program:
    again = procedure(put(P1, "x", ("+", ("part", P1, "x"), number(1))))
    again.body.append(when(INPUT, [call(again, Q, D)]))
    return program(call(again, K1, number(2)), move(P1), move(K1), routines=[again])


def frame(axis: str, value: Node) -> Statement:
    return Statement("set frame", (axis, value))


def changing(kind: str) -> small.Program:
    """A routine that gives a target or a number back."""
    if kind == "target":
        up = function(Q, put(Q, "z", ("+", ("part", Q, "z"), D)))
        return program(
            move(("calls", up, K1, number(15))), copy(P1, ("calls", up, K2, number(5))), move(P1), routines=[up]
        )
    high = function(("+", ("part", Q, "z"), D), of="number ")
    return program(let("n1", ("asks", high, K1, number(3))), put(P1, "y", N1), move(P1), routines=[high])


CASES: dict[str, Callable[[], small.Program]] = {
    "points one after another": lambda: program(*(move(literal(10 * k, 5, k * k)) for k in range(5))),
    "one target of two motions": lambda: program(move(K1), move(K2), move(K1)),
    "shifted target": lambda: program(move(above(K1, number(40))), move(K1), move(above(K1, number(15))), move(K2)),
    "target that is set": lambda: program(
        copy(P1, literal(5, 6, 7)), move(P1), copy(P1, K2), move(P1), put(P1, "y", number(9)), move(P1), move(K2)
    ),
    "copy of a target": lambda: program(copy(P2, P1), put(P1, "z", number(77)), move(P2), move(P1)),
    "part of a target": lambda: program(put(P1, "x", ("+", ("part", K1, "z"), number(4))), move(P1), move(K1)),
    "array": lambda: program(*(move(("element", k)) for k in (2, 1, 3))),
    "array in a loop": lambda: program(loop("for", "c1", 3, move(("element", C1)))),
    "element that is set": lambda: program(
        Statement("set element", (number(2), P1)), move(("element", 2)), move(("element", 1)), move(P1)
    ),
    **{
        f"pallet by {name}": lambda kind=kind: pallet(kind)
        for kind, name in (("for", "a counter"), ("while", "a condition"), ("repeat", "a jump back"), ("jumps", "jumps"))
    },
    "value after a loop": lambda: program(loop("for", "c1", 3, let("n1", times(C1, 10))), put(P1, "x", N1), move(P1)),
    "loop of many turns": lambda: program(loop("for", "c1", 3000, put(P1, "x", C1)), move(P1), move(K1)),
    "condition on a number": lambda: program(
        let("n1", number(7)), when((">=", N1, number(8)), [move(K1)], [move(K2)]), when(("=", N1, number(7)), [move(K1)])
    ),
    "condition on a target": lambda: program(
        put(P1, "x", number(3)), when(("<", ("part", P1, "x"), number(5)), [put(P1, "z", number(50))]), move(P1)
    ),
    "case": lambda: program(
        *(
            statement
            for value in (2, 5)
            for statement in (
                let("c1", number(value)),
                Statement("case", ("c1",), ([put(P1, "x", number(11))], [put(P1, "x", number(99))])),
                move(P1),
            )
        )
    ),
    "call": lambda: program(
        put(P1, "x", number(31)), call(r := procedure(put(P1, "y", D), move(P1)), K1, number(8)), move(P1), routines=[r]
    ),
    "pick and approach": picking,
    "call in a loop": lambda: program(
        loop("for", "c1", 3, put(P1, "x", times(C1, 25)), call(r := procedure(move(above(Q, D)), move(Q)), P1, number(12))),
        routines=[r],
    ),
    "routine in a routine": nested,
    "return": lambda: leaving(("<", D, number(30))),
    "return that only sensors decide": lambda: program(
        call(r := procedure(move(Q), when(INPUT, [Statement("return")]), move(above(Q, D))), K1, number(8)), move(K2),
        routines=[r],
    ),
    "function of a target": lambda: changing("target"),
    "function of a number": lambda: changing("number"),
    "function that moves": lambda: program(
        copy(P1, ("calls", r := function(Q, move(above(Q, D))), K1, number(15))), move(P1),
        copy(P1, ("calls", r, K2, number(5))), move(P1), routines=[r],
    ),
    "function that moves in a condition": lambda: program(
        when(("=", ("asks", r := function(D, move(above(Q, D)), of="number "), K1, number(3)), number(3)), [move(K2)]),
        let("n1", ("asks", r, K2, number(7))), put(P1, "x", N1), move(P1), routines=[r],
    ),
    "argument that is changed": lambda: program(
        call(r := procedure(put(Q, "z", D), move(Q)), K1, number(80)), move(K1), routines=[r]
    ),
    "routine that calls itself": calling_itself,
    "active frame": lambda: program(
        move(K1), Statement("set frame", ("x", number(35))), move(K1), Statement("set frame", ("z", N1)), move(K2)
    ),
    "frame of a caller and of a routine": lambda: program(
        frame("x", number(35)), call(r := procedure(move(Q), frame("x", D), move(Q)), K1, number(8)), move(K1), routines=[r]
    ),
    "frame by its number": lambda: program(move(K1), Statement("select frame", (2,)), move(K1)),
    "tool by its number": lambda: program(move(K1), Statement("select tool", (2,)), move(K1)),
    # what a text does not tell
    "unknown value": lambda: program(put(P1, "x", SENSOR), move(P1), move(K1)),
    "unknown value that is set anew": lambda: program(put(P1, "x", SENSOR), put(P1, "x", number(4)), move(P1)),
    "unknown part": lambda: program(
        put(P1, "x", SENSOR), put(P2, "y", ("part", P1, "y")), move(P2), put(P2, "y", ("part", P1, "x")), move(P2)
    ),
    "unknown height above a target": lambda: program(let("n1", SENSOR), move(above(K1, N1)), move(K1), move(K2)),
    "unknown condition": lambda: two_ways(1, 2),
    "unknown condition that decides nothing": lambda: two_ways(6, 6),
    "unknown condition around a motion": lambda: program(
        when(INPUT, [put(P1, "x", number(1)), move(P1)], [move(K1)]), put(P1, "x", number(2)), move(P1)
    ),
    "unknown number of turns": lambda: program(
        as_long_as(INPUT, move(P1), put(P1, "x", ("+", ("part", P1, "x"), number(1)))), move(P1), move(K1)
    ),
    "unknown number of turns that change nothing": lambda: program(
        as_long_as(INPUT, put(P1, "z", number(20)), move(P1)), move(K1)
    ),
    "unknown condition around a frame": lambda: program(
        when(INPUT, [frame("x", number(5))], [frame("x", number(5))]), move(K1), when(INPUT, [frame("x", number(9))]), move(K2)
    ),
    "unknown number of turns around a frame": lambda: program(
        as_long_as(INPUT, frame("x", number(9)), move(K1), frame("x", number(0)), move(K1)), move(K2)
    ),
    "unknown return before a frame": lambda: program(
        call(r := procedure(when(INPUT, [Statement("return")]), frame("x", D)), K1, number(8)), move(K2), routines=[r]
    ),
    "unknown value of a function": lambda: program(
        copy(P1, ("calls", r := function(Q, put(Q, "z", D)), K2, SENSOR)), move(P1), move(K1), routines=[r]
    ),
    "unknown in some calls": lambda: program(
        call(r := procedure(move(above(K1, D))), K1, number(8)), call(r, K1, SENSOR), move(K2), routines=[r]
    ),
    "unknown frame": lambda: program(
        Statement("set frame", ("x", SENSOR)), move(K1), Statement("set frame", ("x", number(2))), move(K1)
    ),
    "routine that is not in the files": lambda: program(move(P1), Statement("strange", (P1,)), move(P1)),
    "routine beside": lambda: program(
        move(P1), put(P2, "x", number(5)), move(P2), side=[put(P1, "z", number(90)), put(P1, "x", number(2))]
    ),
    "routine beside that sets a frame": lambda: program(move(K1), side=[Statement("set frame", ("x", number(44)))]),
    "routine beside that selects a frame": lambda: program(
        Statement("select frame", (1,)), move(K1), side=[Statement("select frame", (2,))]
    ),
    "routine beside that selects a tool": lambda: program(
        Statement("select tool", (1,)), move(K1), side=[Statement("select tool", (2,))]
    ),
}  # fmt: skip
"""Programs by their subjects; each makes a new one, for writers note their lines in it."""


# What languages lack, with the reason. A gap that is closed fails its test: then its line goes.

POINTS_ONLY = dict.fromkeys(
    CASES.keys() - {"points one after another"}, "a list of points has no names, numbers or routines"
)
BY_REFERENCE = "a routine is given the number of a register, and would change it for its caller"
NO_FUNCTIONS = "there are no functions"
UNWRITABLE: dict[str, dict[str, str]] = {
    "APT": POINTS_ONLY,
    "CSV": POINTS_ONLY,
    "TP": {
        **dict.fromkeys(
            (
                "function of a target", "function of a number", "function that moves", "function that moves in a condition",
                "unknown value of a function",
            ),
            NO_FUNCTIONS,
        ),
        "argument that is changed": BY_REFERENCE,
    },
}  # fmt: skip
"""Programs that cannot be said in a language."""

TOO_MANY = "so many turns are not gone through"
ALL_REGISTERS = "what is not followed takes all registers with it"
ELEMENTS_IN_TURNS = "an element of a list that a loop sets is not followed through it"
UNREAD: dict[tuple[str, str], str] = {
    ("TP", "pallet by a jump back"): "a turn of jumps inside another one is not followed",
    ("URScript", "unknown number of turns around a frame"): ELEMENTS_IN_TURNS,
    ("KRL", "function that moves in a condition"): "its motions are not followed, and what it sets",
    **{(language, "loop of many turns"): TOO_MANY for language in ("RAPID", "KRL", "URScript", "TP")},
    **{("TP", case): ALL_REGISTERS for case in ("routine beside", "routine that calls itself")},
}  # fmt: skip
"""Programs of which more lines are refused than the sensors decide."""

NO_TURNS = "turns of jumps are not written out, and have no counter for an array"
NO_COPIES = "calls are not written out"
ONE_TEXT = {
    "array in a loop", "pick and approach", "call in a loop", "routine in a routine", "function that moves",
    "function that moves in a condition",
    *(case for case in CASES if case.startswith("pallet")),
}  # fmt: skip
"""Programs whose text gets longer because it stands for motions that need different numbers; of others none is written out."""
UNWRITTEN: dict[tuple[str, str], str] = {
    **{(language, f"pallet by {way}"): NO_TURNS for language in ("RAPID", "KRL") for way in ("a jump back", "jumps")},
    **{("TP", f"pallet by {way}"): "turns are not written out" for way in ("a counter", "a condition", "jumps")},
    ("TP", "array in a loop"): "a register has no place in the text, and turns are not written out",
    **{("TP", case): NO_COPIES for case in ("pick and approach", "call in a loop", "routine in a routine")},
}
"""Programs with motions that stay because they need different numbers in one text."""


Place = tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What a program does that was written."""

    went: Mapping[int, frozenset[Place]]
    """Lines by all places to which they lead."""
    decided: Set[int]
    """Lines for which the sensors decide it."""
    before: Mapping[tuple[int, Place], frozenset[tuple[int, Place] | None]]
    """To which line and place the robot went before; None where it began."""


def truth(made: small.Program) -> Truth:
    """What a program does, over many values of the sensors."""
    seen: dict[int, set[frozenset[Place]]] = {}
    before: dict[tuple[int, Place], set[tuple[int, Place] | None]] = {}
    asked = list[int]()
    for k in range(RUNS):
        rng = Random(k)
        machine = small.Machine(sensor=lambda rng=rng: asked.append(rng.randint(0, 60)) or asked[-1])
        machine.run(made)
        for line in {line for line, _ in machine.went}:
            seen.setdefault(line, set()).add(frozenset(place for at, place in machine.went if at == line))
        for one, last in machine.before.items():
            before.setdefault(one, set()).update(last)
        if not asked:  # it does the same each time
            break
    return Truth(
        went={line: frozenset().union(*found) for line, found in seen.items()},
        decided={line for line, found in seen.items() if len(found) > 1},
        before={one: frozenset(last) for one, last in before.items()},
    )
