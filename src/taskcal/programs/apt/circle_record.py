"""Arcs as ``CIRCLE/`` records: the centre, the axis, and the end in the ``GOTO`` behind.

Two forms have a sense of rotation that is certain. SOLIDWORKS CAM writes six numbers, centre and axis, and turns about the axis
by the right hand: so do all of 1085 arcs (in 10 files of one workshop) that a tangent motion leads into, but for three behind a
corner. NX writes eleven: centre, axis, radius, tolerance and its share inside, diameter and corner radius of the
tool; its axis assumes a clockwise turn (NX Manufacturing, CLSF, CIRCLE), against the right hand: so do all 295 such arcs.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.apt.circle import Arc, arc_through
from taskcal.programs.apt.lexer import Token
from taskcal.programs.apt.syntax import Statement

_SENSE = {6: 1.0, 11: -1.0}
"""By how many numbers a record has: whether it turns by the right hand about its axis, or against it."""

_AGREE = 2e-5
"""How far the numbers of one arc may disagree, metres: files round to a few digits."""

_UNIT_LENGTH = 1e-3
"""How far the length of the axis may be from one."""


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
    if abs(np.linalg.norm(record[3:6]) - 1.0) > _UNIT_LENGTH:
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
    if radius <= _AGREE:
        return "the arc has no radius"
    if abs(float(np.linalg.norm(last)) - radius) > _AGREE or (
        record.has_radius and abs(record.values[6] * unit - radius) > _AGREE
    ):
        return "the arc's start or end does not lie on its circle"
    if max(abs(spoke @ axis), abs(last @ axis)) > _AGREE:
        return "the arc climbs along its axis, as a helix does"
    sweep = float(np.arctan2(np.cross(spoke, last) @ axis, spoke @ last) % (2.0 * np.pi))
    if min(sweep, 2.0 * np.pi - sweep) * radius < _AGREE:
        quarters = [center + se3.exp(axis * (share * np.pi / 2.0)) @ spoke for share in (1, 2, 3)]
        arcs = arc_through(start, quarters[0], quarters[1]), arc_through(quarters[1], quarters[2], end)
    else:
        arcs = (arc_through(start, center + se3.exp(axis * (sweep / 2.0)) @ spoke, end),)
    trouble = next((arc for arc in arcs if isinstance(arc, str)), "")
    return trouble or tuple(arc for arc in arcs if isinstance(arc, Arc))
