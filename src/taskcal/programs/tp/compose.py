"""A new TP program of motions to joint positions, such as a measuring program has."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from taskcal.errors import TaskcalError
from taskcal.programs.program import Move
from taskcal.programs.source import Source
from taskcal.programs.tp.position import joint_values, listed

NEWLINE = "\r\n"
"""As FANUC's controllers write it."""

LONGEST_NAME = 36
LONGEST_REMARK = 32


def compose_tp(
    name: str,
    moves: Sequence[Move],
    *,
    notes: Sequence[str] = (),
    wait_s: float = 0.0,
    joint_speed_percent: float = 10.0,
) -> Source:
    """A program of its own, ``name.ls``.

    Args:
        name: of the program.
        moves: its motions, to joint positions: to poses a program says the numbers of user frame and tool, which it cannot state.
        notes: a remark before each motion.
        wait_s: seconds to wait behind each motion that stops and waits.
        joint_speed_percent: of the axes' largest speeds.

    Raises:
        TaskcalError: TP cannot say it.
    """
    if not re.fullmatch(f"[A-Za-z][A-Za-z0-9_]{{0,{LONGEST_NAME - 1}}}", name):
        raise TaskcalError(
            f"'{name}' is not a name of a TP program; begin with a letter, and use at most {LONGEST_NAME} letters, digits and _"
        )
    positions: list[str] = []
    for number, move in enumerate(moves):
        if move.end.q is None:
            raise TaskcalError(
                f"motion {number} goes to a pose in '{move.part.name}'; a TP program does not state its frames, so that new ones "
                "are written of motions to joint positions only: correct a program that is there, or write another language"
            )
        positions.append(f"P[{number + 1}{listed((0, 0), joint_values(move.end.q), '', NEWLINE)}")
    instructions = list(_instructions(moves, notes, wait_s, joint_speed_percent))
    lines = [
        f"/PROG  {name.upper()}",
        "/ATTR",
        "OWNER\t\t= MNEDITOR;",
        f"LINE_COUNT\t= {len(instructions)};",
        "DEFAULT_GROUP\t= 1,*,*,*,*;",
        "/MN",
        *(f"{k + 1:4}:{text} ;" for k, text in enumerate(instructions)),
        "/POS",
        *positions,
        "/END",
    ]
    return Source(path=Path(f"{name}.ls"), text=NEWLINE.join(lines) + NEWLINE, encoding="utf-8")


def _instructions(moves: Sequence[Move], notes: Sequence[str], wait_s: float, percent: float) -> Iterator[str]:
    for i, move in enumerate(moves):
        if notes:
            yield f"  !{' '.join(notes[i].split())[:LONGEST_REMARK]}"
        yield f"J P[{i + 1}] {percent:g}% {'FINE' if move.stops else 'CNT100'}"
        if move.stops and move.waits and wait_s:
            yield f"  WAIT {wait_s:6.2f}(sec)"
