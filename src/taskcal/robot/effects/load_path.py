"""Which motor carries which load: by virtual work, through the robot's true load path."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import walk
from taskcal.geometry.chain import Chain, Joint
from taskcal.robot.robot import Robot

GRAVITY = np.array([0.0, 0.0, -1.0])
"""Direction of gravity in the base of a robot that stands upright."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadPath:
    """How far points of the robot go down for a turn of each motor."""

    robot: Robot
    chains: tuple[Chain, ...]
    """From the base to the origin of each joint but the first, and to the tool."""

    @classmethod
    def of(cls, robot: Robot) -> "LoadPath":
        """The load path of a robot at rest in its nominal geometry."""
        steps = robot.steps()
        joints = [k for k, step in enumerate(steps) if isinstance(step, Joint)]
        return cls(robot=robot, chains=tuple(Chain.of(steps[:k]) for k in (*joints, len(steps))))

    def at(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n points joints"]:
        """∂(height)/∂q of every point, metres per radian; a weight of one newton makes that torque, in newton metres."""
        robot = self.robot
        q = np.asarray(q, dtype=float)
        s, by_q = robot.joint_map(q), drive(robot)
        if robot.four_bar is not None:
            shift = robot.four_bar.shift(q, np.zeros(3))
            s, by_q = s + shift.value, by_q + shift.by_joint
        out = np.zeros((len(q), len(self.chains), q.shape[1]))
        for k, chain in enumerate(self.chains):
            if not chain.joints:
                continue
            own = np.ascontiguousarray(s[:, : chain.joints])
            layout = walk.Columns.of_joints(chain)
            J = walk.columns(chain, own, np.zeros((0, 6)), layout, np.ones_like(own), angular=False)
            down = np.einsum("i,nij->nj", GRAVITY, J)
            full = np.zeros((len(q), robot.joint_map.matrix.shape[0]))
            full[:, : chain.joints] = down
            out[:, k] = full @ by_q if by_q.ndim == 2 else np.einsum("nc,ncj->nj", full, by_q)
        return out


def drive(robot: Robot) -> Float[np.ndarray, "coordinates motors"]:
    """Coordinates that the turn of each motor moves, its four-bar taken for a parallelogram."""
    return np.eye(len(robot.joints)) if robot.four_bar is None else robot.joint_map.matrix
