"""Correcting a program: every target becomes the pose at which a nominal controller moves to the joints the true robot needs."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import expect_kinds
from taskcal.correction.assessment import assess
from taskcal.correction.cell import Cell
from taskcal.correction.controller_trajectory import ControllerTrajectory, simulate_controller
from taskcal.correction.correction import SHARE_OF_UNCERTAINTY, TOLERANCE, Bounds, Correction
from taskcal.correction.correction_problem import CorrectionProblem
from taskcal.correction.diagnostics import diagnose, diagnose_unused_frames
from taskcal.correction.drive_directions import DriveDirections, drive_directions, uses_directions
from taskcal.correction.error_budget import SOURCES, budget_of
from taskcal.correction.frame_calibration import FrameCalibration, calibrate_frames
from taskcal.correction.joint_motion import joint_motion
from taskcal.correction.mounting import ask_for_base, base_statement, mount
from taskcal.correction.new_program import compose_new_program
from taskcal.correction.placement import Placed
from taskcal.correction.rejections import find_rejections
from taskcal.correction.segments import Segments
from taskcal.correction.subdivision import Subdivision, subdivide
from taskcal.correction.target_changes import TargetChanges, target_changes
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration
from taskcal.programs.languages import language_of
from taskcal.programs.program import Move, Program, Waypoint
from taskcal.programs.reading import parse_program
from taskcal.programs.source import Source
from taskcal.programs.spinning import with_spins
from taskcal.robot.robot import Robot

MAX_REASONS = 3
"""Diagnostics that are shown where no motion could be resolved."""

UNMOVED, UNTURNED = 1e-7, 1e-7
"""A target that moves and turns by less, metres and radians, keeps its text."""


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
    kept = {i for i, move in enumerate(moves) if keep_joints and move.kind == "axes"}
    rejected = trajectory.rejected | find_rejections(robot, subdivision, changes, bounds)
    rejected = {i: why for i, why in rejected.items() if i not in kept}
    waypoints = _waypoints(moves, subdivision, changes, kept | rejected.keys())
    progress("the corrected program")
    rewritten = _rewrite(given, program, robot, cell, waypoints, trajectory, into)
    new_trajectory = simulate_controller(robot, rewritten.program.moves, rewritten.refused)
    motion = joint_motion(robot, rewritten.program.moves, new_trajectory)
    before, after = assess(placed, wanted, trajectory), assess(placed, wanted, new_trajectory, rewritten.origin)
    written = np.isin(np.arange(len(moves)), list(waypoints))
    return Correction(
        program=program,
        sources=rewritten.sources,
        moves=rewritten.program.moves,
        bounds=bounds,
        tolerance=subdivision.tolerance,
        wanted=wanted,
        before=before,
        after=after,
        budget=budget_of(before.length[before.at_target], after.length[after.at_target], variances),
        corrected=np.flatnonzero(written),
        pieces=rewritten.pieces,
        shift=np.where(written, changes.shift, 0.0),
        turn=np.where(written, changes.turn, 0.0),
        uncertainty=np.sqrt(variances.sum(axis=1)),
        joint_change=np.where(written, changes.joint, 0.0),
        rejected=rejected,
        diagnostics=(
            *ask_for_base(given, cell, trajectory.out_of_reach),
            *mounted.diagnostics,
            *diagnose_unused_frames(cell, program),
            *diagnose(program, trajectory, new_trajectory, rewritten.origin, subdivision, motion),
        ),
        statements=tuple(
            filter(None, (*dict.fromkeys(frame.statement for frame in frames), base_statement(given, cell)))
        ),
        motion=motion,
    )


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


@dataclass(frozen=True, eq=False, kw_only=True)
class _Rewritten:
    """The corrected program."""

    sources: tuple[Source, ...]
    program: Program
    """As read again from its sources."""
    refused: dict[int, str]
    """Its motions of which it is not known where they lead."""
    pieces: Int[np.ndarray, " m"]
    """Into how many motions each of the given program became."""
    origin: Sequence[tuple[int, float, float]]
    """For each of its motions, the one it comes from and the shares of that one's length where it begins and ends."""


def _rewrite(
    given: Program,
    program: Program,
    robot: Robot,
    cell: Cell,
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    trajectory: ControllerTrajectory,
    into: str | Path | None,
) -> _Rewritten:
    """Write the corrected files, and read the program from them again.

    Args:
        given: the program as it was read, whose frames are those of the files.
        program: with its frames in the robot's base.
        robot: the robot.
        cell: where the robot stands, and what its external axes carry.
        waypoints: what to write, by number of the motion.
        trajectory: of the controller in the program.
        into: file of a new program.

    Raises:
        TaskcalError: it cannot be written, or reads as another number of motions than were written.
    """
    if into is None:
        sources = program.rewrite(robot, waypoints)
        again = program.reread(sources)
    else:
        first = given.moves[0]
        sources = (compose_new_program(Path(into), robot, _with_frames_of(given, program), waypoints, trajectory),)
        declares = language_of(Path(into)).declares_frames
        tool, part = (None, None) if declares else (first.tool, first.part)
        again = parse_program(sources, robot=robot, tool=tool, part=part)
    pieces = np.array([len(waypoints[i]) if i in waypoints else 1 for i in range(len(program.moves))], dtype=np.int64)
    origin = piece_origins(pieces)
    if len(origin) != len(again.moves):
        raise TaskcalError(
            f"the corrected program reads as {len(again.moves)} motions instead of {len(origin)}; nothing was written"
        )
    mounted = mount(again, cell)
    return _Rewritten(sources=sources, program=mounted.program, refused=mounted.refused, pieces=pieces, origin=origin)


def _with_frames_of(given: Program, program: Program) -> Program:
    """A program with the frames as they were read, for a new program that counts them as that one did."""
    moves = tuple(
        replace(move, tool=read.tool, part=read.part) for move, read in zip(program.moves, given.moves, strict=True)
    )
    return replace(program, moves=moves)


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


def _waypoints(
    moves: Sequence[Move], subdivision: Subdivision, changes: TargetChanges, kept: Set[int]
) -> dict[int, tuple[Waypoint, ...]]:
    """What is written for every motion that changes.

    Args:
        moves: the motions of the program.
        subdivision: as corrected.
        changes: how far that moves them.
        kept: numbers of motions that stay as they are.
    """
    nodes = subdivision.nodes
    first = np.searchsorted(nodes.move, np.arange(len(moves) + 1))
    waypoints: dict[int, tuple[Waypoint, ...]] = {}
    for i, move in enumerate(moves):
        rows = range(first[i], first[i + 1])
        unchanged = subdivision.pieces[i] == 1 and changes.shift[i] < UNMOVED and changes.turn[i] < UNTURNED
        if i in kept or not rows or unchanged:
            continue
        if move.kind == "axes":
            waypoints[i] = (Waypoint(kind="axes", q=nodes.q[rows[-1]], T=None),)
            continue
        if move.via is None:
            waypoints[i] = tuple(
                Waypoint(kind=move.kind, q=nodes.q[k], T=nodes.T[k], external=_external(moves, i, nodes.share[k]))
                for k in rows
            )
            continue
        waypoints[i] = tuple(
            Waypoint(
                kind="circular",
                q=nodes.q[k],
                T=nodes.T[k],
                via=Waypoint(kind="circular", q=nodes.q[k - 1], T=nodes.T[k - 1]),
                external=_external(moves, i, nodes.share[k]),
            )
            for k in rows[1::2]
        )
    return waypoints


def _external(moves: Sequence[Move], i: int, share: float) -> tuple[float, ...]:
    """Positions of the external axes at a share of a motion's length; empty where they stay, or their start is not known.

    A controller moves them in step with the way of the tool.
    """
    follows = moves[i].follows
    start, end = () if follows is None else moves[follows].external, moves[i].external
    if share >= 1.0 or start == end or len(start) != len(end):
        return ()
    return tuple(b if np.isnan(a) else a + share * (b - a) for a, b in zip(start, end, strict=True))


def piece_origins(pieces: Int[np.ndarray, " m"]) -> list[tuple[int, float, float]]:
    """For each motion of a rewritten program the one it comes from, and its shares, by how many each became."""
    return [(i, k / count, (k + 1) / count) for i, count in enumerate(pieces.tolist()) for k in range(count)]
