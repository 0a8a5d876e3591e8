"""Which tool and which base hold at a line of a KRL program."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.krl.data import Data
from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.parser import parse_operand
from taskcal.programs.krl.position import pose
from taskcal.programs.krl.syntax import Aggregate, Assignment, Call, Field, Operand
from taskcal.programs.program import Frame
from taskcal.programs.unresolved import Unresolved

Table = Literal["tool", "base", "null", "own"]
"""Where a frame comes from: TOOL_DATA, BASE_DATA, the zero frame, or the program's own."""

EVERYTHING = frozenset({"tool", "base", "mode", "parameters", "speed", "motion"})
"""What lines can alter: $TOOL, $BASE, $IPO_MODE, FDAT_ACT, $VEL.CP, and where the robot is."""

NULL = Frame(name="$NULLFRAME", T=np.eye(4))


@dataclass(frozen=True, kw_only=True)
class Held:
    """What a frame variable holds."""

    frame: Frame | None
    """None where the text does not tell."""
    table: Table = "own"
    reason: str = ""
    """Why it does not tell."""
    carrier: str = ""
    """What moves it; empty where it stands still."""


@dataclass(frozen=True, kw_only=True)
class State:
    """What the lines before have set."""

    tool: Held
    base: Held
    fixed_tool: bool | None = False
    """$IPO_MODE is #TCP: the tool stands still, the robot holds the part; None where the text does not tell."""
    parameters: Aggregate | None = None
    """FDAT_ACT, which the next BAS makes tool and base."""
    parameters_reason: str = "FDAT_ACT is not set before it"
    speed: float | None = None
    """$VEL.CP, metres per second."""
    turn_speed: float | None = None
    """$VEL.ORI1, degrees per second."""
    last: int | None = None
    """Number of the motion that ends where the robot is now."""

    @classmethod
    def unset(cls) -> "State":
        """At the start of a program that nothing calls."""
        return cls(
            tool=Held(frame=None, reason="$TOOL is not set before it"),
            base=Held(frame=None, reason="$BASE is not set before it"),
        )

    def forgotten(self, reason: str, what: frozenset[str] = EVERYTHING) -> "State":
        """Where some of `EVERYTHING` may have become anything."""
        unknown = Held(frame=None, reason=reason)
        return State(
            tool=unknown if "tool" in what else self.tool,
            base=unknown if "base" in what else self.base,
            fixed_tool=None if "mode" in what else self.fixed_tool,
            parameters=None if "parameters" in what else self.parameters,
            parameters_reason=reason if "parameters" in what else self.parameters_reason,
            speed=None if "speed" in what else self.speed,
            turn_speed=None if "speed" in what else self.turn_speed,
            last=None if "motion" in what else self.last,
        )


def merged(states: Sequence[State], reason: str) -> State:
    """What holds after any of some ways through the program."""
    first = states[0]
    same = {
        name: all(getattr(other, name) == getattr(first, name) for other in states)
        for name in ("tool", "base", "fixed_tool", "parameters", "speed", "turn_speed", "last")
    }
    unknown = Held(frame=None, reason=reason)
    return State(
        tool=first.tool if same["tool"] else unknown,
        base=first.base if same["base"] else unknown,
        fixed_tool=first.fixed_tool if same["fixed_tool"] else None,
        parameters=first.parameters if same["parameters"] else None,
        parameters_reason=first.parameters_reason if same["parameters"] else reason,
        speed=first.speed if same["speed"] else None,
        turn_speed=first.turn_speed if same["turn_speed"] else None,
        last=first.last if same["last"] else None,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Frames:
    """Frames by what a module says of them."""

    data: Data
    module: str
    made: dict[tuple[str, bytes], Frame] = field(default_factory=dict[tuple[str, bytes], Frame])
    """Frames met so far, so that one frame is one object."""

    def _frame(self, name: str, T: Float[np.ndarray, "4 4"]) -> Frame:
        return self.made.setdefault((name, T.tobytes()), Frame(name=name, T=T))

    def of(self, operand: Operand, name: str) -> Held:
        """The frame that an operand states, called by a name where it has none of its own."""
        try:
            if not operand.parts:
                raise Unresolved(f"{name} is set to something that the text does not state as a frame")
            T = np.eye(4)
            for part in operand.parts:
                T = T @ (pose(part) if isinstance(part, Aggregate) else self._named(part.name))
        except Unresolved as trouble:
            return Held(frame=None, reason=str(trouble))
        first = operand.parts[0]
        if len(operand.parts) > 1 or isinstance(first, Aggregate):
            return Held(frame=self._frame(name, T))
        if first.name in ("$NULLFRAME", "$WORLD"):
            return Held(frame=NULL, table="null")
        variable = first.name.partition("[")[0]
        table: Table = "tool" if variable == "TOOL_DATA" else "base" if variable == "BASE_DATA" else "own"
        return Held(frame=self._frame(first.name, T), table=table)

    def _named(self, name: str) -> Float[np.ndarray, "4 4"]:
        if name in ("$NULLFRAME", "$WORLD"):
            return np.eye(4)
        if name == "$ROBROOT":
            return self.robroot
        return pose(self.data.find(name, self.module).aggregate)

    @property
    def robroot(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the robot in the world, of $machine.dat; the world's origin where no file says it.

        Raises:
            Unresolved: the program changes it.
        """
        return np.eye(4) if self.data.robroot is None else self.data.robroot

    def numbered(self, table: Literal["tool", "base"], number: float | None) -> Held:
        """An element of TOOL_DATA or BASE_DATA; the zero frame for number 0."""
        array = "TOOL_DATA" if table == "tool" else "BASE_DATA"
        if number is None:
            return Held(frame=None, reason=f"which element of {array} is meant is not stated as a number")
        if number == 0:
            return Held(frame=NULL, table="null")
        name = f"{array}[{number:g}]"
        try:
            return Held(frame=self._frame(name, self._named(name)), table=table)
        except Unresolved as trouble:
            return Held(frame=None, reason=str(trouble))

    def of_parameters(self, state: State, parameters: Aggregate | None) -> State:
        """What a set of frame parameters (FDAT) makes of tool and base."""
        if parameters is None:
            unknown = Held(frame=None, reason=state.parameters_reason)
            return replace(state, tool=unknown, base=unknown, fixed_tool=None)
        mode = parameters.field("IPO_FRAME")
        text = mode.text.upper() if mode else "#BASE"
        return replace(
            state,
            tool=self.numbered("tool", parameters.value("TOOL_NO")),
            base=self.numbered("base", parameters.value("BASE_NO")),
            fixed_tool={"#BASE": False, "#TCP": True}.get(text),
        )

    def after_assignment(self, state: State, line: Assignment) -> State:
        """The state behind an assignment."""
        value = line.value
        match line.name:
            case "$TOOL":
                return replace(state, tool=self.of(value, "$TOOL"))
            case "$BASE":
                return replace(state, base=self.of(value, "$BASE"))
            case "$IPO_MODE":
                return replace(state, fixed_tool={"#BASE": False, "#TCP": True}.get(line.text))
            case "FDAT_ACT":
                return self._with_parameters(state, value)
            case "$VEL.CP":
                return replace(state, speed=_plain_number(line.text))
            case "$VEL":
                part = value.parts[0] if len(value.parts) == 1 else None
                if not isinstance(part, Aggregate):
                    return replace(state, speed=None, turn_speed=None)
                return replace(state, speed=part.value("CP"), turn_speed=part.value("ORI1"))
            case "$VEL.ORI1":
                return replace(state, turn_speed=_plain_number(line.text))
            case _:
                pass
        if line.variable == "FDAT_ACT" and state.parameters is not None:
            return replace(state, parameters=_with_component(state.parameters, line))
        if line.variable in ("$TOOL", "$BASE"):
            held = Held(frame=None, reason=f"{line.name} is changed on its own")
            return replace(state, tool=held) if line.variable == "$TOOL" else replace(state, base=held)
        return state

    def _with_parameters(self, state: State, value: Operand) -> State:
        try:
            return replace(state, parameters=self._parameters(value))
        except Unresolved as trouble:
            return replace(state, parameters=None, parameters_reason=str(trouble))

    def _parameters(self, value: Operand) -> Aggregate:
        if len(value.parts) != 1:
            raise Unresolved("FDAT_ACT is not set to a set of parameters")
        part = value.parts[0]
        return part if isinstance(part, Aggregate) else self.data.find(part.name, self.module).aggregate

    def after_bas(self, state: State, line: Call) -> State:
        """The state behind a call of BAS, the controller's routine for motion parameters (bas.src)."""
        number = _number_of(line.arguments[1]) if len(line.arguments) > 1 else None
        match line.command:
            case "#PTP_PARAMS" | "#PTP_DAT" | "#FRAMES":
                return self.of_parameters(state, state.parameters)
            case "#CP_PARAMS" | "#CP_DAT":
                state = self.of_parameters(state, state.parameters)
                state = replace(state, turn_speed=None)
                return replace(state, speed=number) if line.command == "#CP_PARAMS" else state
            case "#VEL_CP":
                return replace(state, speed=number)
            case "#TOOL":
                return replace(state, tool=self.numbered("tool", number))
            case "#BASE":
                return replace(state, base=self.numbered("base", number))
            case "#EX_BASE":
                return replace(
                    state, base=replace(self.numbered("base", number), carrier="an external kinematic system")
                )
            case "#INITMOV":
                reset = state.forgotten("BAS(#INITMOV) resets tool and base before it", EVERYTHING - {"motion"})
                return replace(reset, fixed_tool=False)
            case _:
                return state

    def with_settings(self, state: State, settings: dict[str, tuple[Word, ...]]) -> State:
        """The state of one motion that sets tool, base or mode for itself."""
        for name, words in settings.items():
            function = words[0].upper if len(words) > 2 and words[1].text == "(" else ""
            if function in ("STOOL", "STOOL2", "SBASE", "SIPO_MODE"):
                state = self._set_by(state, name, words)
            elif name in ("$TOOL", "$BASE"):
                held = self.of(parse_operand(words), name)
                state = replace(state, tool=held) if name == "$TOOL" else replace(state, base=held)
            elif name == "$IPO_MODE":
                state = replace(state, fixed_tool={"#BASE": False, "#TCP": True}.get("".join(w.upper for w in words)))
            elif name in ("$VEL", "$VEL.CP"):
                state = replace(state, speed=_number_of(words[2:3] if function == "SVEL_CP" else words))
            elif name == "$VEL.ORI1":
                state = replace(state, turn_speed=_number_of(words))
        return state

    def _set_by(self, state: State, name: str, words: tuple[Word, ...]) -> State:
        """One of the inline forms' functions of a set of frame parameters, such as ``STOOL2(FP1)``."""
        try:
            parameters = self.data.find(words[2].upper, self.module).aggregate
        except Unresolved as trouble:
            unknown = Held(frame=None, reason=str(trouble))
            return replace(state, tool=unknown, base=unknown, fixed_tool=None)
        set_by = self.of_parameters(state, parameters)
        match name:
            case "$TOOL":
                return replace(state, tool=set_by.tool)
            case "$BASE":
                return replace(state, base=set_by.base)
            case _:
                return replace(state, fixed_tool=set_by.fixed_tool)

    def tool_and_part(self, state: State) -> tuple[Frame, Frame]:
        """Tool and part of a motion, as its poses mean them: what stands still is given in the robot's own base.

        Raises:
            Unresolved: the text does not tell them.
        """
        tool, base = state.tool, state.base
        if tool.frame is None or base.frame is None:
            raise Unresolved(tool.reason if tool.frame is None else base.reason)
        if state.fixed_tool is None:
            raise Unresolved("whether the robot holds tool or part ($IPO_MODE) is not stated before it")
        if not state.fixed_tool:
            return tool.frame, base.frame if base.carrier else self._standing(base.frame)
        if base.carrier or tool.carrier:
            raise Unresolved("$IPO_MODE is #TCP, and the base is one that moves")
        # With #TCP the part hangs on the flange; its frame is one of TOOL_DATA, the fixed tool one of BASE_DATA, whichever of
        # the two variables holds it: bas.src and hand-written programs differ in that
        if {tool.table, base.table} <= {"tool", "base", "null"} and tool.table != base.table:
            held, standing = (tool, base) if tool.table == "tool" or base.table == "base" else (base, tool)
            assert held.frame is not None
            assert standing.frame is not None
            return self._standing(standing.frame), held.frame
        raise Unresolved(
            "$IPO_MODE is #TCP, and which frame is the part's and which the fixed tool's is not clear; take one from "
            "TOOL_DATA and one from BASE_DATA"
        )

    def _standing(self, frame: Frame) -> Frame:
        T = se3.inverse(self.robroot) @ frame.T
        return frame if np.array_equal(T, frame.T) else self._frame(frame.name, T)


def _with_component(parameters: Aggregate, line: Assignment) -> Aggregate:
    """A set of parameters with one component as a line sets it: a number, or something that the text does not tell."""
    name = line.name.partition(".")[2]
    new = Field(
        name=name,
        text=line.text,
        value=_plain_number(line.text),
        start=line.value.start,
        end=line.value.end,
        touches=False,
    )
    return replace(parameters, fields=(*(old for old in parameters.fields if old.name != name), new))


def _number_of(words: Sequence[Word]) -> float | None:
    return _plain_number("".join(word.text for word in words))


def _plain_number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None
