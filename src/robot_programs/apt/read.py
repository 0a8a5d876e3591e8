"""From the statements of an APT program to its motions: lines, arcs and what they count from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from jaxtyping import Float

from robot_programs.apt.circle import (
    UNIT_TOLERANCE,
    CircleRecord,
    Instruction,
    circle_record,
    circle_tokens,
    read_arc,
    recorded_arcs,
)
from robot_programs.apt.rewrite import AptProgram
from robot_programs.apt.syntax import (
    BLOCKING,
    CLEARING,
    ENDING,
    FEEDS,
    HARMLESS,
    MAX_NUMBER,
    UNITS,
    UNREAD_MOTIONS,
    Statement,
    Token,
    numbers,
    parse,
)
from robot_programs.core import se3
from robot_programs.core.errors import FileError
from robot_programs.core.program import Diagnostic, Frame, Motion, MotionKind, Target, with_axis
from robot_programs.core.robot import Robot
from robot_programs.core.source import Place, Source

# How fast an APT program moves: FEDRAT.


@dataclass(kw_only=True)
class Feed:
    """The feed that holds, and the unit in which it was stated last."""

    speed: float | None = None
    """Metres per second; None where it is not known, or per revolution of the spindle."""
    unit: str = ""

    def read(self, statement: Statement, length: float) -> None:
        """Take in a FEDRAT.

        Args:
            statement: the statement.
            length: the program's unit of length, metres, per minute of which a feed without a unit counts.
        """
        words = [word for word in statement.words if word in FEEDS or word == "PERMIN"]
        values = [token.number for token in statement.arguments or () if token.number is not None]
        self.unit = words[0] if words else self.unit
        scale = FEEDS.get(self.unit, length / 60.0)
        self.speed = values[0] * scale if len(values) == 1 and values[0] > 0.0 and scale is not None else None


# Frames that an APT program states by CSYS, and whether its points are still counted in the first one.

FRAME_TOLERANCE = 1e-5
"""Entries of two statements of one frame differ by less; lengths in the program's unit."""

_ORTHONORMAL_TOLERANCE = 1e-4
"""How far the axes of a frame may be from orthonormal: files round to six digits."""

_MAX_AXIS_TILT = 0.05
"""How far a tool axis may be from the axis of a frame: a corrected program tilts it by its corrections."""


def stated_frame(statement: Statement) -> Float[np.ndarray, "3 4"] | None:
    """The pose that twelve numbers state row by row, axes as columns and the origin last; None where they are no pose."""
    values = statement.numbers
    if values is None or len(values) != 12:
        return None
    A = np.array(values).reshape(3, 4)
    R = A[:, :3]
    rigid = np.abs(R.T @ R - np.eye(3)).max() < _ORTHONORMAL_TOLERANCE and np.linalg.det(R) > 0.0
    return A if rigid else None


@dataclass(kw_only=True)
class StatedFrames:
    """Frames that CSYS and TRNTYP have stated so far; `docs/reference/programs-apt.md` says how it is understood."""

    first: Float[np.ndarray, "3 4"] | None = None
    in_world: bool = False
    """TRNTYP/WORLD stands: frames say how the part is turned, and coordinates stay as they were."""
    moved_since: int | None = None
    """Line that stated another frame than the first."""
    tilted: Float[np.ndarray, " 3"] | None = None
    """Its z axis, where that differs from (0, 0, 1): tool axes along it are counted in the first frame."""

    matrix: list[str] | None = None
    """Comments since CATIA's mark of a frame."""

    def read_comment(self, statement: Statement) -> tuple[str, ...] | None:
        """Take in a comment: CATIA states a frame by a mark, its name, and three rows of a matrix; its numbers at the last."""
        if statement.text.strip().upper() == "*CATIA0":
            self.matrix = []
        elif self.matrix is not None:
            self.matrix.append(statement.text)
            if len(self.matrix) == 4:
                stated = tuple(word for row in self.matrix[1:] for word in row.split())
                self.matrix = None
                return stated
        return None

    def read_csys(self, statement: Statement, line: int) -> str | None:
        """Take in a CSYS; why points behind it are uncertain, if they are whatever their tool axis."""
        self.moved_since = self.tilted = None
        A = stated_frame(statement)
        if A is None:
            return f"the CSYS of line {line} is not the twelve numbers of a pose"
        if self.first is None:
            self.first = A
        change = np.abs(A - self.first)
        if change.max() < FRAME_TOLERANCE:
            return None
        self.moved_since, z = line, A[:, 2]
        upright = np.abs(z - [0.0, 0.0, 1.0]).max() < 3.0 * _MAX_AXIS_TILT  # else one axis could be either
        if self.in_world and change[:, 3].max() < FRAME_TOLERANCE and not upright:
            self.tilted = z
            return None
        return f"another frame is stated than the first, the part's (line {line})"

    def read_trntyp(self, statement: Statement, line: int) -> str | None:
        """Take in a TRNTYP; why points behind it are uncertain."""
        offset = numbers((statement.arguments or ())[1:])
        self.in_world = statement.words[:1] == ("WORLD",) and offset == (0.0, 0.0, 0.0)
        return None if self.in_world else f"TRNTYP may move the coordinates since line {line}"

    def why_uncertain(self, axis: Float[np.ndarray, " 3"]) -> str | None:
        """Why it is not certain in which frame a point with a tool axis is counted."""
        if self.tilted is None or np.abs(axis - self.tilted).max() < _MAX_AXIS_TILT:
            return None
        return f"the tool axis does not tell whether points are counted in the frame of line {self.moved_since}"


# Which tool is loaded, by what an APT program calls it.


@dataclass(kw_only=True)
class LoadedTool:
    """Follows the statements that load tools."""

    given: Frame
    """The first one, where it is not among those that are told by name."""
    told: Mapping[str, Frame]
    """Tools by `tool_key`."""
    loaded: Frame
    first: str | None = None
    """Key of the first one that the program loads."""
    loads: bool = False
    """LOAD/TOOL says which tool is loaded; SELECT/TOOL then only brings the next one to the magazine's door."""
    untold: dict[str, Frame] = field(default_factory=dict[str, Frame])
    """Tools of which it is not known where they are, by key."""

    def read(self, statement: Statement) -> bool:
        """Take in a statement; whether it is about tools."""
        words = statement.words
        match statement.word:
            case "LOADTL" | "TOOLNO":
                self._load(words[:1])
            case "TOOL PATH":  # NX: the operation, TOOL, the tool
                self._load(words[2:3] if words[1:2] == ("TOOL",) else words[1:])
            case _ if words[:1] != ("TOOL",):
                return False
            case "LOAD":
                self.loads = True
                self._load(words[1:2])
            case _ if not self.loads:
                self._load(words[1:2])
            case _:
                pass
        return True

    def _load(self, words: tuple[str, ...]) -> None:
        key = tool_key(words[0]) if words else ""
        if self.first is None:
            self.first = key
        if key in self.told:
            self.loaded = self.told[key]
        elif key == self.first:
            self.loaded = self.given
        else:
            untold = Frame(name=key.upper(), T=self.given.T, stated=False)
            self.loaded = self.untold.setdefault(key, untold)


def tool_key(name: str) -> str:
    """Key of a tool: in small letters, numbers without zeros in front."""
    return str(int(name)) if name.isascii() and name.isdecimal() else name.casefold()


# What was read of an APT program.


@dataclass(kw_only=True)
class Reading:
    """Motions read so far of all files."""

    part: Frame
    motions: list[Motion] = field(default_factory=list[Motion])
    instructions: list[Instruction] = field(default_factory=list[Instruction])
    diagnostics: list[Diagnostic] = field(default_factory=list[Diagnostic])


_TO_CIRCLES_END = frozenset({"GOTO", "GODLTA", "FROM", "GOHOME", "FEDRAT", "$$"})
"""What may stand behind a circle, beside words that move nothing, up to the point where its arc ends."""

OTHER_FRAME = "another frame is stated than the first, the part's"


@dataclass(kw_only=True)
class Resolver:
    """Settings of the statements of one file so far."""

    reading: Reading
    source: Source
    number: int
    unit: float = 1e-3
    feed: Feed = field(default_factory=Feed)
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
    circle: CircleRecord | str | None = None
    """Of the arc that the point which follows ends, or why it is not certain."""
    tools: LoadedTool
    """The one that is loaded."""
    cycle: bool = False
    """Points are where a cycle works."""
    first: dict[str, tuple[object, ...]] = field(default_factory=dict[str, tuple[object, ...]])
    """First frame stated, by its word; the caller's is that."""
    frames: StatedFrames = field(default_factory=StatedFrames)
    unknown: set[str] = field(default_factory=set[str])

    def place(self, statement: Statement) -> Place:
        """Place of a statement."""
        return self.source.place(statement.start)

    def diagnose(self, statement: Statement, text: str) -> None:
        """Something that the user should know."""
        self.reading.diagnostics.append(Diagnostic(place=self.place(statement), text=text))

    def unresolved(self, statement: Statement, why: str) -> None:
        """A motion that stays as it is, and after which the tool's place is not known."""
        self.diagnose(statement, f"{why}; the motion stays as it is")
        self.position = self.previous = None
        self.rapid = False
        self.circle = None

    def read(self, statement: Statement) -> None:  # noqa: C901, PLR0912 - one case for each word of the language
        """Take in a statement."""
        word = statement.word
        if self.circle is not None and word not in _TO_CIRCLES_END and word not in HARMLESS:
            self.circle = "its circle is not followed by its end"
        match word:
            case "GOTO" | "GODLTA" | "FROM" | "GOHOME":
                self.rapid = self.rapid or word == "GOHOME"
                self._point(statement)
            case "CIRCLE":
                self.circle = self.circle or circle_record(statement)
            case "CYCLE":
                self._cycle(statement)
            case "INDIRV":
                self.direction = statement
                return
            case "TLON" if self.direction is not None:
                self._arc(statement, self.direction)
            case "RAPID":
                self.rapid = True
            case "FEDRAT":
                self.feed.read(statement, self.unit)
            case "UNITS" | "UNIT":
                self._units(statement)
            case "TLAXIS":
                self._tool_axis(statement)
            case "LOADTL" | "TOOLNO" | "LOAD" | "SELECT" | "TOOL PATH":
                self._tool(statement)
            case "MSYS":
                self._state(statement, statement.numbers or statement.words)
            case "CSYS" | "TRNTYP":
                self._frame(statement)
            case "$$":
                stated = self.frames.read_comment(statement)
                if stated is not None:
                    self._state(statement, stated)
                return
            case _ if word in BLOCKING or word in CLEARING:
                self._block(statement)
            case _ if word in UNREAD_MOTIONS:
                self.unresolved(statement, f"{word} is not read")
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
            if abs(length - 1.0) > UNIT_TOLERANCE:
                self.unresolved(statement, f"the tool axis has length {length:.4g} instead of 1")
                return
            self.axis = np.array(values[3:]) / length
            self.blocked.pop("TLAXIS", None)
        why = self._why_uncertain()
        if why is not None:
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
        if self.circle is not None:
            self._recorded(statement, self.circle, end, tokens, relative=relative)
            return
        self._move(statement, statement, end, None, tokens, relative)

    def _recorded(
        self,
        statement: Statement,
        circle: CircleRecord | str,
        end: np.ndarray,
        tokens: tuple[Token, ...],
        *,
        relative: bool,
    ) -> None:
        """The point that ends an arc whose circle stands before it."""
        self.circle = None
        if isinstance(circle, str):
            arcs = circle
        elif relative:
            arcs = "an arc does not end in an increment"
        elif self.position is None:
            arcs = "the arc begins at a place that is not known"
        else:
            arcs = recorded_arcs(circle, self.position, end, self.unit)
        if isinstance(arcs, str) or isinstance(circle, str):
            self.unresolved(statement, str(arcs))
            self.position = end
            return
        for arc in arcs:
            half = arc is not arcs[-1]
            self._move(circle.statement, statement, arc.end, arc.via, tokens, False, circle, half=half)

    def _why_uncertain(self) -> str | None:
        """Why it is not known what points are counted from."""
        return next(iter(self.blocked.values()), None) or self.frames.why_uncertain(self.axis)

    def _uncertain(self, statement: Statement, why: str) -> None:
        """A point or an arc whose numbers could be corrected if it were known what they count from."""
        self.position = self.previous = self.circle = None
        if statement.word != "FROM":
            text = f"{why}; the motion stays as it is"
            self.reading.diagnostics.append(Diagnostic(place=self.place(statement), text=text, rejected=True))
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
        record: CircleRecord | None = None,
        *,
        half: bool = False,
    ) -> None:
        # a cycle goes to its points by ways that are not written, as a motion of all joints does
        kind: MotionKind = "joint" if self.cycle else "linear" if via is None else "circular"
        self.reading.motions.append(
            Motion(
                kind=kind,
                end=self._target(statement, end),
                via=None if via is None else self._target(statement, via),
                tool=self.tools.loaded,
                part=self.reading.part,
                speed=None if self.rapid or self.cycle else self.feed.speed,
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
                circle=None if via is None or record is not None else circle_tokens(statement),
                record=record,
                half=half,
                relative=relative,
                unit=self.unit,
                rapid=self.rapid,
                begin=self.position,
            )
        )
        self.position, self.previous, self.rapid = end, len(self.reading.motions) - 1, False

    def _target(self, statement: Statement, point: np.ndarray) -> Target:
        T = se3.pose(with_axis(self.axis), point)
        return Target(name="", T=T, q=None, posture=None, place=self.place(statement), free_spin=True)

    def _units(self, statement: Statement) -> None:
        (word,) = statement.words if len(statement.words) == 1 else ("",)
        if word in UNITS:
            self.unit = UNITS[word]
            self.blocked.pop("UNITS", None)
        else:
            self.blocked["UNITS"] = f"the unit of line {self.place(statement).line} is not known"

    def _tool_axis(self, statement: Statement) -> None:
        values = statement.numbers
        if values is not None and len(values) == 3 and abs(np.linalg.norm(values) - 1.0) <= UNIT_TOLERANCE:
            self.axis = np.array(values) / np.linalg.norm(values)
            self.blocked.pop("TLAXIS", None)
        else:
            self.blocked["TLAXIS"] = (
                f"the tool axis of line {self.place(statement).line} is not stated by its components"
            )

    def _tool(self, statement: Statement) -> None:
        """A statement that may load a tool, which moves on from where nobody knows."""
        before = self.tools.loaded
        if not self.tools.read(statement):
            self._unknown(statement)
        if self.tools.loaded is not before:
            self.position = self.previous = None

    def _cycle(self, statement: Statement) -> None:
        """A cycle begins: at each point that follows it moves along the tool's axis, and so does the correction of the point."""
        words = statement.words
        first = words[0] if words else ""
        if first == "INIT":  # SOLIDWORKS CAM announces a cycle by it
            return
        was, self.cycle = self.cycle, first not in ("OFF", "CLEAR", *ENDING)
        if self.cycle and not was:
            self.diagnose(
                statement,
                "a cycle moves the tool at each of its points, which are corrected; what it does there is not read",
            )
        if was and not self.cycle:
            self.position = self.previous = None

    def _frame(self, statement: Statement) -> None:
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

    def _state(self, statement: Statement, stated: tuple[object, ...]) -> None:
        """A frame: the first one is the caller's, another one is not known."""
        word = statement.word
        if self.first.setdefault(word, stated) == stated:
            self.blocked.pop(word, None)
        else:
            self.blocked[word] = f"{OTHER_FRAME} (line {self.place(statement).line})"

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
        self.position = self.previous = None


def literal_poses(rows: Float[np.ndarray, "n k"], like: Motion) -> Float[np.ndarray, "n 4 4"] | None:
    """The poses of points in the unit of a motion, which is that of the last one, with its tool axis where they state none."""
    T = like.end.T
    last = float(np.abs(rows[-1, :3]).max())  # of zeros no unit is known
    if T is None or not last or np.abs(rows).max() > MAX_NUMBER:
        return None
    stated = len(rows[0]) > 3
    if stated and np.abs(np.linalg.norm(rows[:, 3:], axis=1) - 1.0).max() > 0.9 * UNIT_TOLERANCE:
        return None
    unit = min(UNITS.values(), key=lambda unit: abs(unit * last - np.abs(T[:3, 3]).max()))
    axes = (
        rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
        if stated
        else np.repeat(-T[None, :3, 2], len(rows), axis=0)
    )
    return se3.pose(with_axis(axes), unit * rows[:, :3])


def _defines(statement: Statement) -> bool:
    """Whether a statement only gives a value to a name."""
    return len(statement.tokens) > 1 and statement.tokens[1].text == "="


# Reading tool paths in APT.


def read_apt(
    sources: Sequence[Source],
    *,
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    tools: Mapping[str, Frame] | None = None,
) -> AptProgram:
    """Read tool paths in APT. What changes coordinates, or moves in a way that is not read, becomes a diagnostic.

    Args:
        sources: the files, each a path of its own.
        robot: whose own tool moves where `tool` is not given.
        tool: what the positions are of; its z points out of the tool, against APT's tool axis.
        part: frame in which they are counted; the robot's base by default.
        tools: by the name or number by which the program loads them; `tool` is the first one where that is not among them.

    Raises:
        FileError: neither the tool nor the robot is given, or a file is not APT text.
    """
    if tool is None and robot is None:
        raise FileError(sources[0].path, "does not say what its positions are of; give the tool, or the robot")
    own = tool or Frame(name="", T=np.eye(4) if robot is None else robot.T_flange_tool)
    named = {tool_key(name): frame for name, frame in (tools or {}).items()}
    reading = Reading(part=part or Frame(name="", T=np.eye(4)))
    for number, source in enumerate(sources):
        if "\0" in source.text:
            raise FileError(source.path, "is a binary file; export it as APT source")
        loaded = LoadedTool(given=own, told=named, loaded=own)
        resolver = Resolver(reading=reading, source=source, number=number, tools=loaded)
        for statement in parse(source.text):
            resolver.read(statement)
    return AptProgram(
        sources=tuple(sources),
        motions=tuple(reading.motions),
        diagnostics=tuple(reading.diagnostics),
        instructions=tuple(reading.instructions),
        read=partial(read_apt, tool=own, part=reading.part, tools=named),
    )
