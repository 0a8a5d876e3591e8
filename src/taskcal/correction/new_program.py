"""Corrected motions as a new program, for tool paths that no controller reads as they are."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.errors import TaskcalError
from taskcal.programs.composing import compose_program
from taskcal.programs.languages import language_of
from taskcal.programs.program import Move, Program, Waypoint
from taskcal.programs.source import Source
from taskcal.robot.robot import Robot


def compose_new_program(
    into: Path,
    robot: Robot,
    program: Program,
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    trajectory: ControllerTrajectory,
) -> Source:
    """A new program of the corrected motions.

    Raises:
        TaskcalError: the program is more than its motions; a motion cannot be executed, so that nothing can be written for it;
            or its language cannot say it.
    """
    _check_plain(program)
    written: list[Move] = []
    q: list[np.ndarray] = []
    for i, move in enumerate(program.moves):
        if i not in waypoints:
            if i in trajectory.rejected:
                raise TaskcalError(f"{move.place}: {trajectory.rejected[i]}; a new program has no place for it")
            written.append(move)
            q.append(trajectory.end[i])
            continue
        for waypoint in waypoints[i]:
            end = replace(move.end, name="", T=waypoint.T, q=waypoint.q if waypoint.T is None else None, posture=None)
            via = None if waypoint.via is None else replace(end, T=waypoint.via.T)
            written.append(replace(move, kind=waypoint.kind, end=end, via=via))
            q.append(waypoint.q)
    return compose_program(into, robot, written, q=np.array(q))


def _check_plain(program: Program) -> None:
    """See that nothing but motions would be lost.

    Raises:
        TaskcalError: the program has logic, or parts that were not read.
    """
    path = program.sources[0].path
    language = language_of(path)
    if language.declares_frames:
        raise TaskcalError(
            f"{path} is {language.name}, whose logic a new program would lose; name an output of the same language"
        )
    if program.diagnostics:
        raise TaskcalError(
            f"{program.diagnostics[0]}; a new program would lose it: take it out of the path, or read it"
        )
