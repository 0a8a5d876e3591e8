"""A robot without limits, so that a file with wrong joints can be read and looked at."""

from dataclasses import replace

import numpy as np

from taskcal.robot.robot import Robot


def open_limits(robot: Robot) -> Robot:
    """The robot, able to take any joint position."""
    joints = tuple(replace(joint, limits=(-np.inf, np.inf)) for joint in robot.joints)
    return replace(robot, joints=joints, coupled_limits=())
