"""What is not corrected, and that the reason names what would have to be allowed."""

import numpy as np
import pytest

from taskcal.correction.correct import find_rejections, target_changes
from taskcal.correction.options import Bounds


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        (Bounds(shift=1.5e-3, turn=1.0, joint=1.0), "would move by 2.00 mm"),
        (Bounds(shift=1.0, turn=0.015, joint=1.0), "would turn by 1.15°"),
        (Bounds(shift=1.0, turn=1.0, joint=0.03), "would move a joint by 2.3°"),
    ],
    ids=["shift", "turn", "joint"],
)
def test_motion_beyond_a_bound_is_rejected_alone(robot, corrected, bounds, words):
    """Only the motion beyond a bound is rejected and says which."""
    trajectory, subdivision = corrected([0.0, 1e-3, 2e-3], [0.0, 0.01, 0.02], [0.0, 0.02, 0.04])
    changes = target_changes(robot, subdivision, trajectory)
    rejected = find_rejections(robot, subdivision, changes, bounds)
    assert list(rejected) == [2]
    assert words in rejected[2]
    assert not find_rejections(robot, subdivision, changes, Bounds(shift=1.0, turn=1.0, joint=1.0))


def test_changes_are_the_largest_distance_angle_and_joint_motion(robot, corrected):
    trajectory, subdivision = corrected([0.0, 1e-3, 2e-3], [0.0, 0.01, 0.02], [0.0, 0.03, 0.001])
    changes = target_changes(robot, subdivision, trajectory)
    np.testing.assert_allclose(changes.shift, [0.0, 1e-3, 2e-3], atol=1e-12)
    np.testing.assert_allclose(changes.turn, [0.0, 0.01, 0.02], atol=1e-9)
    np.testing.assert_allclose(changes.joint, [0.0, 0.03, 0.001], atol=1e-12)
