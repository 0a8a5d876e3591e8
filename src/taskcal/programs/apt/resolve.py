"""What the statements of an APT program set and do, one after another."""

from dataclasses import dataclass, field

import numpy as np

from taskcal.geometry import se3
from taskcal.programs.apt.circle import circle_tokens, read_arc
from taskcal.programs.apt.frames import StatedFrames
from taskcal.programs.apt.instruction import Instruction
from taskcal.programs.apt.lexer import Token
from taskcal.programs.apt.syntax import Statement
from taskcal.programs.apt.words import BLOCKING, CLEARING, ENDING, FEEDS, HARMLESS, UNITS, UNREAD_MOTIONS
from taskcal.programs.program import Diagnostic, Frame, Move, MoveKind, Target
from taskcal.programs.source import Place, Source
from taskcal.programs.tool_axis import with_axis

_UNIT_LENGTH = 1e-3
"""How far the length of a tool axis may be from one: files round to a few digits."""


OTHER_TOOL = "another tool is loaded than the first, the one given"
OTHER_FRAME = "another frame is stated than the first, the part's"


@dataclass(kw_only=True)
class Reading:
    """What was read so far of all files."""

    tool: Frame
    part: Frame
    moves: list[Move] = field(default_factory=list[Move])
    instructions: list[Instruction] = field(default_factory=list[Instruction])
    diagnostics: list[Diagnostic] = field(default_factory=list[Diagnostic])


@dataclass(kw_only=True)
class Resolver:
    """What the statements of one file have set so far."""

    reading: Reading
    source: Source
    number: int
    unit: float = 1e-3
    feed: float | None = None
    feed_unit: str = ""
    rapid: bool = False
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    position: np.ndarray | None = None
    """Where the tool is, metres; None where that is not known."""
    previous: int | None = None
    """Number of the motion that brought it there."""
    blocked: dict[str, str] = field(default_factory=dict[str, str])
    """Why motions are uncertain, by the word that said so."""
    direction: Statement | None = None
    """Of the arc that follows."""
    arc_pending: bool = False
    """The point that follows ends an arc that was not read."""
    first: dict[str, tuple[object, ...]] = field(default_factory=dict[str, tuple[object, ...]])
    """First tool and first frame stated, by their word; the caller's are those."""
    frames: StatedFrames = field(default_factory=StatedFrames)
    loads: bool = False
    """LOAD/TOOL says which tool is loaded."""
    matrix: list[str] | None = None
    """Comments since CATIA's mark of a frame."""
    unknown: set[str] = field(default_factory=set[str])

    def place(self, statement: Statement) -> Place:
        """Where a statement stands."""
        return self.source.place(statement.start)

    def diagnose(self, statement: Statement, text: str) -> None:
        """Something that the user should know."""
        self.reading.diagnostics.append(Diagnostic(place=self.place(statement), text=text))

    def unresolved(self, statement: Statement, why: str) -> None:
        """A motion that stays as it is, and after which the tool's place is not known."""
        self.diagnose(statement, f"{why}; the motion stays as it is")
        self.position = self.previous = None
        self.rapid = False

    def read(self, statement: Statement) -> None:
        """Take in a statement."""
        word = statement.word
        match word:
            case "GOTO" | "GODLTA" | "FROM":
                self._point(statement)
            case "INDIRV":
                self.direction = statement
                return
            case "TLON" if self.direction is not None:
                self._arc(statement, self.direction)
            case "RAPID":
                self.rapid = True
            case "FEDRAT":
                self._feed(statement)
            case "UNITS" | "UNIT":
                self._units(statement)
            case "TLAXIS":
                self._tool_axis(statement)
            case "LOADTL" | "TOOLNO":
                self._state(statement, statement.words[:1], OTHER_TOOL)
            case "LOAD" | "SELECT" | "TOOL PATH":
                self._tool(statement)
            case "MSYS":
                self._state(statement, statement.numbers or statement.words, OTHER_FRAME)
            case "CSYS" | "TRNTYP":
                self._frame(statement)
            case "$$":
                self._comment(statement)
                return
            case _ if word in BLOCKING or word in CLEARING:
                self._block(statement)
            case _ if word in UNREAD_MOTIONS:
                self.unresolved(statement, f"{word} is not read")
                self.arc_pending = word == "CIRCLE"
            case _ if word not in HARMLESS and not _defines(statement):
                self._unknown(statement)
            case _:
                pass
        if word != "AUTOPS":
            self.direction = None

    def _point(self, statement: Statement) -> None:
        tokens = statement.arguments or ()
        values = statement.numbers
        relative = statement.word == "GODLTA"
        if values is None or len(values) not in ((1, 3, 6) if relative else (3, 6)):
            self.unresolved(statement, f"{statement.word} has not three or six numbers")
            return
        if len(values) == 6:
            length = float(np.linalg.norm(values[3:]))
            if abs(length - 1.0) > _UNIT_LENGTH:
                self.unresolved(statement, f"the tool axis has length {length:.4g} instead of 1")
                return
            self.axis = np.array(values[3:]) / length
            self.blocked.pop("TLAXIS", None)
        why = self._why_uncertain()
        if why is not None and not self.arc_pending:
            self._uncertain(statement, why)
            return
        begin = self.position
        if relative and begin is None:
            self.unresolved(statement, "GODLTA counts from a place that is not known")
            return
        stated = np.array(values)
        step = self.unit * (stated[:3] if len(stated) > 1 else stated[0] * self.axis)
        end = step if begin is None or not relative else begin + step
        if statement.word == "FROM":
            self.position, self.previous = end, None
            return
        if self.arc_pending:
            self.arc_pending = False
            self.unresolved(statement, "it ends an arc whose sense of rotation is not certain")
            self.position = None if why is not None else end
            return
        self._move(statement, statement, end, None, tokens, relative)

    def _why_uncertain(self) -> str | None:
        """Why it is not known what points are counted from."""
        return next(iter(self.blocked.values()), None) or self.frames.why_uncertain(self.axis)

    def _uncertain(self, statement: Statement, why: str) -> None:
        """A point or an arc among motions that are uncertain."""
        if statement.word == "FROM":
            self.position = self.previous = None
        else:
            self._reject(statement, why)

    def _reject(self, statement: Statement, why: str) -> None:
        """A motion whose numbers could be corrected if it were known what they count from."""
        place = self.place(statement)
        self.reading.diagnostics.append(
            Diagnostic(place=place, text=f"{why}; the motion stays as it is", rejected=True)
        )
        self.position = self.previous = None
        self.rapid = False

    def _arc(self, statement: Statement, direction: Statement) -> None:
        tokens, towards = circle_tokens(statement), direction.numbers
        if tokens is None or towards is None or len(towards) != 3:
            self.unresolved(statement, "only arcs between points on one circle are read")
        elif (why := self._why_uncertain()) is not None:
            self._uncertain(statement, why)
        elif self.position is None:
            self.unresolved(statement, "the arc begins at a place that is not known")
        else:
            arc = read_arc(tokens, np.array(towards), self.position, self.unit)
            if isinstance(arc, str):
                self.unresolved(statement, arc)
            else:
                self._move(direction, statement, arc.end, arc.via, direction.arguments or (), False)

    def _move(
        self,
        first: Statement,
        statement: Statement,
        end: np.ndarray,
        via: np.ndarray | None,
        tokens: tuple[Token, ...],
        relative: bool,
    ) -> None:
        """A motion whose numbers are known."""
        kind: MoveKind = "linear" if via is None else "circular"
        self.reading.moves.append(
            Move(
                kind=kind,
                end=self._target(statement, end),
                via=None if via is None else self._target(statement, via),
                tool=self.reading.tool,
                part=self.reading.part,
                part_in_hand=False,
                speed=None if self.rapid else self.feed,
                stops=False,
                follows=self.previous,
                routine=self.source.path.stem,
                place=self.place(statement),
            )
        )
        self.reading.instructions.append(
            Instruction(
                source=self.number,
                start=first.start,
                end=statement.end,
                body=statement.start,
                numbers=tokens,
                circle=None if via is None else circle_tokens(statement),
                relative=relative,
                unit=self.unit,
                rapid=self.rapid,
                begin=self.position,
            )
        )
        self.position, self.previous, self.rapid = end, len(self.reading.moves) - 1, False

    def _target(self, statement: Statement, point: np.ndarray) -> Target:
        T = se3.pose(with_axis(self.axis), point)
        return Target(name="", T=T, q=None, posture=None, place=self.place(statement), free_spin=True)

    def _feed(self, statement: Statement) -> None:
        words = [word for word in statement.words if word in FEEDS or word == "PERMIN"]
        values = [token.number for token in statement.arguments or () if token.number is not None]
        self.feed_unit = words[0] if words else self.feed_unit
        scale = FEEDS.get(self.feed_unit, self.unit / 60.0)
        self.feed = values[0] * scale if len(values) == 1 and values[0] > 0.0 and scale is not None else None

    def _units(self, statement: Statement) -> None:
        (word,) = statement.words if len(statement.words) == 1 else ("",)
        if word in UNITS:
            self.unit = UNITS[word]
            self.blocked.pop("UNITS", None)
        else:
            self.blocked["UNITS"] = f"the unit of line {self.place(statement).line} is not known"

    def _tool_axis(self, statement: Statement) -> None:
        values = statement.numbers
        if values is not None and len(values) == 3 and abs(np.linalg.norm(values) - 1.0) <= _UNIT_LENGTH:
            self.axis = np.array(values) / np.linalg.norm(values)
            self.blocked.pop("TLAXIS", None)
        else:
            self.blocked["TLAXIS"] = (
                f"the tool axis of line {self.place(statement).line} is not stated by its components"
            )

    def _tool(self, statement: Statement) -> None:
        """A tool that is loaded. One that is selected waits in the magazine, unless nothing says which one is loaded."""
        words = statement.words
        if statement.word == "TOOL PATH":  # NX: the operation, TOOL, the tool
            self._state(statement, words[2:3] if words[1:2] == ("TOOL",) else words[1:], OTHER_TOOL)
        elif words[:1] != ("TOOL",):
            self._unknown(statement)
        elif statement.word == "LOAD":
            self.loads = True
            self._state(statement, words[1:2], OTHER_TOOL)
        elif not self.loads:
            self._state(statement, words[1:2], OTHER_TOOL)

    def _frame(self, statement: Statement) -> None:
        """A frame by CSYS or TRNTYP."""
        word, line, before = statement.word, self.place(statement).line, self.frames.moved_since
        why = (self.frames.read_csys if word == "CSYS" else self.frames.read_trntyp)(statement, line)
        self.blocked.pop(word, None)
        if why is not None:
            self.blocked[word] = why
        if why is not None or before != self.frames.moved_since:
            self.position = self.previous = None

    def _unknown(self, statement: Statement) -> None:
        """A word that is not known: with numbers it may move a frame or the tool."""
        word, line = statement.word, self.place(statement).line
        if any(token.number is not None for token in statement.tokens[1:]):
            self.blocked.setdefault(
                word, f"'{word}' of line {line} is not known, and its numbers may move the coordinates"
            )
            self.position = self.previous = None
        elif word not in self.unknown:
            self.unknown.add(word)
            self.diagnose(statement, f"'{word}' is not known; it is taken to move nothing")

    def _state(self, statement: Statement, stated: tuple[object, ...], why: str) -> None:
        """A tool or a frame: the first one is the caller's, another one is not known."""
        word = {"SELECT": "LOAD"}.get(statement.word, statement.word)
        if self.first.setdefault(word, stated) == stated:
            self.blocked.pop(word, None)
        else:
            self.blocked[word] = f"{why} (line {self.place(statement).line})"

    def _comment(self, statement: Statement) -> None:
        """CATIA states the frame of the coordinates in comments: a mark, its name, three rows of a matrix."""
        if statement.text.strip().upper() == "*CATIA0":
            self.matrix = []
        elif self.matrix is not None:
            self.matrix.append(statement.text)
            if len(self.matrix) == 4:
                stated = tuple(word for row in self.matrix[1:] for word in row.split())
                self._state(statement, stated, OTHER_FRAME)
                self.matrix = None

    def _block(self, statement: Statement) -> None:
        word = CLEARING.get(statement.word, statement.word)
        values = statement.numbers or ()
        at_zero = word in ("ORIGIN", "TRANS") and len(values) == 3 and not any(values)
        ended = statement.word in CLEARING or at_zero or not ENDING.isdisjoint(statement.words)
        if ended and word not in ("COPY", "INDEX", "JUMPTO", "IF"):
            self.blocked.pop(word, None)
        elif word == "COPY":
            self.blocked.pop("INDEX", None)
        else:
            self.blocked[word] = f"{BLOCKING[word]} since line {self.place(statement).line}"
        self.previous = None
        if word != "CYCLE":
            self.position = None


def _defines(statement: Statement) -> bool:
    """Whether a statement only gives a value to a name."""
    return len(statement.tokens) > 1 and statement.tokens[1].text == "="
