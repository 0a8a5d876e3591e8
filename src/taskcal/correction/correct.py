"""Correcting a program: every target becomes the pose at which a nominal controller moves to the joints the true robot needs."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import expect_kinds
from taskcal.correction.assessment import assess
from taskcal.correction.cell import Cell
from taskcal.correction.controller_trajectory import ControllerTrajectory, simulate_controller
from taskcal.correction.correction import SHARE_OF_UNCERTAINTY, TOLERANCE, Bounds, Correction
from taskcal.correction.correction_problem import CorrectionProblem
from taskcal.correction.diagnostics import (
    diagnose,
    diagnose_new_corners,
    diagnose_unchanged_files,
    diagnose_unused_frames,
)
from taskcal.correction.drive_directions import DriveDirections, drive_directions, uses_directions
from taskcal.correction.error_budget import SOURCES, budget_of
from taskcal.correction.frame_calibration import FrameCalibration, calibrate_frames
from taskcal.correction.joint_motion import joint_motion
from taskcal.correction.mounting import Mounted, ask_for_base, base_statement, mount
from taskcal.correction.placement import Placed
from taskcal.correction.rewritten_program import rewrite_program
from taskcal.correction.rounded_path import RoundedPath
from taskcal.correction.segments import Segments
from taskcal.correction.subdivision import subdivide
from taskcal.correction.target_changes import target_changes
from taskcal.correction.waypoints import choose_waypoints
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration
from taskcal.programs.program import Diagnostic, Move, Program
from taskcal.programs.spinning import with_spins

MAX_REASONS = 3
"""Diagnostics that are shown where no motion could be resolved."""


def correct(
    calibration: Calibration,
    program: Program,
    *,
    cell: Cell | None = None,
    bounds: Bounds | None = None,
    into: str | Path | None = None,
    keep_joints: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Correction:
    """Correct a robot program by a calibration.

    Args:
        calibration: the robot that will run it.
        program: as it was written for the nominal robot. Where it leaves the rotation about the tool's axis open, one is
            chosen that the robot can follow.
        cell: what was measured of its tools and parts; by default all are where the controller has them.
        bounds: how far targets may be moved, and how well the tool keeps to its path between them.
        into: file in the language of whose suffix the corrected motions are written as a new program, RAPID, KRL or CSV; by default
            the program's own files are rewritten.
        keep_joints: leave motions to joint positions as they are, such as those to a home position that a cell checks.
        progress: told what is being done.

    Raises:
        TaskcalError: the program has no motion that is known; no rotation about the tool's axis lets the robot follow it; or
            what was measured does not fit.
    """
    expect_kinds({"calibration": Calibration, "program": Program}, calibration=calibration, program=program)
    expect_kinds({"cell": Cell | None, "bounds": Bounds | None}, cell=cell, bounds=bounds)
    cell, bounds, robot = cell or Cell(), bounds or Bounds(), calibration.model.robot
    _require_motion(program)
    progress("the joints of the nominal robot")
    given, mounted = program, mount(program, cell)
    program = with_spins(mounted.program, robot)
    moves = program.moves
    trajectory = simulate_controller(robot, moves, mounted.refused)
    frames, number = frames_on(calibration, moves, cell)
    directions = drive_directions(robot, moves, trajectory) if uses_directions(calibration.model) else None
    placed = place_motions(calibration, frames, number, directions)
    wanted = wanted_segments(trajectory, placed, moves)
    variances = variances_at(frames, number, trajectory, directions)
    progress("the joints of the calibrated robot")
    tolerance, widest = _tolerances(variances) if bounds.tolerance is None else (bounds.tolerance, 0.0)
    problem = CorrectionProblem(
        robot=robot, moves=moves, calibration=calibration, placed=placed, wanted=wanted, trajectory=trajectory,
        directions=directions, tolerance=tolerance, widest=widest,
    )  # fmt: skip
    subdivision = subdivide(problem)
    changes = target_changes(robot, subdivision, trajectory)
    waypoints, rejected = choose_waypoints(
        problem, subdivision, changes, bounds, keep_joints=keep_joints, program=program if into is None else None
    )
    progress("the corrected program")
    rewritten = rewrite_program(
        given, program, robot, cell, waypoints, trajectory, into=into, tolerance=subdivision.tolerance
    )
    written_moves, written = rewritten.program.moves, np.isin(np.arange(len(moves)), list(waypoints))
    new_trajectory = simulate_controller(robot, written_moves, rewritten.refused, rewritten.near(trajectory))
    motion = joint_motion(robot, written_moves, new_trajectory)
    path = RoundedPath(segments=wanted, corners=trajectory.corners)
    before, after = assess(placed, path, trajectory), assess(placed, path, new_trajectory, rewritten.origin)
    return Correction(
        program=program,
        sources=rewritten.sources,
        moves=written_moves,
        bounds=bounds,
        tolerance=subdivision.tolerance,
        wanted=path,
        before=before,
        after=after,
        budget=budget_of(before.length[before.at_target], after.length[after.at_target], variances),
        corrected=np.flatnonzero(written),
        pieces=rewritten.pieces,
        origin=rewritten.origin,
        shift=np.where(written, changes.shift, 0.0),
        turn=np.where(written, changes.turn, 0.0),
        uncertainty=np.sqrt(variances.sum(axis=1)),
        joint_change=np.where(written, changes.joint, 0.0),
        rejected=rejected,
        diagnostics=(
            *_diagnose_cell(given, program, cell, mounted, trajectory),
            *diagnose(program, trajectory, new_trajectory, rewritten.origin, written_moves, subdivision, motion),
            *([] if into is None else diagnose_new_corners(program, trajectory, new_trajectory, rewritten.origin)),
            *([] if into is not None else diagnose_unchanged_files(program, rewritten.sources)),
        ),
        statements=_statements(frames, given, cell),
        motion=motion,
    )


def _diagnose_cell(
    given: Program, program: Program, cell: Cell, mounted: Mounted, trajectory: ControllerTrajectory
) -> tuple[Diagnostic, ...]:
    """What the user should know of where the robot stands, and of the tools and parts around it."""
    return (
        *ask_for_base(given, cell, trajectory.out_of_reach),
        *mounted.diagnostics,
        *diagnose_unused_frames(cell, program),
    )


def _statements(frames: Sequence[FrameCalibration], given: Program, cell: Cell) -> tuple[str, ...]:
    """Relative to which frames, and with which tools, a program is accurate."""
    return tuple(filter(None, (*dict.fromkeys(frame.statement for frame in frames), base_statement(given, cell))))


def _tolerances(variances: Float[np.ndarray, "m sources"]) -> tuple[float, float]:
    """How near to their paths lines and arcs are to be, where nobody says it, and at the widest, metres.

    Args:
        variances: of what the calibration must expect at the targets, metres².
    """
    known = variances[np.isfinite(variances).all(axis=1)]
    rms = float(np.sqrt(known.sum(axis=1).mean())) if len(known) else 0.0
    return max(TOLERANCE, SHARE_OF_UNCERTAINTY * rms), rms


def _require_motion(program: Program) -> None:
    """See that a program has anything to correct.

    Raises:
        TaskcalError: none of its motions could be resolved; the message says why.
    """
    if not program.moves:
        why = "".join(f"; {diagnostic}" for diagnostic in program.diagnostics[:MAX_REASONS])
        raise TaskcalError(f"{program.sources[0].path} has no motion that could be resolved{why}")


def frames_on(
    calibration: Calibration, moves: Sequence[Move], cell: Cell
) -> tuple[list[FrameCalibration], Int[np.ndarray, " m"]]:
    """Calibrated frames of tools and parts, those in common once, and the number of every motion's."""
    numbers: dict[tuple[object, ...], int] = {}
    frames: list[FrameCalibration] = []
    own: list[int] = []
    for move in moves:
        key = (move.tool.name, move.tool.T.tobytes(), move.part.name, move.part.T.tobytes(), move.part_in_hand)
        if key not in numbers:
            numbers[key] = len(frames)
            frames.append(calibrate_frames(calibration, move, cell))
        own.append(numbers[key])
    return frames, np.array(own, dtype=np.int64)


def place_motions(
    calibration: Calibration,
    frames: Sequence[FrameCalibration],
    number: Int[np.ndarray, " m"],
    directions: DriveDirections | None,
) -> Placed:
    """The motions on the robot as calibrated, each drive coming from its side where the model tells one from the other."""

    def tool_in_base(
        q: Float[np.ndarray, "k joints"], move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, "k 4 4"]:
        return calibration.tool_in_base(q, None if directions is None else directions.at(move, share))

    placements = tuple(frame.placement for frame in frames)
    return Placed(tool_in_base=tool_in_base, placements=placements, number=number)


def wanted_segments(trajectory: ControllerTrajectory, placed: Placed, moves: Sequence[Move]) -> Segments:
    """The path of the tool on a robot: where tool or part changes, from where the tool before ended there."""
    m = len(moves)
    ended = np.isfinite(trajectory.end[:, 0])
    B = np.full((m, 4, 4), np.nan)
    rows = np.flatnonzero(ended)
    B[rows] = placed.robot_tool(rows, trajectory.segments.end[rows])
    start = np.full((m, 4, 4), np.nan)
    for i, move in enumerate(moves):
        if move.follows is not None and ended[move.follows]:
            start[i] = placed.placements[placed.number[i]].tool_in_part(B[move.follows][None])[0]
    return Segments(start=start, end=trajectory.segments.end, via=trajectory.segments.via)


def variances_at(
    frames: Sequence[FrameCalibration],
    number: Int[np.ndarray, " m"],
    trajectory: ControllerTrajectory,
    directions: DriveDirections | None,
) -> Float[np.ndarray, "m sources"]:
    """Mean square of the error in space that the calibration must expect at every target, by source, metres²."""
    variances = np.full((len(number), len(SOURCES)), np.nan)
    ended = np.isfinite(trajectory.end[:, 0])
    for k, frame in enumerate(frames):
        rows = np.flatnonzero(ended & (number == k))
        conditions = None if directions is None else directions.at(rows, np.ones(len(rows)))
        variances[rows] = frame.variances(trajectory.end[rows], conditions)
    return variances
