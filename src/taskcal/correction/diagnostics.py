"""What the user of a corrected program should know, by file and line."""

from collections.abc import Sequence

import numpy as np

from taskcal.correction.cell import Cell
from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.correction.joint_motion import TURN_SPEED, JointMotion
from taskcal.correction.rounded_path import RoundedPath
from taskcal.correction.subdivision import Subdivision
from taskcal.kinematics.tracing import NEARLY_SINGULAR
from taskcal.programs.program import Diagnostic, Move, Program
from taskcal.programs.source import Place, Source


def diagnose(
    program: Program,
    trajectory: ControllerTrajectory,
    new_trajectory: ControllerTrajectory,
    origin: Sequence[tuple[int, float, float]],
    written: Sequence[Move],
    subdivision: Subdivision,
    motion: JointMotion,
) -> tuple[Diagnostic, ...]:
    """What the user should know, by file and line.

    Args:
        program: as it was given.
        trajectory: the controller's, of that program.
        new_trajectory: the controller's, of the corrected program.
        origin: for each motion of the corrected program, the one it comes from, and the shares of its length.
        written: motions of the corrected program.
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
        elif move.kind in ("linear", "circular") and subdivision.pieces[i] and move.texts_motions > 1:
            text = f"stands for {move.texts_motions} motions, so that it is not divided: corrected at its points alone"
            out.append(Diagnostic(place=move.place, text=text))
        elif move.kind in ("linear", "circular") and subdivision.pieces[i] and not move.divisible:
            text = "does something once along its way, so that it is not divided: corrected at its points alone"
            out.append(Diagnostic(place=move.place, text=text))
    for i in np.flatnonzero(np.isfinite(subdivision.deviation) & (subdivision.deviation > subdivision.tolerance)):
        text = f"leaves its path by {subdivision.deviation[i] * 1e3:.3f} mm between corrected targets, however finely it is divided"
        if trajectory.corners.after[i] >= 0 or trajectory.corners.before[i] >= 0:
            text += "; its rounded corners stay clear of further targets"
        out.append(Diagnostic(place=moves[int(i)].place, text=text))
    unknown = [
        moves[i]
        for (i, _, end), move in zip(origin, written, strict=True)
        if end == 1.0 and not move.stops and move.zone is None
    ]
    if unknown:
        others = f", as {len(unknown) - 1} others do" if len(unknown) > 1 else ""
        text = (
            f"passes by its target in a corner whose size is not known{others}: assessed as if the tool went through the "
            "target"
        )
        out.append(Diagnostic(place=unknown[0].place, text=text))
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


def diagnose_new_corners(
    program: Program,
    trajectory: ControllerTrajectory,
    new_trajectory: ControllerTrajectory,
    origin: Sequence[tuple[int, float, float]],
) -> list[Diagnostic]:
    """Corners that a new program rounds, and the path that it was made of does not.

    Args:
        program: the path.
        trajectory: the controller's, of the path.
        new_trajectory: the controller's, of the new program.
        origin: for each of its motions, the one it comes from, and the shares of its length.
    """
    ends = [k for k, (i, _, end) in enumerate(origin) if end == 1.0 and trajectory.corners.after[i] < 0]
    rows = np.array([k for k in ends if new_trajectory.corners.after[k] >= 0], dtype=np.int64)
    if not len(rows):
        return []
    path = RoundedPath(segments=new_trajectory.segments, corners=new_trajectory.corners)
    past = np.linalg.norm((path.at(rows, np.ones(len(rows))) - path.segments.end[rows])[:, :3, 3], axis=1)
    worst = int(np.argmax(past))
    text = (
        f"the new program does not stop here, and passes by at {past[worst] * 1e3:.3f} mm, the farthest of {len(rows)} corners; "
        "where that is too far, let the motion stop"
    )
    return [Diagnostic(place=program.moves[origin[rows[worst]][0]].place, text=text)]


def diagnose_unchanged_files(program: Program, written: Sequence[Source]) -> list[Diagnostic]:
    """Files with motions, of several that are written together, in which nothing was corrected.

    Args:
        program: as it was given.
        written: its files as they are written, in the same order.
    """
    if len(written) < 2:
        return []
    moved = {str(move.place.path) for move in program.moves}
    return [
        Diagnostic(
            place=Place(path=new.path, line=1),
            text="no motion of this file was corrected; it is written with the others as it was read",
        )
        for old, new in zip(program.sources, written, strict=True)
        if old.text == new.text and str(new.path) in moved
    ]


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
