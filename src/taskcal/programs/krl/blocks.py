"""Blocks of a KRL routine: what holds where their branches begin and end."""

from dataclasses import dataclass, field

from taskcal.programs.krl.parser import BLOCKS
from taskcal.programs.krl.state import State
from taskcal.programs.krl.syntax import Control, Statement

SPLINES = {"SPLINE", "PTP_SPLINE"}
LOOPS = {"FOR", "WHILE", "REPEAT", "LOOP"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Block:
    """A block that is open at a line."""

    keyword: str
    entry: State
    exits: list[State] = field(default_factory=list[State])
    """At the ends of its branches so far, and where a loop is left."""
    has_default: list[bool] = field(default_factory=list[bool])
    condition: bool | None = None
    """Of an IF, where the text tells it."""


def decided(block: Block, state: State) -> State:
    """What holds behind an IF whose condition the text tells."""
    if block.condition:
        return block.exits[0] if block.exits else state
    return state if block.exits else block.entry


def body_of(lines: tuple[Statement, ...], number: int) -> tuple[Statement, ...]:
    """The lines of a loop that starts at a line."""
    depth = 0
    for i in range(number, len(lines)):
        line = lines[i]
        if isinstance(line, Control):
            depth += (line.keyword in BLOCKS) - (line.keyword in set(BLOCKS.values()))
            if depth == 0:
                return lines[number:i]
    return lines[number:]
