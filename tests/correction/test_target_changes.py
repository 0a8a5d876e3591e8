"""How far a correction moves the targets of a program."""

import numpy as np

from taskcal.correction.correct import target_changes


def test_changes_are_the_largest_distance_angle_and_joint_motion(robot, corrected):
    trajectory, subdivision = corrected([0.0, 1e-3, 2e-3], [0.0, 0.01, 0.02], [0.0, 0.03, 0.001])
    changes = target_changes(robot, subdivision, trajectory)
    np.testing.assert_allclose(changes.shift, [0.0, 1e-3, 2e-3], atol=1e-12)
    np.testing.assert_allclose(changes.turn, [0.0, 0.01, 0.02], atol=1e-9)
    np.testing.assert_allclose(changes.joint, [0.0, 0.03, 0.001], atol=1e-12)
