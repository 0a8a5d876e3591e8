"""What is not corrected, and that the reason names what would have to be allowed."""

import pytest

from taskcal.correction.correct import find_rejections, target_changes
from taskcal.correction.correction import Bounds


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
