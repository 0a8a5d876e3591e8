"""What the lines of a KRL program before another one have set: tool, base, mode, speed, and where the robot is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any, Literal, Self

import numpy as np
from jaxtyping import Float

from robot_programs.core import flow, se3
from robot_programs.core.program import THROUGH_TARGET, Frame, MotionKind, Unresolved, Zone
from robot_programs.core.values import Lost
from robot_programs.krl.data import Data, NotInFiles, aggregate_of, pose
from robot_programs.krl.syntax import (
    Aggregate,
    Assignment,
    Call,
    Operand,
    Word,
    arguments_of,
    closing,
    parse_operand,
)
from robot_programs.krl.values import (
    AbstractValue,
    Adjustable,
    Known,
    Lookup,
    Names,
    Variables,
    evaluated,
    name_of,
    number_of,
    of_both,
    structure,
    values_of,
    with_values,
)

# Where a KRL motion may be left for the next one: $APO, and who sets it.
#
# KUKA's bas.src sets $APO from the parameter sets of the inline forms, and to DEF_APO_CDIS and DEF_APO_CPTP at
# BAS(#INITMOV).

WHOLE_PERCENT = 200.0
"""At $APO.CPTP = 100 % approximation begins in the middle of the motion (KST PLC mxAutomation Logix, structure APO)."""


@dataclass(frozen=True, kw_only=True)
class Approximation:
    """Value of $APO; None where the text does not tell."""

    distance: float | None = None
    """CDIS, millimetres."""
    share: float | None = None
    """CPTP, percent."""

    def zone(self, passing: Sequence[str], kind: MotionKind) -> Zone | None:
        """Zone in which a motion passes by its target; None where the text does not tell.

        Args:
            passing: its words for that.
            kind: of the motion.
        """
        words = set(passing)
        if not words:
            return THROUGH_TARGET
        if words <= {"C_DIS", "C_SPL"}:
            distance = self.distance
            return None if distance is None else Zone(distance=distance / 1e3, turn_distance=distance / 1e3)
        if words == {"C_PTP"} and kind in ("joint", "axes") and self.share is not None:
            return Zone(distance=math.inf, angle=math.inf, share=self.share / WHOLE_PERCENT)
        return None  # from which speed or orientation on is not a place that the text gives

    def after_setting(self, name: str, words: Sequence[Word], known: Known) -> "Approximation":
        """Approximation after a value for a component, or for all of it: of a line, or of one motion behind WITH."""
        match name:
            case "$APO.CDIS":
                return replace(self, distance=_size(words, known))
            case "$APO.CPTP":
                return replace(self, share=_size(words, known))
            case _ if _function(words) in ("SAPO", "SAPO_PTP"):
                return Approximation(distance=_component(words[2].upper, known)[0])
            case _:
                stated = _structure(words)
                if stated is None:
                    return Approximation()
                own, other = stated.value("CDIS"), stated.value("CPTP")
                return Approximation(
                    distance=self.distance if own is None else own, share=self.share if other is None else other
                )

    def after_bas(self, line: Call, known: Known) -> "Approximation":
        """Approximation after a call of BAS."""
        match line.command:
            case "#CP_PARAMS" | "#CP_DAT":
                return replace(self, distance=_component("LDAT_ACT", known)[0])
            case "#PTP_PARAMS" | "#PTP_DAT":
                size, mode = _component("PDAT_ACT", known)
                if mode is None:
                    return Approximation()
                return replace(self, distance=size) if mode == "#CDIS" else replace(self, share=size)
            case "#INITMOV":
                module = known.names.module
                distance, share = (known.data.number(name, module) for name in ("DEF_APO_CDIS", "DEF_APO_CPTP"))
                return Approximation(distance=_positive(distance), share=_positive(share))
            case _:
                return self


NOT_KNOWN = Approximation()


def _component(name: str, known: Known) -> tuple[float | None, str | None]:
    """Size and kind of approximation in a set of motion parameters (LDAT, PDAT); None where the text does not tell them."""
    try:
        value = known.value(name)
    except Unresolved:
        return None, None
    if not isinstance(value, Aggregate):
        return None, None
    mode = value.field("APO_MODE")
    return _positive(value.value("APO_DIST")), "#CPTP" if mode is None else mode.text.upper()


def _function(words: Sequence[Word]) -> str:
    """Name of the function that a value begins with; empty where it begins with none."""
    return words[0].upper if len(words) > 2 and words[1].text == "(" else ""


def _structure(words: Sequence[Word]) -> Aggregate | None:
    return aggregate_of(parse_operand(words))


def _size(words: Sequence[Word], known: Known) -> float | None:
    return _positive(_number(words, known))


def _positive(value: float | bool | None) -> float | None:
    return None if value is None or isinstance(value, bool) or value < 0.0 else float(value)


Table = Literal["tool", "base", "null", "own"]
"""Where a frame comes from: TOOL_DATA, BASE_DATA, the zero frame, or the program's own."""

EVERYTHING = frozenset({"tool", "base", "mode", "parameters", "speed", "approximation", "motion"})
"""What lines can alter: $TOOL, $BASE, $IPO_MODE, FDAT_ACT, $VEL.CP, $APO, and where the robot is."""


@dataclass(frozen=True, kw_only=True)
class FrameVariable:
    """Value of a frame variable."""

    frame: Frame | None
    """None where the text does not tell."""
    table: Table = "own"
    reason: str = ""
    """Why it does not tell."""
    carrier: str = ""
    """What moves it; empty where it stands still."""


def _unknown(reason: object) -> FrameVariable:
    """Value that the text does not tell."""
    return FrameVariable(frame=None, reason=str(reason))


@dataclass(frozen=True, kw_only=True)
class State(flow.State):
    """State set by the lines before."""

    tool: FrameVariable
    base: FrameVariable
    fixed_tool: bool | None = False
    """$IPO_MODE is #TCP: the tool stands still, the robot holds the part; None where the text does not tell."""
    parameters: Aggregate | None = None
    """FDAT_ACT, which the next BAS makes tool and base."""
    parameters_reason: str = "FDAT_ACT is not set before it"
    speed: float | None = None
    """$VEL.CP, metres per second."""
    turn_speed: float | None = None
    """$VEL.ORI1, degrees per second."""
    approximation: Approximation = NOT_KNOWN
    """$APO."""
    armed: frozenset[tuple[int, int]] = frozenset()
    """Actions that may run at any time from here on, by file and first character of their line."""

    @classmethod
    def unset(cls) -> "State":
        """At the start of a program that nothing calls."""
        return cls(tool=_unknown("$TOOL is not set before it"), base=_unknown("$BASE is not set before it"))

    def lost(self, reason: str, what: frozenset[str] = EVERYTHING) -> Self:
        """State in which some of `EVERYTHING` may have become anything."""
        fields = [name for name, group in _GROUPS.items() if group in what]
        return self._with_unknown(fields, reason) if fields else self

    def joined(self, others: Sequence[Self], why: str) -> Self:
        """Join states; see `flow.State.joined`."""
        differing = [name for name in _GROUPS if any(getattr(self, name) != getattr(other, name) for other in others)]
        return replace(
            super().joined(others, why)._with_unknown(differing, why),
            armed=self.armed.union(*(other.armed for other in others)),
        )

    def common(self, values: Sequence[AbstractValue | None], why: str) -> AbstractValue | None:
        """See `flow.State.common`: a copy of a data list's number, and that number, are one."""
        return reduce(of_both, values)

    def lost_in(self, joined: Self) -> tuple[frozenset[str], frozenset[str]]:
        """Groups of `EVERYTHING` and variables of this state that a state joined from it has lost."""
        what = {group for name, group in _GROUPS.items() if getattr(self, name) != getattr(joined, name)}
        return frozenset(what), frozenset(self.variables.keys() - joined.variables.keys())

    def without(self, lost: tuple[frozenset[str], frozenset[str]] | None, why: str) -> Self:
        """State without the facts that `lost_in` gave."""
        what, keys = lost or (frozenset[str](), frozenset[str]())
        if not what and not keys:
            return self
        variables = {key: value for key, value in self.variables.items() if key not in keys}
        return replace(self.lost(why, what), variables=variables)

    def _with_unknown(self, fields: Sequence[str], reason: str) -> Self:
        unknown = _unknown(reason)
        to: dict[str, Any] = {"tool": unknown, "base": unknown, "approximation": NOT_KNOWN}
        changes = {name: to.get(name) for name in fields}
        if "parameters" in changes:
            changes["parameters_reason"] = reason
        return replace(self, **changes)


_GROUPS = {
    "tool": "tool", "base": "base", "fixed_tool": "mode", "parameters": "parameters", "speed": "speed",
    "turn_speed": "speed", "approximation": "approximation", "last": "motion",
}  # fmt: skip
"""To what of `EVERYTHING` each field belongs."""

UNREACHED = State(tool=FrameVariable(frame=None), base=FrameVariable(frame=None), reached=False)
"""Where control does not come."""


# Bases that move: on external kinematic systems, on other robots and on conveyors.
#
# KUKA's bas.src couples them so: EX_BASE sets ``$BASE=EK(root, kinematic system, frame)``, LK_BASE links ``$BASE``
# to a robot of another controller by ``LK(…)``, EB_BASE to a conveyor by ``EB(…)``; its FRAMES chooses by
# MACHINE_FRAME_DAT and MACHINE_DEF of $config.dat.

EXTERNAL_KINEMATIC = "an external kinematic system"

_STEERED_ELSEWHERE = {
    "LK": "is linked by LK to another robot, and where that is this program does not tell",
    "EB": "is linked by EB to a conveyor, and where that is this program does not tell",
}


def coupled(words: Sequence[Word]) -> tuple[Word, ...] | FrameVariable | None:
    """Frame of ``$BASE`` where a function couples it to something that moves.

    Args:
        words: the value.

    Returns:
        The words of the frame in an external kinematic system, none where it is the system's own; why the base is not known; or
        None where nothing couples it.
    """
    function = _function(words)
    if function in _STEERED_ELSEWHERE:
        return _unknown(f"$BASE {_STEERED_ELSEWHERE[function]}")
    if function != "EK":
        return None
    given = arguments_of(words[1:])
    if len(given) not in (2, 3) or closing(words[1:]) != len(words) - 2:
        return _unknown("$BASE is set by EK in a way that is not understood; write EK(root, kinematic system, frame)")
    return given[2] if len(given) == 3 else ()


NULL = Frame(name="$NULLFRAME", T=np.eye(4))

_MODES = {"#BASE": False, "#TCP": True}
"""Whether the tool stands still, by $IPO_MODE."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Frames:
    """Frames by what a module says of them."""

    data: Data
    names: Names
    """What names of variables mean in the routine."""
    made: dict[tuple[str, bytes], Frame] = field(default_factory=dict[tuple[str, bytes], Frame])
    """Frames met so far, so that one frame is one object."""

    def _frame(self, name: str, T: Float[np.ndarray, "4 4"]) -> Frame:
        return self.made.setdefault((name, T.tobytes()), Frame(name=name, T=T))

    def known(self, state: State) -> Known:
        """The values of variables where something holds."""
        both = {"$TOOL": state.tool, "$BASE": state.base}
        frames = {name: v.frame for name, v in both.items() if v.frame is not None and not v.carrier}
        return Known(names=self.names, data=self.data, variables=state.variables, frames=frames)

    def of(self, words: Sequence[Word], name: str, known: Known) -> FrameVariable:
        """The frame that an expression states, called by a name where it has none of its own."""
        operand = parse_operand(words)
        try:
            if not operand.parts:
                return FrameVariable(frame=self._frame(name, self._computed(words, name, known)))
            T, names = np.eye(4), list[str]()
            for part in operand.parts:
                if isinstance(part, Aggregate):
                    T = T @ pose(with_values(part, known))
                else:
                    names.append(name_of(part, known))
                    T = T @ self._named(names[-1], known)
        except NotInFiles as trouble:
            return _unknown(f"{name}: {trouble}")
        except Unresolved as trouble:
            return _unknown(trouble)
        if len(operand.parts) > 1 or not names:
            return FrameVariable(frame=self._frame(name, T))
        if names[0] in ("$NULLFRAME", "$WORLD"):
            return FrameVariable(frame=NULL, table="null")
        variable = names[0].partition("[")[0]
        table: Table = "tool" if variable == "TOOL_DATA" else "base" if variable == "BASE_DATA" else "own"
        return FrameVariable(frame=self._frame(names[0], T), table=table)

    def _computed(self, words: Sequence[Word], name: str, known: Known) -> Float[np.ndarray, "4 4"]:
        """A frame that functions compute, such as ``INV_POS(F):G``."""
        value = evaluated(words, known)
        if not isinstance(value, Aggregate):
            raise Unresolved(f"{name} is set to something that the text does not state as a frame")
        return pose(value)

    def _base(self, words: Sequence[Word], known: Known) -> FrameVariable:
        inside = coupled(words)
        if inside is None or isinstance(inside, FrameVariable):
            return self.of(words, "$BASE", known) if inside is None else inside
        variable = self.of(inside, "$BASE", known) if inside else FrameVariable(frame=NULL, table="null")
        return replace(variable, carrier=EXTERNAL_KINEMATIC)

    def _named(self, name: str, known: Known) -> Float[np.ndarray, "4 4"]:
        if name in ("$NULLFRAME", "$WORLD"):
            return np.eye(4)
        if name == "$ROBROOT":
            return self.robroot
        assigned = known.assigned(name)
        if isinstance(assigned, Aggregate):
            return pose(assigned)
        if assigned is None and name in known.frames:
            return known.frames[name].T
        try:
            return pose(self._stated(name))
        except NotInFiles:
            if name not in self.data.given:
                raise
            return self.data.given[name].T

    @property
    def robroot(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the robot in the world, of $machine.dat; the world's origin where no file says it.

        Raises:
            Unresolved: the program changes it.
        """
        return np.eye(4) if self.data.robroot is None else self.data.robroot

    def numbered(self, table: Literal["tool", "base"], number: float | None, known: Known) -> FrameVariable:
        """An element of TOOL_DATA or BASE_DATA; the zero frame for number 0."""
        array = "TOOL_DATA" if table == "tool" else "BASE_DATA"
        if number is None:
            return _unknown(f"which element of {array} is meant is not stated as a number")
        if number == 0:
            return FrameVariable(frame=NULL, table="null")
        name = f"{array}[{number:g}]"
        try:
            return FrameVariable(frame=self._frame(name, self._named(name, known)), table=table)
        except Unresolved as trouble:
            return _unknown(trouble)

    def of_parameters(self, state: State, parameters: Aggregate | None) -> State:
        """State with the tool and base of a set of frame parameters (FDAT)."""
        if parameters is None:
            unknown = _unknown(state.parameters_reason)
            return replace(state, tool=unknown, base=unknown, fixed_tool=None)
        mode = parameters.field("IPO_FRAME")
        text = mode.text.upper() if mode else "#BASE"
        number = parameters.value("BASE_NO")
        return replace(
            state,
            tool=self.numbered("tool", parameters.value("TOOL_NO"), self.known(state)),
            base=self._on_its_mechanism(self.numbered("base", number, self.known(state)), number),
            fixed_tool=_MODES.get(text),
        )

    def _on_its_mechanism(self, variable: FrameVariable, number: float | None) -> FrameVariable:
        """A base of a set of frame parameters, given as if it stood still, on what carries it by $config.dat."""
        if not number:
            return variable
        base = f"BASE_DATA[{number:g}]"
        try:
            index = self._stated(f"MACHINE_FRAME_DAT[{number:g}]").value("MACH_DEF_INDEX")
        except Unresolved as trouble:
            changed = "MACHINE_FRAME_DAT" in self.data.refused
            return _unknown(f"what carries {base} is not known: {trouble}") if changed else variable
        if index is None:
            return _unknown(f"what carries {base} is not known: MACHINE_FRAME_DAT[{number:g}] has no MACH_DEF_INDEX")
        if index == 0:
            return variable
        try:
            machine = self._stated(f"MACHINE_DEF[{index:g}]")
        except Unresolved as trouble:
            return _unknown(f"what carries {base} is not known: {trouble}")
        kind, controller = machine.field("MECH_TYPE"), machine.value("COOP_KRC_INDEX")
        match "" if kind is None else kind.text.upper():
            case "#NONE":
                return variable
            case "#ROBOT" if controller == 1:
                return variable
            case "#EASYS" | "#EBSYS" | "#ECSYS" | "#EDSYS" | "#EESYS" | "#EFSYS" if controller == 1:
                return replace(variable, carrier=EXTERNAL_KINEMATIC)
            case _:
                text = (
                    f"{base} is carried by MACHINE_DEF[{index:g}], which is no external kinematic system of this robot"
                )
                return _unknown(f"{text}, and where it is this program does not tell")

    def _stated(self, name: str) -> Aggregate:
        """The structure that data lists state for a variable.

        Raises:
            Unresolved: none does, or the program changes it.
        """
        return self.data.find(name, self.names.module, self.names.routine).aggregate

    def after_assignment(self, state: State, line: Assignment, variables: Variables, by_function: bool) -> State:
        """The state behind an assignment, which makes variables what they are, perhaps by a function of the program."""
        if line.name == "FDAT_ACT":
            return self._with_parameters(state, line.value)
        if line.variable == "FDAT_ACT" and state.parameters is not None:
            return replace(state, parameters=_with_component(state.parameters, line, self.known(state)))
        if line.variable in ("$TOOL", "$BASE") and (by_function or line.name != line.variable):
            variable = self._with_own_component(line, variables)
            return replace(state, tool=variable) if line.variable == "$TOOL" else replace(state, base=variable)
        return self._after_setting(state, line.name, line.words)

    def _after_setting(self, state: State, name: str, words: tuple[Word, ...]) -> State:
        """The state behind a value for one of the controller's variables: of a line, or of one motion behind WITH."""
        known, function = self.known(state), _function(words)
        match name:
            case "$TOOL" | "$BASE" | "$IPO_MODE" if function in ("STOOL", "STOOL2", "SBASE", "SIPO_MODE"):
                return self._set_by(state, name, words)
            case "$TOOL":
                return replace(state, tool=self.of(words, "$TOOL", known))
            case "$BASE":
                return replace(state, base=self._base(words, known))
            case "$IPO_MODE":
                return replace(state, fixed_tool=_MODES.get("".join(word.upper for word in words)))
            case "$VEL" | "$VEL.CP" if function == "SVEL_CP":
                return replace(state, speed=_number(words[2:3], known))
            case "$VEL":
                stated = _structure(words)
                if stated is None:
                    return replace(state, speed=None, turn_speed=None)
                return replace(state, speed=stated.value("CP"), turn_speed=stated.value("ORI1"))
            case "$VEL.CP":
                return replace(state, speed=_number(words, known))
            case "$VEL.ORI1":
                return replace(state, turn_speed=_number(words, known))
            case "$APO" | "$APO.CDIS" | "$APO.CPTP":
                return replace(state, approximation=state.approximation.after_setting(name, words, known))
            case _:
                return state

    def _with_own_component(self, line: Assignment, variables: Variables) -> FrameVariable:
        """$TOOL or $BASE with a component that a line sets."""
        value = variables.get(self.names.key(line.variable))
        value = value.value if isinstance(value, Adjustable) else value
        if not isinstance(value, Aggregate):
            reason = value.reason if isinstance(value, Lost) else f"{line.name} is changed on its own"
            return _unknown(reason)
        try:
            return FrameVariable(frame=self._frame(line.variable, pose(value)))
        except Unresolved as trouble:
            return _unknown(trouble)

    def _with_parameters(self, state: State, value: Operand) -> State:
        part = value.parts[0] if len(value.parts) == 1 else None
        if part is None:
            return replace(state, parameters=None, parameters_reason="FDAT_ACT is not set to a set of parameters")
        try:
            stated = part if isinstance(part, Aggregate) else self._stated(part.name)
            return replace(state, parameters=stated)
        except Unresolved as trouble:
            return replace(state, parameters=None, parameters_reason=str(trouble))

    def after_bas(self, state: State, line: Call) -> State:
        """The state behind a call of BAS, the controller's routine for motion parameters (bas.src)."""
        known = self.known(state)
        state = replace(state, approximation=state.approximation.after_bas(line, known))
        number = _number(line.arguments[1], known) if len(line.arguments) > 1 else None
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
                return replace(state, tool=self.numbered("tool", number, known))
            case "#BASE":
                return replace(state, base=self.numbered("base", number, known))
            case "#EX_BASE":
                return replace(state, base=replace(self.numbered("base", number, known), carrier=EXTERNAL_KINEMATIC))
            case "#INITMOV":
                return self._initial(state)
            case _:
                return state

    def _initial(self, state: State) -> State:
        """The state behind BAS(#INITMOV): as the bas.src that was passed says; else tool and base are not known."""
        reset = state.lost("BAS(#INITMOV) resets tool and base before it", EVERYTHING - {"motion", "approximation"})
        tool, base = self.data.initial_frames
        known = self.known(state)
        if tool is not None:
            reset = replace(reset, tool=self.numbered("tool", tool, known))
        if base is not None:
            reset = replace(reset, base=self.numbered("base", base, known))
        return replace(reset, fixed_tool=False)

    def with_settings(self, state: State, settings: dict[str, tuple[Word, ...]]) -> State:
        """The state of one motion that sets tool, base or mode for itself."""
        for name, words in settings.items():
            state = self._after_setting(state, name, words)
        return state

    def _set_by(self, state: State, name: str, words: tuple[Word, ...]) -> State:
        """One of the inline forms' functions of a set of frame parameters, such as ``STOOL2(FP1)``."""
        try:
            parameters = self._stated(words[2].upper)
        except Unresolved as trouble:
            unknown = _unknown(trouble)
            return replace(state, tool=unknown, base=unknown, fixed_tool=None)
        set_by = self.of_parameters(state, parameters)
        match name:
            case "$TOOL":
                return replace(state, tool=set_by.tool)
            case "$BASE":
                # SBASE knows BASE_DATA alone
                text = f"SBASE sets a base that is carried by {set_by.base.carrier}; whether it then moves is not known"
                return replace(state, base=_unknown(text) if set_by.base.carrier else set_by.base)
            case _:
                return replace(state, fixed_tool=set_by.fixed_tool)

    def tool_and_part(self, state: State) -> tuple[Frame, Frame]:
        """Tool and part of a motion, as its poses mean them: what stands still is given in the robot's own base.

        Raises:
            Unresolved: the text does not tell them.
        """
        tool, base = state.tool, state.base
        if tool.frame is None or base.frame is None:  # names that have to be stated are said together
            reasons = list(dict.fromkeys(one.reason for one in (tool, base) if one.frame is None))
            raise Unresolved("; ".join(reasons) if all(map(NotInFiles.is_said, reasons)) else reasons[0])
        if state.fixed_tool is None:
            raise Unresolved("whether the robot holds tool or part ($IPO_MODE) is not stated before it")
        if not state.fixed_tool:
            return tool.frame, base.frame if base.carrier else self._standing(base.frame)
        if base.carrier or tool.carrier:
            raise Unresolved("$IPO_MODE is #TCP, and the base is one that moves")
        # With #TCP the part hangs on the flange; its frame is one of TOOL_DATA, the fixed tool one of BASE_DATA, whichever of
        # the two variables holds it: bas.src and hand-written programs differ in that
        if {tool.table, base.table} <= {"tool", "base", "null"} and tool.table != base.table:
            variable, standing = (tool, base) if tool.table == "tool" or base.table == "base" else (base, tool)
            assert variable.frame is not None
            assert standing.frame is not None
            return self._standing(standing.frame), variable.frame
        raise Unresolved(
            "$IPO_MODE is #TCP, and which frame is the part's and which the fixed tool's is not clear; take one from "
            "TOOL_DATA and one from BASE_DATA"
        )

    def _standing(self, frame: Frame) -> Frame:
        if self.data.robroot is None:
            return frame
        T = se3.inverse(self.robroot) @ frame.T
        return frame if np.array_equal(T, frame.T) else self._frame(frame.name, T)


def _with_component(parameters: Aggregate, line: Assignment, known: Known) -> Aggregate:
    """A set of parameters with one component as a line sets it: a number, or something that the text does not tell."""
    name, number = line.name.partition(".")[2], _number(line.words, known)
    return structure(parameters.type, {**values_of(parameters), name: line.text if number is None else number})


def _number(words: Sequence[Word], lookup: Lookup) -> float | None:
    try:
        return number_of(words, lookup)
    except Unresolved:
        return None
