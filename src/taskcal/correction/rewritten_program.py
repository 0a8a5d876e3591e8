"""The corrected program: written, and read again from what was written."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from taskcal.correction.cell import Cell
from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.correction.mounting import mount
from taskcal.correction.new_program import compose_new_program
from taskcal.correction.read_back import check_reading
from taskcal.errors import TaskcalError
from taskcal.programs.languages import language_of
from taskcal.programs.program import Move, Program, Waypoint
from taskcal.programs.reading import parse_program
from taskcal.programs.source import Source
from taskcal.programs.spinning import with_spins_near
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class RewrittenProgram:
    """The corrected program."""

    sources: tuple[Source, ...]
    program: Program
    """As read again from its sources."""
    refused: dict[int, str]
    """Its motions of which it is not known where they lead."""
    pieces: Int[np.ndarray, " m"]
    """Into how many motions each of the given program became."""
    origin: tuple[tuple[int, float, float], ...]
    """For each of its motions, the one it comes from and the shares of that one's length where it begins and ends."""

    def near(self, trajectory: ControllerTrajectory) -> Float[np.ndarray, "m joints"]:
        """Where each of its motions ends, about, radians: in the target of the one it comes from, as the controller goes there."""
        return trajectory.end[[number for number, _, _ in self.origin]]


def rewrite_program(
    given: Program,
    program: Program,
    robot: Robot,
    cell: Cell,
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    trajectory: ControllerTrajectory,
    *,
    into: str | Path | None,
    tolerance: float,
) -> RewrittenProgram:
    """Write the corrected files, and read the program from them again.

    Args:
        given: the program as it was read, whose frames are those of the files.
        program: with its frames in the robot's base.
        robot: the robot.
        cell: where the robot stands, and what its external axes carry.
        waypoints: what to write, by number of the motion.
        trajectory: of the controller in the program.
        into: file of a new program; None to rewrite the program's own files.
        tolerance: how far a target may be off that goes with another one, metres.

    Raises:
        TaskcalError: it cannot be written, or does not read as what was written.
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
    pieces = np.array([len(waypoints.get(i, (1,))) for i in range(len(program.moves))], dtype=np.int64)
    origin = _origins(len(program.moves), waypoints)
    if len(origin) != len(again.moves):
        raise TaskcalError(
            f"the corrected program reads as {len(again.moves)} motions instead of {len(origin)}; nothing was written"
        )
    if into is None:
        again = with_spins_near(again, _wanted_poses(program, waypoints))
    mounted = mount(again, cell)
    if into is None:
        check_reading(mounted.program.moves, pieces, waypoints, tolerance)
    return RewrittenProgram(
        sources=sources, program=mounted.program, refused=mounted.refused, pieces=pieces, origin=origin
    )


def _wanted_poses(
    program: Program, waypoints: Mapping[int, tuple[Waypoint, ...]]
) -> list[list[Float[np.ndarray, "4 4"] | None]]:
    """Of each motion of a rewritten program, where its via point and its end were to be."""
    poses: list[list[Float[np.ndarray, "4 4"] | None]] = []
    for i, move in enumerate(program.moves):
        for wanted in waypoints.get(i, (move,)):
            end = wanted.end.T if isinstance(wanted, Move) else wanted.T
            poses.append([end] if wanted.via is None else [wanted.via.T, end])
    return poses


def _with_frames_of(given: Program, program: Program) -> Program:
    """A program with the frames as they were read, for a new program that counts them as that one did."""
    moves = tuple(
        replace(move, tool=read.tool, part=read.part) for move, read in zip(program.moves, given.moves, strict=True)
    )
    return replace(program, moves=moves)


def _origins(m: int, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[tuple[int, float, float], ...]:
    """For each motion of a rewritten program the one of m it comes from, and its shares where it begins and ends."""
    out: list[tuple[int, float, float]] = []
    for i in range(m):
        ends = [waypoint.share for waypoint in waypoints.get(i, ())] or [1.0]
        out += [(i, begin, end) for begin, end in zip([0.0, *ends[:-1]], ends, strict=True)]
    return tuple(out)
