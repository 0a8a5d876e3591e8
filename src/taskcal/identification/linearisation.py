"""A campaign's residuals and their derivatives at an estimate, as one dense block a pose."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.geometry import walk
from taskcal.geometry.observations import Walked
from taskcal.identification.kept_rows import by_entry, tracker_rows
from taskcal.identification.problem import Problem


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearisation:
    """What every pose says; m numbers a pose, those of its targets one behind another, zero where a beam was lost."""

    residual: Float[np.ndarray, "n m"]
    """Measured less predicted in the tracker frame, metres (then radians, for poses)."""
    by_entry: Float[np.ndarray, "n m z"]
    """Derivative of what is predicted by the entries of z."""
    by_joint: Float[np.ndarray, "n m joints"]
    """Derivative of what is predicted by the joints' true positions."""
    seen: Bool[np.ndarray, "n m"]

    def take(self, rows: Int[np.ndarray, " k"]) -> "Linearisation":
        """Some of the poses."""
        return Linearisation(
            residual=self.residual[rows],
            by_entry=self.by_entry[rows],
            by_joint=self.by_joint[rows],
            seen=self.seen[rows],
        )


def linearise_rows(problem: Problem, z: Float[np.ndarray, " z"]) -> Linearisation:
    """The rows of a problem about an estimate.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    if problem.kinds:
        return _linearise_kinds(problem, z)
    at, pose = problem.walked(z), problem.frames.pose
    joints = len(problem.frames.model.robot.joints)
    residual, by_z = tracker_rows(at, problem.seen)
    n, _, width = residual.shape
    moved = [joint_columns(at, offset, angular=pose)[:, :, :joints] for offset in at.points.position]
    if pose:
        moved[0][:, 3:] = at.points.turn @ moved[0][:, 3:]
    seen = np.repeat(problem.seen.valid, width, axis=1)
    made = (residual.reshape(n, -1), by_z.reshape(n, seen.shape[1], -1), np.concatenate(moved, axis=1))
    for array in made:
        array[~seen] = 0.0
    return Linearisation(residual=made[0], by_entry=made[1], by_joint=made[2], seen=seen)


def _linearise_kinds(problem: Problem, z: Float[np.ndarray, " z"]) -> Linearisation:
    """The same where what was seen is linearised by the twist of the tool."""
    at = problem.walked(z)
    seen, tool = problem.linearised(at, z), np.zeros(3)
    assert seen.linear is not None
    joints = joint_columns(at, tool, angular=True)[:, :, : len(problem.frames.model.robot.joints)]
    n, targets, b = seen.linear.residual.shape
    made = (
        seen.linear.residual.reshape(n, -1),
        by_entry(at, seen),
        seen.linear.by_end.reshape(n, targets * b, 6) @ joints,
    )
    valid = np.repeat(seen.valid, b, axis=1)
    for array in made:
        array[~valid] = 0.0
    return Linearisation(residual=made[0], by_entry=made[1], by_joint=made[2], seen=valid)


def joint_columns(
    at: Walked, offset: Float[np.ndarray, " 3"], *, angular: bool
) -> Float[np.ndarray, "n rows coordinates"]:
    """Derivative of a target by the coordinates of the chain."""
    layout = walk.Columns.of_joints(at.chain)
    return walk.columns(at.chain, at.s, at.e, layout, np.ones_like(at.s), angular=angular, point=offset)
