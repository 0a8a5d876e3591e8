"""Error frames stand behind each joint and the tool, or at each nominal length, and move nothing at zero."""

import numpy as np
import pytest

from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, ErrorFrame, Joint
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import COMPONENTS, defect_steps, length_steps


@pytest.mark.parametrize("name", catalogue_names())
@pytest.mark.parametrize("make", [defect_steps, length_steps])
def test_each_error_frame_has_six_slots_and_at_zero_the_chain_is_the_robots(name, make):
    robot = load_robot(name)
    steps, slots = make(robot)
    frames = sum(isinstance(step, ErrorFrame) for step in steps)
    assert [len(slot) for slot in slots] == [6] * frames
    s = np.random.default_rng(0).uniform(-0.4, 0.4, (5, len(robot.joints)))
    plain = walk.poses(Chain.of(robot.steps()), s, np.zeros((0, 6)))
    np.testing.assert_allclose(walk.poses(Chain.of(steps), s, np.zeros((frames, 6))), plain, atol=1e-14)


@pytest.mark.parametrize("name", catalogue_names())
def test_a_defects_frame_follows_its_joint_and_is_named_after_it(name):
    robot = load_robot(name)
    steps, slots = defect_steps(robot)
    for place, step in enumerate(steps):
        if isinstance(step, Joint):
            assert isinstance(steps[place + 1], ErrorFrame)
    assert isinstance(steps[-1], ErrorFrame)
    assert slots == [[f"{frame}.{c}" for c in COMPONENTS] for frame in (*robot.joint_names, "tool")]
