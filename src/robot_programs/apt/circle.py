"""Arcs as CATIA writes them: the direction at the start, the circle, and the line through its centre to the end.

``INDIRV/ tx,ty,tz`` and ``TLON,GOFWD/ (CIRCLE/ cx,cy,cz,r),ON[,2,INTOF],(LINE/ cx,cy,cz,ex,ey,ez)``; the tool stops
where it meets the line for the first time, or for the second one (CATIA V5 and 3DEXPERIENCE, Syntax of APT instructions).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from robot_programs.apt.syntax import Statement, Token, numbers
from robot_programs.core import se3

_ARC_TOLERANCE_M = 1e-5
"""How far the numbers of one arc may disagree, metres: files round to a few digits."""

_SHAPE = ("TLON", ",", "GOFWD", "/", "(", "CIRCLE", "/"), (")", ",", "ON"), (",", "(", "LINE", "/"), (")",)
_SECOND = (",", "2", ",", "INTOF")


@dataclass(frozen=True, kw_only=True)
class CircleTokens:
    """Numbers of an arc."""

    circle: tuple[Token, ...]
    """Centre and radius."""
    line: tuple[Token, ...]
    """Centre and end."""
    values: tuple[float, ...]
    """Of all of them."""
    second: tuple[int, int]
    """Where ``,2,INTOF`` stands, or would stand: first character, and behind the last one."""


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


def circle_tokens(statement: Statement) -> CircleTokens | None:
    """The numbers of a circle statement; None where it has another form."""
    texts = tuple(token.text.upper() for token in statement.tokens)
    head, middle, line, tail = _SHAPE
    rest = statement.tokens
    if texts[: len(head)] != head:
        return None
    circle, rest = _listed(rest[len(head) :], 4)
    if not circle or _texts(rest[: len(middle)]) != middle:
        return None
    on, rest = rest[len(middle) - 1], rest[len(middle) :]
    end = on.end
    if _texts(rest[: len(_SECOND)]) == _SECOND:
        end, rest = rest[len(_SECOND) - 1].end, rest[len(_SECOND) :]
    if _texts(rest[: len(line)]) != line:
        return None
    ends, rest = _listed(rest[len(line) :], 6)
    values = numbers(circle + ends)
    if not ends or values is None or _texts(rest) != tail:
        return None
    return CircleTokens(circle=circle, line=ends, values=values, second=(on.end, end))


def _texts(tokens: tuple[Token, ...]) -> tuple[str, ...]:
    return tuple(token.text.upper() for token in tokens)


def _listed(tokens: tuple[Token, ...], count: int) -> tuple[tuple[Token, ...], tuple[Token, ...]]:
    """So many tokens with commas between them, none where it is not so; and what follows."""
    given, commas = tokens[: 2 * count - 1 : 2], tokens[1 : 2 * count - 2 : 2]
    if len(given) < count or any(token.text != "," for token in commas):
        return (), tokens
    return given, tokens[2 * count - 1 :]


def read_arc(
    tokens: CircleTokens, direction: Float[np.ndarray, " 3"], start: Float[np.ndarray, " 3"], unit: float
) -> Arc | str:
    """The arc of a circle statement.

    Args:
        tokens: its numbers.
        direction: in which the arc begins, of any length.
        start: where it begins, metres.
        unit: length of the program's unit, metres.

    Returns:
        The arc, or why there is none.
    """
    values = np.array(tokens.values) * unit
    center, radius, end = values[:3], float(values[3]), values[7:]
    spoke, last = start - center, end - center
    size = np.linalg.norm(direction)
    if size == 0.0 or radius <= _ARC_TOLERANCE_M:
        return "the arc has no direction or no radius"
    tangent = direction / size
    if max(abs(np.linalg.norm(spoke) - radius), abs(np.linalg.norm(last) - radius)) > _ARC_TOLERANCE_M:
        return "the arc's start or end does not lie on its circle"
    if abs(tangent @ spoke) > 1e-3 * radius or abs(np.cross(spoke, tangent) @ last) > _ARC_TOLERANCE_M * radius:
        return "the arc's direction, start and end do not lie on one circle"
    sweep = float(np.arctan2(last @ tangent, last @ spoke / radius) % (2.0 * np.pi))
    if min(sweep, 2.0 * np.pi - sweep) * radius < _ARC_TOLERANCE_M:
        return "a full circle is not told by three points; write it as two arcs"
    passes = tokens.second[0] < tokens.second[1]
    if passes != (sweep > np.pi) and abs(sweep - np.pi) * radius > _ARC_TOLERANCE_M:
        return "the arc ends at another meeting with its line than the one stated"
    return arc_through(start, center + _turned(spoke, tangent, sweep / 2.0), end)


def _turned(spoke: np.ndarray, tangent: np.ndarray, angle: float) -> np.ndarray:
    axis = np.cross(spoke, tangent)
    return se3.exp(axis / np.linalg.norm(axis) * angle) @ spoke


def arc_through(
    start: Float[np.ndarray, " 3"], via: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]
) -> Arc | str:
    """The arc through three points, metres, or why there is none."""
    u, w = via - start, end - start
    normal = np.cross(u, w)
    square = float(normal @ normal)
    if square <= (1e-9 * max(u @ u, w @ w)) ** 2:
        return "the arc is straight"
    center = start + np.cross((u @ u) * w - (w @ w) * u, normal) / (2.0 * square)
    spoke = start - center
    radius = float(np.linalg.norm(spoke))
    tangent = np.cross(normal, spoke)
    tangent /= np.linalg.norm(tangent)
    last = end - center
    sweep = float(np.arctan2(last @ tangent, last @ spoke / radius) % (2.0 * np.pi))
    return Arc(direction=tangent, center=center, radius=radius, sweep=sweep, via=via, end=end)


# Arcs as ``CIRCLE/`` records: the centre, the axis, and the end in the ``GOTO`` behind.
#
# Two forms have a sense of rotation that is certain. SOLIDWORKS CAM writes six numbers, centre and axis, and turns
# about the axis by the right hand: so do all of 1085 arcs (in 10 files of one workshop) that a tangent motion leads
# into, but for three behind a corner. NX writes eleven: centre, axis, radius, tolerance and its share inside,
# diameter and corner radius of the tool; its axis assumes a clockwise turn (NX Manufacturing, CLSF, CIRCLE),
# against the right hand: so do all 295 such arcs.

_SENSE = {6: 1.0, 11: -1.0}
"""By how many numbers a record has: whether it turns by the right hand about its axis, or against it."""

_RECORD_TOLERANCE_M = 2e-5
"""How far the numbers of one arc may disagree, metres: files round to a few digits."""

UNIT_TOLERANCE = 1e-3
"""How far the length of a direction may be from one: files round to a few digits."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CircleRecord:
    """A CIRCLE statement."""

    statement: Statement
    tokens: tuple[Token, ...]
    """Its numbers."""
    values: Float[np.ndarray, " n"]
    sense: float
    """1 where it turns by the right hand about its axis, −1 where against it."""

    @property
    def has_radius(self) -> bool:
        """Whether the radius is written behind the axis."""
        return len(self.tokens) > 6


def circle_record(statement: Statement) -> CircleRecord | str:
    """The record of a CIRCLE statement, or why its arc is not certain."""
    values = statement.numbers
    if values is None:
        return (
            "a circle of several turns is not read"
            if "TIMES" in statement.words
            else "its circle is not written as numbers"
        )
    sense = _SENSE.get(len(values))
    if sense is None:
        return f"the sense of rotation of a CIRCLE with {len(values)} numbers is not certain; six or eleven are read"
    record = np.array(values)
    if abs(np.linalg.norm(record[3:6]) - 1.0) > UNIT_TOLERANCE:
        return "the axis of the circle is not of length 1"
    return CircleRecord(statement=statement, tokens=statement.arguments or (), values=record, sense=sense)


def recorded_arcs(
    record: CircleRecord, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], unit: float
) -> tuple[Arc, ...] | str:
    """The arc of a record between two points, or the two halves of a full circle; or why there is none.

    Args:
        record: the circle.
        start: where the motion before ended, metres.
        end: the point behind the record, metres.
        unit: length of the program's unit, metres.
    """
    center, axis = record.values[:3] * unit, record.sense * record.values[3:6]
    spoke, last = start - center, end - center
    radius = float(np.linalg.norm(spoke))
    if radius <= _RECORD_TOLERANCE_M:
        return "the arc has no radius"
    if abs(float(np.linalg.norm(last)) - radius) > _RECORD_TOLERANCE_M or (
        record.has_radius and abs(record.values[6] * unit - radius) > _RECORD_TOLERANCE_M
    ):
        return "the arc's start or end does not lie on its circle"
    if max(abs(spoke @ axis), abs(last @ axis)) > _RECORD_TOLERANCE_M:
        return "the arc climbs along its axis, as a helix does"
    sweep = float(np.arctan2(np.cross(spoke, last) @ axis, spoke @ last) % (2.0 * np.pi))
    if min(sweep, 2.0 * np.pi - sweep) * radius < _RECORD_TOLERANCE_M:
        quarters = [center + se3.exp(axis * (share * np.pi / 2.0)) @ spoke for share in (1, 2, 3)]
        arcs = arc_through(start, quarters[0], quarters[1]), arc_through(quarters[1], quarters[2], end)
    else:
        arcs = (arc_through(start, center + se3.exp(axis * (sweep / 2.0)) @ spoke, end),)
    trouble = next((arc for arc in arcs if isinstance(arc, str)), "")
    return trouble or tuple(arc for arc in arcs if isinstance(arc, Arc))


# Where a motion of an APT program stands.


@dataclass(frozen=True, eq=False, kw_only=True)
class Instruction:
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
    circle: CircleTokens | None
    """Of an arc as CATIA writes it."""
    record: CircleRecord | None = None
    """Of an arc whose circle stands before its end."""
    half: bool = False
    """The first half of a full circle, whose second half is the next motion and has the same statements."""
    relative: bool
    """The numbers count from where the motion begins."""
    unit: float
    """Metres."""
    rapid: bool
    """``RAPID`` stands before it."""
    begin: Float[np.ndarray, " 3"] | None
    """Where it begins, metres; None where that is not known."""
