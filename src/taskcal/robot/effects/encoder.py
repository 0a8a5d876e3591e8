"""Scale errors of encoders."""

from dataclasses import dataclass

import numpy as np

from taskcal.robot.effects.base import Effect, LinearTerm, at_joints
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class EncoderGain(Effect):
    """A scale error of each joint: the joint turns a little more or less than the controller says."""

    key = "gain"
    label = "encoder gain"
    summary = "joints that turn a little more or less than the controller says"

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.gain``, radians per radian."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        middle = robot.joint_map(np.zeros((1, len(robot.joints))))[0]
        return at_joints(
            [f"{robot.joint_names[j]}.gain" for j in joints],
            robot,
            joints,
            [self.tolerance] * len(joints),
            lambda q: (robot.joint_map(q) - middle)[:, joints],
            by_joint=lambda q: np.broadcast_to(
                robot.joint_map.matrix[joints], (len(q), *robot.joint_map.matrix[joints].shape)
            ),
            share=True,
        )
