"""Error frames stand behind each joint and the tool, or at each nominal length, and move nothing at zero."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, ErrorFrame, Joint
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import COMPONENTS, error_steps
from tests.laws.robots import NAMED, Case, cases


@given(cases())
def test_error_frames_of_zero_move_nothing(case: Case):
    """Each error frame has six slots and moves nothing at zero."""
    assert_frames_move_nothing(case.robot)


@pytest.mark.parametrize("name", NAMED)
def test_error_frames_of_a_named_robot_move_nothing_at_zero(name):
    assert_frames_move_nothing(load_robot(name))
    assert_frames_follow_joints(load_robot(name))


def assert_frames_move_nothing(robot):
    s = np.random.default_rng(0).uniform(-0.4, 0.4, (5, len(robot.joints)))
    plain = walk.poses(Chain.of(robot.steps()), s, np.zeros((0, 6)))
    for lengths_only in (False, True):
        steps, slots = error_steps(robot, lengths_only=lengths_only)
        frames = sum(isinstance(step, ErrorFrame) for step in steps)
        assert [len(slot) for slot in slots] == [6] * frames
        np.testing.assert_allclose(walk.poses(Chain.of(steps), s, np.zeros((frames, 6))), plain, atol=1e-14)


@given(cases())
def test_a_defects_frame_follows_its_joint_and_is_named_after_it(case: Case):
    assert_frames_follow_joints(case.robot)


def assert_frames_follow_joints(robot):
    steps, slots = error_steps(robot, lengths_only=False)
    for place, step in enumerate(steps):
        if isinstance(step, Joint):
            assert isinstance(steps[place + 1], ErrorFrame)
    assert isinstance(steps[-1], ErrorFrame)
    assert slots == [[f"{frame}.{c}" for c in COMPONENTS] for frame in (*robot.joint_names, "tool")]
