"""Bases that move: on external kinematic systems, on other robots and on conveyors.

KUKA's bas.src couples them so: EX_BASE sets ``$BASE=EK(root, kinematic system, frame)``, LK_BASE links ``$BASE`` to a
robot of another controller by ``LK(…)``, EB_BASE to a conveyor by ``EB(…)``; its FRAMES chooses by MACHINE_FRAME_DAT and
MACHINE_DEF of $config.dat.
"""

from collections.abc import Sequence
from dataclasses import replace

from taskcal.programs.krl.data import Data
from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.parser import arguments_of
from taskcal.programs.krl.state import Held
from taskcal.programs.krl.variables import Names
from taskcal.programs.unresolved import Unresolved

EXTERNAL_KINEMATIC = "an external kinematic system"

_STEERED_ELSEWHERE = {
    "LK": "is linked by LK to another robot, and where that is this program does not tell",
    "EB": "is linked by EB to a conveyor, and where that is this program does not tell",
}


def coupled(words: Sequence[Word]) -> tuple[Word, ...] | Held | None:
    """What ``$BASE`` is set to, where a function couples it to something that moves.

    Args:
        words: the value.

    Returns:
        The words of the frame in an external kinematic system, none where it is the system's own; why the base is not known; or
        None where nothing couples it.
    """
    function = words[0].upper if len(words) > 2 and words[1].text == "(" else ""
    if function in _STEERED_ELSEWHERE:
        return Held(frame=None, reason=f"$BASE {_STEERED_ELSEWHERE[function]}")
    if function != "EK":
        return None
    given = arguments_of(words[1:])
    if len(given) not in (2, 3) or _closing(words) != len(words) - 1:
        return Held(
            frame=None,
            reason="$BASE is set by EK in a way that is not understood; write EK(root, kinematic system, frame)",
        )
    return given[2] if len(given) == 3 else ()


def _closing(words: Sequence[Word]) -> int:
    """Where the first pair of parentheses ends."""
    depth = 0
    for i, word in enumerate(words):
        depth += (word.text == "(") - (word.text == ")")
        if depth == 0 and word.text == ")":
            return i
    return len(words)


def on_its_mechanism(held: Held, number: float | None, data: Data, names: Names) -> Held:
    """A base of a set of frame parameters on what carries it by $config.dat.

    Args:
        held: the base, as if it stood still.
        number: its number.
        data: the data lists.
        names: of the routine.
    """
    if not number:
        return held
    base = f"BASE_DATA[{number:g}]"
    try:
        index = data.find(f"MACHINE_FRAME_DAT[{number:g}]", names.module, names.routine).aggregate.value(
            "MACH_DEF_INDEX"
        )
    except Unresolved as trouble:
        changed = "MACHINE_FRAME_DAT" in data.refused
        return Held(frame=None, reason=f"what carries {base} is not known: {trouble}") if changed else held
    if index == 0:
        return held
    try:
        machine = data.find(f"MACHINE_DEF[{index or 0:g}]", names.module, names.routine).aggregate
    except Unresolved as trouble:
        return Held(frame=None, reason=f"what carries {base} is not known: {trouble}")
    kind, controller = machine.field("MECH_TYPE"), machine.value("COOP_KRC_INDEX")
    match "" if kind is None else kind.text.upper():
        case "#NONE":
            return held
        case "#ROBOT" if controller == 1:
            return held
        case "#EASYS" | "#EBSYS" | "#ECSYS" | "#EDSYS" | "#EESYS" | "#EFSYS" if controller == 1:
            return replace(held, carrier=EXTERNAL_KINEMATIC)
        case _:
            text = (
                f"{base} is carried by MACHINE_DEF[{index or 0:g}], which is no external kinematic system of this robot"
            )
            return Held(frame=None, reason=f"{text}, and where it is this program does not tell")
