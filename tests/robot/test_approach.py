import numpy as np

from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import conditions_in_order, drive_motion
from taskcal.robot.robot_file import robot_from


def arm(*angles, signs=()):
    joints = [{"name": f"J{i + 1}", "angle": angle} for i, angle in enumerate(angles)]
    return robot_from({"name": "arm", "joint": joints, "tool": [{"tx_mm": 100.0}]})


def test_a_drive_keeps_its_way_until_it_moves_again():
    robot = arm("J1", "J2")
    q = np.radians([[0, 0], [10, 0], [10, -5], [5, -5], [5.001, -5]])
    np.testing.assert_array_equal(conditions_in_order(robot, q).approach, [[0, 0], [1, 0], [1, -1], [-1, -1], [-1, -1]])


def test_approach_is_unknown_after_gap_until_motion():
    """The approach direction is unknown after a gap until a drive moves."""
    robot = arm("J1", "J2")
    q = np.radians([[0, 0], [10, 10], [20, 20], [30, 20], [20, 30]])
    follows = np.array([False, True, False, True, True])
    np.testing.assert_array_equal(
        conditions_in_order(robot, q, follows).approach, [[0, 0], [1, 1], [0, 0], [1, 0], [-1, 1]]
    )


def test_reversed_joints_count_in_the_controllers_sense():
    q = np.radians([[0.0], [10.0]])
    assert conditions_in_order(arm("-J1"), q).approach[1, 0] == 1.0


def test_coupled_drive_turns_with_its_own_joint():
    """θ3 = −(J2 + J3): when J2 alone moves, the third drive has to turn as well."""
    robot = arm("J1", "J2", "-(J2 + J3)")
    q = np.radians([[0, 0, 0], [0, 10, 0], [0, 20, -15]])
    np.testing.assert_array_equal(conditions_in_order(robot, q).approach, [[0, 0, 0], [0, 1, 1], [0, 1, -1]])


def test_behind_a_parallelogram_the_controller_counts_motors():
    robot = load_robot("abb-irb6660-205-1.9")
    np.testing.assert_array_equal(drive_motion(robot), np.eye(6))


def test_moves_are_those_of_the_drives_and_nil_behind_a_gap():
    robot = arm("J1", "-J2", "J2 + J3")
    q = np.array([[0.0, 0.0, 0.0], [0.1, 0.2, 0.3], [0.2, 0.2, 0.2]])
    np.testing.assert_allclose(conditions_in_order(robot, q).move, [[0, 0, 0], [0.1, 0.2, 0.5], [0.1, 0.0, -0.1]])
    follows = np.array([False, True, False])
    np.testing.assert_array_equal(conditions_in_order(robot, q, follows).move[2], 0.0)
