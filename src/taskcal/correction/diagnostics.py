"""What the user of a corrected program should know, by file and line."""

from collections.abc import Sequence

import numpy as np

from taskcal.correction.cell import Cell
from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.correction.joint_motion import TURN_SPEED, JointMotion
from taskcal.correction.subdivision import Subdivision
from taskcal.kinematics.tracing import NEARLY_SINGULAR
from taskcal.programs.program import Diagnostic, Program
from taskcal.programs.source import Place


def diagnose(
    program: Program,
    trajectory: ControllerTrajectory,
    new_trajectory: ControllerTrajectory,
    origin: Sequence[tuple[int, float, float]],
    subdivision: Subdivision,
    motion: JointMotion,
) -> tuple[Diagnostic, ...]:
    """What the user should know, by file and line.

    Args:
        program: as it was given.
        trajectory: the controller's, of that program.
        new_trajectory: the controller's, of the corrected program.
        origin: for each motion of the corrected program, the one it comes from, and the shares of its length.
        subdivision: the corrected motions.
        motion: how the corrected program moves the joints.
    """
    moves = program.moves
    out = list(program.diagnostics)
    out += [Diagnostic(place=moves[i].place, text=text) for i, text in sorted(trajectory.warnings.items())]
    for k, text in sorted(new_trajectory.rejected.items()):
        i = origin[k][0]
        if i not in trajectory.rejected:
            out.append(Diagnostic(place=moves[i].place, text=f"as corrected, {text}"))
    for i, move in enumerate(moves):
        if move.kind in ("linear", "circular") and subdivision.pieces[i] and np.isnan(trajectory.start[i, 0]):
            text = "begins where the text does not tell: corrected at its points, not looked at between them"
            out.append(Diagnostic(place=move.place, text=text))
        elif move.kind in ("linear", "circular") and subdivision.pieces[i] and not move.divisible:
            text = "does something once along its way, so that it is not divided: corrected at its points alone"
            out.append(Diagnostic(place=move.place, text=text))
    for i in np.flatnonzero(np.isfinite(subdivision.deviation) & (subdivision.deviation > subdivision.tolerance)):
        text = f"leaves its path by {subdivision.deviation[i] * 1e3:.3f} mm between corrected targets, however finely it is divided"
        out.append(Diagnostic(place=moves[int(i)].place, text=text))
    if motion.nearest_singular is not None and motion.conditioning < NEARLY_SINGULAR:
        out.append(
            Diagnostic(
                place=moves[origin[motion.nearest_singular][0]].place,
                text=f"passes near a singular posture (ratio {motion.conditioning:.3f}), where small corrections take large joint "
                "motions",
            )
        )
    if motion.turn_speed_assumed is not None:
        out.append(
            Diagnostic(
                place=moves[origin[motion.turn_speed_assumed][0]].place,
                text=f"states no reorientation speed; joint speeds are those at {np.degrees(TURN_SPEED):.0f}°/s from here on, "
                "wherever the path speed would turn the tool faster",
            )
        )
    for joint, speed, limit in zip(motion.robot.joint_names, motion.speed, motion.robot.speed_limits, strict=True):
        if speed > limit:
            text = f"{joint} would have to turn {speed / limit:.2f} times as fast as it can, at the programmed speed"
            out.append(Diagnostic(place=moves[0].place, text=text))
    return tuple(out)


def diagnose_unused_frames(cell: Cell, program: Program) -> list[Diagnostic]:
    """Tools and parts of the cell that no motion speaks of, which may be misspelled."""
    tools = {move.tool.name.casefold() for move in program.moves}
    parts = {move.part.name.casefold() for move in program.moves}
    toucher = {measured.touched_with.casefold() for measured in cell.parts.values()}
    place = Place(path=program.sources[0].path, line=1)
    out: list[Diagnostic] = []
    for kind, frames, used in (("tool", cell.tools, tools | toucher), ("part", cell.parts, parts)):
        for key, measured in frames.items():
            if key not in used:
                names = ", ".join(sorted(used - {""})) or "none"
                text = f"no motion has the cell's {kind} '{measured.name}'; the program's: {names}"
                out.append(Diagnostic(place=place, text=text))
    return out
