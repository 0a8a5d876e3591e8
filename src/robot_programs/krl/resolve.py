"""Where the motions of a KRL program go, given what holds before each."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from robot_programs.core import flow, se3
from robot_programs.core.program import Move, MoveKind, Target, Unresolved
from robot_programs.krl.data import (
    AXES,
    EXTERNAL,
    POSE,
    Datum,
    File,
    Routine,
    Text,
    axes,
    external,
    has_axes,
    has_pose,
    pose,
    pose_values,
    rotation_stated,
    whole,
)
from robot_programs.krl.frames import NULL, Frames, State
from robot_programs.krl.rewrite import ACCURATE_BIT, Site, Status, Written
from robot_programs.krl.syntax import RELATIVE_MOTIONS, Aggregate, Motion, Operand, Reference
from robot_programs.krl.values import (
    HERE,
    ZERO,
    AbstractValue,
    Adjustable,
    Known,
    Lost,
    evaluated,
    name_of,
    structure,
    with_values,
)

# Points that do not state all their components, and motions by a distance: both count from where the motion before
# ended.
#
# A component that a point leaves out keeps the value that it has there (KUKA System Software, programming of
# motions to points); ``LIN_REL`` and ``PTP_REL`` add theirs to it, along the base's axes, or with ``#TOOL`` along
# the tool's. Both points of ``CIRC_REL`` count from where the arc begins (KUKA.PLC mxAutomation as in Beckhoff
# TF5120, KRC_MoveCircRelative).

UNKNOWN = "it counts from where the motion before ended, and that is not known"


def is_incomplete(aggregate: Aggregate) -> bool:
    """Whether components of a pose, or axes, are left out."""
    names = POSE if has_pose(aggregate) else AXES
    return not all(aggregate.field(name) for name in names)


def completed_axes(aggregate: Aggregate, before: Move | None) -> Float[np.ndarray, " joints"]:
    """Joint positions, those left out as they were, radians.

    Raises:
        Unresolved: where the motion before ended is not known by its joints.
    """
    if not is_incomplete(aggregate):
        return axes(aggregate)
    if before is None or before.end.q is None:
        missing = next(name for name in AXES if not aggregate.field(name))
        raise Unresolved(f"{missing} is not stated, and {UNKNOWN}")
    return np.where([aggregate.field(name) is not None for name in AXES], axes(aggregate, needed=()), before.end.q)


def completed_pose(aggregate: Aggregate, before: Move | None) -> Float[np.ndarray, "4 4"]:
    """A pose, what is left out as it was; either all of A, B and C are, or none.

    Args:
        aggregate: the point.
        before: the motion before, with the same tool and base.

    Raises:
        Unresolved: it is not known where that ended, or only some of the angles are stated.
    """
    if not is_incomplete(aggregate):
        return pose(aggregate)
    if before is None or before.end.T is None:
        missing = next(name for name in POSE if not aggregate.field(name))
        raise Unresolved(f"{missing} is not stated, and {UNKNOWN}")
    oriented = rotation_stated(aggregate)
    kept = pose_values(before.end.T)
    position = [kept[name] if aggregate.field(name) is None else None for name in "XYZ"]
    T = pose(aggregate, needed=())
    xyz = [own if old is None else old * 1e-3 for own, old in zip(T[:3, 3], position, strict=True)]
    return se3.pose(T[:3, :3] if oriented else before.end.T[:3, :3], np.array(xyz))


def moved_pose(step: Float[np.ndarray, "4 4"], before: Move | None, *, by_tool: bool) -> Float[np.ndarray, "4 4"]:
    """End of a motion by a distance.

    Args:
        step: the distance, metres.
        before: the motion before, with the same tool and base.
        by_tool: whether it is along the tool's axes.

    Raises:
        Unresolved: it is not known where it begins, or it turns, too.
    """
    if before is None or before.end.T is None:
        raise Unresolved(UNKNOWN)
    if np.abs(step[:3, :3] - np.eye(3)).max() > 0.0:
        raise Unresolved("it turns the tool by angles that are not added here; write a motion to a complete point")
    T = before.end.T.copy()
    T[:3, 3] += T[:3, :3] @ step[:3, 3] if by_tool else step[:3, 3]
    return T


def refuse_moved_axes(aggregate: Aggregate) -> None:
    """Let no external axis be moved by a distance, which would be taken for its position.

    Raises:
        Unresolved: one is.
    """
    for name in EXTERNAL:
        if aggregate.field(name) and aggregate.value(name) != 0.0:
            raise Unresolved(
                f"it moves {name} by a distance that is not added here; write a motion to a complete point"
            )


def moved_axes(aggregate: Aggregate, before: Move | None) -> Float[np.ndarray, " joints"]:
    """End of a motion by angles of the axes.

    Raises:
        Unresolved: it is not known by its joints where it begins.
    """
    if before is None or before.end.q is None:
        raise Unresolved(UNKNOWN)
    return before.end.q + axes(aggregate, needed=())


# What was found while a KRL program was read: its motions, and what is to be said of it.


@dataclass(eq=False, kw_only=True)
class Findings(flow.Findings[Text, tuple[Move, Site]]):
    """Motions found so far."""

    diagnostics: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    """Number of the file, position and text."""

    def diagnose(self, file: File, position: int, text: str) -> None:
        """Note something about a place."""
        self.diagnostics.append((file.number, position, text))

    def note(self, move: Move, site: Site, before: int | None) -> int:
        """The number of a motion."""
        meaning = (
            site.text, *_target(move.end.T, move.end.q), *_target(None if move.via is None else move.via.T, None),
            move.end.posture, *(None if w.datum is None else (w.datum.file.number, w.datum.start) for w in site.written),
            id(move.tool), id(move.part), move.part_in_hand, move.carrier, move.speed, move.turn_speed, move.stops,
            move.zone, repr(move.external), move.divisible,
        )  # fmt: skip
        return self.number(site.text, (move, site), meaning, before)

    def finished(self) -> Iterator[tuple[Move, Site]]:
        """The motions that are understood on all ways that lead to them, in the order of the text."""
        for found in self.ordered(lambda found: found.text not in self.reasons, lambda text: text):
            move, site = found.motion
            divisible = move.divisible and found.same_text == 1
            move = replace(move, follows=found.follows, texts_motions=found.same_text, divisible=divisible)
            yield move, replace(site, before=found.before)


def _target(T: Float[np.ndarray, "4 4"] | None, q: Float[np.ndarray, " joints"] | None) -> tuple[object, ...]:
    return (None if T is None else T.tobytes(), None if q is None else q.tobytes())


KINDS: dict[str, MoveKind] = {
    "PTP": "joint", "SPTP": "joint", "LIN": "linear", "SLIN": "linear", "CIRC": "circular", "SCIRC": "circular",
    "SPL": "linear", "PTP_REL": "joint", "SPTP_REL": "joint", "LIN_REL": "linear", "SLIN_REL": "linear",
    "CIRC_REL": "circular", "SCIRC_REL": "circular",
}  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class Resolver:
    """Resolver of the motions of a routine."""

    findings: Findings
    routine: Routine
    frames: Frames

    def resolve(
        self, line: Motion, state: State, *, in_spline: bool, returned: Mapping[int, AbstractValue]
    ) -> tuple[Move, Site]:
        """A motion and its place in the text.

        Args:
            line: the motion.
            state: what holds before it.
            in_spline: whether it is part of a SPLINE block.
            returned: what functions of the program return of its points, by their first character.

        Raises:
            Unresolved: the text does not tell where it goes.
        """
        if line.trouble or (line.keyword == "SPL" and not in_spline):
            raise Unresolved(line.trouble or "it is part of no SPLINE block")
        move, site = self._resolve(line, self.frames.with_settings(state, line.settings), returned)
        # the shape of a spline depends on all its points: they are corrected, and it is left whole
        return (replace(move, divisible=False) if in_spline else move), site

    def position(self, state: State) -> Aggregate | None:
        """Position of the robot, with the tool and base that hold; None where the text does not tell."""
        before = self._before(state)
        if before is None or before.end.T is None:
            return None
        return structure("$POS_ACT", dict(pose_values(before.end.T)))

    def stays_there(self, line: Motion, state: State) -> bool:
        """Whether a motion goes to where the robot is, as programs begin."""
        parts = line.operands[0].parts if len(line.operands) == 1 else ()
        if len(parts) != 1 or not isinstance(parts[0], Reference) or parts[0].index:
            return False
        name = parts[0].name
        try:
            return name in HERE or self.frames.known(state).assigned(name) in HERE
        except Unresolved:
            return False

    def _resolve(self, line: Motion, state: State, returned: Mapping[int, AbstractValue]) -> tuple[Move, Site]:
        kind = KINDS[line.keyword]
        known = self.frames.known(state)
        if any(_asks_for_its_place(operand) for operand in line.operands):
            known = replace(known, here=self.position(state))
        written = tuple(
            self._written(operand, known) if operand.parts else self._computed(line, operand, known, returned)
            for operand in line.operands
        )
        end = self._target(written[-1], kind, line, self._before(state))
        if end.q is not None:
            if kind != "joint":
                raise Unresolved(f"{line.keyword} is given axis positions")
            kind = "axes"
        via = None
        if kind == "circular":
            assert end.T is not None
            via = self._via(written[0], end.T, line, self._before(state))
        try:
            tool, part = self.frames.tool_and_part(state)
        except Unresolved:
            if kind != "axes":
                raise
            tool = part = NULL  # joint positions are reached with any tool
        move = Move(
            kind=kind,
            end=end,
            via=via,
            tool=tool,
            part=part,
            part_in_hand=bool(state.fixed_tool),
            speed=state.speed if kind in ("linear", "circular") else None,
            turn_speed=_turn_speed(state) if kind in ("linear", "circular") else None,
            stops=not line.passing,
            zone=state.approximation.zone(line.passing, kind),
            follows=None,
            routine=self.routine.name,
            place=self.routine.file.source.place(line.start),
            external=_external(written[-1].aggregates[0], line),
            carrier=state.base.carrier,
        )
        first = written[-1].aggregates[0]
        leans = line.keyword in RELATIVE_MOTIONS or is_incomplete(first) or first.type == "$POS_ACT"
        return move, Site(file=self.routine.file, motion=line, written=written, leans=leans)

    def _before(self, state: State) -> Move | None:
        """The motion before, if tool and base are still the same."""
        if state.last is None:
            return None
        before, _ = self.findings.occurrences[state.last].motion
        try:
            tool, part = self.frames.tool_and_part(state)
        except Unresolved:
            return before if before.end.q is not None else None
        same = before.tool is tool and before.part is part and before.part_in_hand == bool(state.fixed_tool)
        return before if same or before.end.q is not None else None

    def _written(self, operand: Operand, known: Known) -> Written:
        """Place of the numbers of a point."""
        parts = [self._part(part, known) for part in operand.parts]
        datum = parts[0] if isinstance(parts[0], Datum) else None
        aggregates = tuple(part.aggregate if isinstance(part, Datum) else part for part in parts)
        computed = any(
            not isinstance(part, Datum) and part is not stated
            for part, stated in zip(parts, operand.parts, strict=True)
        )
        return Written(operand=operand, aggregates=aggregates, datum=datum, file=self.routine.file, computed=computed)

    def _computed(self, line: Motion, operand: Operand, known: Known, returned: Mapping[int, AbstractValue]) -> Written:
        """A point that functions compute."""
        words = line.words_of(operand)
        if not words:
            raise Unresolved("its point is not stated in the text")
        value = returned[operand.start] if operand.start in returned else evaluated(words, known)
        if isinstance(value, Lost):
            raise Unresolved(value.reason)
        value = value.value if isinstance(value, Adjustable) else value
        if not isinstance(value, Aggregate):
            raise Unresolved("what stands for its point is not a position")
        return Written(operand=operand, aggregates=(value,), datum=None, file=self.routine.file, computed=True)

    def _part(self, part: Aggregate | Reference, known: Known) -> Aggregate | Datum:
        """A position as it is written, or what its variable holds."""
        if isinstance(part, Aggregate):
            return with_values(part, known)
        name = name_of(part, known)
        if name == "$POS_ACT" and known.here is not None:
            return known.here
        if name in ("$NULLFRAME", "$WORLD"):
            return ZERO
        assigned = known.assigned(name)
        if assigned is None:
            return self.frames.data.find(name, self.routine.file.module, self.routine.name)
        if not isinstance(assigned, Aggregate):
            raise Unresolved(f"{name} is set to something that is not a position")
        return assigned

    def _target(self, written: Written, kind: MoveKind, line: Motion, before: Move | None) -> Target:
        first, last = written.aggregates[0], written.aggregates[-1]
        place = self.routine.file.source.place(written.operand.start) if written.datum is None else written.datum.place
        name = "" if written.datum is None else written.datum.name
        if has_axes(first) and not has_pose(first):
            if len(written.aggregates) > 1:
                raise Unresolved("a frame is added to axis positions")
            relative = line.keyword in RELATIVE_MOTIONS
            q = moved_axes(first, before) if relative else completed_axes(first, before)
            return Target(name=name, T=None, q=q, posture=None, place=place)
        if line.keyword in RELATIVE_MOTIONS:
            T = moved_pose(_distance(written), before, by_tool=line.along == "#TOOL")
        else:
            T = completed_pose(first, before)
            for aggregate in written.aggregates[1:]:
                T = T @ _offset(aggregate)
        S, turn = whole(last, "S"), whole(last, "T")
        if S is not None and S & ACCURATE_BIT:
            self.findings.diagnose(
                self.routine.file,
                written.operand.start,
                "the point was taught with the controller's own absolute accuracy (bit 4 of S); where that is on, a corrected "
                "program would correct twice",
            )
        # S and T count in PTP only: LIN and CIRC keep the posture in which they start
        stated = kind == "joint" and (S is not None or turn is not None)
        return Target(name=name, T=T, q=None, posture=Status(S=S, T=turn) if stated else None, place=place)

    def _via(self, written: Written, end: Float[np.ndarray, "4 4"], line: Motion, before: Move | None) -> Target:
        """The auxiliary point of an arc, which need not state an orientation."""
        place = self.routine.file.source.place(written.operand.start) if written.datum is None else written.datum.place
        name = "" if written.datum is None else written.datum.name
        first = written.aggregates[0]
        external(first)  # refuses what is not a number
        if line.keyword in RELATIVE_MOTIONS:
            T = moved_pose(_distance(written), before, by_tool=False)
            return Target(name=name, T=T, q=None, posture=None, place=place)
        oriented = any(first.field(name) for name in "ABC")
        T = pose(first) if oriented else pose(first, needed=("X", "Y", "Z"))
        for aggregate in written.aggregates[1:]:
            T = T @ _offset(aggregate)
        if not oriented:
            T[:3, :3] = end[:3, :3]
        return Target(name=name, T=T, q=None, posture=None, place=place)


def _asks_for_its_place(operand: Operand) -> bool:
    """Whether a point may be counted from where the robot is."""
    return not operand.parts or any(isinstance(part, Reference) and part.name == "$POS_ACT" for part in operand.parts)


def _distance(written: Written) -> Float[np.ndarray, "4 4"]:
    """By what a motion goes on from where the one before ended.

    Raises:
        Unresolved: it is not stated as a frame.
    """
    first = written.aggregates[0]
    if has_axes(first) or not has_pose(first):
        refuse_moved_axes(first)
        raise Unresolved("its distance is not stated by X, Y and Z")
    T = np.eye(4)
    for aggregate in written.aggregates:
        T = T @ _offset(aggregate)
    return T


def _external(aggregate: Aggregate, line: Motion) -> tuple[float, ...]:
    """Positions of the external axes at the end of a motion; NaN where they stay as they are."""
    if line.keyword not in RELATIVE_MOTIONS:
        return external(aggregate)
    refuse_moved_axes(aggregate)
    return (math.nan,) * len(EXTERNAL)


def _offset(aggregate: Aggregate) -> Float[np.ndarray, "4 4"]:
    if not has_pose(aggregate):
        raise Unresolved("what is added by ':' is not a frame")
    return pose(aggregate, needed=())


def _turn_speed(state: State) -> float | None:
    """Radians per second; None where the text does not tell."""
    given = state.turn_speed
    return None if given is None or not given > 0.0 else math.radians(given)
