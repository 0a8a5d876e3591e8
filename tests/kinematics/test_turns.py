from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings

from taskcal.kinematics.tracing import turned
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws import plain
from tests.laws.robots import generators, industrial, irb6660_description

TURN = 2.0 * np.pi


@given(generators)
@settings(max_examples=8)
def test_turned_postures_leave_the_tool_in_place(rng):
    """Turned postures are all those inside the limits and leave the tool where it is."""
    description = industrial(rng)
    wide = [float(rng.choice([100.0, 190.0, 400.0])) for _ in range(6)]
    joints = [{**j, "limits_deg": [-half, half]} for j, half in zip(description["joint"], wide, strict=True)]
    coupled = [{"of": "J4 + J6", "range_deg": [-500.0, 450.0]}]
    description = {**description, "joint": joints, "coupled_limit": coupled}
    q = rng.uniform(-np.radians(wide), np.radians(wide))
    q[5] = np.clip(q[5], -3.0 - q[3], 3.0 - q[3])
    robot = robot_from(description)
    found = turned(robot, q)
    expected = set()
    for turns in product(range(-2, 3), repeat=6):
        at = np.degrees(q + TURN * np.array(turns))
        if (np.abs(at) <= wide).all() and -500.0 <= at[3] + at[5] <= 450.0:
            expected.add(turns)
    assert {tuple(np.round((row - q) / TURN).astype(int)) for row in found} == expected
    assert len(found) == len(expected)
    if len(found):
        at = plain.pose(description, q)
        for row in found[:: max(1, len(found) // 5)]:
            np.testing.assert_allclose(plain.pose(description, row), at, rtol=0.0, atol=1e-12)
        assert np.all(np.diff(np.abs(found - q).sum(axis=1)) >= 0.0)


def test_ratio_joints_turn_by_the_common_period():
    """Joints that move axes by a ratio turn by the period of all they move."""
    names = ["J1", "J2", "J3"]
    description = industrial(np.random.default_rng(0))
    joints = [
        {**description["joint"][i], "name": name, "limits_deg": [-3000.0, 3000.0]} for i, name in enumerate(names)
    ]
    joints[1]["angle"] = "J2/2"
    joints[2]["angle"] = "0.3333333333333333*J3 - J2"
    description = {"name": "geared", "joint": joints, "tool": description["tool"]}
    robot = robot_from(description)
    q = np.array([0.1, 0.2, 0.3])
    found = turned(robot, q)
    np.testing.assert_allclose(
        np.unique(np.round(np.diff(np.unique(np.round(found[:, 1], 6))), 5)), [2 * TURN], atol=1e-4
    )
    np.testing.assert_allclose(
        np.unique(np.round(np.diff(np.unique(np.round(found[:, 2], 6))), 5)), [3 * TURN], atol=1e-4
    )
    for row in found[::37]:
        np.testing.assert_allclose(plain.pose(description, row), plain.pose(description, q), rtol=0.0, atol=1e-11)


def test_unlimited_joint_is_turned_once_either_way():
    """A joint without limits is turned once either way and a sliding one not at all."""
    description = industrial(np.random.default_rng(0))
    joints = description["joint"][:2]
    joints[0] = {"name": "J1", "type": "prismatic", "mdh": {}, "limits_mm": [-9000.0, 9000.0]}
    robot = robot_from({"name": "short", "joint": joints, "tool": []})
    found = turned(robot, np.array([0.1, 0.5]))
    np.testing.assert_allclose(found[np.argsort(found[:, 1])], [[0.1, 0.5 - TURN], [0.1, 0.5], [0.1, 0.5 + TURN]])


@pytest.mark.parametrize(("q6_deg", "expected"), [(0.0, [0.0, -360.0, 360.0]), (100.0, [100.0, -260.0])])
def test_the_irb6660_has_the_last_joint_to_turn(q6_deg, expected):
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.radians([0.0, 10.0, 40.0, 10.0, 45.0, q6_deg])
    found = turned(model.robot, q)
    assert sorted(np.degrees(found[:, 5])) == pytest.approx(sorted(expected))
    np.testing.assert_array_equal(found[0], q)
    for row in found:
        at = plain.pose(irb6660_description(), row)
        np.testing.assert_allclose(at, plain.pose(irb6660_description(), q), rtol=0.0, atol=1e-12)


def test_a_posture_beyond_a_limit_is_turned_back_inside():
    robot = load_robot("abb-irb6660-205-1.9")
    q = np.radians([200.0, 10.0, 40.0, 10.0, 45.0, 20.0])
    assert np.degrees(turned(robot, q)[:, 0]) == pytest.approx([-160.0, -160.0])
