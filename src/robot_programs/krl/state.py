"""What the lines of a KRL program before another one have set: tool, base, mode, speed, and where the robot is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

from robot_programs.core import flow
from robot_programs.core.program import THROUGH_TARGET, Frame, MoveKind, Unresolved, Zone
from robot_programs.krl.syntax import Aggregate, Assignment, Call, Word
from robot_programs.krl.values import AbstractValue, Known, Variables, common, number_of

# Where a KRL motion may be left for the next one: $APO, and who sets it.
#
# KUKA's bas.src sets $APO from the parameter sets of the inline forms, and to DEF_APO_CDIS and DEF_APO_CPTP at
# BAS(#INITMOV).

WHOLE_PERCENT = 200.0
"""At $APO.CPTP = 100 % approximation begins in the middle of the motion (KST PLC mxAutomation Logix, structure APO)."""


@dataclass(frozen=True, kw_only=True)
class Approximation:
    """What $APO holds; None where the text does not tell."""

    distance: float | None = None
    """CDIS, millimetres."""
    share: float | None = None
    """CPTP, percent."""

    def zone(self, passing: Sequence[str], kind: MoveKind) -> Zone | None:
        """How near a motion passes by its target; None where the text does not tell.

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

    def after_assignment(self, line: Assignment, known: Known) -> "Approximation":
        """Behind an assignment."""
        match line.name:
            case "$APO.CDIS":
                return replace(self, distance=_size(line.words, known))
            case "$APO.CPTP":
                return replace(self, share=_size(line.words, known))
            case "$APO":
                part = line.value.parts[0] if len(line.value.parts) == 1 else None
                if not isinstance(part, Aggregate):
                    return Approximation()
                own, other = part.value("CDIS"), part.value("CPTP")
                return Approximation(
                    distance=self.distance if own is None else own, share=self.share if other is None else other
                )
            case _:
                return self

    def after_bas(self, line: Call, known: Known) -> "Approximation":
        """Behind a call of BAS."""
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

    def of_motion(self, name: str, words: Sequence[Word], known: Known) -> "Approximation":
        """For one motion, which sets some of it behind WITH."""
        if name == "$APO.CDIS":
            return replace(self, distance=_size(words, known))
        if name == "$APO.CPTP":
            return replace(self, share=_size(words, known))
        if name == "$APO":
            function = words[0].upper if len(words) > 2 and words[1].text == "(" else ""
            return Approximation(
                distance=_component(words[2].upper, known)[0] if function in ("SAPO", "SAPO_PTP") else None
            )
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


def _size(words: Sequence[Word], known: Known) -> float | None:
    try:
        return _positive(number_of(words, known))
    except Unresolved:
        return None


def _positive(value: float | bool | None) -> float | None:
    return None if value is None or isinstance(value, bool) or value < 0.0 else float(value)


Table = Literal["tool", "base", "null", "own"]
"""Where a frame comes from: TOOL_DATA, BASE_DATA, the zero frame, or the program's own."""

EVERYTHING = frozenset({"tool", "base", "mode", "parameters", "speed", "approximation", "motion"})
"""What lines can alter: $TOOL, $BASE, $IPO_MODE, FDAT_ACT, $VEL.CP, $APO, and where the robot is."""


@dataclass(frozen=True, kw_only=True)
class FrameVariable:
    """What a frame variable holds."""

    frame: Frame | None
    """None where the text does not tell."""
    table: Table = "own"
    reason: str = ""
    """Why it does not tell."""
    carrier: str = ""
    """What moves it; empty where it stands still."""


@dataclass(frozen=True, kw_only=True)
class State(flow.State):
    """What the lines before have set."""

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
    variables: Variables = field(default_factory=dict[str, AbstractValue])
    """What code has assigned, as far as the text tells."""
    armed: frozenset[tuple[int, int]] = frozenset()
    """Actions that may run at any time from here on, by file and first character of their line."""

    @classmethod
    def unset(cls) -> "State":
        """At the start of a program that nothing calls."""
        return cls(
            tool=FrameVariable(frame=None, reason="$TOOL is not set before it"),
            base=FrameVariable(frame=None, reason="$BASE is not set before it"),
        )

    def forgotten(self, reason: str, what: frozenset[str] = EVERYTHING) -> Self:
        """Where some of `EVERYTHING` may have become anything."""
        fields = [name for name, group in _GROUPS.items() if group in what]
        return self._unknown(fields, reason) if fields else self

    def joined(self, others: Sequence[Self], why: str) -> Self:
        """What holds behind any of several ways; see `flow.State.joined`."""
        differing = [name for name in _GROUPS if any(getattr(self, name) != getattr(other, name) for other in others)]
        states = (self, *others)
        return replace(
            self._unknown(differing, why),
            variables=common(state.variables for state in states),
            armed=frozenset[tuple[int, int]]().union(*(state.armed for state in states)),
        )

    def agrees(self, other: Self) -> bool:
        """Whether the same holds."""
        return self == other

    def lost_in(self, joined: Self) -> tuple[frozenset[str], frozenset[str]]:
        """What of `EVERYTHING`, and which variables, do not hold any more in a state that was joined from this one."""
        what = {group for name, group in _GROUPS.items() if getattr(self, name) != getattr(joined, name)}
        return frozenset(what), frozenset(self.variables.keys() - joined.variables.keys())

    def without(self, lost: tuple[frozenset[str], frozenset[str]] | None, why: str) -> Self:
        """What holds without what `lost_in` gave."""
        what, keys = lost or (frozenset[str](), frozenset[str]())
        if not what and not keys:
            return self
        variables = {key: value for key, value in self.variables.items() if key not in keys}
        return replace(self.forgotten(why, what), variables=variables)

    def _unknown(self, fields: Sequence[str], reason: str) -> Self:
        unknown = FrameVariable(frame=None, reason=reason)
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

NOWHERE = State(tool=FrameVariable(frame=None), base=FrameVariable(frame=None), reached=False)
"""Where control does not come."""
