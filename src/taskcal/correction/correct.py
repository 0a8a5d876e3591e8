"""Correcting a program: every target becomes the pose that makes a nominal controller drive the joints the true robot needs."""

from collections.abc import Callable, Mapping, Sequence, Set
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import expect_kinds
from taskcal.correction.afresh import compose_afresh
from taskcal.correction.assessment import assess
from taskcal.correction.cell import Cell
from taskcal.correction.chords import Chords, Wish, cut
from taskcal.correction.controller import Driven, drive
from taskcal.correction.correction import Bounds, Correction
from taskcal.correction.error_budget import SOURCES, budget_of
from taskcal.correction.frame_calibration import FrameCalibration, calibrate_frames
from taskcal.correction.motion import move_joints
from taskcal.correction.placement import Placed
from taskcal.correction.refusals import refuse
from taskcal.correction.remarks import remark, remark_unused
from taskcal.correction.way import Ways
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.programs.languages import language_of
from taskcal.programs.program import Move, Program, Waypoint
from taskcal.programs.reading import parse_program
from taskcal.programs.source import Source
from taskcal.programs.spinning import with_spins
from taskcal.robot.robot import Robot

REASONS = 3
"""Remarks that are shown where no motion could be resolved."""

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
        bounds: how far targets may be moved, and how well the tool keeps to its way between them.
        into: file in the language of whose suffix the corrected motions are written afresh, RAPID, KRL or CSV; by default
            the program's own files are rewritten.
        keep_joints: leave motions to joint positions as they are, such as those to a home position that a cell checks.
        progress: told what is being done.

    Raises:
        TaskcalError: the program has no motion that is known; no rotation about the tool's axis lets the robot follow it; or
            what was measured does not fit.
    """
    expect_kinds({"calibration": Calibration, "program": Program}, calibration=calibration, program=program)
    cell, bounds, robot = cell or Cell(), bounds or Bounds(), calibration.model.robot
    if not program.moves:
        why = "".join(f"; {remark}" for remark in program.remarks[:REASONS])
        raise TaskcalError(f"{program.sources[0].path} has no motion that could be resolved{why}")
    progress("the joints of the nominal robot")
    program = with_spins(program, robot)
    moves = program.moves
    driven = drive(robot, moves)
    frames, number = _frames(calibration, moves, cell)
    placed = Placed(
        tool_in_base=calibration.tool_in_base,
        placements=tuple(frame.placement for frame in frames),
        number=number,
    )
    wanted = wanted_ways(driven, placed, moves)
    progress("the joints of the calibrated robot")
    chords = cut(
        Wish(
            robot=robot,
            moves=moves,
            calibration=calibration,
            placed=placed,
            wanted=wanted,
            driven=driven,
            tolerance=bounds.tolerance,
        )
    )
    shift, turn = _changes(chords, len(moves))
    joint_change = _joint_changes(robot, chords, driven)
    left = {i for i, move in enumerate(moves) if keep_joints and move.kind == "axes"}
    refused = driven.refused | refuse(robot, chords, shift, turn, joint_change, bounds)
    refused = {i: why for i, why in refused.items() if i not in left}
    ways = _waypoints(moves, chords, shift, turn, left | refused.keys())
    progress("the corrected program")
    sources, again = _rewritten(program, robot, ways, driven, into)
    pieces = np.array([len(ways[i]) if i in ways else 1 for i in range(len(moves))], dtype=np.int64)
    origin = piece_origins(pieces)
    if len(origin) != len(again.moves):
        raise TaskcalError(
            f"the corrected program reads as {len(again.moves)} motions instead of {len(origin)}; nothing was written"
        )
    redriven = drive(robot, again.moves)
    motion = move_joints(robot, again.moves, redriven)
    before, after = assess(placed, wanted, driven), assess(placed, wanted, redriven, origin)
    variances = _variances(frames, number, driven)
    written = np.isin(np.arange(len(moves)), list(ways))
    return Correction(
        program=program,
        sources=sources,
        moves=again.moves,
        bounds=bounds,
        wanted=wanted,
        before=before,
        after=after,
        budget=budget_of(before.length[before.at_target], after.length[after.at_target], variances),
        corrected=np.flatnonzero(written),
        pieces=pieces,
        shift=np.where(written, shift, 0.0),
        turn=np.where(written, turn, 0.0),
        uncertainty=np.sqrt(variances.sum(axis=1)),
        joint_change=np.where(written, joint_change, 0.0),
        refused=refused,
        remarks=(*remark_unused(cell, program), *remark(program, driven, redriven, origin, chords, bounds, motion)),
        statements=tuple(dict.fromkeys(frame.statement for frame in frames)),
        motion=motion,
    )


def _rewritten(
    program: Program,
    robot: Robot,
    ways: Mapping[int, tuple[Waypoint, ...]],
    driven: Driven,
    into: str | Path | None,
) -> tuple[tuple[Source, ...], Program]:
    """The corrected files, and the program that reads from them."""
    if into is None:
        sources = program.rewrite(robot, ways)
        return sources, program.reread(sources)
    first = program.moves[0]
    sources = (compose_afresh(Path(into), robot, program, ways, driven),)
    tools = {} if language_of(Path(into)).declares_frames else {"tool": first.tool, "part": first.part}
    return sources, parse_program(sources, robot=robot, **tools)


def _joint_changes(robot: Robot, chords: Chords, driven: Driven) -> Float[np.ndarray, " m"]:
    """Largest change of a revolute joint at every target, radians; NaN where it is not known."""
    out = np.full(len(driven.end), np.nan)
    ends = chords.nodes.share == 1.0
    move = chords.nodes.move[ends]
    turning = [j for j, slides in enumerate(robot.prismatic) if not slides]
    out[move] = np.abs(chords.nodes.q[ends] - driven.end[move])[:, turning].max(axis=1, initial=0.0)
    return out


def _frames(
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


def wanted_ways(driven: Driven, placed: Placed, moves: Sequence[Move]) -> Ways:
    """The ways that the tool is to go on a robot: where tool or part changes, from where the tool before ended there."""
    m = len(moves)
    ended = np.isfinite(driven.end[:, 0])
    B = np.full((m, 4, 4), np.nan)
    rows = np.flatnonzero(ended)
    B[rows] = placed.robot_tool(rows, driven.ways.end[rows])
    start = np.full((m, 4, 4), np.nan)
    for i, move in enumerate(moves):
        if move.follows is not None and ended[move.follows]:
            start[i] = placed.placements[placed.number[i]].tool_in_part(B[move.follows][None])[0]
    return Ways(start=start, end=driven.ways.end, via=driven.ways.via)


def _variances(
    frames: Sequence[FrameCalibration], number: Int[np.ndarray, " m"], driven: Driven
) -> Float[np.ndarray, "m sources"]:
    """Mean square of the error in space that the calibration must expect at every target, by source, metres²."""
    out = np.full((len(number), len(SOURCES)), np.nan)
    ended = np.isfinite(driven.end[:, 0])
    for k, frame in enumerate(frames):
        rows = np.flatnonzero(ended & (number == k))
        out[rows] = frame.variances(driven.end[rows])
    return out


def _changes(chords: Chords, m: int) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """How far the nodes of every motion are moved and turned from where the tool is wanted."""
    nodes = chords.nodes
    shift, turn = np.zeros(m), np.zeros(m)
    np.maximum.at(shift, nodes.move, np.linalg.norm(nodes.T[:, :3, 3] - nodes.wanted[:, :3, 3], axis=1))
    angle = np.linalg.norm(se3.log(nodes.T[:, :3, :3] @ np.swapaxes(nodes.wanted[:, :3, :3], 1, 2)), axis=1)
    np.maximum.at(turn, nodes.move, angle)
    return shift, turn


def _waypoints(
    moves: Sequence[Move],
    chords: Chords,
    shift: Float[np.ndarray, " m"],
    turn: Float[np.ndarray, " m"],
    left: Set[int],
) -> dict[int, tuple[Waypoint, ...]]:
    """What is written for every motion that changes."""
    nodes = chords.nodes
    first = np.searchsorted(nodes.move, np.arange(len(moves) + 1))
    out: dict[int, tuple[Waypoint, ...]] = {}
    for i, move in enumerate(moves):
        rows = range(first[i], first[i + 1])
        unchanged = chords.pieces[i] == 1 and shift[i] < UNMOVED and turn[i] < UNTURNED
        if i in left or not rows or unchanged:
            continue
        if move.kind == "axes":
            out[i] = (Waypoint(kind="axes", q=nodes.q[rows[-1]], T=None),)
            continue
        if move.via is None:
            out[i] = tuple(Waypoint(kind=move.kind, q=nodes.q[k], T=nodes.T[k]) for k in rows)
            continue
        out[i] = tuple(
            Waypoint(
                kind="circular",
                q=nodes.q[k],
                T=nodes.T[k],
                via=Waypoint(kind="circular", q=nodes.q[k - 1], T=nodes.T[k - 1]),
            )
            for k in rows[1::2]
        )
    return out


def piece_origins(pieces: Int[np.ndarray, " m"]) -> list[tuple[int, float, float]]:
    """For each motion of a rewritten program the one it comes from, and its shares, by how many each became."""
    return [(i, k / count, (k + 1) / count) for i, count in enumerate(pieces.tolist()) for k in range(count)]
