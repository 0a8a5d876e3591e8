"""Reading KRL programs: where each motion goes, from the routines that nothing calls through all that they call."""

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from robot_programs.core import flow, se3
from robot_programs.core.errors import FileError, InputError
from robot_programs.core.flow import MIN_LINES, Body, Counts, Effects, Group, Loop, Node, lines_in
from robot_programs.core.program import Diagnostic, Frame, Motion, MotionKind, Target, Unresolved
from robot_programs.core.source import Source, uncollected
from robot_programs.core.values import Lost
from robot_programs.krl.data import (
    AXES,
    EXTERNAL,
    POSE,
    Data,
    Datum,
    File,
    NotInFiles,
    Routine,
    Text,
    axes,
    external,
    given_data,
    has_axes,
    has_pose,
    pose,
    pose_values,
    rotation_stated,
    stated,
    whole,
)
from robot_programs.krl.frames import EVERYTHING, NULL, UNREACHED, Frames, State
from robot_programs.krl.rewrite import ACCURATE_BIT, KrlProgram, Site, Status, Written
from robot_programs.krl.routines import (
    Actions,
    actions_of,
    callers_of,
    calls_of,
    changed_by,
    concerned,
    effects_of,
    matters,
    only_computes,
    read_names,
    roots_of,
    routines_of,
)
from robot_programs.krl.syntax import (
    LOOPS,
    RELATIVE_MOTIONS,
    Aggregate,
    Assignment,
    Begin,
    Beside,
    Call,
    Condition,
    Control,
    MotionLine,
    Operand,
    Reference,
    Statement,
    Tree,
    Word,
    closing,
    lines_of_words,
    passed_by_reference,
    passed_in,
    tree_of,
    whole_call,
)
from robot_programs.krl.values import (
    HERE,
    ZERO,
    AbstractValue,
    Adjustable,
    Known,
    Names,
    Value,
    Variables,
    after_assignment,
    bound,
    element_assigned,
    evaluated,
    forgotten,
    given_by,
    name_of,
    number_of,
    structure,
    values_of,
    with_values,
    without_own,
    without_places,
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
    return not {component.name for component in aggregate.fields}.issuperset(names)


def axes_at_end(aggregate: Aggregate, before: Motion | None, *, relative: bool) -> Float[np.ndarray, " joints"]:
    """Joint positions, those left out as they were, or moved by angles, radians.

    Raises:
        Unresolved: where the motion before ended is not known by its joints.
    """
    missing = next((name for name in AXES if not aggregate.field(name)), "")
    if not (relative or missing):
        return axes(aggregate)
    if before is None or before.end.q is None:
        raise Unresolved(UNKNOWN if relative else f"{missing} is not stated, and {UNKNOWN}")
    given = axes(aggregate, needed=())
    if relative:
        return before.end.q + given
    return np.where([aggregate.field(name) is not None for name in AXES], given, before.end.q)


def completed_pose(aggregate: Aggregate, before: Motion | None) -> Float[np.ndarray, "4 4"]:
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


def moved_pose(step: Float[np.ndarray, "4 4"], before: Motion | None, *, by_tool: bool) -> Float[np.ndarray, "4 4"]:
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


MIN_SINE = 1e-3
"""Of the angle in which a circle is seen from one of three points on it: points nearer to a line are none of a circle."""

SAME_ORIENTATION_RAD = 1e-6

MAX_ARC_DEG = 350.0
"""Arcs that nearly close are told apart from those of next to no angle by digits that points do not have."""


def at_angle(
    angle: float, start: Float[np.ndarray, "4 4"], via: Float[np.ndarray, "4 4"], last: Float[np.ndarray, "4 4"]
) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "4 4"]]:
    """Middle and end of an arc that ends at an angle, on the circle from its start through two points.

    The angle is that of the whole arc, counted the way that leads by the first point to the second, negative the other way (KUKA
    System Software, circular motions, circular angle).

    Args:
        angle: degrees.
        start: pose where it begins.
        via: the first point.
        last: the second one.

    Raises:
        Unresolved: they are on no circle, the tool turns on the way to the second point, or the arc is none of one turn.
    """
    a, b = via[:3, 3] - start[:3, 3], last[:3, 3] - start[:3, 3]
    normal, aa, bb, cc = np.cross(a, b), a @ a, b @ b, (b - a) @ (b - a)
    if not normal @ normal > MIN_SINE**2 * max(aa * bb, bb * cc, cc * aa):
        raise Unresolved("its points and its start are on no circle on which CA would count")
    if np.abs(start[:3, :3] - last[:3, :3]).max() > SAME_ORIENTATION_RAD:
        raise Unresolved(
            "the tool turns along it, and how far up to the angle CA is not known; write it to its own end"
        )
    if not 0.0 < abs(angle) < MAX_ARC_DEG:
        raise Unresolved(f"CA {angle:g} is not between 0 and {MAX_ARC_DEG:g}°; write two arcs")
    centre = np.cross(aa * b - bb * a, normal) / (2.0 * normal @ normal)
    axis = normal / np.linalg.norm(normal)
    turns = (se3.exp(axis * np.radians(share * angle)) for share in (0.5, 1.0))
    middle, end = (se3.pose(last[:3, :3], start[:3, 3] + centre - R @ centre) for R in turns)
    return middle, end


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


# What was found while a KRL program was read: its motions, and what is to be said of it.


@dataclass(eq=False, kw_only=True)
class Findings(flow.Findings[Text, tuple[Motion, Site]]):
    """Motions found so far."""

    diagnostics: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    """Number of the file, position and text."""

    def diagnose(self, file: File, position: int, text: str) -> None:
        """Note something about a place."""
        self.diagnostics.append((file.number, position, text))

    def note(self, move: Motion, site: Site, before: int | None) -> int:
        """The number of a motion."""
        meaning = (
            site.text, *_target(move.end.T, move.end.q), *_target(None if move.via is None else move.via.T, None),
            move.end.posture, *(None if w.datum is None else (w.datum.file.number, w.datum.start) for w in site.written),
            id(move.tool), id(move.part), move.part_in_hand, move.carrier, move.speed, move.turn_speed, move.stops,
            move.zone, repr(move.external), move.divisible,
        )  # fmt: skip
        return self.number(site.text, (move, site), meaning, before)

    def finished(self) -> Iterator[tuple[Motion, Site]]:
        """The motions that are understood on all ways that lead to them, in the order of the text."""
        for found in self.ordered(lambda found: found.text not in self.reasons, lambda text: text):
            move, site = found.motion
            divisible = move.divisible and found.same_text == 1
            move = replace(move, follows=found.follows, texts_motions=found.same_text, divisible=divisible)
            yield move, replace(site, before=found.before)


def _target(T: Float[np.ndarray, "4 4"] | None, q: Float[np.ndarray, " joints"] | None) -> tuple[object, ...]:
    return (None if T is None else T.tobytes(), None if q is None else q.tobytes())


KINDS: dict[str, MotionKind] = {
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
    motion_before: Callable[[int | None], int | None]
    """Number of the motion before, by that of the last one of a state; it then is of consequence."""

    def resolve(
        self, line: MotionLine, state: State, *, in_spline: bool, returned: Mapping[int, AbstractValue]
    ) -> tuple[Motion, Site]:
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
        state = self.frames.with_settings(state, line.settings)
        try:
            move, site = self._resolve(line, state, returned)
        except Unresolved as trouble:
            if not NotInFiles.is_said(said := str(trouble)):
                raise
            # names that have to be stated are said together
            raise Unresolved("; ".join(dict.fromkeys([said, *self._missing_frames(state)]))) from None
        # the shape of a spline depends on all its points: they are corrected, and it is left whole
        return (replace(move, divisible=False) if in_spline else move), site

    def _missing_frames(self, state: State) -> Iterator[str]:
        try:
            self.frames.tool_and_part(state)
        except Unresolved as trouble:
            if NotInFiles.is_said(str(trouble)):
                yield str(trouble)

    def position(self, state: State) -> Aggregate | None:
        """Position of the robot, with the tool and base that hold; None where the text does not tell."""
        before = self._before(state)
        if before is None or before.end.T is None:
            return None
        return structure("$POS_ACT", dict(pose_values(before.end.T)))

    def stays_there(self, line: MotionLine, state: State) -> bool:
        """Whether a motion goes to where the robot is, as programs begin."""
        parts = line.operands[0].parts if len(line.operands) == 1 else ()
        if len(parts) != 1 or not isinstance(parts[0], Reference) or parts[0].index:
            return False
        name = parts[0].name
        try:
            return name in HERE or self.frames.known(state).assigned(name) in HERE
        except Unresolved:
            return False

    def _resolve(self, line: MotionLine, state: State, returned: Mapping[int, AbstractValue]) -> tuple[Motion, Site]:
        kind = KINDS[line.keyword]
        known = self.frames.known(state)
        if any(_asks_for_its_place(operand) for operand in line.operands):
            known = replace(known, place=lambda: self.position(state))
        written = tuple(
            self._written(operand, known) if operand.parts else self._computed(line, operand, known, returned)
            for operand in line.operands
        )
        first = written[-1].aggregates[0]
        leans = line.keyword in RELATIVE_MOTIONS or is_incomplete(first) or bool(line.angle)
        before = self._before(state) if leans else None
        end = self._target(written[-1], kind, line, before)
        if end.q is not None:
            if kind != "joint":
                raise Unresolved(f"{line.keyword} is given axis positions")
            kind = "axes"
        via = None
        if kind == "circular":
            assert end.T is not None
            via = self._via(written[0], end.T, line, before)
            if line.angle:
                if before is None or before.end.T is None:
                    raise Unresolved(UNKNOWN)
                assert via.T is not None
                middle, T = at_angle(number_of(line.angle, known), before.end.T, via.T, end.T)
                via, end = replace(via, T=middle), replace(end, T=T)
        try:
            tool, part = self.frames.tool_and_part(state)
        except Unresolved:
            if kind != "axes":
                raise
            tool = part = NULL  # joint positions are reached with any tool
        move = Motion(
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
            routine=self.routine.name,
            place=self.routine.file.source.place(line.start),
            external=_external(written[-1].aggregates[0], line),
            carrier=state.base.carrier,
        )
        leans = leans or first.type == "$POS_ACT"
        return move, Site(file=self.routine.file, motion=line, written=written, leans=leans)

    def _before(self, state: State) -> Motion | None:
        """The motion before, if tool and base are still the same."""
        number = self.motion_before(state.last)
        if number is None:
            return None
        before, _ = self.findings.occurrences[number].motion
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

    def _computed(
        self, line: MotionLine, operand: Operand, known: Known, returned: Mapping[int, AbstractValue]
    ) -> Written:
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
        datum = self.frames.data.set_once.get((self.routine, name))
        return assigned if datum is None or values_of(datum.aggregate) != values_of(assigned) else datum

    def _target(self, written: Written, kind: MotionKind, line: MotionLine, before: Motion | None) -> Target:
        first, last = written.aggregates[0], written.aggregates[-1]
        place = self.routine.file.source.place(written.operand.start) if written.datum is None else written.datum.place
        name = "" if written.datum is None else written.datum.name
        if has_axes(first) and not has_pose(first):
            if len(written.aggregates) > 1:
                raise Unresolved("a frame is added to axis positions")
            q = axes_at_end(first, before, relative=line.keyword in RELATIVE_MOTIONS)
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

    def _via(self, written: Written, end: Float[np.ndarray, "4 4"], line: MotionLine, before: Motion | None) -> Target:
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


def _external(aggregate: Aggregate, line: MotionLine) -> tuple[float, ...]:
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


# One pass through the lines of a KRL routine, and through the routines that it calls.


MAX_IDLE_CALLS = 40
"""So often a routine without motions is followed, as those for messages are; behind further calls, what it changes is not known."""

RESUMED = "an interrupt may resume behind it"

_SUMMARISED = tuple(one.name for one in fields(State) if one.name not in ("last", "variables"))
"""What of a state is of consequence for every routine."""

MAX_IDLE_LINES = 1000
"""Lines of all turns of a loop without motions that is gone through turn by turn."""


@dataclass(eq=False, kw_only=True)
class _Flow(flow.Flow[State, Routine]):
    """The routines of a program, and how far they have been followed."""

    findings: Findings
    routines: Mapping[str, Sequence[Routine]]
    trees: Mapping[Routine, Tree]
    frames: Callable[[Routine], Frames]
    concerns: Mapping[str, frozenset[str]]
    """By name of a routine: keys of the variables that it, or what it calls, reads or changes."""
    changes: Mapping[str, frozenset[str]]
    """By name of a routine: keys of the variables it changes, and what of tool, base and the like."""
    by_value: Mapping[str, tuple[bool, ...]]
    actions: Actions
    """What may run beside the lines."""
    left_in: list[State] = field(default_factory=list[State])
    """What holds in all places at which an interrupt may leave the routines that are being called, the innermost last."""
    idle_calls: dict[str, int] = field(default_factory=dict[str, int])
    """By name of a routine that neither moves nor sets tool, base and the like: how often it was followed."""
    elements: dict[Text, set[str] | None] = field(default_factory=dict[Text, set[str] | None])
    """By assignment to an element by a computed index: which elements it sets; None where that is not known."""

    def body(self, routine: Routine) -> Body:
        return self.trees[routine].body

    def name(self, routine: Routine) -> str:
        return routine.name

    def walk(self, routine: Routine, inside: tuple[Routine, ...]) -> "_Walk":
        odd = self.trees[routine].odd
        if odd is not None and not self.scouting:
            text = f"{odd.keyword} does not match the blocks of {routine.name}; what holds behind it is not known"
            self.findings.diagnose(routine.file, odd.start, text)
        return _Walk(flow=self, routine=routine, inside=inside, tree=self.trees[routine], frames=self.frames(routine))

    def anything(self, why: str) -> State:
        """State in which anything may hold, and any action may have been started."""
        self.unclear += 1  # what a routine does not concern is not known behind it, either
        return replace(State.unset().lost(why), armed=self.actions.all)

    def start(self, routine: Routine) -> State:
        return State.unset()

    def found_all(self, routine: Routine) -> bool:
        motions = {(routine.file.number, line.start) for line in routine.lines if isinstance(line, MotionLine)}
        return motions <= self.findings.seen

    def may_follow(self, routine: Routine) -> bool:
        """Whether a routine may still be gone through; not if it moves nothing and was gone through often."""
        if not self.changes[routine.name] & EVERYTHING:
            self.idle_calls[routine.name] = self.idle_calls.get(routine.name, 0) + 1
            if self.idle_calls[routine.name] > MAX_IDLE_CALLS:
                return False
        return super().may_follow(routine)

    def depends_on(self, routine: Routine, entry: State) -> Hashable | None:
        """All on which depends what a routine does, but the motion before it: variables that it names, and all else."""
        if self.left_in:  # what holds inside it counts, too
            return None
        concerns = self.concerns[routine.name]
        variables = frozenset(
            (key, type(value), value) for key, value in entry.variables.items() if key.partition("[")[0] in concerns
        )
        return routine, bool(self.scouting), variables, tuple(getattr(entry, name) for name in _SUMMARISED)

    def after_summary(self, routine: Routine, entry: State, end: State) -> State:
        if not end.reached:
            return end
        concerns = self.concerns[routine.name]
        others = {key: value for key, value in entry.variables.items() if key.partition("[")[0] not in concerns}
        own = {key: value for key, value in end.variables.items() if key.partition("[")[0] in concerns}
        moves = "motion" in self.changes[routine.name]
        return replace(end, variables={**(without_places(others) if moves else others), **own})

    def needed_before(self, last: int | None) -> int | None:
        """Number of the motion before, on which something depends."""
        self.unclear += last == flow.ENTRY
        return self.before(last)

    def link(self, number: int, before: int | None) -> None:
        self.findings.link(number, before)

    def forget(self, name: str, state: State) -> State:
        """State after a routine that is not followed."""
        if name not in self.routines:
            return state
        self.anywhere.update(self.routines[name])
        return self.lost_by(name, state)

    def lost_by(self, name: str, state: State) -> State:
        """State after a routine that may have left anything that it changes."""
        variables = forgotten(state.variables, self.changes[name])
        armed = state.armed | self.actions.by_routine.get(name, frozenset())
        return replace(state.lost(f"{name} sets it", self.changes[name]), variables=variables, armed=armed)

    def armed_by(self, routine: Routine, lines: Sequence[Statement]) -> frozenset[Text]:
        """Actions that some lines of a routine may start."""
        started, by_routine = self.actions.started, self.actions.by_routine
        return frozenset[Text]().union(
            *(started.get((routine.file.number, line.start), frozenset()) for line in lines),
            *(by_routine.get(name, frozenset()) for line in lines for name in calls_of(line)),
        )


@dataclass(eq=False, kw_only=True)
class _Walk(flow.Walk[State, Routine]):
    """One pass through a routine."""

    flow: _Flow  # pyright: ignore[reportIncompatibleVariableOverride]
    tree: Tree
    frames: Frames
    in_spline: bool = False
    trigger: bool = False
    """A TRIGGER waits for the next motion."""

    @property
    def unreached(self) -> State:
        return UNREACHED

    def through(self, entry: State) -> tuple[State, AbstractValue | None]:
        """State after the routine, its own variables included, and what it returns."""
        state, value = super().through(entry)
        local = state.armed & self.flow.actions.local.get(self.routine.name, frozenset())
        return replace(state, armed=state.armed - local) if local else state, value

    def between(self, state: State) -> State:
        """State where started actions may have run, and one of them may leave the routine."""
        state = self.flow.actions.weakened(state)
        if state.reached:
            left_in = self.flow.left_in
            left_in[:] = [one.joined([state], RESUMED) if one.reached else state for one in left_in]
        return state

    def behind(self, state: State) -> State:
        """State after the last line of a block; see `between`."""
        return self.between(state)

    # Conditions, and loops that count.

    def asked(self, line: Statement, state: State, node: Node | None = None) -> State:
        for name in calls_of(line):
            state = self.flow.forget(name, state)
        return self._forgotten(passed_in(line, self.flow.by_value), state) if isinstance(line, Control) else state

    def truth(self, condition: Condition, state: State) -> bool | None:
        value = self._value(condition.words, state)
        if condition.cases is None:
            return value if isinstance(value, bool) else None
        cases = [self._value(words, state) for words in condition.cases]
        if value is None or any(type(case) is not type(value) for case in cases):
            return None
        return value in cases

    def reads_data(self, condition: Condition) -> bool:
        return any(word.kind == "name" for word in condition.words)

    def widened(self, state: State, nodes: Sequence[Node], why: str) -> State:
        lines = tuple(lines_in(nodes))
        changed = frozenset[str]().union(*map(self._changed_by, lines))
        keys = changed - EVERYTHING
        variables = {key: Lost(reason=f"{key.rpartition(':')[2]} is not the same in every turn") for key in keys}
        state = replace(
            state,
            variables={**without_places(forgotten(state.variables, keys)), **variables},
            armed=state.armed | self.flow.armed_by(self.routine, lines),
        )
        return state.lost(why, changed | {"motion"})

    def counts(self, loop: Loop, state: State) -> Counts | None:
        """Bounds and step of a FOR; None where the text does not tell, or no counter is named."""
        words, names = loop.line.words, self.frames.names
        upper = [word.upper for word in words]
        if len(words) < 5 or upper[1] != "=" or "TO" not in upper or names.key(upper[0]) in names.volatile:
            return None
        to = upper.index("TO")
        by = upper.index("STEP") if "STEP" in upper else len(words)
        known = replace(self.frames.known(state), deciding=True)
        try:
            first, last = number_of(words[2:to], known), number_of(words[to + 1 : by], known)
            step = number_of(words[by + 1 :], known) if by < len(words) else 1.0
        except Unresolved:
            return None
        whole = first.is_integer() and last.is_integer() and step.is_integer()
        return Counts(first=first, last=last, step=step) if whole and step else None

    def counting(self, loop: Loop, state: State, count: float | None) -> State:
        if loop.kind != "counted":
            return state
        if count is None:
            return replace(state, variables=forgotten(state.variables, self._changed_by(loop.line)))
        return replace(state, variables={**state.variables, self._counter(loop): count})

    def counted(self, loop: Loop, state: State, count: float) -> float | None:
        now = state.variables.get(self._counter(loop))
        return now if isinstance(now, float) else None

    def by_turns(self, loop: Loop, turns: int) -> bool:
        """Whether a loop moves, or is short, as one that computes points is."""
        if turns * loop.size <= MAX_IDLE_LINES:
            return True
        return any("motion" in self._changed_by(line) for line in lines_in(loop.body))

    def _counter(self, loop: Loop) -> str:
        return self.frames.names.key(loop.line.words[0].upper)

    def _value(self, words: Sequence[Word], state: State) -> Value | None:
        """The value of an expression by which ways are chosen; None where the text does not tell, or all are gone through."""
        if self.flow.all_ways:
            return None
        try:
            return evaluated(words, replace(self.frames.known(state), deciding=True))
        except Unresolved:
            value = self._with_functions(words, state)
            return None if isinstance(value, Lost | Adjustable) else value

    def _changed_by(self, line: Statement) -> frozenset[str]:
        return changed_by(line, self.frames.names, self.flow.by_value, self.flow.changes)

    def _forgotten(self, variables: Sequence[str], state: State) -> State:
        """State in which some variables, by their names in the routine, may hold anything."""
        if not variables:
            return state
        keys = map(self.frames.names.key, variables)
        return replace(state, variables=forgotten(state.variables, keys))

    # Lines.

    def within(self, group: Group, state: State) -> State:
        """State after a SPLINE block."""
        self.in_spline = True
        state = self.block(group.body, replace(state, last=None))
        self.in_spline = False
        return state

    def returned(self, line: Control, state: State) -> AbstractValue | None:
        return given_by(line.words, self.frames.known(state)) if line.keyword == "RETURN" and line.words else None

    def step(self, line: Statement, state: State) -> State:
        match line:
            case MotionLine():
                return self._motion(line, state)
            case Assignment():
                return self._assignment(line, state)
            case Call():
                return self._call(line, state)
            case Beside():
                return self._beside(line, state)
            case Control() if self.tree.odd is None and line.keyword in LOOPS:  # without any line of consequence
                state = self.asked(line, state)
                return replace(state, variables=forgotten(state.variables, self._changed_by(line)))
            case Control():
                return self.flow.anything(f"the blocks of {self.routine.name} do not match")
            case _:
                return state

    def _beside(self, line: Beside, state: State) -> State:
        actions, text = self.flow.actions, (self.routine.file.number, line.start)
        if not self.flow.scouting:
            self.trigger = self.trigger or line.keyword == "TRIGGER"
            for said in actions.missing.get(text, ()):
                self.flow.findings.diagnose(self.routine.file, line.start, said)
        started, ended = actions.started.get(text, frozenset()), actions.ended.get(text, frozenset())
        return replace(state, armed=(state.armed - ended) | started)

    def _assignment(self, line: Assignment, state: State) -> State:
        returned = None
        called = self._function(line.words)
        if called is None:
            returned = self._with_functions(line.words, state)
            if returned is None:
                state = self._forgotten(passed_in(line, self.flow.by_value), self.asked(line, state))
        else:
            state, returned = self._followed(called, state)
            if returned is None:
                returned = Lost(reason=f"what {called.name} returns is known only at run time")
            if not state.reached:
                return UNREACHED
        known = self.frames.known(state)
        if line.index is not None and not self.flow.scouting and line.variable not in self.frames.names.own:
            self._note_element(line, element_assigned(known, line))
        # what is set to the robot's place as a whole is that place, wherever it is
        if line.component or len(line.words) > 1:
            known = replace(known, place=partial(self._resolver().position, state))
        variables = after_assignment(known, line, returned)
        by_function = returned is not None
        return replace(self.frames.after_assignment(state, line, variables, by_function), variables=variables)

    def _note_element(self, line: Assignment, element: str | None) -> None:
        """Note which element an assignment sets."""
        text = (self.routine.file.number, line.start)
        known = self.flow.elements.setdefault(text, set())
        if element is None or self.flow.all_ways:
            self.flow.elements[text] = None
        elif known is not None:
            known.add(f"{line.variable}[{element.partition('[')[2]}")

    def _call(self, line: Call, state: State) -> State:
        if line.name == "BAS":
            keys = changed_by(line, self.frames.names, self.flow.by_value, {})
            return self.frames.after_bas(replace(state, variables=forgotten(state.variables, keys)), line)
        for name in calls_of(line)[1:]:
            state = self.flow.forget(name, state)
        if line.name in self.flow.routines:
            state, _ = self._followed(line, state)
            return state
        if not self.flow.scouting:
            text = f"{line.name} is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are"
            self.flow.findings.diagnose(self.routine.file, line.start, text)
        return replace(self._forgotten(passed_in(line, self.flow.by_value), state), last=None)

    def _function(self, words: Sequence[Word]) -> Call | None:
        """The function of the program whose value is all of an expression; None where it is anything else."""
        called = whole_call(words)
        return called if called is not None and called.name in self.flow.routines else None

    def _with_functions(self, words: Sequence[Word], state: State) -> AbstractValue | None:
        """Value of an expression that calls functions of the program; None where it calls none, or they do more than compute."""
        out = list(words)
        for at in reversed(range(len(words) - 1)):  # a call within another's arguments first
            if out[at].kind != "name" or out[at].upper not in self.flow.routines or out[at + 1].text != "(":
                continue
            end = at + closing(out[at + 1 :]) + 2
            call = whole_call(out[at:end])
            if call is None or not self._only_computes(call):
                return None
            _, value = self._followed(call, state)
            word = out[at]._replace(text=f"{call.name}@{out[at].start}")  # a name that no variable has
            state = replace(state, variables={**state.variables, word.upper: self._of_function(call.name, value)})
            out[at:end] = [word]
        return given_by(out, self.frames.known(state)) if len(out) < len(words) else None

    def _only_computes(self, call: Call) -> bool:
        """Whether a call of a routine of the files changes nothing."""
        routines = self.flow.routines
        same = routines[call.name]
        return not passed_by_reference(call, self.flow.by_value) and all(only_computes(one, routines) for one in same)

    def _followed(self, call: Call, state: State) -> tuple[State, AbstractValue | None]:
        """State after a call of a routine of the files, and what it returns."""
        program, known = self.flow, self.frames.known(state)
        by_reference = passed_by_reference(call, program.by_value)
        left = self._forgotten(by_reference, state)
        keys = frozenset(map(self.frames.names.key, by_reference))

        def entry(routine: Routine) -> State:
            given = zip(routine.parameters, call.arguments, strict=False)
            # what is passed by reference has two names inside: only the parameter's is followed
            return replace(state, variables=forgotten(bound(known, given, program.frames(routine).names), keys))

        armed = state.armed | program.actions.by_routine.get(call.name, frozenset())
        resumes = armed & program.actions.resuming.get(self.routine.name, frozenset())
        if resumes:
            program.left_in.append(UNREACHED)
        followed = self.follow(program.routines[call.name], entry)
        inside = program.left_in.pop() if resumes else UNREACHED
        if followed is None:
            return program.lost_by(call.name, left), None
        behind, value = followed
        if resumes:
            own = {key: one for key, one in inside.variables.items() if "@" not in key or key in state.variables}
            inside = replace(inside, last=None, variables=without_places(forgotten(own, keys)))
            behind, value = self.merged([behind, inside], RESUMED), None
        if not behind.reached:
            return UNREACHED, value
        if program.all_ways:
            return replace(behind, variables=forgotten(behind.variables, keys)), value
        return replace(behind, variables=self._behind_call(call, by_reference, behind.variables)), value

    def _behind_call(self, call: Call, by_reference: Sequence[str], variables: Variables) -> Variables:
        """Variables after a call: those passed by reference as a whole have the final values of the parameters."""
        names, (routine,) = self.frames.names, self.flow.routines[call.name]
        back = dict(forgotten(without_own(variables, routine.prefix), map(names.key, by_reference)))
        for parameter, words in zip(routine.parameters, call.arguments, strict=False):
            if len(words) != 1 or by_reference.count(words[0].upper) != 1:
                continue
            key, value = names.key(words[0].upper), variables.get(f"{routine.prefix}{parameter}")
            changed = key in self.flow.changes[call.name] or key in names.volatile
            if value is None or changed or (isinstance(value, str) and value in HERE):
                continue
            plain = value.value if isinstance(value, Adjustable) else value
            if isinstance(plain, float) and not plain.is_integer() and words[0].upper in names.whole_numbers:
                continue
            back[key] = value
        return back

    def _motion(self, line: MotionLine, state: State) -> State:
        findings, file, resolver = self.flow.findings, self.routine.file, self._resolver()
        if resolver.stays_there(line, state):
            return state
        state, returned = self._points_returned(line, state)
        if not state.reached:
            return UNREACHED
        variables = without_places(state.variables)
        if self.flow.scouting:
            return replace(state, last=None, variables=variables)
        trigger, self.trigger = self.trigger, False
        text = (file.number, line.start)
        if self.flow.all_ways and text in findings.seen:
            return replace(state, last=None, variables=variables)
        try:
            move, site = resolver.resolve(line, state, in_spline=self.in_spline, returned=returned)
        except Unresolved as trouble:
            findings.fail(text, file, f"{line.keyword} stays as it is: {trouble}")
            return replace(state, last=None, variables=variables)
        if trigger:
            said = "a TRIGGER acts along this motion; check it if the motion is divided"
            findings.diagnose(file, line.start, said)
        number = findings.note(move, site, None if self.in_spline else self.flow.before(state.last))
        if not self.in_spline:
            self.flow.note_order(number, state.last)
        return replace(state, last=number, variables=variables)

    def _resolver(self) -> Resolver:
        flow = self.flow
        return Resolver(
            findings=flow.findings, routine=self.routine, frames=self.frames, motion_before=flow.needed_before
        )

    def _points_returned(self, line: MotionLine, state: State) -> tuple[State, dict[int, AbstractValue]]:
        """State after the program's functions in a motion, and what they return of its points, by their first character."""
        returned: dict[int, AbstractValue] = {}
        known = 0
        for operand in line.operands:
            words = () if operand.parts else line.words_of(operand)
            called = self._function(words)
            if called is not None and state.reached:
                state, value = self._followed(called, state)
                returned[operand.start] = self._of_function(called.name, value)
                known += 1
            elif called is None and (computed := self._with_functions(words, state)) is not None:
                returned[operand.start] = computed
                known += sum(word.upper in self.flow.routines for word in words)
        if known < sum(name in self.flow.routines for name in calls_of(line)):
            state = self._forgotten(passed_in(line, self.flow.by_value), self.asked(line, state))
        return state, returned

    def _of_function(self, name: str, value: AbstractValue | None) -> AbstractValue:
        """Point returned by a function, whose numbers may take the place of its call."""
        if value is None:
            return Lost(reason=f"what {name} returns is known only at run time")
        if not all(only_computes(routine, self.flow.routines) for routine in self.flow.routines[name]):
            return Lost(reason=f"its point comes from {name}, which does more than compute it")
        return value


# Reading KRL programs: from the routines that nothing calls through all that they call.


MAX_PASSES = 30
"""As many lines as the program has, so many times, are gone through again for calls and the turns of loops; behind that, what
routines set is taken as not known, and loops are not taken turn by turn."""


@uncollected()
def read_krl(
    sources: Sequence[Source],
    tools: Mapping[str, Frame] | None = None,
    parts: Mapping[str, Frame] | None = None,
    data: Mapping[str, str] | None = None,
) -> KrlProgram:
    """Read a KRL program.

    Args:
        sources: its ``.src`` files, with their ``.dat`` and, for tools and bases by number, ``$config.dat``.
        tools: those that no file states, by name: ``TOOL_DATA[3]``.
        parts: bases that no file states, in the world, the same.
        data: points, parameter sets and numbers that no file states, by name, as KRL writes them.

    Raises:
        FileError: a file is no KRL, or none holds a program.
        InputError: a value that is given is none.
    """
    files = tuple(File.of(i, source) for i, source in enumerate(sources))
    for file in files:
        if not any(isinstance(line, Begin) for line in file.statements):
            raise FileError(file.source.path, f"is not a KRL file: no {'DEFDAT' if file.holds_data else 'DEF'} line")
    if sources and all(file.holds_data for file in files):
        raise FileError(sources[0].path, "holds data only; pass the .src with the motions, too")
    given = {name.upper(): frame for name, frame in {**(tools or {}), **(parts or {})}.items()}
    if data:
        beside = given_data(len(files), data)
        for datum in (datum for file in files for datum in stated(file) if datum.shared):
            if any(datum.name == other.name for other in stated(beside)):
                raise InputError(f"{datum.name} is stated in {datum.place}; leave it out beside the files")
        files = (*files, beside)
    program = _Reading(files=files, given=given).program()
    return replace(program, sources=tuple(sources), read=partial(read_krl, tools=tools, parts=parts, data=data))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Reading:
    files: tuple[File, ...]
    given: Mapping[str, Frame]
    """As in `Data`."""
    findings: Findings = field(default_factory=Findings)
    elements: Mapping[Text, frozenset[str]] = field(default_factory=dict[Text, frozenset[str]])
    """What assignments by a computed index set, where that is known already."""

    def program(self) -> KrlProgram:
        """Follow the program from all routines that nothing calls."""
        routines = routines_of(self.files)
        callers = callers_of(routines)
        data = Data(files=self.files, given=self.given, roots=roots_of(callers), elements=self.elements)
        effects = effects_of(self.files, routines, data)
        flow = self._flow(routines, data, effects)
        roots = [name for name in routines if not callers[name] - {name} or name in effects.beside]
        everywhere = [routine for same in routines.values() for routine in same]
        begin = {routine for routine in everywhere if routine.name in roots}
        flow.follow(everywhere, begin)
        known = {text: frozenset(names) for text, names in flow.elements.items() if names is not None}
        if not self.elements and data.refused & {name.partition("[")[0] for names in known.values() for name in names}:
            return _Reading(files=self.files, given=self.given, elements=known).program()
        self.findings.close()
        flow.follow_rest(everywhere, begin)
        self._warn()
        self._say_set_elsewhere(data)
        bodies = {routine: flow.body(routine).nodes for routine in everywhere}
        return replace(self._ordered(data), bodies=bodies, turns=flow.turns, begun=flow.begun)

    def _flow(self, routines: Mapping[str, list[Routine]], data: Data, effects: Effects[str, str]) -> _Flow:
        changes, volatile = effects.within, effects.unseen
        made: dict[tuple[str, bytes], Frame] = {}
        frames: dict[Routine, Frames] = {}

        def frames_of(routine: Routine) -> Frames:
            if routine not in frames:
                frames[routine] = Frames(data=data, names=Names.of(routine, data, volatile), made=made)
            return frames[routine]

        read = read_names(self.files)
        followed = lambda key: key not in volatile and key.rpartition(":")[2] in read  # noqa: E731
        size = sum(len(file.statements) for file in self.files)
        return _Flow(
            findings=self.findings,
            routines=routines,
            trees={
                r: tree_of(r.lines, lambda x: matters(x, read, routines)) for same in routines.values() for r in same
            },
            frames=frames_of,
            concerns=concerned(routines, data, changes),
            changes=changes,
            by_value=data.by_value,
            actions=actions_of(routines, data, changes, followed),
            left=MIN_LINES + MAX_PASSES * size,
        )

    def _say_set_elsewhere(self, data: Data) -> None:
        """Say which tools and bases another program may change."""
        for name, place in data.set_elsewhere.items():
            number = next(i for i, file in enumerate(self.files) if file.source.path == place.path)
            text = (
                f"{name} is changed here, in a program of its own; motions are corrected for the value in the data list"
            )
            self.findings.diagnose(self.files[number], self.files[number].source.start(place.line), text)

    def _warn(self) -> None:
        """Say where the controller may correct its geometry by itself."""
        for file in self.files:
            for words in lines_of_words(file.source.text) if "$ABS_" in file.source.text.upper() else ():
                if any(word.upper in ("$ABS_ACCUR", "$ABS_CONVERT") for word in words):
                    self.findings.diagnose(
                        file,
                        words[0].start,
                        "the controller's own absolute accuracy may be on; a corrected program would then correct twice",
                    )

    def _ordered(self, data: Data) -> KrlProgram:
        """Moves in the order of the text."""
        try:
            T_world_base = data.robroot
        except Unresolved:  # the motions to poses say so
            T_world_base = None
        found = list(self.findings.finished())
        shared = "is stated once beside the files, and taken in {}; pass the data list of those that have their own"
        failed = ((number, start, text) for (number, start), (_, text) in self.findings.reasons.items())
        return KrlProgram(
            sources=tuple(file.source for file in self.files),
            motions=tuple(move for move, _ in found),
            diagnostics=(
                *(
                    Diagnostic(
                        place=self.files[0].source.place(0),
                        text=f"{name} {shared.format(', '.join(sorted(modules)))}",
                    )
                    for name, modules in sorted(data.taken.items())
                    if len(modules) > 1
                ),
                *(
                    Diagnostic(place=self.files[file].source.place(position), text=text)
                    for file, position, text in sorted({*self.findings.diagnostics, *failed})
                ),
            ),
            sites=tuple(site for _, site in found),
            files=self.files,
            T_world_base=T_world_base,
            unresolved=frozenset(self.findings.reasons),
        )
