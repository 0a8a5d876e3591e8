"""What languages state of a posture is true of it, and of no other posture of the same pose."""

import numpy as np
import pytest
from hypothesis import given

from robot_programs.krl.points import StatusTurn
from robot_programs.rapid.resolve import Confdata
from robot_programs.tp.listing import Configuration
from taskcal.kinematics.inverse import find_postures
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import generators, industrial, industrial_positions

STATED = {
    "RAPID": Confdata.of,
    "KRL": StatusTurn(S=0, T=0).of,
    "TP": Configuration.parse("N U T, 0, 0, 0").of,
}
"""By language, what is stated of a robot at joint positions."""


@pytest.mark.parametrize("name", STATED)
@given(rng=generators)
def test_a_posture_agrees_with_what_is_stated_of_it(name, rng):
    robot, q = robot_from(industrial(rng)), industrial_positions(rng, 4)
    for row in q:
        assert STATED[name](robot, row).agrees(robot, row[None])[0]


@pytest.mark.parametrize("name", STATED)
@pytest.mark.parametrize("seed", range(6))
def test_what_is_stated_tells_the_postures_of_one_pose_apart(name, seed):
    rng = np.random.default_rng(seed)
    robot = robot_from(industrial(rng))
    model = ErrorModel(robot)
    postures = find_postures(model, model.poses(industrial_positions(rng, 1))[0])
    # whole turns of axes 2, 3 and 5 are not stated, nor those of all others in KRL and TP
    counted = [1, 2, 4] if name == "RAPID" else slice(None)
    turns = [p for p in postures if np.abs(p[counted]).max() < np.pi]
    sure = [p for p in turns if np.abs(np.sin(2 * p[[0, 3, 5]])).min() > 0.05 and abs(p[4]) > 0.05]
    stated = {tuple(p): STATED[name](robot, p) for p in sure}
    if name == "TP":  # which does not state the elbow of an arm that is bent back over axis 1
        stated = {p: one for p, one in stated.items() if one.front}
    assert len(stated) > 1
    agree = [one.agrees(robot, np.array(list(stated))) for one in stated.values()]
    np.testing.assert_array_equal(agree, np.eye(len(stated), dtype=bool))


@pytest.mark.parametrize(
    ("name", "joint", "turn"), [*(("RAPID", joint, turn) for joint in (0, 3, 5) for turn in (0.6, 2.0)), ("TP", 5, 2.0)]
)
@given(rng=generators)
def test_a_turn_of_an_axis_is_another_posture(name, joint, turn, rng):
    """By a whole one, in RAPID by more than a quarter."""
    robot, q = robot_from(industrial(rng)), industrial_positions(rng, 1)
    stated, turned = STATED[name](robot, q[0]), q.copy()
    turned[0, joint] += turn * np.pi
    assert not stated.agrees(robot, turned)[0]
    assert stated.agrees(robot, q + 1e-4)[0]
