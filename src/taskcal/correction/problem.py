"""What is to be corrected: the motions of a program, the path they ask for, and the robot as calibrated."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.program import Move
from taskcal.correction.controller import ControllerTrajectory
from taskcal.correction.frames import nominal_flange
from taskcal.correction.motion import DriveDirections
from taskcal.correction.path import Segments
from taskcal.correction.placement import Placed
from taskcal.identification.calibration import Calibration
from taskcal.robot.conditions import Conditions
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class CorrectionProblem:
    """What is to be corrected."""

    robot: Robot
    moves: Sequence[Move]
    calibration: Calibration
    placed: Placed
    """On the robot as calibrated."""
    wanted: Segments
    trajectory: ControllerTrajectory
    """Of the program as it was given, on the nominal robot."""
    directions: DriveDirections | None
    """Of the drives, where the calibration depends on them."""
    tolerance: float
    """Of the true tool's distance from its path between nodes, metres."""
    widest: float = 0.0
    """To how much that may be widened where the program would grow too much, metres; not at all where it is less."""

    @cached_property
    def is_circular(self) -> Bool[np.ndarray, " m"]:
        """Motions that have a via point, whether or not their start is known."""
        return np.array([move.via is not None for move in self.moves], dtype=bool)

    @cached_property
    def clear(self) -> Float[np.ndarray, "m 2"]:
        """Shares of the motions' lengths, from their starts and before their ends, in which no target may be put.

        A controller rounds a corner by no more than half of the way to the target next to it; a target that stood nearer would
        make the corner another one.
        """
        corners = self.trajectory.corners
        return 2.0 * np.stack([corners.entry.max(axis=1), corners.exit.max(axis=1)], axis=1)

    def seeds(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k joints"]:
        """Nominal joint positions along motions, between the samples of the controller's trajectory."""
        trajectory = self.trajectory
        if not len(move):
            return np.zeros((0, trajectory.end.shape[1]))
        rows = np.arange(len(self.moves))
        started = np.isfinite(trajectory.start[:, 0])
        ended = np.isfinite(trajectory.end[:, 0])
        place = np.concatenate([trajectory.move + trajectory.share, rows[started] + 1e-9, rows[ended] + 1.0 - 1e-9])
        q = np.concatenate([trajectory.q, trajectory.start[started], trajectory.end[ended]])
        order = np.argsort(place, kind="stable")
        at = move + np.clip(share, 2e-9, 1.0 - 2e-9)
        return np.stack([np.interp(at, place[order], column[order]) for column in q.T], axis=1)

    def conditions(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Conditions | None:
        """Under which the robot is there, at shares of the lengths of some motions."""
        return None if self.directions is None else self.directions.at(move, share)

    def controller_poses(
        self, move: Int[np.ndarray, " k"], q: Float[np.ndarray, "k joints"]
    ) -> Float[np.ndarray, "k 4 4"]:
        """Tool in part as the controller has it, for joint positions in some motions."""
        flange = nominal_flange(self.robot, q)
        T = np.empty_like(flange)
        for rows, example in self.by_placement(move):
            T[rows] = example.target(flange[rows])
        return T

    def by_placement(self, move: Int[np.ndarray, " k"]) -> list[tuple[Int[np.ndarray, " _"], Move]]:
        """Rows whose motions have tool and part in common, with one of these motions."""
        own = self.placed.number[move]
        return [(rows, self.moves[int(move[rows[0]])]) for rows in (np.flatnonzero(own == k) for k in np.unique(own))]
