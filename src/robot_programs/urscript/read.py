"""Reading URScript programs: where each motion goes, from what nothing calls through all that it calls."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np

from robot_programs.core import flow, se3
from robot_programs.core.errors import FileError
from robot_programs.core.flow import MIN_LINES, Body, Branches, Effects, Node, lines_in
from robot_programs.core.program import (
    Diagnostic,
    Frame,
    Motion,
    MotionKind,
    NearPosture,
    Target,
    Unresolved,
    Zone,
)
from robot_programs.core.robot import JOINTS, Robot
from robot_programs.core.source import Source, uncollected
from robot_programs.core.values import Lost
from robot_programs.urscript.rewrite import Point, Site, UrscriptProgram, slot_of
from robot_programs.urscript.syntax import (
    Expression,
    File,
    Routine,
    Statement,
    inside,
    parse,
    plain_name,
)
from robot_programs.urscript.values import (
    CONSTANTS,
    FUNCTIONS,
    MOTIONS,
    Array,
    Evaluator,
    Inverse,
    Pose,
    Six,
    Value,
    computed,
    matrix,
    numbers,
    signature,
)

# What the language's own functions do beside returning a value.

DEFAULT_SPEED_M_S = 0.25
"""Of movel, movep and movec, metres per second."""

_STEERED = frozenset({"servoc", "servoj", "servol", "speedj", "speedl", "move_until_contact", "screw_driving"})
"""Motions that are steered while they go."""

_BEGINS = {
    "force_mode": "force mode", "freedrive_mode": "freedrive mode", "teach_mode": "teach mode",
    "track_conveyor_linear": "conveyor tracking", "track_conveyor_circular": "conveyor tracking",
    "path_offset_enable": "a path offset",
}  # fmt: skip
"""What moves the tool away from its targets, by the function that switches it on."""
_ENDS = {
    "end_force_mode": "force mode", "end_freedrive_mode": "freedrive mode", "end_teach_mode": "teach mode",
    "stop_conveyor_tracking": "conveyor tracking", "path_offset_disable": "a path offset",
}  # fmt: skip

_RESTING = re.compile(
    r"(get|set|is|read|write|socket|rtde|modbus|str|to|encoder|conveyor|force|interpreter|rpc|request|zero|tool|pose|point|make"
    r"|wrench|rotvec|end|binary|integer|bin|path|ft|payload|enable|disable|clear|skip|enter|exit)_\w+"
    r"|rotvec2rpy|popup|textmsg|sleep|sync|size|norm|normalize|inv|transpose|random|log|abs|time|struct|\w+\.[\w.]+"
)
"""Functions of the language, and of servers called by their names, that do not move the robot."""


def _rests(name: str) -> bool:
    return name in FUNCTIONS or _RESTING.fullmatch(name) is not None


_HALTING = frozenset({"stopj", "stopl", "reset_revolution_counter", "powerdown"})
"""Behind which it is not known where the robot is."""

TOOL, MOTION, MODE = "@tool", "@motion", "@mode"
"""What statements can alter beside variables."""


# What holds at a place of the program.


@dataclass(frozen=True, kw_only=True)
class State(flow.State):
    """State set by the statements before."""

    tool: Frame | None
    """The active TCP; None where the text does not tell."""
    why_no_tool: str = field(default="", compare=False)
    missing: str = field(default="it is not set before", compare=False)
    """Why other variables are not known."""
    modes: frozenset[str] = frozenset()
    """What may move the tool away from its targets."""

    def joined(self, others: Sequence[Self], why: str) -> Self:
        """Join states; see `flow.State.joined`."""
        states = (self, *others)
        first = next((state for state in states if state.tool is None), self)
        return replace(
            super().joined(others, why),
            tool=self.tool if all(other.tool is self.tool for other in others) else None,
            why_no_tool=first.why_no_tool or why,
            modes=self.modes.union(*(other.modes for other in others)),
        )

    def common(self, values: Sequence[Value | None], why: str) -> Value:
        """What several ways have left of a value, with why it is not known where they differ."""
        known = super().common(values, why)
        return Lost(reason=why) if known is None else known

    def lost(self, keys: Set[str], why: str) -> Self:
        """State in which variables, and what else is named, may have become anything."""
        variables = {key: Lost(reason=why) for key in keys if not key.startswith("@")}
        state = replace(self, variables={**self.variables, **variables}) if variables else self
        if TOOL in keys:
            state = replace(state, tool=None, why_no_tool=why)
        return replace(state, last=None) if MOTION in keys else state


@dataclass(frozen=True, eq=False, kw_only=True)
class Names:
    """Which variables and functions the names of a program mean.

    A variable is global where it says so anywhere, or is set outside of all functions; else it is of the innermost function
    around it that sets it (Script manual: scoping rules).
    """

    files: Sequence[File]

    @cached_property
    def shared(self) -> frozenset[str]:
        """Global variables."""
        declared = {
            plain_name(line.name)
            for file in self.files for routine in file.routines for line in routine.lines
            if line.scope == "global" or (not routine.kind and line.kind == "assign")
        }  # fmt: skip
        return frozenset(declared)

    @cached_property
    def routines(self) -> Mapping[str, Sequence[Routine]]:
        """Functions by name."""
        out: dict[str, list[Routine]] = {}
        for file in self.files:
            for routine in file.routines:
                if routine.kind:
                    out.setdefault(routine.name, []).append(routine)
        return out

    def called(self, name: str, file: File) -> Sequence[Routine]:
        """Functions that a name may mean in a file."""
        found = self.routines.get(name, ())
        return [routine for routine in found if routine.file is file] or found

    def key(self, name: str, routine: Routine) -> str:
        """By which the value of a variable is kept."""
        name = plain_name(name)
        if name in routine.own:
            return _local(name, routine)
        if name in self.shared:
            return name
        around = routine.parent
        while around is not None and around.kind:
            if name in around.own or name in around.assigned:
                return _local(name, around)
            around = around.parent
        return _local(name, routine)

    def changed(self, line: Statement, routine: Routine) -> frozenset[str]:
        """What a statement may alter by itself, without the functions that it calls."""
        out = {self.key(line.name, routine)} if line.kind == "assign" else set[str]()
        for call in line.calls:
            if call.name == "set_tcp":
                out.add(TOOL)
            elif call.name in _BEGINS or call.name in _ENDS:
                out |= {MODE, MOTION}
            elif not self.called(call.name, routine.file) and not _rests(call.name):
                out.add(MOTION)
        return frozenset(out)

    def calls(self, line: Statement, routine: Routine) -> frozenset[Routine]:
        """Functions of the program that a statement calls."""
        if line.kind == "run":
            return frozenset()
        return frozenset(called for call in line.calls for called in self.called(call.name, routine.file))


def _local(name: str, routine: Routine) -> str:
    return f"{routine.file.number}:{routine.start}:{routine.kind}:{name}"


# One pass through the statements of a function, and through the functions that it calls.


@dataclass(eq=False, kw_only=True)
class Findings(flow.Findings[tuple[int, int], tuple[Motion, Site]]):
    """Motions found so far."""

    strange: dict[str, list[tuple[int, int]]] = field(default_factory=dict[str, list[tuple[int, int]]])
    """Functions that no file has, and where they are called."""
    failing: dict[tuple[int, int], Expression] = field(default_factory=dict[tuple[int, int], Expression])
    """Calls that are not understood as motions."""
    shifted: set[tuple[int, int]] = field(default_factory=set[tuple[int, int]])
    """Motions where something may move the tool away from its target."""


@dataclass(eq=False, kw_only=True)
class _Flow(flow.Flow[State, Routine]):
    """The functions of a program, and how far they have been followed."""

    findings: Findings
    names: Names
    effects: Effects[Routine, str]
    """What each function may alter."""
    robot: Robot | None
    tool: Frame | None
    part: Frame
    corrects: str
    """How functions begin that correct a target at run time, to which motions are left out; empty where there are none."""
    ends: dict[int, State] = field(default_factory=dict[int, State])
    """What holds behind the statements outside of all functions, by number of the file."""
    made: dict[tuple[str, Six], Frame] = field(default_factory=dict[tuple[str, Six], Frame])

    def body(self, routine: Routine) -> Body:
        return routine.body

    def name(self, routine: Routine) -> str:
        return routine.name

    def walk(self, routine: Routine, inside: tuple[Routine, ...]) -> "_Walk":
        return _Walk(flow=self, routine=routine, inside=inside)

    def anything(self, why: str) -> State:
        return State(tool=None, why_no_tool=why, missing=why)

    def start(self, routine: Routine) -> State:
        """State where a program begins: behind the statements outside of all functions."""
        unset = State(
            tool=self.tool,
            why_no_tool="no set_tcp stands before it: the TCP is that of the robot's installation; name it in a cell file "
            "(--tool), or set it in the program",
        )
        behind = self.ends.get(routine.file.number, unset)
        return replace(behind, last=None) if behind.reached else unset

    def found_all(self, routine: Routine) -> bool:
        texts = {
            (routine.file.number, call.start) for line in routine.lines for call in line.calls if call.name in MOTIONS
        }
        return texts <= self.findings.seen

    def is_correcting(self, expression: Expression) -> bool:
        """Whether a function that corrects a target at run time is called in an expression."""
        return bool(self.corrects) and any(one.name.startswith(self.corrects) for one in inside(expression))

    def frame(self, name: str, values: Six) -> Frame:
        """A frame, made once."""
        key = name, values
        if key not in self.made:
            self.made[key] = Frame(name=name, T=matrix(values))
        return self.made[key]


@dataclass(eq=False, kw_only=True)
class _Walk(flow.Walk[State, Routine]):
    """One pass through a function."""

    flow: _Flow  # pyright: ignore[reportIncompatibleVariableOverride]
    value: Value | None = None
    """Last one that is returned."""

    @property
    def unreached(self) -> State:
        return State(tool=None, reached=False)

    def through(self, entry: State) -> tuple[State, Any]:
        state, value = super().through(entry)
        if not self.routine.kind and not self.flow.scouting and not self.flow.all_ways:
            self.flow.ends[self.routine.file.number] = state
        return state, value

    # Conditions.

    def asked(self, line: Statement, state: State, node: Node) -> State:
        """State after functions in the conditions of a line, or in what it returns."""
        if line.kind == "return":
            self.value = None
            if line.value is not None:
                self.value, state = self.evaluated(line.value, state)
            return state
        lines = (
            [line, *(arm.line for arm in node.arms if arm.line is not None)] if isinstance(node, Branches) else [line]
        )
        for call in (call for one in lines for call in one.calls):
            routines = self.flow.names.called(call.name, self.routine.file)
            state = self._lost_by(routines, state) if routines else self._own(call, state)
        return state

    def returned(self, line: Statement, state: State) -> Value | None:
        return self.value

    def truth(self, condition: Expression, state: State) -> bool | None:
        if self.flow.all_ways:
            return None
        value = self._evaluator(lambda: state, self._unasked)(condition)
        return value if isinstance(value, bool) else None

    def _unasked(self, call: Expression) -> Value | None:
        known = self.flow.names.called(call.name, self.routine.file)
        return Lost(reason=f"what {call.name} returns is not followed") if known else None

    def reads_data(self, condition: Expression) -> bool:
        return any(e.kind == "call" or (e.kind == "name" and e.name not in CONSTANTS) for e in inside(condition))

    def widened(self, state: State, nodes: Sequence[Node], why: str) -> State:
        names, changes = self.flow.names, self.flow.effects.within
        keys = {MOTION}
        for line in lines_in(nodes):
            keys |= names.changed(line, self.routine)
            for routine in names.calls(line, self.routine):
                keys |= changes[routine]
        return state.lost(keys, why)

    def unknown(self, line: Statement, state: State) -> State:
        moving = next((word for word in (*MOTIONS, *_STEERED) if word in line.words), None)
        if moving is not None and not self.flow.scouting:
            self._fail(line.start, f"{moving} stays as it is: its statement is not understood", None)
        return super().unknown(line, state)

    # Expressions.

    def _evaluator(self, state: Callable[[], State], called: Callable[[Expression], Value | None]) -> Evaluator:
        def variable(name: str) -> Value:
            key = self.flow.names.key(name, self.routine)
            if key in self.flow.effects.unseen:
                return Lost(reason=f"{name} is set in a thread")
            value = state().variables.get(key)
            return Lost(reason=f"{name} is not known: {state().missing}") if value is None else value

        def forward(q: Six, tcp: Expression | None) -> Value:
            tool = state().tool
            if tcp is not None or tool is None:
                return Lost(reason="the TCP of get_forward_kin is not known")
            T = self._forward(q, tool)
            return Lost(reason="get_forward_kin needs the robot's kinematics") if T is None else computed(T)

        return Evaluator(file=self.routine.file.number, variable=variable, called=called, forward=forward)

    def _forward(self, q: Six, tool: Frame) -> np.ndarray | None:
        """Pose of a tool in the base; None without a robot of six joints."""
        robot = self.flow.robot
        if robot is None or len(robot.joint_names) != JOINTS:
            return None
        return robot.tool_poses(np.array([q]))[0] @ se3.inverse(robot.T_flange_tool) @ tool.T

    def evaluated(self, expression: Expression, state: State) -> tuple[Value, State]:
        """Value of an expression, and the state behind all functions in it."""

        def called(call: Expression) -> Value | None:
            nonlocal state
            routines = self.flow.names.called(call.name, self.routine.file)
            if self.flow.corrects and call.name.startswith(self.flow.corrects):
                for argument in call.parts:
                    evaluator(argument)
                return Lost(reason="it is corrected at run time")
            if not routines:
                state = self._own(call, state)
                return Lost(reason=f"{call.name} returns nothing") if call.name in MOTIONS else None
            given = [(name, evaluator(value)) for name, value in call.arguments]
            state, value = self._followed(call, routines, given, state)
            return value

        evaluator = self._evaluator(lambda: state, called)
        return evaluator(expression), state

    def _followed(
        self, call: Expression, routines: Sequence[Routine], given: Sequence[tuple[str, Value]], state: State
    ) -> tuple[State, Value]:
        """State after a call of a function of the program, and what it returns."""
        unknown = Lost(reason=f"what {call.name} returns is known only at run time")

        def entry(routine: Routine) -> State:
            names = [name for name, _ in routine.parameters]
            evaluator = self._evaluator(lambda: state, lambda _: unknown)
            bound = {name: evaluator(default) for name, default in routine.parameters if default is not None}
            for position, (name, value) in enumerate(given):
                name = name or (names[position] if position < len(names) else "")
                bound[name] = value
            lost = Lost(reason=f"{call.name} is not given it")
            own = {_local(name, routine): bound.get(name, lost) for name in names}
            return replace(state, variables={**state.variables, **own})

        followed = self.follow(routines, entry)
        if followed is None:
            return self._lost_by(routines, state), unknown
        behind, value = followed
        return behind, unknown if value is None else value

    def _lost_by(self, routines: Sequence[Routine], state: State) -> State:
        """State after functions that may have altered all that they alter."""
        self.flow.anywhere.update(routines)
        keys = frozenset[str]().union(*(self.flow.effects.within[routine] for routine in routines))
        return state.lost(keys, f"{routines[0].name} sets it")

    # Statements.

    def between(self, state: State) -> State:
        """State before a statement, where a thread may have done something."""
        return state.lost(self.flow.effects.unseen & {TOOL, MOTION}, "a thread sets it")

    def step(self, line: Statement, state: State) -> State:
        match line.kind:
            case "assign":
                return self._assigned(line, state)
            case "run":
                self.flow.anywhere.update(self.flow.names.called(line.name, self.routine.file))
                return state
            case "evaluate":
                assert line.value is not None
                if line.value.kind == "call" and line.value.name in MOTIONS:
                    return self._motion(line.value, state)
                return self.evaluated(line.value, state)[1]
            case _:
                return state

    def _assigned(self, line: Statement, state: State) -> State:
        assert line.value is not None
        value, state = self.evaluated(line.value, state)
        if not state.reached:
            return state
        key = self.flow.names.key(line.name, self.routine)
        if "." in line.name:
            value = Lost(reason=f"fields of structures, such as {line.name}, are not followed")
        if line.index is not None:
            index, state = self.evaluated(line.index, state)
            value = _with_element(state.variables.get(key), index, value)
        return replace(state, variables={**state.variables, key: value})

    def _own(self, call: Expression, state: State) -> State:
        """State after one of the language's own functions, or one that no file has."""
        name = call.name
        if name == "set_tcp":
            return self._set_tool(call, state)
        if name in _BEGINS:
            return replace(state, modes=state.modes | {_BEGINS[name]}, last=None)
        if name in _ENDS:
            return replace(state, modes=state.modes - {_ENDS[name]}, last=None)
        if name in _STEERED or name in MOTIONS:
            why = "is steered while it goes" if name in _STEERED else "is part of an expression"
            self._fail(call.start, f"{name} stays as it is: it {why}", call)
            return replace(state, last=None)
        if _rests(name):
            return state
        if name not in _HALTING and not self.flow.scouting:
            places = self.flow.findings.strange.setdefault(name, [])
            if (place := (self.routine.file.number, call.start)) not in places:
                places.append(place)
        return replace(state, last=None)

    def _set_tool(self, call: Expression, state: State) -> State:
        given = signature(call, ("pose", "tcp_name")) or {}
        if "pose" not in given:
            return replace(state, tool=None, why_no_tool="set_tcp before it is not given a pose")
        value = self._evaluator(lambda: state, self._unasked)(given["pose"])
        values = numbers(value, 6)
        if values is None:
            why = value.reason if isinstance(value, Lost) else "it is given no pose"
            return replace(state, tool=None, why_no_tool=f"set_tcp before it sets a TCP that is not known: {why}")
        named = self._evaluator(lambda: state, self._unasked)(given["tcp_name"]) if "tcp_name" in given else None
        stated = given["pose"].name if given["pose"].kind == "name" else DEFAULT_TCP
        return replace(state, tool=self.flow.frame(named if isinstance(named, str) else stated, values))

    def _fail(self, start: int, reason: str, call: Expression | None) -> None:
        if self.flow.scouting:
            return
        text = (self.routine.file.number, start)
        self.flow.findings.fail(text, self.routine.file, reason)
        if call is not None:
            self.flow.findings.failing[text] = call

    def _motion(self, call: Expression, state: State) -> State:
        findings, text = self.flow.findings, (self.routine.file.number, call.start)
        values: dict[int, Value] = {}
        for argument in call.parts:
            values[argument.start], state = self.evaluated(argument, state)
        if not state.reached:
            return state
        seen = self.flow.all_ways and text in findings.seen
        if self.flow.scouting or seen or self.flow.is_correcting(call):
            return replace(state, last=None)
        try:
            move, site = self._resolved(call, values, state)
        except Unresolved as why:
            self._fail(call.start, f"{call.name} stays as it is: {why}", call)
            return replace(state, last=None)
        end = move.end
        meaning = (
            text, *((point.literal, point.values, point.feature) for point in site.points), id(move.tool), move.speed, move.zone,
            move.divisible, str(end.posture), "" if site.points[-1].turns or end.T is None else end.T.tobytes(),
        )  # fmt: skip
        return replace(state, last=findings.number(text, (move, site), meaning, state.last))

    def _resolved(self, call: Expression, values: Mapping[int, Value], state: State) -> tuple[Motion, Site]:
        kind, names = MOTIONS[call.name]
        given = signature(call, names)
        needed = names[: 2 if kind == "circular" else 1]
        if given is None or not given.keys() >= set(needed):
            raise Unresolved(f"its arguments are not those of {call.name}({', '.join(names)})")
        if state.modes or MODE in self.flow.effects.unseen:
            self.flow.findings.shifted.add((self.routine.file.number, call.start))
            what = f"{min(state.modes)} is on, which moves" if state.modes else "a thread may switch on what moves"
            raise Unresolved(f"{what} the tool away from its target")
        mode = values[given["mode"].start] if "mode" in given else 0
        if mode not in (0, 1):
            raise Unresolved("its mode is neither 0 nor 1, as far as the text tells")

        def number(name: str, default: float) -> float | None:
            value = values[given[name].start] if name in given else default
            return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

        targets = [self._target(given[name], values[given[name].start], state, kind) for name in needed]
        (end, point), (via, _) = targets[-1], targets[0]
        if kind == "circular" and mode == 1:
            end, point = self._turned(end, via, self._part(point).T, state), replace(point, turns=False)
            targets[-1] = end, point
        radius, time, speed = number("r", 0.0), number("t", 0.0), number("v", DEFAULT_SPEED_M_S)
        if end.q is not None:
            kind = "axes"
        move = Motion(
            kind=kind,
            end=end,
            via=via if kind == "circular" else None,
            tool=state.tool or NO_TOOL,
            part=self._part(point),
            part_in_hand=False,
            speed=speed if kind in ("linear", "circular") and time == 0.0 and speed else None,
            stops=radius is not None and radius <= 0.0,
            zone=None if radius is None else Zone(distance=max(radius, 0.0), turn_distance=max(radius, 0.0)),
            follows=None,
            routine=self.routine.name,
            place=self.routine.file.source.place(call.start),
            divisible=time == 0.0,
        )
        points = tuple(point for _, point in targets)
        return move, Site(file=self.routine.file, call=call, points=points)

    def _turned(self, end: Target, via: Target, T_base_part: np.ndarray, state: State) -> Target:
        """End of an arc along which the tool keeps its angle to the path (Script manual, movec: mode 1).

        Raises:
            Unresolved: it is not known in which pose it begins, or its points lie on a line.
        """
        before = None if state.last is None else self.flow.findings.occurrences[state.last].motion[0]
        assert end.T is not None
        assert via.T is not None
        if before is None or before.end.T is None or before.tool is not state.tool:
            raise Unresolved(
                "its mode is 1, by which the tool turns with the arc, and the pose in which it begins is not known"
            )
        start, (last, middle) = before.part.T @ before.end.T, T_base_part @ np.stack([end.T, via.T])
        u, w = middle[:3, 3] - start[:3, 3], last[:3, 3] - middle[:3, 3]
        normal = np.cross(u, w)
        size = float(np.linalg.norm(normal))
        if size < MIN_ARC_SINE * np.linalg.norm(u) * np.linalg.norm(w) or not size:
            raise Unresolved("its mode is 1, by which the tool turns with the arc, and its points lie on a line")
        # the arc is twice the angle by which its chords turn (inscribed angle)
        last[:3, :3] = se3.exp(normal / size * 2.0 * np.arctan2(size, u @ w)) @ start[:3, :3]
        return replace(end, T=se3.inverse(T_base_part) @ last)

    def _part(self, point: Point) -> Frame:
        return self.flow.part if point.feature is None else self.flow.frame(*point.feature)

    def _target(self, expression: Expression, value: Value, state: State, kind: MotionKind) -> tuple[Target, Point]:
        """Target of a motion, and where the text states it."""
        place, name = self.routine.file.source.place(expression.start), ""
        if isinstance(value, Lost):
            raise Unresolved(value.reason)
        posture = None
        if isinstance(value, Inverse):
            # a line keeps the posture in which it begins
            posture = NearPosture(q=np.array(value.near)) if value.near is not None and kind == "joint" else None
            value = value.pose
        slot, framed = slot_of(expression)
        if slot.kind == "name":
            name = slot.name
        q = numbers(value, 6) if isinstance(value, Array) else None
        if q is not None and isinstance(value, Array):
            literal = value.literal
            point = Point(
                slot=slot, framed=False, named=False, literal=literal, values=q, joints=True, feature=None, T=self.flow.part.T
            )  # fmt: skip
            if kind == "joint":
                return Target(name=name, T=None, q=np.array(q), posture=None, place=place), point
            T = None if state.tool is None else self._forward(q, state.tool)
            if state.tool is not None and T is None:
                raise Unresolved("its target is joint positions, whose pose follows from the robot's kinematics")
            posture = NearPosture(q=np.array(q))
        elif isinstance(value, Pose):
            feature = value.feature
            point = Point(
                slot=slot, framed=framed, named=framed or self._holds(feature, state), literal=value.literal, joints=False,
                values=value.stated, feature=feature, T=self.flow.part.T if feature is None else matrix(feature[1]),
            )  # fmt: skip
            T = matrix(value.stated)
        else:
            raise Unresolved("its target is neither a pose nor six joint positions")
        if state.tool is None or T is None:
            raise Unresolved(state.why_no_tool)
        if point.feature is None:
            T = se3.inverse(self.flow.part.T) @ T
        return Target(name=name, T=T, q=None, posture=posture, posture_binds=False, place=place), point

    def _holds(self, feature: tuple[str, Six] | None, state: State) -> bool:
        """Whether the variable of a feature has its pose at a place."""
        if feature is None:
            return False
        value = state.variables.get(self.flow.names.key(feature[0], self.routine))
        return isinstance(value, Pose) and value.values == feature[1]


def _with_element(value: Value | None, index: Value, element: Value) -> Value:
    """A list or a pose with another element."""
    if isinstance(value, Pose | Array) and isinstance(index, int) and not isinstance(index, bool):
        items: list[Value] = list(value.items if isinstance(value, Array) else value.values)
        if 0 <= index < len(items):
            items[index] = element
            if isinstance(value, Array):
                return Array.of(items)
            values = numbers(Array.of(items), 6)
            if values is not None:
                return Pose(stated=values)
    return Lost(reason="an element of it is set to what is not known")


MIN_ARC_SINE = 1e-6
"""Of the angle between an arc's chords, below which they are one line; points have some micrometres."""

DEFAULT_TCP = "TCP"
"""What PolyScope calls the first TCP of an installation; a cell file calls so what set_tcp is given as numbers."""
BASE = "Base"
"""PolyScope's feature of the robot's base."""

NO_TOOL = Frame(name="", T=np.eye(4))


# Reading.

MAX_PASSES = 30
"""As many lines as the program has, so many times, are gone through again for calls and the turns of loops."""


@uncollected()
def read_urscript(
    sources: Sequence[Source],
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    corrects: str = "",
) -> UrscriptProgram:
    """Read a URScript program.

    Args:
        sources: its files.
        robot: for lines to joint positions and ``get_forward_kin``, whose poses follow from its kinematics.
        tool: the TCP that is active before the first ``set_tcp``.
        part: frame on which motions are that name no feature; the robot's base by default.
        corrects: how functions begin that correct a target at run time; motions to what they return are left out.

    Raises:
        FileError: a file is no URScript, or its blocks and their ends do not match.
    """
    for source in sources:
        if "\0" in source.text:
            raise FileError(source.path, "is a binary file; save the program as a .script file")
    files = tuple(parse(source, number) for number, source in enumerate(sources))
    for file in files:
        moving = (call for routine in file.routines for line in routine.lines for call in line.calls)
        if len(file.routines) == 1 and not any(call.name in MOTIONS for call in moving):
            raise FileError(file.source.path, "is not URScript: it has no def and no motion")
    names = Names(files=files)
    routines = [routine for file in files for routine in file.routines]
    effects = Effects(
        own={r: frozenset[str]().union(*(names.changed(line, r) for line in r.lines)) for r in routines},
        calls={r: frozenset[Routine]().union(*(names.calls(line, r) for line in r.lines)) for r in routines},
        beside=[routine for routine in routines if routine.kind in ("thread", "sec")],
    )
    flow = _Flow(
        findings=Findings(),
        names=names,
        effects=effects,
        robot=robot,
        tool=tool,
        part=part or Frame(name=BASE, T=np.eye(4)),
        corrects=corrects,
        left=MIN_LINES + MAX_PASSES * sum(len(routine.lines) for routine in routines),
    )
    roots = [one for one in routines if not effects.callers[one] - {one} and one.kind != "thread"]
    flow.follow(routines, roots)
    flow.findings.close()
    flow.follow_rest(routines, roots)
    return _program(files, flow, partial(read_urscript, robot=robot, tool=tool, part=part, corrects=corrects))


def _program(files: Sequence[File], flow: _Flow, read: Callable[..., UrscriptProgram]) -> UrscriptProgram:
    findings = flow.findings
    motions: list[Motion] = []
    sites: list[Site] = []
    for found in findings.ordered(lambda found: found.text not in findings.reasons, lambda text: text):
        move, site = found.motion
        divisible = move.divisible and found.same_text == 1
        motions.append(replace(move, follows=found.follows, texts_motions=found.same_text, divisible=divisible))
        sites.append(site)
    return UrscriptProgram(
        sources=tuple(file.source for file in files),
        motions=tuple(motions),
        diagnostics=tuple(
            Diagnostic(place=files[number].source.place(start), text=text)
            for (number, start), text in sorted(_diagnosed(findings))
        ),
        sites=tuple(sites),
        files=tuple(files),
        failing=tuple((number, call) for (number, _), call in findings.failing.items()),
        shifted=frozenset(findings.shifted),
        turns=flow.turns,
        read=read,
    )


def _diagnosed(findings: Findings) -> Iterator[tuple[tuple[int, int], str]]:
    for text, (_, reason) in findings.reasons.items():
        yield text, reason
    for name, places in findings.strange.items():
        times = f" ({len(places)} times)" if len(places) > 1 else ""
        yield (
            min(places),
            f"{name} is not in the files given{times}; it is taken to leave TCP and variables as they are; where the robot is "
            "after it is not known",
        )
