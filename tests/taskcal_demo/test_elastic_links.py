"""Links that bend, by virtual work."""

import numpy as np

from taskcal.robot.effects.drives import MotorTorque
from taskcal.robot.effects.load_path import LoadPath
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.statics import Load
from taskcal_demo.true_robot import AXES, ElasticLinks, carried, elastic_robot


def test_moments_about_the_axes_are_those_of_virtual_work(robot, q):
    """What a link carries about its axis, seen from the motors, is the torque that `Compliance` knows but for the spring."""
    heavy = elastic_robot(robot)
    path = LoadPath.at(heavy, q)
    about_axes = carried(heavy, 6, q).reshape(len(q), 6, AXES)[:, :, 5]
    by_motor = np.einsum("nc,ncm->nm", about_axes, path.by_motor)
    known = MotorTorque.of(heavy, Load()).at(path)
    spring = heavy.statics.spring
    assert spring is not None
    turn = path.coordinates[:, spring.joint] - heavy.joint_map.offset[spring.joint]
    known -= spring.torque(turn)[:, None] * path.by_motor[:, spring.joint]
    np.testing.assert_allclose(by_motor, known, atol=1e-6 * np.abs(known).max())


def test_a_link_turns_the_tool_by_its_moment_about_its_end(robot, q):
    """Against the lever by hand: the stand yields at the origin of axis 1, where all weights pull."""
    heavy = elastic_robot(robot)
    turn, shift = 1e-8, 2e-10
    model = ErrorModel(heavy, effects=(ElasticLinks(turns=(turn,), shifts=(shift,)),))
    rigid = ErrorModel(heavy).poses(q)
    end = np.linalg.multi_dot([part.transform for part in heavy.joints[0].before] + [np.eye(4)] * 2)
    load = carried(heavy, 1, q)
    arm = rigid[:, :3, 3] - end[:3, 3]
    wanted = (turn * np.cross(load[:, 3:] @ end[:3, :3].T, arm)) + shift * load[:, :3] @ end[:3, :3].T
    moved = model.poses(q)[:, :3, 3] - rigid[:, :3, 3]
    np.testing.assert_allclose(moved, wanted, atol=2e-3 * np.abs(wanted).max())
    assert np.abs(moved).max() > 1e-5
