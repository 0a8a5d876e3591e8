"""In which direction each drive turns along a program: it decides on which side of its lost motion the drive stands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.programs.program import Move
from taskcal.robot.approach import MAX_REST_MOTION, drive_motion
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

BEFORE_END = 1e-9
"""Share of a motion before its end, which is its own place and not the start of the next motion."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveDirections:
    """In which direction each drive turned last, along the motions of a program."""

    place: Float[np.ndarray, " k"]
    """Of each sample, in order: number of its motion plus the share of that motion's length."""
    approach: Float[np.ndarray, "k joints"]
    """As in `Conditions`: 1 where the joint's value grew, −1 where it fell, 0 where unknown, between them at a reversal."""

    def at(self, move: Int[np.ndarray, " n"], share: Float[np.ndarray, " n"]) -> Conditions:
        """The conditions at shares of the lengths of some motions; from one sample to the next a drive turns over evenly."""
        place = move + np.clip(share, 0.0, 1.0 - BEFORE_END)
        if not len(self.place):
            return Conditions(approach=np.zeros((len(place), self.approach.shape[1])))
        columns = [np.interp(place, self.place, column) for column in self.approach.T]
        return Conditions(approach=np.stack(columns, axis=1))


def uses_directions(model: ErrorModel) -> bool:
    """Whether an effect of the model depends on the direction in which a drive turned last."""
    return any("approach" in (*effect.needs, *effect.uses) for effect in model.effects)


def drive_directions(robot: Robot, moves: Sequence[Move], trajectory: ControllerTrajectory) -> DriveDirections:
    """Follow the drives through a program.

    A drive has turned over when it has gone back by twice `MAX_REST_MOTION`; less is what a controller reports of a joint
    at rest. Where it is not known from where a motion begins, directions are unknown until the drives turn.

    Args:
        robot: as its controller knows it.
        moves: the motions.
        trajectory: of the controller in them.
    """
    number = np.arange(len(moves))
    started = np.flatnonzero(np.isfinite(trajectory.start[:, 0]))
    alone = np.flatnonzero(np.isfinite(trajectory.end[:, 0]) & ~np.isin(number, trajectory.move))
    along = trajectory.move + np.minimum(trajectory.share, 1.0 - BEFORE_END)
    place = np.concatenate([started, along, alone + 1.0 - BEFORE_END])
    q = np.concatenate([trajectory.start[started], trajectory.q, trajectory.passes[alone]])
    order = np.argsort(place, kind="stable")
    place, turned = place[order], q[order] @ drive_motion(robot).T
    of_move = place.astype(np.int64)
    continues = np.array(
        [move.follows is not None and move.follows == i - 1 for i, move in enumerate(moves)], dtype=bool
    )
    first = np.diff(of_move, prepend=-1) > 0
    gap = first & ~continues[of_move]
    step = np.diff(turned, axis=0, prepend=turned[:1])
    approach = np.zeros_like(turned)
    for i in range(len(turned)):
        if not gap[i] and i:
            approach[i] = np.clip(approach[i - 1] + step[i] / MAX_REST_MOTION, -1.0, 1.0)
    return DriveDirections(place=place, approach=approach)
