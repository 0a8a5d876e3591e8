"""What an APT program is made of: statements, and arcs, as CATIA writes them and as records of a circle.

CATIA states the direction at the start, the circle, and the line through its centre to the end: ``INDIRV/ tx,ty,tz`` and
``TLON,GOFWD/ (CIRCLE/ cx,cy,cz,r),ON[,2,INTOF],(LINE/ cx,cy,cz,ex,ey,ez)``; the tool stops where it meets the line for the first
time, or for the second one (CATIA V5 and 3DEXPERIENCE, Syntax of APT instructions).

A record ``CIRCLE/`` states the centre and the axis; the arc ends in the ``GOTO`` behind it. Two forms have a sense of rotation that
is certain. SOLIDWORKS CAM writes six numbers, centre and axis, and turns about the axis by the right hand: so do all of 1085 arcs
(in 10 files of one workshop) that a tangent motion leads into, but for three behind a corner. NX writes eleven: centre, axis,
radius, tolerance and its share inside, diameter and corner radius of the tool; its axis assumes a clockwise turn (NX Manufacturing,
CLSF, CIRCLE), against the right hand: so do all 295 such arcs.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from robot_programs.core.kit import Token, words
from robot_programs.core.program import NUMBER, UNIT_TOLERANCE, Unresolved
from robot_programs.core.source import lines_of
from taskcal_groundwork import se3

# Statements.

_WORDS = re.compile(
    rf"(?P<space>\s+)|(?P<separator>[/,()=])|(?P<number>{NUMBER}(?=\s*(?:[/,()=]|\Z)))|(?P<word>[^\s/,()=](?:[^/,()=]*[^\s/,()=])?)"
)
"""Blanks inside a word belong to it."""

MAX_NUMBER = 1e9
"""Of any number; no path has a larger one."""


def numbers(found: Sequence[Token]) -> tuple[float, ...] | None:
    """Values of words, where all are numbers that a path may have."""
    if any(word.kind != "number" for word in found):
        return None
    values = tuple(float(word.text) for word in found)
    return None if any(abs(value) > MAX_NUMBER for value in values) else values


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A statement, possibly over several lines; or a comment."""

    word: str
    """Its first word in capitals, ``$$`` of a comment."""
    text: str = ""
    """Of a comment or a line of text: what follows the word."""
    tokens: tuple[Token, ...] = ()
    """From the first word on; empty for a comment or a line of text."""
    start: int
    end: int

    @cached_property
    def arguments(self) -> tuple[Token, ...] | None:
        """Arguments between commas after the slash; None where it is not so simple."""
        given, commas = self.tokens[2::2], self.tokens[3::2]
        if len(self.tokens) < 2:
            return ()
        simple = self.tokens[1].text == "/" and len(given) > len(commas) and all(word.text == "," for word in commas)
        return given if simple and all(word.kind != "separator" for word in given) else None

    @cached_property
    def words(self) -> tuple[str, ...]:
        """The arguments in capitals; none where they are not simple."""
        return tuple(word.upper for word in self.arguments or ())

    @cached_property
    def numbers(self) -> tuple[float, ...] | None:
        """The arguments, where all are numbers."""
        return numbers(self.arguments or ())


# Words of APT, by what they mean for the motions around them.

_NO_MOTION = """
    PARTNO PPRINT INSERT LETTER REMARK FINI END CLPRNT NOPOST MACHIN MULTAX AUTOPS CHANNEL SWITCH PIVOTZ
    CUTTER TLDATA END-OF-PATH PAINT DISPLY PLOT INTOL OUTTOL TOLER CUTCOM CLEARP CLRSRF SAFETY
    CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH PSIS CUT DNTCUT ISN HEADER THICK VERIFY
    SPINDL COOLNT DELAY DWELL STOP OPSTOP OPSKIP SEQNO AUXFUN PREFUN REWIND CLAMP HEAD TMARK LEADER RESERV SELCTL SELECTL
"""
HARMLESS = frozenset(_NO_MOTION.split())
"""They move nothing, or say how to move, not where."""

_GO = "MOVARC ARCSLP TLON TLLFT TLRGT GO GOFWD GOBACK GOLFT GORGT GOUP GODOWN RETRCT GOCLER POCKET PROFIL CALL"
UNREAD_MOTIONS = frozenset(_GO.split())
"""Motions whose path is not written as numbers, or not in a form that is certain."""

MOVING = frozenset({"GOTO", "GODLTA", "GOHOME", "TLON", "CIRCLE"})
"""Words of motions that begin a statement, or stand in brackets."""

BLOCKING = {
    "ORIGIN": "ORIGIN moves the coordinates",
    "TRANS": "TRANS moves the coordinates",
    "TRACUT": "TRACUT transforms the motions",
    "REFSYS": "REFSYS changes the coordinates",
    "ROTABL": "ROTABL turns the table",
    "ROTATE": "ROTATE turns the table",
    "ROTHED": "ROTHED turns the head",
    "MIRROR": "MIRROR reflects the motions",
    "INDEX": "COPY repeats motions elsewhere",
    "COPY": "COPY repeats motions elsewhere",
    "MACRO": "a macro is run from elsewhere",
    "LOOPST": "a loop runs motions again",
    "JUMPTO": "JUMPTO changes the order of motions",
    "IF": "IF changes the order of motions",
}
"""What makes motions uncertain from a statement on until it is cleared, and why."""

CLEARING = {"TERMAC": "MACRO", "LOOPND": "LOOPST"}
"""Words that end what others began."""

ENDING = {"NOMORE", "OFF"}
"""Arguments that end what their word began."""

INCH = 0.0254
UNITS = {"MM": 1e-3, "CM": 1e-2, "INCH": INCH, "INCHES": INCH, "IN": INCH}
"""Metres."""

FEEDS = {"MMPM": 1e-3 / 60.0, "IPM": INCH / 60.0, "MMPR": None, "IPR": None, "PERREV": None}
"""Metres per second; none per revolution of the spindle."""


# From the text of a file to its statements.

_LITERAL = ("PARTNO", "PPRINT", "INSERT", "LETTER", "REMARK")
"""Words whose line is text."""

_CARD = 72
"""Columns of a card that hold the statement; behind them CATIA numbers its points: PT 5, CIR 1."""
_CARD_NUMBER = re.compile(r"(PT|CIR)\s+\d+\s*")


def parse(text: str) -> Iterator[Statement]:
    """The statements of a text; those that a dollar sign continues are one."""
    found: list[Token] = []
    for start, end in lines_of(text, start=text.startswith("\ufeff")):
        line = text[start:end]
        if not found:
            stripped = line.lstrip()
            word = "$$" if stripped.startswith("$$") else stripped[:6].upper()
            if word == "$$" or word in _LITERAL:
                yield Statement(word=word, text=stripped[len(word) :], start=end - len(stripped), end=end)
                continue
        if len(line) > _CARD and _CARD_NUMBER.fullmatch(line, _CARD):
            line = line[:_CARD]
        line, dollar, behind = line.partition("$")
        found += words(_WORDS, line, start)
        if found and (not dollar or behind.startswith("$")):
            yield _statement(found)
            found = []
    if found:
        yield _statement(found)


def _statement(found: list[Token]) -> Statement:
    if len(found) > 2 and found[1].text == ")":  # a label
        found = found[2:]
    word = " ".join(found[0].upper.split())
    return Statement(word=word, tokens=tuple(found), start=found[0].start, end=found[-1].end)


# Arcs, and where a motion of an APT program stands.

_ARC_TOLERANCE_M = 1e-5
"""How far the numbers of one arc of CATIA may disagree, metres: files round to a few digits."""

_RECORD_TOLERANCE_M = 2e-5
"""The same of a record."""

OFF_CIRCLE = "the arc's start or end does not lie on its circle"


@dataclass(frozen=True, eq=False, kw_only=True)
class Arc:
    """An arc from a start that is known."""

    direction: Float[np.ndarray, " 3"]
    """In which it begins, of unit length."""
    center: Float[np.ndarray, " 3"]
    """Metres."""
    radius: float
    """Metres."""
    sweep: float
    """Angle, radians, 0 to 2π."""
    via: Float[np.ndarray, " 3"]
    """Its middle, metres."""
    end: Float[np.ndarray, " 3"]
    """Metres."""

    @property
    def second(self) -> bool:
        """Whether it passes the line to its end once before it ends there."""
        return self.sweep > np.pi


def arc_through(start: Float[np.ndarray, " 3"], via: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]) -> Arc:
    """The arc through three points, metres.

    Raises:
        Unresolved: they lie on a line.
    """
    u, w = via - start, end - start
    normal = np.cross(u, w)
    square = float(normal @ normal)
    if square <= (1e-9 * max(u @ u, w @ w)) ** 2:
        raise Unresolved("the arc is straight")
    center = start + np.cross((u @ u) * w - (w @ w) * u, normal) / (2.0 * square)
    spoke = start - center
    tangent = np.cross(normal, spoke)
    tangent /= np.linalg.norm(tangent)
    radius, last = float(np.linalg.norm(spoke)), end - center
    sweep = float(np.arctan2(last @ tangent, last @ spoke / radius) % (2.0 * np.pi))
    return Arc(direction=tangent, center=center, radius=radius, sweep=sweep, via=via, end=end)


def _is_full(sweep: float, radius: float, tolerance: float) -> bool:
    return min(sweep, 2.0 * np.pi - sweep) * radius < tolerance


# As CATIA writes them.

_CIRCLE = f"TLON , GOFWD / ( CIRCLE / {' , '.join(4 * ['number'])} ) , ON"
_SECOND = " , number , INTOF"
_LINE = f" , ( LINE / {' , '.join(6 * ['number'])} )"
"""Words of the statement, numbers by their kind."""


@dataclass(frozen=True, kw_only=True)
class CircleTokens:
    """Numbers of an arc."""

    tokens: tuple[Token, ...]
    """Centre and radius of the circle, centre and end of the line."""
    values: tuple[float, ...]
    second: tuple[int, int]
    """Where ``,2,INTOF`` stands, or would stand: first character, and behind the last one."""


def circle_tokens(statement: Statement) -> CircleTokens | None:
    """The numbers of a circle statement; None where it has another form."""
    found = statement.tokens
    shape = " ".join(word.kind if word.kind == "number" else word.upper for word in found)
    on = len(_CIRCLE.split()) - 1
    second = shape == _CIRCLE + _SECOND + _LINE
    if not (second and found[on + 2].text == "2") and shape != _CIRCLE + _LINE:
        return None
    behind = on + len(_SECOND.split()) if second else on
    stated = tuple(word for word in (*found[:on], *found[behind + 1 :]) if word.kind == "number")
    values = numbers(stated)
    second_at = found[on].end, found[behind].end
    return None if values is None else CircleTokens(tokens=stated, values=values, second=second_at)


def read_arc(
    tokens: CircleTokens, direction: Float[np.ndarray, " 3"], start: Float[np.ndarray, " 3"], unit: float
) -> Arc:
    """The arc of a circle statement, from a start in metres and in a direction of any length.

    Raises:
        Unresolved: there is none.
    """
    values = np.array(tokens.values) * unit
    center, radius, end = values[:3], float(values[3]), values[7:]
    spoke, last = start - center, end - center
    size = np.linalg.norm(direction)
    if size == 0.0 or radius <= _ARC_TOLERANCE_M:
        raise Unresolved("the arc has no direction or no radius")
    tangent = direction / size
    axis = np.cross(spoke, tangent)
    if max(abs(np.linalg.norm(spoke) - radius), abs(np.linalg.norm(last) - radius)) > _ARC_TOLERANCE_M:
        raise Unresolved(OFF_CIRCLE)
    if abs(tangent @ spoke) > 1e-3 * radius or abs(axis @ last) > _ARC_TOLERANCE_M * radius:
        raise Unresolved("the arc's direction, start and end do not lie on one circle")
    sweep = float(np.arctan2(last @ tangent, last @ spoke / radius) % (2.0 * np.pi))
    if _is_full(sweep, radius, _ARC_TOLERANCE_M):
        raise Unresolved("a full circle is not told by three points; write it as two arcs")
    passes = tokens.second[0] < tokens.second[1]
    if passes != (sweep > np.pi) and abs(sweep - np.pi) * radius > _ARC_TOLERANCE_M:
        raise Unresolved("the arc ends at another meeting with its line than the one stated")
    return arc_through(start, center + se3.exp(axis / np.linalg.norm(axis) * (sweep / 2.0)) @ spoke, end)


# As records.

_SENSE = {6: 1.0, 11: -1.0}
"""By how many numbers a record has: whether it turns by the right hand about its axis, or against it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CircleRecord:
    """A CIRCLE statement."""

    start: int
    """Its first character."""
    tokens: tuple[Token, ...]
    """Its numbers."""
    values: Float[np.ndarray, " n"]
    sense: float
    """1 where it turns by the right hand about its axis, −1 where against it."""


def circle_record(statement: Statement) -> CircleRecord:
    """The record of a CIRCLE statement.

    Raises:
        Unresolved: its arc is not certain.
    """
    values = statement.numbers
    if "TIMES" in statement.words:
        raise Unresolved("a circle of several turns is not read")
    if values is None:
        raise Unresolved("its circle is not written as numbers")
    if len(values) not in _SENSE:
        count = f"{len(values)} numbers"
        raise Unresolved(f"the sense of rotation of a CIRCLE with {count} is not certain; six or eleven are read")
    if abs(np.linalg.norm(values[3:6]) - 1.0) > UNIT_TOLERANCE:
        raise Unresolved("the axis of the circle is not of length 1")
    tokens = statement.arguments or ()
    return CircleRecord(start=statement.start, tokens=tokens, values=np.array(values), sense=_SENSE[len(values)])


def recorded_arcs(
    record: CircleRecord, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], unit: float
) -> tuple[Arc, ...]:
    """The arc of a record between two points in metres, or the two halves of a full circle.

    Raises:
        Unresolved: there is none.
    """
    center, axis = record.values[:3] * unit, record.sense * record.values[3:6]
    spoke, last = start - center, end - center
    radius = float(np.linalg.norm(spoke))
    if radius <= _RECORD_TOLERANCE_M:
        raise Unresolved("the arc has no radius")
    stated = record.values[6:7] * unit
    if (np.abs(np.append(stated, np.linalg.norm(last)) - radius) > _RECORD_TOLERANCE_M).any():
        raise Unresolved(OFF_CIRCLE)
    if max(abs(spoke @ axis), abs(last @ axis)) > _RECORD_TOLERANCE_M:
        raise Unresolved("the arc climbs along its axis, as a helix does")
    sweep = float(np.arctan2(np.cross(spoke, last) @ axis, spoke @ last) % (2.0 * np.pi))
    if not _is_full(sweep, radius, _RECORD_TOLERANCE_M):
        return (arc_through(start, center + se3.exp(axis * (sweep / 2.0)) @ spoke, end),)
    quarters = [center + se3.exp(axis * (share * np.pi / 2.0)) @ spoke for share in (1, 2, 3)]
    return arc_through(start, quarters[0], quarters[1]), arc_through(quarters[1], quarters[2], end)


# Where a motion stands.


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionStatements:
    """The statements of a motion."""

    source: int
    """Number of its file."""
    start: int
    """First character of its first statement."""
    end: int
    """Behind the last character of its last statement."""
    body: int
    """First character of the statement that moves; of an arc the one with the circle."""
    numbers: tuple[Token, ...]
    """Of a point, and of the end behind a circle: three, or six with the tool's axis. Of an arc as CATIA writes it: its
    direction."""
    circle: CircleTokens | CircleRecord | None
    """Of an arc."""
    half: bool
    """The first half of a full circle, whose second half is the next motion and has the same statements."""
    relative: bool
    """The numbers count from where the motion begins."""
    unit: float
    """Metres."""
    rapid: bool
    """``RAPID`` stands before it."""
    begin: Float[np.ndarray, " 3"] | None
    """Where it begins, metres; None where that is not known."""
