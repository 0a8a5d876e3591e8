"""One pass through the lines of a KRL routine: what holds for tool and base, and where each motion goes."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from taskcal.programs.krl.blocks import LOOPS, SPLINES, Block, body_of, decided
from taskcal.programs.krl.calls import Calls
from taskcal.programs.krl.data_lists import Datum
from taskcal.programs.krl.expressions import evaluated, name_of, with_values
from taskcal.programs.krl.findings import Findings, Found
from taskcal.programs.krl.frames import NULL, Frames
from taskcal.programs.krl.incomplete import completed_axes, completed_pose, is_incomplete, moved_axes, moved_pose
from taskcal.programs.krl.parameters import handed_over
from taskcal.programs.krl.parser import BLOCKS
from taskcal.programs.krl.position import external, has_axes, has_pose, pose, whole
from taskcal.programs.krl.rewrite import Site, Written
from taskcal.programs.krl.routines import Routine, altered_by, calls_of, keys_changed_by
from taskcal.programs.krl.state import State, merged
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
from taskcal.programs.krl.variables import (
    HERE,
    Known,
    Variables,
    after_assignment,
    forgotten,
    without_own,
    without_places,
)
from taskcal.programs.program import Move, MoveKind, Target
from taskcal.programs.unresolved import Unresolved

KINDS: dict[str, MoveKind] = {
    "PTP": "joint", "SPTP": "joint", "LIN": "linear", "SLIN": "linear", "CIRC": "circular", "SCIRC": "circular",
    "SPL": "linear", "PTP_REL": "joint", "SPTP_REL": "joint", "LIN_REL": "linear", "SLIN_REL": "linear",
}  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class Walk:
    """One pass through the lines of a routine."""

    findings: Findings
    routine: Routine
    frames: Frames
    calls: Calls
    returns: list[State] = field(default_factory=list[State])
    """What holds where the routine is left before its end."""

    def run(self, state: State) -> State:
        """Go through all lines.

        Args:
            state: what holds where the routine is called.

        Returns:
            What holds behind it.
        """
        blocks: list[Block] = []
        trigger = False
        for number, line in enumerate(self.routine.lines):
            match line:
                case Motion():
                    state = self._motion(line, state, any(b.keyword in SPLINES for b in blocks), trigger)
                    trigger = False
                case Assignment():
                    variables = after_assignment(self.frames.known(state), line)
                    state = self._asked(line, self.frames.after_assignment(state, line), {"variables": variables})
                case Call():
                    state = self._call(line, state)
                case Control(keyword="TRIGGER"):
                    trigger = True
                case Control():
                    state = self._control(number, line, self._asked(line, state, {}), blocks)
                case _:
                    pass
        prefix = self.routine.prefix
        state = merged([*self.returns, state], f"it differs between the ends of {self.routine.name}")
        return replace(state, variables=without_own(state.variables, prefix))

    def _asked(self, line: Statement, state: State, changes: dict[str, Variables]) -> State:
        """What holds behind functions in the expressions of a line."""
        state = replace(state, **changes)
        for name in calls_of(line):
            state = self.calls.forget(name, state)
        if isinstance(line, Control) and line.changed:
            keys = (self.frames.names.key(name) for name in line.changed)
            state = replace(state, variables=forgotten(state.variables, keys))
        return state

    def _control(self, number: int, line: Control, state: State, blocks: list[Block]) -> State:
        keyword = line.keyword
        if keyword == "LABEL":
            return replace(state.forgotten("it can be reached by a GOTO"), variables={})
        if keyword == "RETURN":
            self.returns.append(state)
            return replace(state, last=None)
        if keyword in BLOCKS:
            if keyword in LOOPS:
                state = self._at_loop(number, state)
            blocks.append(Block(keyword=keyword, entry=state, condition=self._condition(line, state)))
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
            if block.condition is not None:
                return decided(block, state)
            complete = block.keyword in (*SPLINES, "LOOP", "REPEAT") or any(block.has_default)
            return merged([*block.exits, state, *([] if complete else [block.entry])], reason)
        return replace(state, last=None)

    def _condition(self, line: Control, state: State) -> bool | None:
        """Whether the condition of an IF holds; None where the text does not tell, and of other blocks."""
        if line.keyword != "IF":
            return None
        words = line.words[:-1] if line.words and line.words[-1].upper == "THEN" else line.words
        try:
            value = evaluated(words, self.frames.known(state))
        except Unresolved:
            return None
        return value if isinstance(value, bool) else None

    def _at_loop(self, number: int, state: State) -> State:
        """At the start of a loop: what it sets further down differs from pass to pass."""
        body, by_value = body_of(self.routine.lines, number), self.frames.data.by_value
        sets = frozenset[str]().union(*(altered_by(line, self.calls.alters) for line in body))
        keys = frozenset[str]().union(
            *(keys_changed_by(line, self.frames.names, by_value, self.calls.changes) for line in body)
        )
        state = replace(state, variables=forgotten(state.variables, keys))
        return state.forgotten("it is set further down in the same loop", sets | {"motion"})

    def _call(self, line: Call, state: State) -> State:
        if line.name == "BAS":
            return self.frames.after_bas(state, line)
        if line.name not in self.calls.routines:
            self.findings.diagnose(
                self.routine.file,
                line.start,
                f"{line.name} is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are",
            )
            state = replace(state, last=None)
        else:
            state = self.calls.through(line, self.frames.known(state), state)
        keys = (self.frames.names.key(name) for name in handed_over(line, self.frames.data.by_value))
        return replace(state, variables=forgotten(state.variables, keys))

    def _motion(self, line: Motion, state: State, in_spline: bool, trigger: bool) -> State:
        if self._stays_there(line, state):
            return state
        try:
            if line.trouble or (line.keyword == "SPL" and not in_spline):
                raise Unresolved(line.trouble or "it is part of no SPLINE block")
            move, site = self._resolve(line, self.frames.with_settings(state, line.settings))
            if in_spline:  # its shape depends on all its points: they are corrected, and it is left whole
                move = replace(move, divisible=False)
        except Unresolved as trouble:
            self.findings.diagnose(self.routine.file, line.start, f"{line.keyword} stays as it is: {trouble}")
            return replace(state, last=None, variables=without_places(state.variables))
        if trigger:
            self.findings.diagnose(
                self.routine.file, line.start, "a TRIGGER acts along this motion; check it if the motion is divided"
            )
        key = (self.routine.file.number, line.start)
        follows = None if in_spline else state.last
        self.findings.found[key] = Found(move=move, site=site, follows=follows)
        return replace(state, last=key, variables=without_places(state.variables))

    def _stays_there(self, line: Motion, state: State) -> bool:
        """Whether a motion goes to where the robot is, as programs begin."""
        parts = line.operands[0].parts if len(line.operands) == 1 else ()
        if len(parts) != 1 or not isinstance(parts[0], Reference) or parts[0].index:
            return False
        name = parts[0].name
        return name in HERE or self.frames.known(state).assigned(name) in HERE

    def _resolve(self, line: Motion, state: State) -> tuple[Move, Site]:
        kind = KINDS[line.keyword]
        known = self.frames.known(state)
        written = tuple(self._written(operand, known) for operand in line.operands)
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
            follows=None,
            routine=self.routine.name,
            place=self.routine.file.source.place(line.start),
            external=external(written[-1].aggregates[0]),
            carrier=state.base.carrier,
        )
        leans = line.keyword in RELATIVE_MOTIONS or is_incomplete(written[-1].aggregates[0])
        return move, Site(file=self.routine.file, motion=line, written=written, leans=leans)

    def _before(self, state: State) -> Move | None:
        """The motion before, if tool and base are still the same."""
        key = state.last or (-1, -1)
        found = self.findings.found.get(key) or self.findings.beside.get(key)
        if found is None:
            return None
        before = found.move
        try:
            tool, part = self.frames.tool_and_part(state)
        except Unresolved:
            return before if before.end.q is not None else None
        same = before.tool is tool and before.part is part and before.part_in_hand == bool(state.fixed_tool)
        return before if same or before.end.q is not None else None

    def _written(self, operand: Operand, known: Known) -> Written:
        """Where the numbers of a point stand."""
        if not operand.parts:
            raise Unresolved("its point is not stated in the text")
        parts = [self._part(part, known) for part in operand.parts]
        datum = parts[0] if isinstance(parts[0], Datum) else None
        aggregates = tuple(part.aggregate if isinstance(part, Datum) else part for part in parts)
        computed = any(
            not isinstance(part, Datum) and part is not stated
            for part, stated in zip(parts, operand.parts, strict=True)
        )
        return Written(operand=operand, aggregates=aggregates, datum=datum, file=self.routine.file, computed=computed)

    def _part(self, part: Aggregate | Reference, known: Known) -> Aggregate | Datum:
        """A position as it is written, or what its variable holds."""
        if isinstance(part, Aggregate):
            return with_values(part, known)
        name = name_of(part, known)
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


def _offset(aggregate: Aggregate) -> Float[np.ndarray, "4 4"]:
    if not has_pose(aggregate):
        raise Unresolved("what is added by ':' is not a frame")
    return pose(aggregate, needed=())


def _turn_speed(state: State) -> float | None:
    """Radians per second; None where the text does not tell."""
    given = state.turn_speed
    return None if given is None or not given > 0.0 else math.radians(given)
