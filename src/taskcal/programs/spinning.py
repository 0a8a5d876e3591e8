"""Spins for the targets of a program that leave them open."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.spin import choose_spin
from taskcal.programs.program import Move, Program, Target
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot


def with_spins(program: Program, robot: Robot) -> Program:
    """The program with the rotation about the tool's axis chosen wherever it leaves that open.

    Motions that follow each other get spins that the robot can go through without jumps, inside its limits; see
    `choose_spin`. What is written in the program's files does not change.

    Raises:
        ReachError: no rotations let the robot follow the motions; names the line.
    """
    moves = list(program.moves)
    for run in _runs(moves):
        targets = [target for k in run for target in _targets(moves[k])]
        first = moves[run[0]]
        T = np.stack([_pose(target) for target in targets])
        try:
            spun = choose_spin(ErrorModel(robot), first.part.T @ T, tip=se3.inverse(robot.T_flange_tool) @ first.tool.T)
        except ReachError as error:
            raise ReachError(f"{first.place}: of the motions from this line on: {error}") from error
        chosen = iter(se3.inverse(first.part.T) @ spun.T)
        for k in run:
            via = moves[k].via
            via = None if via is None else replace(via, T=next(chosen))
            moves[k] = replace(moves[k], via=via, end=replace(moves[k].end, T=next(chosen)))
    return replace(program, moves=tuple(moves))


def _runs(moves: Sequence[Move]) -> list[list[int]]:
    """Motions whose spin is open, in runs that follow each other with one tool and one part."""
    runs: list[list[int]] = []
    for k, move in enumerate(moves):
        if not move.end.free_spin:
            continue
        before = moves[k - 1]
        alike = move.tool is before.tool and move.part is before.part
        if runs and runs[-1][-1] == k - 1 and move.follows == k - 1 and alike:
            runs[-1].append(k)
        else:
            runs.append([k])
    return runs


def _targets(move: Move) -> list[Target]:
    return [move.end] if move.via is None else [move.via, move.end]


def _pose(target: Target) -> Float[np.ndarray, "4 4"]:
    if target.T is None:
        raise ValueError("joint positions leave no spin open")
    return target.T
