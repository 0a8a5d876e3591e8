"""From the statements of an APT program to its motions: lines, arcs and what they count from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from jaxtyping import Float

from robot_programs.apt.rewrite import AptProgram
from robot_programs.apt.syntax import (
    BLOCKING,
    CLEARING,
    ENDING,
    FEEDS,
    HARMLESS,
    MAX_NUMBER,
    MOVING,
    UNITS,
    UNREAD_MOTIONS,
    CircleRecord,
    CircleTokens,
    MotionStatements,
    Statement,
    circle_record,
    circle_tokens,
    numbers,
    parse,
    read_arc,
    recorded_arcs,
)
from robot_programs.core.program import (
    UNIT_TOLERANCE,
    Diagnostic,
    Frame,
    Motion,
    Target,
    Unresolved,
    tool_of_points,
    with_axis,
)
from robot_programs.core.robot import Robot
from robot_programs.core.source import Place, Source
from taskcal_groundwork import se3
from taskcal_groundwork.errors import FileError

# Frames that an APT program states by CSYS, and whether its points are still counted in the first one.

OTHER_FRAME = "another frame is stated than the first, the part's"

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
                rows, self.matrix = self.matrix[1:], None
                return tuple(" ".join(rows).split())
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
        return f"{OTHER_FRAME} (line {line})"

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
        word, words = statement.word, statement.words
        if word == "TOOL PATH":  # NX: the operation, TOOL, the tool
            words = words[2:3] if words[1:2] == ("TOOL",) else words[1:]
        elif word not in ("LOADTL", "TOOLNO"):
            if words[:1] != ("TOOL",):
                return False
            words = words[1:]
            if self.loads and word != "LOAD":
                return True
            self.loads = word == "LOAD"
        key = tool_key(words[0]) if words else ""
        self.first = key if self.first is None else self.first
        known = self.told.get(key) or (self.given if key == self.first else None)
        untold = Frame(name=key.upper(), T=self.given.T, stated=False)
        self.loaded = known or self.untold.setdefault(key, untold)
        return True


def tool_key(name: str) -> str:
    """Key of a tool: in small letters, numbers without zeros in front."""
    return str(int(name)) if name.isascii() and name.isdecimal() else name.casefold()


# Motions of the statements of one file.

_NO_AXIS = "the tool axis of line {} is not stated by its components"
_TO_CIRCLES_END = frozenset({"GOTO", "GODLTA", "FROM", "GOHOME", "FEDRAT", "$$", *HARMLESS})
"""What may stand behind a circle, up to the point where its arc ends."""


@dataclass(kw_only=True)
class Resolver:
    """Settings of the statements of one file so far, and what was read of all files."""

    source: Source
    number: int
    part: Frame
    found: list[tuple[Motion, MotionStatements]]
    diagnostics: list[Diagnostic]
    unit: float = 1e-3
    speed: float | None = None
    """The feed that holds, metres per second; None where it is not known, or per revolution of the spindle."""
    feed_unit: str = ""
    """In which it was stated last."""
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
    circle: CircleRecord | Unresolved | None = None
    """Of the arc that the point which follows ends, or why it is not certain."""
    tools: LoadedTool
    """The one that is loaded."""
    cycle: bool = False
    """Points are where a cycle works."""
    first: dict[str, tuple[object, ...]] = field(default_factory=dict[str, tuple[object, ...]])
    """First frame stated, by its word; the caller's is that."""
    frames: StatedFrames = field(default_factory=StatedFrames)
    unknown: set[str] = field(default_factory=set[str])
    line: int = 0
    """Of the statement that is read."""

    def diagnose(self, start: int, text: str, *, rejected: bool = False, unread: bool = False) -> None:
        """Something that the user should know of a place; flags as of `Diagnostic`."""
        place = self.source.place(start)
        self.diagnostics.append(Diagnostic(place=place, text=text, rejected=rejected, unread=unread))

    def lost(self) -> None:
        """Where the tool is, is not known any longer."""
        self.position = self.previous = None

    def unresolved(self, start: int, why: object, *, rejected: bool = False) -> None:
        """A motion that stays as it is, and after which the tool's place is not known."""
        self.diagnose(start, f"{why}; the motion stays as it is", rejected=rejected, unread=True)
        self.lost()
        self.rapid, self.circle = False, None

    def read(self, statement: Statement) -> None:
        """Take in a statement."""
        word, self.line = statement.word, self.source.line(statement.start)
        if self.circle is not None and word not in _TO_CIRCLES_END:
            self.circle = Unresolved("its circle is not followed by its end")
        try:
            self._take(word, statement)
        except Unresolved as why:
            self.unresolved(statement.start, why)
        if word not in ("INDIRV", "$$", "AUTOPS"):
            self.direction = None
        if statement.arguments is None:
            self._swallowed(statement)

    def _take(self, word: str, statement: Statement) -> None:  # noqa: C901, PLR0912 - one case for each word of the language
        match word:
            case "GOTO" | "GODLTA" | "FROM" | "GOHOME":
                self.rapid = self.rapid or word == "GOHOME"
                self._point(statement)
            case "CIRCLE":
                try:
                    self.circle = self.circle or circle_record(statement)
                except Unresolved as why:
                    self.circle = why
            case "CYCLE":
                self._cycle(statement)
            case "INDIRV":
                self.direction = statement
            case "TLON" if self.direction is not None:
                self._arc(statement, self.direction)
            case "RAPID":
                self.rapid = True
            case "FEDRAT":
                self._feed(statement)
            case "UNITS" | "UNIT":
                unit = UNITS.get(" ".join(statement.words))
                self.unit = unit or self.unit
                self._block("UNITS", None if unit else f"the unit of line {self.line} is not known")
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
            case _ if word in BLOCKING or word in CLEARING:
                self._transformed(statement)
            case _ if word in UNREAD_MOTIONS:
                raise Unresolved(f"{word} is not read")
            case _ if word not in HARMLESS and [token.text for token in statement.tokens[1:2]] != [
                "="
            ]:  # gives no name a value
                self._unknown(statement)
            case _:
                pass

    def _swallowed(self, statement: Statement) -> None:
        """Motions whose words stand inside a statement, as behind a dollar sign that should not be there."""
        for before, inner in zip(statement.tokens, statement.tokens[1:], strict=False):
            word = inner.upper.partition(" ")[0]
            if word in MOVING and (word != "CIRCLE" or before.text not in ("(", "=")):
                why = f"{word} stands in the statement of line {self.line}, not in one of its own"
                self.unresolved(inner.start, why)
                self.circle = Unresolved("its circle is not read") if word == "CIRCLE" else None

    def _point(self, statement: Statement) -> None:
        values = statement.numbers
        relative = statement.word == "GODLTA"
        if len(statement.tokens) > 7:  # more than a place: until it is understood, the axis is not known
            self._block("TLAXIS", _NO_AXIS.format(self.line))
        if values is None or len(values) not in ((1, 3, 6) if relative else (3, 6)):
            raise Unresolved(f"{statement.word} has not three or six numbers")
        if len(values) == 6:
            length = float(np.linalg.norm(values[3:]))
            if abs(length - 1.0) > UNIT_TOLERANCE:
                raise Unresolved(f"the tool axis has length {length:.4g} instead of 1")
            self.axis = np.array(values[3:]) / length
            self._block("TLAXIS", None)
        if self._is_uncertain(statement):
            return
        if relative and self.position is None:
            raise Unresolved("GODLTA counts from a place that is not known")
        stated = np.array(values)
        end = self.unit * (stated[:3] if len(stated) > 1 else stated[0] * self.axis)
        if relative and self.position is not None:
            end += self.position
        if statement.word == "FROM":
            self.position, self.previous = end, None
        elif self.circle is not None:
            self._recorded(statement, self.circle, end)
        else:
            self._move(statement, end, relative=relative)

    def _recorded(self, statement: Statement, circle: CircleRecord | Unresolved, end: np.ndarray) -> None:
        """The point that ends an arc whose circle stands before it."""
        try:
            if isinstance(circle, Unresolved):
                raise circle
            if statement.word == "GODLTA":
                raise Unresolved("an arc does not end in an increment")
            if self.position is None:
                raise Unresolved("the arc begins at a place that is not known")
            arcs = recorded_arcs(circle, self.position, end, self.unit)
        except Unresolved as why:
            self.unresolved(statement.start, why)
            self.position = end
            return
        self.circle = None
        for arc in arcs:
            half = arc is not arcs[-1]
            self._move(statement, arc.end, arc.via, start=circle.start, circle=circle, half=half)

    def _is_uncertain(self, statement: Statement) -> bool:
        """Whether it is not known what a point or an arc is counted from; its numbers could be corrected if it were."""
        why = next(iter(self.blocked.values()), None) or self.frames.why_uncertain(self.axis)
        if why is not None and statement.word == "FROM":
            self.lost()
            self.circle = None
        elif why is not None:
            self.unresolved(statement.start, why, rejected=True)
        return why is not None

    def _arc(self, statement: Statement, direction: Statement) -> None:
        tokens, towards = circle_tokens(statement), direction.numbers
        if tokens is None or towards is None or len(towards) != 3:
            raise Unresolved("only arcs between points on one circle are read")
        if self._is_uncertain(statement):
            return
        if self.position is None:
            raise Unresolved("the arc begins at a place that is not known")
        arc = read_arc(tokens, np.array(towards), self.position, self.unit)
        self._move(statement, arc.end, arc.via, start=direction.start, circle=tokens, direction=direction)

    def _move(
        self,
        statement: Statement,
        end: np.ndarray,
        via: np.ndarray | None = None,
        *,
        start: int | None = None,
        circle: CircleTokens | CircleRecord | None = None,
        direction: Statement | None = None,
        half: bool = False,
        relative: bool = False,
    ) -> None:
        place, R = Place(path=self.source.path, line=self.line), with_axis(self.axis)
        target = partial(Target, name="", q=None, posture=None, place=place, free_spin=True)
        motion = Motion(
            # a cycle goes to its points by ways that are not written, as a motion of all joints does
            kind="joint" if self.cycle else "linear" if via is None else "circular",
            end=target(T=se3.pose(R, end)),
            via=None if via is None else target(T=se3.pose(R, via)),
            tool=self.tools.loaded,
            part=self.part,
            speed=None if self.rapid or self.cycle else self.speed,
            stops=False,
            follows=self.previous,
            routine=self.source.path.stem,
            place=place,
        )
        instruction = MotionStatements(
            source=self.number,
            start=statement.start if start is None else start,
            end=statement.end,
            body=statement.start,
            numbers=(direction or statement).arguments or (),
            circle=circle,
            half=half,
            relative=relative,
            unit=self.unit,
            rapid=self.rapid,
            begin=self.position,
        )
        self.found.append((motion, instruction))
        self.position, self.previous, self.rapid = end, len(self.found) - 1, False

    def _block(self, word: str, why: str | None) -> None:
        """Note why motions are uncertain because of a word; None where they no longer are."""
        if why is None:
            self.blocked.pop(word, None)
        else:
            self.blocked[word] = why

    def _feed(self, statement: Statement) -> None:
        """The feed: without a unit it counts per minute in the program's unit of length."""
        stated = [word for word in statement.words if word in FEEDS or word == "PERMIN"]
        values = [value for word in statement.arguments or () for value in numbers((word,)) or ()]
        self.feed_unit = stated[0] if stated else self.feed_unit
        scale = FEEDS.get(self.feed_unit, self.unit / 60.0)
        self.speed = values[0] * scale if len(values) == 1 and values[0] > 0.0 and scale is not None else None

    def _tool_axis(self, statement: Statement) -> None:
        values = statement.numbers or ()
        self._block("TLAXIS", _NO_AXIS.format(self.line))
        if len(values) == 3 and abs(np.linalg.norm(values) - 1.0) <= UNIT_TOLERANCE:
            self.axis = np.array(values) / np.linalg.norm(values)
            self._block("TLAXIS", None)

    def _tool(self, statement: Statement) -> None:
        """A statement that may load a tool, which moves on from where nobody knows."""
        before = self.tools.loaded
        if not self.tools.read(statement):
            self._unknown(statement)
        if self.tools.loaded is not before:
            self.lost()

    def _cycle(self, statement: Statement) -> None:
        """A cycle begins: at each point that follows it moves along the tool's axis, and so does the correction of the point."""
        first = statement.words[0] if statement.words else ""
        if first == "INIT":  # SOLIDWORKS CAM announces a cycle by it
            return
        was, self.cycle = self.cycle, first not in ("OFF", "CLEAR", *ENDING)
        if self.cycle and not was:
            what = "a cycle moves the tool at each of its points, which are corrected; what it does there is not read"
            self.diagnose(statement.start, what)
        if was and not self.cycle:
            self.lost()

    def _frame(self, statement: Statement) -> None:
        word, before = statement.word, self.frames.moved_since
        why = (self.frames.read_csys if word == "CSYS" else self.frames.read_trntyp)(statement, self.line)
        self._block(word, why)
        if why is not None or before != self.frames.moved_since:
            self.lost()

    def _unknown(self, statement: Statement) -> None:
        """A word that is not known: with numbers it may move a frame or the tool."""
        word = statement.word
        if any(numbers((token,)) for token in statement.tokens[1:]):
            why = f"'{word}' of line {self.line} is not known, and its numbers may move the coordinates"
            self.blocked.setdefault(word, why)
            self.lost()
        elif word not in self.unknown:
            self.unknown.add(word)
            self.diagnose(statement.start, f"'{word}' is not known; it is taken to move nothing")
        if (first := word.partition(" ")[0]) in MOVING:
            raise Unresolved(f"'{word}' is not read: no slash stands behind {first}")

    def _state(self, statement: Statement, stated: tuple[object, ...]) -> None:
        """A frame: the first one is the caller's, another one is not known."""
        known = self.first.setdefault(statement.word, stated) == stated
        self._block(statement.word, None if known else f"{OTHER_FRAME} (line {self.line})")

    def _transformed(self, statement: Statement) -> None:
        """A statement that transforms or repeats motions, or ends that."""
        word = CLEARING.get(statement.word, statement.word)
        values = statement.numbers or ()
        at_zero = word in ("ORIGIN", "TRANS") and len(values) == 3 and not any(values)
        ended = statement.word in CLEARING or at_zero or not ENDING.isdisjoint(statement.words)
        if word == "COPY":
            self._block("INDEX", None)
        elif ended and word not in ("INDEX", "JUMPTO", "IF"):
            self._block(word, None)
        else:
            self.blocked[word] = f"{BLOCKING[word]} since line {self.line}"
        self.lost()


def literal_poses(rows: Float[np.ndarray, "n k"], like: Motion) -> Float[np.ndarray, "n 4 4"] | None:
    """The poses of points in the unit of a motion, which is that of the last one, with its tool axis where they state none."""
    T = like.end.T
    last = float(np.abs(rows[-1, :3]).max())  # of zeros no unit is known
    if T is None or not last or np.abs(rows).max() > MAX_NUMBER:
        return None
    axes, lengths = np.repeat(-T[None, :3, 2], len(rows), axis=0), np.ones(len(rows))
    if len(rows[0]) > 3:
        axes, lengths = rows[:, 3:], np.linalg.norm(rows[:, 3:], axis=1)
    if np.abs(lengths - 1.0).max() > 0.9 * UNIT_TOLERANCE:
        return None
    unit = min(UNITS.values(), key=lambda unit: abs(unit * last - np.abs(T[:3, 3]).max()))
    return se3.pose(with_axis(axes / lengths[:, None]), unit * rows[:, :3])


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
    own = tool_of_points(sources[0].path, robot, tool)
    named = {tool_key(name): frame for name, frame in (tools or {}).items()}
    part = part or Frame(name="", T=np.eye(4))
    found, diagnostics = list[tuple[Motion, MotionStatements]](), list[Diagnostic]()
    for number, source in enumerate(sources):
        if "\0" in source.text:
            raise FileError(source.path, "is a binary file; export it as APT source")
        loaded = LoadedTool(given=own, told=named, loaded=own)
        resolver = Resolver(source=source, number=number, part=part, found=found, diagnostics=diagnostics, tools=loaded)
        for statement in parse(source.text):
            resolver.read(statement)
    return AptProgram(
        sources=tuple(sources),
        motions=tuple(motion for motion, _ in found),
        diagnostics=tuple(diagnostics),
        instructions=tuple(instruction for _, instruction in found),
        read=partial(read_apt, tool=own, part=part, tools=named),
    )
