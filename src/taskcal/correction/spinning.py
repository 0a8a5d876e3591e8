"""Spins for the targets of a program that leave them open."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import Move, Program
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.spin import about_z, choose_spin
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

P = TypeVar("P", bound=Program)


def with_spins(program: P, robot: Robot) -> P:
    """The program with the rotation about the tool's axis chosen wherever it leaves that open.

    Motions that follow each other get spins that the robot can go through without jumps, inside its limits; see
    `choose_spin`. What is written in the program's files does not change.

    Raises:
        ReachError: no rotations let the robot follow the motions; names the line.
    """
    moves = list(program.moves)
    for run in _runs(moves):
        first = moves[run[0]]
        tip = se3.inverse(robot.T_flange_tool) @ first.tool.T
        try:
            spun = choose_spin(ErrorModel(robot), first.part.T @ _poses(moves, run), tip=tip)
        except ReachError as error:
            raise ReachError(f"{first.place}: of the motions from this line on: {error}") from error
        _place(moves, run, se3.inverse(first.part.T) @ spun.T)
    return replace(program, moves=tuple(moves))


def with_spins_near(program: P, paths: Sequence[Sequence[Float[np.ndarray, "4 4"] | None]]) -> P:
    """The program with the rotation about the tool's axis, where that is open, as near as it can be to that of other poses.

    Args:
        program: the program.
        paths: of each motion the poses of its via point, if it has one, and of its end; None where it goes to joint positions.
    """
    moves = list(program.moves)
    for k, path in enumerate(paths):
        if not moves[k].end.free_spin:
            continue
        T, wanted = _poses(moves, [k]), np.stack([pose for pose in path if pose is not None])
        x = (np.swapaxes(T[:, :3, :3], 1, 2) @ wanted[:, :3, :1])[:, :, 0]
        _place(moves, [k], T @ about_z(np.arctan2(x[:, 1], x[:, 0])))
    return replace(program, moves=tuple(moves))


def _runs(moves: Sequence[Move]) -> list[list[int]]:
    """Motions whose spin is open, in runs that follow each other with one tool and one part."""
    runs: list[list[int]] = []
    for k, move in enumerate(moves):
        if not (move.end.free_spin and move.tool.stated):
            continue
        before = moves[k - 1]
        same_frames = move.tool is before.tool and move.part is before.part
        if runs and runs[-1][-1] == k - 1 and move.follows == k - 1 and same_frames:
            runs[-1].append(k)
        else:
            runs.append([k])
    return runs


def _poses(moves: Sequence[Move], run: Sequence[int]) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the via points and the ends of some motions, in their order."""
    targets = [t for k in run for t in (moves[k].via, moves[k].end) if t is not None]
    return np.stack([target.T for target in targets if target.T is not None])


def _place(moves: list[Move], run: Sequence[int], T: Float[np.ndarray, "n 4 4"]) -> None:
    """Give some motions other poses, in the order of `_poses`."""
    poses = iter(T)
    for k in run:
        via = moves[k].via
        via = None if via is None else replace(via, T=next(poses))
        moves[k] = replace(moves[k], via=via, end=replace(moves[k].end, T=next(poses)))
