"""TP lowered to the one form: the instructions of a listing, from their words to the nodes of a routine.

FANUC's operator's manuals, section "Motion instructions": J moves the joints, L along a line, C along an arc through a point to
another one, A along arcs through the points of several instructions.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import radians
from typing import Any, ClassVar, Literal

from robot_programs.core import flow
from robot_programs.core.form import (
    Arming,
    Assign,
    Check,
    Do,
    Expression,
    Hole,
    Key,
    Lit,
    MoveLine,
    Op,
    Ref,
    Routine,
    Span,
)
from robot_programs.core.kit import Cursor, Token, named, words
from robot_programs.core.program import THROUGH_TARGET, MotionKind, Unresolved, Zone
from robot_programs.tp.listing import METRES_PER_SECOND, ROBOT_GROUP, Instruction, Listing

# Words and motion instructions: from text to expressions, and to what a motion says.

WORDS = re.compile(
    r"(?P<space>\s+)|(?P<text>'[^'\n]*')|(?P<group>GP\d\s*:)|(?P<comment>:[^\[\],]*)|(?P<number>\d+\.?\d*|\.\d+)|"
    r"(?P<name>\$?[A-Za-z_][\w.$]*)|(?P<sign><>|<=|>=|\S)",
    re.IGNORECASE,
)
REMARKS = ("!", "//", "--")
"""Instructions that begin so do nothing."""
ARRAYS = ("P", "PR", "R", "UFRAME", "UTOOL")
"""Data of elements: positions, registers and frames."""
ACTIVE = ("UFRAME_NUM", "UTOOL_NUM")
"""Numbers of the active frames."""
REGISTERS = ("PR", "R")
SHARED = (*REGISTERS, *ACTIVE)
"""What a program that is not in the files may set; it is taken to leave the frames as they are."""
ARGUMENTS = 10
"""Of a call."""

RUN_TIME = "is known only at run time"
SET = "is set in the program, to what is known only at run time"


# Expressions.


class TpReader(Cursor):
    """Expressions of TP."""

    BINDING: ClassVar = {
        "OR": 1, "AND": 2, "=": 4, "<>": 4, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6, "DIV": 6, "MOD": 6,
    }  # fmt: skip
    PREFIXES: ClassVar = {"!": 7, "-": 7, "+": 7}
    SIGNS: ClassVar = {"!": "not"}
    OPERAND = 4
    """As strong as what stands before a comparison, or before what is assigned."""

    def single(self) -> Expression:
        """Read a value: a number, a text, ON or OFF, data, or what only the running program knows."""
        self.height, start, word = 0, self.place, self.take()
        match word.kind, word.upper:
            case "number", text:
                return Lit(at=self.span(start), value=float(text))
            case "text", _:
                return Lit(at=self.span(start), value=word.text)
            case "sign", "(":
                found = self.expression()
                self.expect(")")
                return found
            case "name", "ON" | "OFF" as state:
                return Lit(at=self.span(start), value=state == "ON")
            case "name", name if name in ACTIVE:
                return self._active(name, start)
            case "name", ("AR" | "P" | "PR" | "R" | "UFRAME" | "UTOOL") as name if self.accept("["):
                return self._element(name, start)
            case "name", name:
                if self.accept("["):
                    self.skip("[", "]")
                return Hole(at=self.span(start), why=f"{name} {RUN_TIME}")
            case _:
                raise self.problem(f"'{word.text}' is not evaluated")

    def _active(self, name: str, start: int) -> Expression:
        if self.accept("["):
            group = self.take().upper
            self.expect("]")
            if group != "GP1":
                return Hole(at=self.span(start), why=f"{name} of {group} {RUN_TIME}")
        return Ref(at=self.span(start), name=name, key=name)

    def _element(self, name: str, start: int) -> Expression:
        """Data behind their opening bracket: an index, that of a component of a register, and a comment behind either."""
        other = self.next.kind == "group" and self.take().upper[:3] != f"GP{ROBOT_GROUP}"
        indices = [self.expression()]
        commented = self._comment()
        if self.at(","):
            self.take()
            if name == "PR" and (not commented or self._is_index()):
                indices.append(self.expression())
                commented = self._comment()
            if commented and not self.at("]"):
                self.skip("[", "]")
                self.number -= 1
        if not self.accept("]"):
            raise self.problem("a bracket is not closed")
        (first, *_) = indices
        if other:
            return Hole(at=self.span(start), why=f"{name} of another group {RUN_TIME}")
        if name != "AR":
            key: Key = (name, self.file) if name == "P" else name
            return Ref(at=self.span(start), name=name, key=key, path=(tuple(indices),))
        if isinstance(first, Lit):
            return Ref(at=self.span(start), name=f"AR[{first.value:g}]", key=argument(self.file, first.value))
        return Hole(at=self.span(start), why="which argument is meant is known only at run time")

    def _comment(self) -> bool:
        """Read a comment in brackets up to a comma, or to the bracket that closes; whether there is one."""
        if self.next.kind != "comment":
            return False
        self.take()
        while self.at("["):
            self.take()
            self.skip("[", "]")
            while not self.done and not self.at("[", "]", ","):
                self.take()
        return True

    def _is_index(self) -> bool:
        """Whether the next words are an index behind a comment, and no more of the comment."""
        return (self.next.kind == "number" and self.behind_next.text in ("]",)) or (
            self.at("R", "AR") and self.behind_next.text == "["
        )


def argument(file: int, number: float) -> Key:
    """Key of an argument with which the program of a file is called."""
    return "AR", file, int(number)


# Motions.

KINDS: Mapping[str, MotionKind] = {"J": "joint", "L": "linear", "C": "circular", "A": "linear"}
KEYWORDS = frozenset({*KINDS, "S"})
_ENDING = re.compile(r"(FINE|CNT|CD|CR)(\d*|A?R)")


@dataclass(frozen=True, kw_only=True)
class NamedPosition:
    """A position of a motion, as it is named."""

    register: bool
    """``PR[…]``, a register of the controller; otherwise ``P[…]``, a position of the program."""
    number: int | None
    """None where it is computed."""
    start: int
    end: int

    @property
    def name(self) -> str:
        """Name by which the motion calls it."""
        return f"{'PR' if self.register else 'P'}[{self.number}]"


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionInstruction(MoveLine):
    """A motion instruction as it is written; places are characters of the file."""

    instruction: Instruction
    keyword: str
    """J, L, C, A, or S for a spline."""
    keyword_at: int
    operands: tuple[NamedPosition, ...] = ()
    """Its positions, the last of them the end."""
    termination: tuple[int, int] = (0, 0)
    """Where FINE or CNT stands; empty where neither does."""
    stops: bool = True
    zone: Zone | None = THROUGH_TARGET
    """How near it passes by; None where the text does not say: a corner by ``CNT`` depends on how the controller accelerates."""
    speed_at: tuple[int, int, str] = (0, 0, "")
    """Where its number stands, and the unit behind it in lower case; empty where it states none."""
    speed_unit: float | None = None
    """Metres per second of the unit; None of one that is not of a speed along the path."""
    turn_speed: float | None = None
    """Radians per second; None where the text does not say."""
    wrist: bool = False
    """``Wjnt``: the wrist's joints move evenly instead of the orientation."""
    offsets: tuple[tuple[Literal["Offset", "Tool_Offset"], str], ...] = ()
    """Shifts of its positions, in the user frame or in the tool, with the setting of each; empty where none is stated."""


Said = dict[str, Any]
"""What is read of a motion so far, by the fields of `MotionInstruction`."""


def spelled(register: Expression) -> str:
    """A register as a motion calls it."""
    index = register.path[0][0] if isinstance(register, Ref) and register.path else None
    return f"PR[{index.value:g}]" if isinstance(index, Lit) else "PR[…]"


def read_operands(found: TpReader, said: Said, count: int) -> None:
    """Read the positions of a motion.

    Raises:
        Unresolved: there are less.
    """
    points, operands = list[Expression](), list[NamedPosition]()
    for k in range(count):
        if not found.at("P", "PR") or found.behind_next.text != "[":
            raise found.problem("the end of its arc is missing" if k else "its position is not understood")
        register, start = found.at("PR"), found.place
        point = found.single()
        number = point.path[0][0] if isinstance(point, Ref) and point.path else None
        stated = number.value if isinstance(number, Lit) else None
        whole = int(stated) if isinstance(stated, float) and stated.is_integer() else None
        if isinstance(point, Ref) and whole is None and number is not None:
            said["settings"] = {**said["settings"], f"index {k}": number}
        points.append(point)
        operands.append(NamedPosition(register=register, number=whole, start=start, end=found.end))
    said["points"], said["operands"] = tuple(points), tuple(operands)


def read_speed(found: TpReader, said: Said) -> None:
    """Read the speed of a motion.

    Raises:
        Unresolved: it is not understood.
    """
    if found.accept("MAX_SPEED", "WELD_SPEED"):
        return
    number, amount = found.next, _amount(found)
    unit = "" if found.done else found.take().text.lower()
    if found.accept("/"):
        unit += "/" + ("" if found.done else found.take().text.lower())
    along = METRES_PER_SECOND.get(unit)
    known = along is not None or unit in ("%", "deg/sec", "sec", "msec")
    match amount:
        case Ref(name=name) if known and name[:2] in ("R", "AR"):
            said.update(settings={**said["settings"], "speed": amount}, speed_unit=along)
        case Hole() if known and number.upper == "AR":
            pass
        case Lit(value=float() as value) if known and number.kind == "number":
            if value > 0.0:
                said.update(speed_at=(number.start, number.end, unit), speed_unit=along)
                if along is not None:
                    said["settings"] = {**said["settings"], "speed": amount}
                if unit == "deg/sec":
                    said["turn_speed"] = radians(value)
        case _:
            raise found.problem("its speed is not understood")


def _amount(found: TpReader) -> Expression | None:
    try:
        return found.single()
    except Unresolved:
        return None


def read_offset(found: TpReader, said: Said, kind: Literal["Offset", "Tool_Offset"]) -> None:
    """Read the register by which a motion is shifted; there may be none."""
    offsets: tuple[Any, ...] = said.get("offsets", ())
    setting = ""
    if found.accept(","):
        by = found.single()
        if isinstance(by, Ref) and by.key == "PR" and len(by.path[0]) == 1:
            setting = f"{kind} {len(offsets)}"
            said["settings"] = {**said["settings"], setting: by}
    said["offsets"] = (*offsets, (kind, setting))


def read_ending(found: TpReader, said: Said) -> None:
    """Read how a motion ends: ``CD`` states the distance from the target where the corner begins, millimetres.

    ``CR`` says a length, too, but no document at hand whether it is that distance or the corner's radius.

    Raises:
        Unresolved: it does not say.
    """
    match, word = _ENDING.fullmatch(found.next.upper), found.next
    if match is None:
        raise found.problem("it says neither FINE nor CNT")
    found.take()
    kind, by = match[1], match[2]
    if kind == "FINE" or by.isdecimal():
        pass
    elif not by and found.next.kind == "number":
        by = found.take().text
    elif kind == "CNT" and ((by and found.at("[")) or (not by and found.at("R", "AR"))):
        if not by:
            found.take()
        found.expect("[")
        found.skip("[", "]")
        by = "R"
    else:
        raise found.problem("it says neither FINE nor CNT")
    if found.sticks and (found.at("[") or found.next.kind in ("name", "number")):
        raise found.problem("it says neither FINE nor CNT")
    stops = kind == "FINE" or (kind == "CNT" and by == "0")
    zone = THROUGH_TARGET if stops else None
    if kind == "CD":
        zone = Zone(distance=float(by) / 1e3, turn_distance=float(by) / 1e3)
    said.update(termination=(word.start, found.end), stops=stops, zone=zone)


# Lines and blocks.

_MACRO = re.compile(r"[A-Z_][A-Z0-9_ -]*(?=\(|;|$)")
_SYSTEM = re.compile(
    r"(END|PAUSE|ABORT|RETURN|(UN)?LOCK|COL|SOFTFLOAT|INDEPENDENT|SIMULTANEOUS|WEAVE|TRACK|ARC|SEARCH|TOUCH|MPASS|STOP|CLEAR|"
    r"RESET|WAIT)\b",
    re.IGNORECASE,
)
"""Instructions of the system that look like macros."""
_OUTPUTS = re.compile(
    r"[A-Z]?[DRGAWSU]O|[A-Z]?[DRGAWSU]I|F|M|SR|VR|PL|GO|TIMER|OVERRIDE|RSR|ERR_NUM|DIAG_REC|\w*(FLAG|MARKER|MAX_SPEED|STRING)"
)
"""What else is assigned to, which neither moves the robot nor is followed."""
_FRAME_VARIABLE = re.compile(r"\$.*(UFRAME|UTOOL|MNU)", re.IGNORECASE)

# Options of motions.

_VALUE = re.compile(r"((?:\d+(?:\.\d*)?|\.\d+)?%?(?:\[(?:[^\[\]]|\[[^\[\]]*\])*\])*)")
"""Of an option: ``100``, ``50%``, ``[1]``, or nothing."""
_WITHOUT_EFFECT = frozenset({
    "acc", "ev", "pth", "mrot", "break", "arc", "start", "end", "weave", "sine", "circle", "figure", "spot", "ap_ld", "rt_ld",
})  # fmt: skip
"""Options that do not change where the motion leads."""
_VALUED = frozenset({"acc", "ev", "figure", "ap_ld", "rt_ld"})
"""Those of them that have a value, which may stand behind a blank."""
_REFUSED = {
    "inc": "INC counts its position from where the tool is",
    "coord": "COORD moves it with another group",
    "rtcp": "RTCP lets the tool stand still",
    "voffset": "VOFFSET shifts it by what a camera saw",
    "ind.ev": "Ind.EV moves an extended axis on its own",
    "track": "it is corrected at run time by a sensor",
    "tast": "it is corrected at run time by a sensor",
    "avc": "it is corrected at run time by a sensor",
}


@dataclass(eq=False, kw_only=True)
class Callees:
    """The programs of the files by name, and what is called that is not among them."""

    programs: Mapping[str, tuple[Routine, ...]]
    """By names in capitals."""
    strange: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    """Calls of others: file, place and name."""
    running: dict[str, Routine] = field(default_factory=dict[str, Routine])
    """Others that are started beside the lines."""


@dataclass(eq=False, kw_only=True)
class _Open:
    """A block that is open."""

    closes: str
    """The word that closes it."""
    check: Check
    condition: Expression | None = None
    body: list[flow.Node] = field(default_factory=list[flow.Node])
    arms: list[flow.Arm] = field(default_factory=list[flow.Arm])
    """Those of an IF that are closed already."""


_SETTINGS: Mapping[str, Expression] = {
    key: Ref(at=(0, 0, 0), name=key, key=key) for key in (*ACTIVE, "UFRAME", "UTOOL")
}
"""On what each motion depends beside its positions."""


class Lowering:
    """One listing, lowered to the nodes of its routine."""

    def __init__(self, listing: Listing, file: int, others: Callees) -> None:
        """Take a listing of a file, which is given by its number, and the programs that it may call."""
        self.listing, self.file, self.others = listing, file, others
        self.labels, self.doubled, self.computed = set[str](), set[str](), False
        self.open = [_Open(closes="", check=Check(at=(file, 0, 0)))]
        self.select: tuple[Expression, list[flow.Arm]] | None = None
        """What the SELECT in the line before compares, with its branches so far."""
        self.data = {
            name: Ref(at=(file, 0, 0), name=name, key=(name, file) if name == "P" else name)
            for name in (*ARRAYS, *ACTIVE)
        }

    def lower(self, routine: Routine) -> None:
        """Give a routine its nodes."""
        for instruction in self.listing.instructions:
            text = instruction.text.strip("; \t\r\n")
            if text and not text.startswith(REMARKS):
                self._line(instruction, text)
        while len(self.open) > 1:
            self._close(self.open[-1].closes, broken=True)
        routine.nodes = tuple(self.open[0].body)
        routine.unread = frozenset(self.labels if self.computed else self.doubled)

    def _add(self, *nodes: flow.Node) -> None:
        self.open[-1].body.extend(nodes)

    def _line(self, instruction: Instruction, text: str) -> None:
        end = len(instruction.text.rstrip("; \t\r\n"))
        found = TpReader(list(words(WORDS, instruction.text[:end], instruction.body)), self.file)
        at = (self.file, found.place, instruction.body + end)
        select, self.select = self.select, None
        first = found.next.upper
        try:
            if first in KEYWORDS and found.behind_next.upper in ("P", "PR"):
                self._add(*self._motion(found, at, instruction))
            elif select is not None and (first == "=" or (first == "ELSE" and found.behind_next.text == ",")):
                self._case(select, found, at)
            elif not self._block(first, found, at):
                self._add(*self._action(found, at, text))
        except Unresolved:
            if first in ("LBL", "IF", "FOR", "WHILE", "SELECT"):
                self._add(flow.Unknown(line=None))
            self._add(*self._broken(found, at))

    # Blocks.

    def _block(self, first: str, found: TpReader, at: Span) -> bool:
        """Read a line that opens, divides or closes a block, or is a label; whether it is one."""
        match first:
            case "IF":
                self._if(found, at)
            case "ELSE" if self.open[-1].closes == "ENDIF":
                one = self.open[-1]
                # behind a second ELSE, what closed the branch before was not understood
                condition = one.condition or Hole(at=at, why=RUN_TIME)
                one.arms.append(flow.Arm(condition=condition, body=tuple(one.body)))
                one.body, one.condition = [], None
            case "FOR":
                self._for(found, at)
            case "WHILE":
                found.take()
                condition = self._condition(found)
                check = Check(at=at, conditions=(condition,))
                self.open.append(_Open(closes="ENDWHILE", check=check, condition=condition))
            case "SELECT":
                found.take()
                self._add(flow.Branches(line=Check(at=at), name="SELECT", arms=()))
                self._case((found.expression(TpReader.OPERAND), []), found, at)
            case "ELSE" | "ENDIF" | "ENDFOR" | "ENDWHILE":
                if all(one.closes != first for one in self.open):
                    self._add(flow.Unknown(line=None))  # what it closes was not understood
                self._close(first)
            case "LBL":
                self._label(found)
            case _:
                return False
        return True

    def _close(self, word: str, *, broken: bool = False) -> None:
        """Close the blocks up to the innermost one that a word closes; without such a one, none."""
        if all(one.closes != word for one in self.open):
            return
        closed = ""
        while closed != word:
            one = self.open.pop()
            closed, body = one.closes, tuple(one.body)
            if closed != word or broken:  # where it ends is not known, nor how often it is gone through
                body = (flow.Unknown(line=None), *body)
            match closed:
                case "ENDIF":
                    arms = (*one.arms, flow.Arm(condition=one.condition, body=body))
                    self._add(flow.Branches(line=one.check, name="IF", arms=arms))
                case "ENDWHILE":
                    loop = flow.Loop(line=one.check, name="WHILE", kind="while", condition=one.condition, body=body)
                    self._add(loop)
                case _:
                    self._add(flow.Loop(line=one.check, name="FOR", kind="counted", body=body))
                    assert one.check.counter is not None
                    left = Hole(at=one.check.at, why="what a FOR leaves in its counter is not followed")
                    self._add(flow.FlowStep(line=Assign(at=one.check.at, target=one.check.counter, value=left)))

    def _if(self, found: TpReader, at: Span) -> None:
        found.take()
        condition = self._condition(found)
        check = Check(at=at, conditions=(condition,))
        if found.accept("THEN"):
            self.open.append(_Open(closes="ENDIF", check=check, condition=condition))
            return
        found.accept(",")
        self._add(_branch(check, "IF", condition, self._action(found, at)))

    def _for(self, found: TpReader, at: Span) -> None:
        found.take()
        counter = found.expression(TpReader.OPERAND)
        found.expect("=")
        first = found.expression()
        step = Lit(at=at, value=-1.0 if found.at("DOWNTO") else 1.0)
        if not found.accept("TO", "DOWNTO") or not isinstance(counter, Ref):
            raise found.problem("a FOR counts in a register")
        last = found.whole()
        self.open.append(_Open(closes="ENDFOR", check=Check(at=at, conditions=(first, last, step), counter=counter)))

    def _condition(self, found: TpReader) -> Expression:
        """A condition, up to THEN or to the comma before what is done; a hole where it is not understood."""
        start = found.place
        try:
            condition = found.expression()
            if found.done or found.at("THEN", ","):
                return condition
            why = f"'{found.next.text}' is not evaluated"
        except Unresolved as reason:
            why = str(reason)
        while not found.done and not found.at("THEN") and not (found.at(",") and found.behind_next.kind == "name"):
            found.take()
        return Hole(at=(self.file, start, found.end), why=why)

    def _case(self, select: tuple[Expression, list[flow.Arm]], found: TpReader, at: Span) -> None:
        """Read one comparison of a SELECT, and what is done then."""
        compared, arms = select
        self.select = select
        condition: Expression | None = None
        try:
            if not found.accept("ELSE"):
                found.expect("=")
                condition = Op(at=at, sign="=", operands=(compared, found.expression(TpReader.OPERAND)))
            found.accept(",")
        except Unresolved as why:
            condition = Hole(at=at, why=str(why))
        arms.append(flow.Arm(condition=condition, body=self._action(found, at)))
        conditions = tuple(arm.condition for arm in arms if arm.condition is not None)
        check = Check(at=at, conditions=conditions)
        self.open[-1].body[-1] = flow.Branches(line=check, name="SELECT", arms=tuple(arms))

    def _label(self, found: TpReader) -> None:
        found.take()
        found.expect("[")
        word = found.take()
        if word.kind != "number":
            raise found.problem("a label has a number")
        self.doubled |= self.labels & {word.text}
        self.labels.add(word.text)
        self._add(flow.Label(line=None, name=word.text))

    def _jump(self, found: TpReader, at: Span) -> flow.Leave:
        """Read where a jump leads, behind JMP or a comma."""
        found.expect("LBL")
        found.expect("[")
        word = found.take()
        if word.kind == "number":
            found.skip("[", "]")
            return flow.Leave(line=Check(at=at), way="jump", label=word.text)
        found.skip("[", "]")
        self.computed = True
        return flow.Leave(line=Check(at=at), way="stop")

    # Instructions in one line.

    def _action(self, found: TpReader, at: Span, text: str = "") -> flow.Block:
        """Nodes of an instruction; `text` is the whole line, of one that stands alone in it."""
        try:
            return self._understood(found, at, text)
        except Unresolved:
            return self._broken(found, at)

    def _understood(self, found: TpReader, at: Span, text: str) -> flow.Block:
        first, check = found.next.upper, Check(at=at)
        match first:
            case "JMP":
                found.take()
                return (self._jump(found, at),)
            case "END":
                return (flow.Leave(line=check, way="return"),)
            case "ABORT":
                return (flow.Leave(line=check, way="stop"),)
            case "PAUSE":  # the robot may be moved by hand, and other frames be chosen
                return (self._changing(at, ACTIVE, SET),)
            case "CALL" | "RUN":
                found.take()
                return self._called(found, at, runs=first == "RUN")
            case "SKIP" | "WAIT" | "MESSAGE" | "OFFSET" | "TOOL_OFFSET":
                return self._waiting(found, at)
            case _ if first.startswith("$"):
                names = ("UFRAME", "UTOOL", *ACTIVE) if _FRAME_VARIABLE.match(first) else ()
                return (self._changing(at, names, SET),) if names and any(w.text == "=" for w in found.words) else ()
            case _:
                pass
        if first in ACTIVE or (first in ("AR", *ARRAYS) and found.behind_next.text == "["):
            return self._assignment(found, at)
        macro = _MACRO.match(text)
        if macro is not None and not _SYSTEM.match(text):
            return self._macro(found, at, macro[0].strip())
        if not _OUTPUTS.fullmatch(first) and (first in KEYWORDS or _may_matter(found.words[found.number :])):
            raise found.problem("it may move the robot, set positions, or lead elsewhere")
        return ()

    def _assignment(self, found: TpReader, at: Span) -> flow.Block:
        first = found.next.upper
        target = found.expression(TpReader.OPERAND)
        found.expect("=")
        value = found.whole()
        if isinstance(target, Hole):  # of another motion group; of the active frames each has its own
            return () if first in ACTIVE or first == "AR" else (self._changing(at, [first], SET),)
        if not isinstance(target, Ref):
            raise found.problem("it is not known what is set")
        return (flow.FlowStep(line=Assign(at=at, target=target, value=value)),)

    def _waiting(self, found: TpReader, at: Span) -> flow.Block:
        """Read WAIT, which may go on elsewhere behind TIMEOUT, or another one that has no effect."""
        while not found.done and not found.at("TIMEOUT"):
            found.take()
        if found.done:
            return ()
        found.take()
        found.accept(",")
        hole = Hole(at=at, why=RUN_TIME)
        return (_branch(Check(at=at, conditions=(hole,)), "WAIT", hole, (self._jump(found, at),)),)

    def _called(self, found: TpReader, at: Span, *, runs: bool = False, moves: bool = True) -> flow.Block:
        """Read which program is called, behind CALL or RUN; what a motion calls on its way moves nothing itself."""
        start = found.take()
        if start.upper in ("SR", "AR", "R") and found.accept("["):
            found.skip("[", "]")
            name = _text_from(found, start)
            if runs:
                every = tuple(routine for routines in self.others.programs.values() for routine in routines)
                return (self._strange(at, name), *self._runs(at, (*every, self._running(name, at))))
            return (flow.FlowStep(line=Do(at=at, any=True)), self._strange(at, name, moves=moves))
        while found.sticks and not found.at("(", ",", ")"):
            found.take()
        name = _text_from(found, start).upper()
        routines = self.others.programs.get(name, ())
        if runs:
            strange = () if routines else (self._strange(at, name),)
            return (*strange, *self._runs(at, routines or (self._running(name, at),)))
        if not routines:
            return (self._strange(at, name, moves=moves),)
        return (flow.FlowStep(line=Do(at=at, routines=routines, arguments=self._arguments(found))),)

    def _macro(self, found: TpReader, at: Span, name: str) -> flow.Block:
        while not found.done and not found.at("("):
            found.take()
        routines = self.others.programs.get(name.upper(), ())
        if not routines:
            return (self._strange(at, name.upper()),)
        return (flow.FlowStep(line=Do(at=at, routines=routines, arguments=self._arguments(found))),)

    def _arguments(self, found: TpReader) -> tuple[Expression, ...]:
        given: list[Expression] = []
        if found.accept("("):
            while not found.done and not found.accept(")"):
                start = found.place
                try:
                    given.append(found.expression())
                except Unresolved as why:  # nor are those behind it
                    given += [Hole(at=found.span(start), why=str(why))] * ARGUMENTS
                    break
                found.accept(",")
        return tuple(given)

    def _runs(self, at: Span, routines: tuple[Routine, ...]) -> flow.Block:
        """Programs that run beside the lines from some on."""
        return (flow.FlowStep(line=Arming(at=at, routines=routines)), self._changing(at, ACTIVE, SET))

    def _running(self, name: str, at: Span) -> Routine:
        """A program that is not in the files, and runs beside the lines from some on."""
        routine = self.others.running.get(name)
        if routine is None:
            changes = tuple(self.data[register] for register in REGISTERS)
            node = flow.FlowStep(line=Do(at=at, changes=changes, why=_by_strange(name)))
            routine = self.others.running[name] = Routine(name=name, nodes=(node,))
        return routine

    def _strange(self, at: Span, name: str, *, moves: bool = True) -> flow.FlowStep:
        """A call of a program that is not in the files; one that does not move the robot leaves the active frames, too."""
        self.others.strange.append((self.file, at[1], name))
        changes = tuple(self.data[shared] for shared in (SHARED if moves else REGISTERS))
        return flow.FlowStep(line=Do(at=at, changes=changes, why=_by_strange(name), moves=moves))

    def _changing(self, at: Span, names: Iterable[str], why: str) -> flow.FlowStep:
        """A step behind which some data are not known, nor where the robot is."""
        return flow.FlowStep(line=Do(at=at, changes=tuple(self.data[name] for name in names), why=why, moves=True))

    def _broken(self, found: TpReader, at: Span) -> flow.Block:
        """What a line that is not understood may do: set what it names, or, where it names nothing, all but the positions."""
        if any(word.upper in ("CALL", "RUN") for word in found.words):
            others = (name for name in self.data if name != "P")
            return (flow.FlowStep(line=Do(at=at, any=True)), self._changing(at, others, SET))
        self.computed = self.computed or any(word.upper in ("JMP", "LBL") for word in found.words)
        refs = named(found.words, self.data)
        names = [ref.name for ref in refs] or [name for name in self.data if name != "P"]
        return (self._changing(at, names, SET),)

    # Motions.

    def _motion(self, found: TpReader, at: Span, instruction: Instruction) -> flow.Block:
        keyword = found.take()
        said: Said = {"settings": _SETTINGS}
        behind: list[flow.Node] = []
        try:
            if keyword.upper == "S":
                raise found.problem("how a spline runs between its points is not known")
            read_operands(found, said, 2 if keyword.upper == "C" else 1)
            read_speed(found, said)
            read_ending(found, said)
            self._options(found, at, said, behind)
        except Unresolved as why:
            said["why"] = str(why)
            behind += self._unread_options(found, at)
        line = MotionInstruction(
            at=at, instruction=instruction, keyword=keyword.upper, keyword_at=keyword.start, **said
        )
        return (flow.FlowStep(line=line), *behind)

    def _unread_options(self, found: TpReader, at: Span) -> flow.Block:
        """What the rest of a motion that is not understood may do: call, set registers, and lead to any label."""
        nodes, rest = list[flow.Node](), found.words[found.number - 1 :]
        self.computed = self.computed or any(word.upper == "SKIP" for word in rest)
        if any(word.text == "=" for word in rest):
            nodes.append(self._changing(at, REGISTERS, SET))
        while not found.done:
            if found.take().upper in ("CALL", "RUN") and not found.done:
                nodes += self._perhaps(at, "CALL", self._called(found, at, moves=False))
        return tuple(nodes)

    def _options(self, found: TpReader, at: Span, said: Said, behind: list[flow.Node]) -> None:
        """Read what stands behind the termination of a motion.

        Args:
            found: the words.
            at: the motion's place.
            said: what the motion says so far.
            behind: is given what happens behind the motion.

        Raises:
            Unresolved: an option that leads elsewhere, or is not known.
        """
        valued = False  # the option before may have its value behind a blank
        while not found.done:
            word = found.take()
            if word.kind != "name":
                value = self._stuck(found, word, word.start)
                if not valued or not _VALUE.fullmatch(value):
                    raise found.problem(f"'{value}' among its options is not understood")
                valued = False
                continue
            name = re.match(r"[A-Za-z_.]*", word.text)[0].lower()  # pyright: ignore[reportOptionalSubscript]
            valued = False
            if name in _REFUSED:
                raise found.problem(_REFUSED[name])
            if name in ("ta", "tb", "db") and len(name) == len(word.text):
                behind += self._timed(found, at, word)
            elif name in ("offset", "tool_offset") and len(name) == len(word.text):
                read_offset(found, said, "Offset" if name == "offset" else "Tool_Offset")
            elif name == "skip" and len(name) == len(word.text):
                said["ends"] = False
                behind += self._skipping(found, at)
            else:
                rest = self._stuck(found, word, word.start + len(name))
                valued = name in _VALUED and not rest
                if name == "wjnt" and not rest:
                    said["wrist"] = True
                elif name not in _WITHOUT_EFFECT or not _VALUE.fullmatch(rest):
                    raise found.problem(f"its option '{word.text[: len(name)]}{rest}' is not provided for")

    def _stuck(self, found: TpReader, word: Token, start: int) -> str:
        """Text from a character of a word to the next blank outside of brackets."""
        opened = word.text == "["
        while found.sticks or opened:
            opened = opened or found.take().text == "["
            if opened:
                found.skip("[", "]")
                opened = False
        return self.listing.text[start : found.end]

    def _skipping(self, found: TpReader, at: Span) -> flow.Block:
        """Read where a motion leads that met nothing, and the register that holds where it ended."""
        found.expect(",")
        jump = self._jump(found, at)
        if found.accept(","):
            target = found.single()
            found.expect("=")
            if not isinstance(target, Ref) or not found.accept("LPOS", "JPOS"):
                raise found.problem("what a Skip sets is not understood")
            ends = Assign(at=at, target=target, value=Hole(at=at, why=RUN_TIME))
            return (*self._perhaps(at, "Skip", (jump,)), flow.FlowStep(line=ends))
        return self._perhaps(at, "Skip", (jump,))

    def _perhaps(self, at: Span, name: str, nodes: flow.Block) -> flow.Block:
        """What happens, or does not."""
        hole = Hole(at=at, why=RUN_TIME)
        return (_branch(Check(at=at, conditions=(hole,)), name, hole, nodes),)

    def _timed(self, found: TpReader, at: Span, option: Token) -> flow.Block:
        """Read what is done at a time or distance from the target: a call, or an output that is set.

        Raises:
            Unresolved: it is not understood.
        """
        wrong = f"what is done at a time of its way is not understood: '{self.listing.text[option.start : at[2]]}'"
        try:
            time = found.single()
            if not isinstance(time, Lit | Ref | Hole) or not found.accept("SEC", "MM"):
                raise found.problem(wrong)
            found.expect(",")
            if found.at("CALL"):
                found.take()
                start = found.number
                done = self._called(found, at, moves=False)
                if found.number > start and found.accept("("):
                    found.skip("(", ")")
                return self._perhaps(at, option.text, done)
            if found.accept("P") and found.accept("-"):
                found.expect("SPS")
                return ()
            if found.accept("POINT_LOGIC"):
                return ()
            return self._output(found, at)
        except Unresolved:
            raise found.problem(wrong) from None

    def _output(self, found: TpReader, at: Span) -> flow.Block:
        """Read an output that is set at a time of a motion."""
        target = found.single()
        found.expect("=")
        if found.accept("PULSE"):
            if found.accept(","):
                found.single()
                found.expect("SEC")
        else:
            found.expression()
        if isinstance(target, Ref):
            return (flow.FlowStep(line=Assign(at=at, target=target, value=Hole(at=at, why=RUN_TIME))),)
        return ()


def _text_from(found: TpReader, start: Token) -> str:
    """The words from one to the one read last, without blanks between them."""
    first = next(k for k, word in enumerate(found.words) if word is start)
    return "".join(word.text for word in found.words[first : found.number])


def _may_matter(rest: Sequence[Token]) -> bool:
    """Whether an instruction that is not known sets something, names positions, calls, or leads to a label."""
    depth = 0
    for number, word in enumerate(rest, start=1):
        depth += (word.text == "[") - (word.text == "]")
        positions = word.upper in ("P", "PR") and [one.text for one in rest[number : number + 1]] == ["["]
        if positions or word.upper in ("LBL", "CALL", "RUN") or (word.text == "=" and depth == 0):
            return True
    return False


def _branch(check: Check, name: str, condition: Expression, body: flow.Block) -> flow.Branches:
    return flow.Branches(line=check, name=name, arms=(flow.Arm(condition=condition, body=body),))


def _by_strange(name: str) -> str:
    return f"may be set by {name}, which is called before and is not in the files given; pass its .ls"


def lowered(listings: Mapping[int, Listing]) -> tuple[dict[int, Routine], list[tuple[int, int, str]]]:
    """The routine of each listing, by the number of its file, and calls of programs that are not among them."""
    routines = {
        file: Routine(name=listing.name, parameters=tuple(argument(file, number) for number in range(1, ARGUMENTS + 1)))
        for file, listing in listings.items()
    }
    programs: dict[str, tuple[Routine, ...]] = {}
    for routine in routines.values():
        name = routine.name.upper()
        programs[name] = (*programs.get(name, ()), routine)
    others = Callees(programs=programs)
    for file, listing in listings.items():
        Lowering(listing, file, others).lower(routines[file])
    return routines, others.strange
