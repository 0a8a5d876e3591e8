"""What the user of a corrected program should know, by file and line."""

from collections.abc import Sequence

import numpy as np

from taskcal.correction.cell import Cell
from taskcal.correction.chords import Chords
from taskcal.correction.controller import Driven
from taskcal.correction.correction import Bounds
from taskcal.correction.motion import SINGULAR, TURN_SPEED, JointMotion
from taskcal.programs.program import Program, Remark
from taskcal.programs.source import Place


def remark(
    program: Program,
    driven: Driven,
    redriven: Driven,
    origin: Sequence[tuple[int, float, float]],
    chords: Chords,
    bounds: Bounds,
    motion: JointMotion,
) -> tuple[Remark, ...]:
    """What the user should know, by file and line."""
    moves = program.moves
    out = list(program.remarks)
    out += [Remark(place=moves[i].place, text=text) for i, text in sorted(driven.warnings.items())]
    for k, text in sorted(redriven.refused.items()):
        i = origin[k][0]
        if i not in driven.refused:
            out.append(Remark(place=moves[i].place, text=f"as corrected, {text}"))
    for i, move in enumerate(moves):
        if move.kind in ("linear", "circular") and chords.pieces[i] and np.isnan(driven.start[i, 0]):
            text = "begins where the text does not tell: corrected at its points, not looked at between them"
            out.append(Remark(place=move.place, text=text))
    for i in np.flatnonzero(np.isfinite(chords.deviation) & (chords.deviation > bounds.tolerance)):
        text = (
            f"leaves its way by {chords.deviation[i] * 1e3:.3f} mm between corrected targets, however finely it is cut"
        )
        out.append(Remark(place=moves[int(i)].place, text=text))
    if motion.nearest_singular is not None and motion.conditioning < SINGULAR:
        out.append(
            Remark(
                place=moves[origin[motion.nearest_singular][0]].place,
                text=f"passes near a singular posture (ratio {motion.conditioning:.3f}), where small corrections take large joint "
                "motions",
            )
        )
    if motion.turn_speed_assumed is not None:
        out.append(
            Remark(
                place=moves[origin[motion.turn_speed_assumed][0]].place,
                text=f"states no reorientation speed; joint speeds are those at {np.degrees(TURN_SPEED):.0f}°/s from here on, "
                "wherever the path speed would turn the tool faster",
            )
        )
    for joint, speed, limit in zip(motion.robot.joint_names, motion.speed, motion.robot.speed_limits, strict=True):
        if speed > limit:
            text = f"{joint} would have to turn {speed / limit:.2f} times as fast as it can, at the programmed speed"
            out.append(Remark(place=moves[0].place, text=text))
    return tuple(out)


def remark_unused(cell: Cell, program: Program) -> list[Remark]:
    """Tools and parts of the cell that no motion speaks of, which may be misspelled."""
    tools = {move.tool.name.casefold() for move in program.moves}
    parts = {move.part.name.casefold() for move in program.moves}
    toucher = {measured.touched_with.casefold() for measured in cell.parts.values()}
    place = Place(path=program.sources[0].path, line=1)
    out: list[Remark] = []
    for kind, known, used in (("tool", cell.tools, tools | toucher), ("part", cell.parts, parts)):
        for key, measured in known.items():
            if key not in used:
                names = ", ".join(sorted(used - {""})) or "none"
                text = f"no motion has the cell's {kind} '{measured.name}'; the program's: {names}"
                out.append(Remark(place=place, text=text))
    return out
