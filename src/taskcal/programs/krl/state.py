"""What the lines of a KRL program before another one have set: tool, base, mode, speed, and where the robot is."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from taskcal.programs.krl.approximation import NOT_KNOWN, Approximation
from taskcal.programs.krl.syntax import Aggregate
from taskcal.programs.krl.variables import Holding, Variables, common
from taskcal.programs.program import Frame

Table = Literal["tool", "base", "null", "own"]
"""Where a frame comes from: TOOL_DATA, BASE_DATA, the zero frame, or the program's own."""

EVERYTHING = frozenset({"tool", "base", "mode", "parameters", "speed", "approximation", "motion"})
"""What lines can alter: $TOOL, $BASE, $IPO_MODE, FDAT_ACT, $VEL.CP, $APO, and where the robot is."""


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
    approximation: Approximation = NOT_KNOWN
    """$APO."""
    last: int | None = None
    """Number of the motion that ends where the robot is now; None where the text does not tell."""
    variables: Variables = field(default_factory=dict[str, Holding])
    """What code has assigned, as far as the text tells."""
    reached: bool = True
    """Whether control comes there."""
    armed: frozenset[tuple[int, int]] = frozenset()
    """Actions that may run at any time from here on, by file and first character of their line; see `beside`."""

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
            reached=self.reached,
            tool=unknown if "tool" in what else self.tool,
            base=unknown if "base" in what else self.base,
            fixed_tool=None if "mode" in what else self.fixed_tool,
            parameters=None if "parameters" in what else self.parameters,
            parameters_reason=reason if "parameters" in what else self.parameters_reason,
            speed=None if "speed" in what else self.speed,
            turn_speed=None if "speed" in what else self.turn_speed,
            approximation=NOT_KNOWN if "approximation" in what else self.approximation,
            last=None if "motion" in what else self.last,
            variables=self.variables,
            armed=self.armed,
        )


def differing(one: State, other: State) -> frozenset[str]:
    """What of `EVERYTHING` two states do not hold alike."""
    names = {
        "tool": "tool", "base": "base", "fixed_tool": "mode", "parameters": "parameters", "speed": "speed",
        "turn_speed": "speed", "approximation": "approximation", "last": "motion",
    }  # fmt: skip
    return frozenset(what for name, what in names.items() if getattr(one, name) != getattr(other, name))


NOWHERE = State(tool=Held(frame=None), base=Held(frame=None), reached=False)
"""Where control does not come."""


def merged(ways: Sequence[State], reason: str) -> State:
    """What holds after any of some ways through the program."""
    states = [state for state in ways if state.reached]
    if not states:
        return NOWHERE
    first = states[0]
    if len(states) == 1:
        return first
    same = {
        name: all(getattr(other, name) == getattr(first, name) for other in states)
        for name in ("tool", "base", "fixed_tool", "parameters", "speed", "turn_speed", "approximation", "last")
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
        approximation=first.approximation if same["approximation"] else NOT_KNOWN,
        last=first.last if same["last"] else None,
        variables=common(state.variables for state in states),
        armed=frozenset[tuple[int, int]]().union(*(state.armed for state in states)),
    )
