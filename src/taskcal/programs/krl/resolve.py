"""One pass through the lines of a KRL routine: what holds for tool and base, and where each motion goes."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from taskcal.programs.krl.data import Datum, File
from taskcal.programs.krl.frames import NULL, Frames, State, merged
from taskcal.programs.krl.incomplete import completed_axes, completed_pose, is_incomplete, moved_axes, moved_pose
from taskcal.programs.krl.parser import BLOCKS
from taskcal.programs.krl.position import external, has_axes, has_pose, pose, whole
from taskcal.programs.krl.rewrite import Site, Written
from taskcal.programs.krl.routines import Routine, altered_by
from taskcal.programs.krl.status import ACCURATE_BIT, Status
from taskcal.programs.krl.syntax import (
    RELATIVE_MOTIONS,
    Aggregate,
    Assignment,
    Call,
    Control,
    Motion,
    Operand,
    Reference,
    Statement,
)
from taskcal.programs.program import Move, MoveKind, Target
from taskcal.programs.unresolved import Unresolved

KINDS: dict[str, MoveKind] = {
    "PTP": "joint", "SPTP": "joint", "LIN": "linear", "SLIN": "linear", "CIRC": "circular", "SCIRC": "circular",
    "SPL": "linear", "PTP_REL": "joint", "SPTP_REL": "joint", "LIN_REL": "linear", "SLIN_REL": "linear",
}  # fmt: skip

SPLINES = {"SPLINE", "PTP_SPLINE"}
LOOPS = {"FOR", "WHILE", "REPEAT", "LOOP"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """A motion that was resolved, its number in the order of reading."""

    number: int
    move: Move
    site: Site


@dataclass(frozen=True, eq=False, kw_only=True)
class Findings:
    """What was found so far."""

    found: list[Found] = field(default_factory=list[Found])
    """In the order of reading."""
    diagnostics: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    """Number of the file, position and text."""

    def diagnose(self, file: File, position: int, text: str) -> None:
        """Note something about a place."""
        self.diagnostics.append((file.number, position, text))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Block:
    """A block that is open at a line."""

    keyword: str
    entry: State
    exits: list[State] = field(default_factory=list[State])
    """At the ends of its branches so far, and where a loop is left."""
    has_default: list[bool] = field(default_factory=list[bool])


@dataclass(frozen=True, eq=False, kw_only=True)
class Walk:
    """One pass through the lines of a routine."""

    findings: Findings
    routine: Routine
    frames: Frames
    alters: dict[str, frozenset[str]]
    called_at: dict[str, list[State]]

    def run(self, state: State) -> None:
        """Go through all lines.

        Args:
            state: what holds where the routine is called.
        """
        blocks: list[_Block] = []
        trigger = False
        for number, line in enumerate(self.routine.lines):
            match line:
                case Motion():
                    state = self._motion(line, state, any(b.keyword in SPLINES for b in blocks), trigger)
                    trigger = False
                case Assignment():
                    state = self.frames.after_assignment(state, line)
                case Call():
                    state = self._call(line, state)
                case Control(keyword="TRIGGER"):
                    trigger = True
                case Control():
                    state = self._control(number, line, state, blocks)
                case _:
                    pass

    def _control(self, number: int, line: Control, state: State, blocks: list[_Block]) -> State:
        keyword = line.keyword
        if keyword == "LABEL":
            return state.forgotten("it can be reached by a GOTO")
        if keyword in BLOCKS:
            if keyword in LOOPS:
                state = self._at_loop(number, state)
            blocks.append(_Block(keyword=keyword, entry=state))
            return replace(state, last=None) if keyword in SPLINES else state
        if not blocks:
            return replace(state, last=None)
        if keyword == "EXIT":
            loops = [block for block in blocks if block.keyword in LOOPS]
            if loops:
                loops[-1].exits.append(state)
            return state
        block = blocks[-1]
        if keyword in ("ELSE", "CASE", "DEFAULT"):
            if block.keyword == "IF" or block.has_default:  # before the first CASE there is no branch
                block.exits.append(state)
            block.has_default.append(keyword != "CASE")
            return block.entry
        if keyword in BLOCKS.values():
            blocks.pop()
            reason = f"it is set in one branch of the {block.keyword} before and not, or differently, in another"
            complete = block.keyword in (*SPLINES, "LOOP", "REPEAT") or any(block.has_default)
            return merged([*block.exits, state, *([] if complete else [block.entry])], reason)
        return replace(state, last=None)

    def _at_loop(self, number: int, state: State) -> State:
        """At the start of a loop: what it sets further down differs from pass to pass."""
        body = _body(self.routine.lines, number)
        sets = frozenset[str]().union(*(altered_by(line, self.alters) for line in body))
        return state.forgotten("it is set further down in the same loop", sets | {"motion"})

    def _call(self, line: Call, state: State) -> State:
        if line.name == "BAS":
            return self.frames.after_bas(state, line)
        if line.name not in self.alters:
            self.findings.diagnose(
                self.routine.file,
                line.start,
                f"{line.name} is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are",
            )
            return replace(state, last=None)
        self.called_at[line.name].append(replace(state, last=None))
        return state.forgotten(f"{line.name} sets it", self.alters[line.name])

    def _motion(self, line: Motion, state: State, in_spline: bool, trigger: bool) -> State:
        if _stays_there(line):
            return state
        try:
            if line.trouble or (line.keyword == "SPL" and not in_spline):
                raise Unresolved(line.trouble or "it is part of no SPLINE block")
            move, site = self._resolve(line, self.frames.with_settings(state, line.settings))
            if in_spline:  # its shape depends on all its points: they are corrected, and it is left whole
                move = replace(move, follows=None, divisible=False)
        except Unresolved as trouble:
            self.findings.diagnose(self.routine.file, line.start, f"{line.keyword} stays as it is: {trouble}")
            return replace(state, last=None)
        if trigger:
            self.findings.diagnose(
                self.routine.file, line.start, "a TRIGGER acts along this motion; check it if the motion is divided"
            )
        number = len(self.findings.found)
        self.findings.found.append(Found(number=number, move=move, site=site))
        return replace(state, last=number)

    def _resolve(self, line: Motion, state: State) -> tuple[Move, Site]:
        kind = KINDS[line.keyword]
        written = tuple(self._written(operand) for operand in line.operands)
        end = self._target(written[-1], kind, line, self._before(state))
        if end.q is not None:
            if kind != "joint":
                raise Unresolved(f"{line.keyword} is given axis positions")
            kind = "axes"
        via = None
        if kind == "circular":
            assert end.T is not None
            via = self._via(written[0], end.T)
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
            follows=state.last,
            routine=self.routine.name,
            place=self.routine.file.source.place(line.start),
            external=external(written[-1].aggregates[0]),
            carrier=state.base.carrier,
        )
        leans = line.keyword in RELATIVE_MOTIONS or is_incomplete(written[-1].aggregates[0])
        return move, Site(file=self.routine.file, motion=line, written=written, leans=leans)

    def _before(self, state: State) -> Move | None:
        """The motion before, if tool and base are still the same."""
        if state.last is None:
            return None
        before = self.findings.found[state.last].move
        try:
            tool, part = self.frames.tool_and_part(state)
        except Unresolved:
            return before if before.end.q is not None else None
        same = before.tool is tool and before.part is part and before.part_in_hand == bool(state.fixed_tool)
        return before if same or before.end.q is not None else None

    def _written(self, operand: Operand) -> Written:
        """Where the numbers of a point stand."""
        if not operand.parts:
            raise Unresolved("its point is not stated in the text")
        first = operand.parts[0]
        datum = self._datum(first) if isinstance(first, Reference) else None
        aggregates = tuple(
            part if isinstance(part, Aggregate) else self._datum(part).aggregate for part in operand.parts
        )
        return Written(operand=operand, aggregates=aggregates, datum=datum, file=self.routine.file)

    def _datum(self, reference: Reference) -> Datum:
        return self.frames.data.find(reference.name, self.routine.file.module)

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
            T = moved_pose(first, before, by_tool=line.along == "#TOOL")
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

    def _via(self, written: Written, end: Float[np.ndarray, "4 4"]) -> Target:
        """The auxiliary point of an arc, which need not state an orientation."""
        place = self.routine.file.source.place(written.operand.start) if written.datum is None else written.datum.place
        first = written.aggregates[0]
        oriented = any(first.field(name) for name in "ABC")
        T = pose(first) if oriented else pose(first, needed=("X", "Y", "Z"))
        for aggregate in written.aggregates[1:]:
            T = T @ _offset(aggregate)
        if not oriented:
            T[:3, :3] = end[:3, :3]
        return Target(name="" if written.datum is None else written.datum.name, T=T, q=None, posture=None, place=place)


def _stays_there(line: Motion) -> bool:
    """Whether a motion goes to where the robot is, as programs begin."""
    parts = line.operands[0].parts if len(line.operands) == 1 else ()
    return len(parts) == 1 and isinstance(parts[0], Reference) and parts[0].name in ("$POS_ACT", "$AXIS_ACT")


def _offset(aggregate: Aggregate) -> Float[np.ndarray, "4 4"]:
    if not has_pose(aggregate):
        raise Unresolved("what is added by ':' is not a frame")
    return pose(aggregate, needed=())


def _body(lines: tuple[Statement, ...], number: int) -> tuple[Statement, ...]:
    """The lines of a loop that starts at a line."""
    depth = 0
    for i in range(number, len(lines)):
        line = lines[i]
        if isinstance(line, Control):
            depth += (line.keyword in BLOCKS) - (line.keyword in set(BLOCKS.values()))
            if depth == 0:
                return lines[number:i]
    return lines[number:]


def _turn_speed(state: State) -> float | None:
    """Radians per second; None where the text does not tell."""
    given = state.turn_speed
    return None if given is None or not given > 0.0 else math.radians(given)
