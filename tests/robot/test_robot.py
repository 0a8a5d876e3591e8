import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import ReachError
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot_file import robot_from
from tests.laws import plain
from tests.laws.robots import cases, four_bar_cases, irb6660_description


@given(cases())
def test_the_joint_map_is_the_expressions_plus_offsets(case):
    s = case.robot.joint_map(case.q)
    np.testing.assert_allclose(s, [plain.coordinates(case.description, q) for q in case.q], rtol=1e-12, atol=1e-12)


@given(cases())
def test_the_nominal_chain_is_the_product_of_the_files_steps(case):
    robot = case.robot
    T = walk.poses(Chain.of(robot.steps()), robot.joint_map(case.q), np.zeros((0, 6)))
    np.testing.assert_allclose(T, plain.poses(case.description, case.q), rtol=1e-11, atol=1e-11)


@given(cases() | four_bar_cases())
def test_tool_poses_end_the_joint_frames(case):
    robot = case.robot
    q = np.mod(case.q + np.pi, 2.0 * np.pi) - np.pi if robot.four_bar is None else case.q
    T = robot.tool_poses(q)
    np.testing.assert_allclose(T, plain.poses(case.description, q), rtol=1e-11, atol=1e-11)
    behind = np.eye(4)
    for part in (*robot.joints[-1].after, *robot.tool):
        behind = behind @ part.transform
    np.testing.assert_allclose(robot.joint_frames(q)[:, -1] @ behind, T, rtol=1e-11, atol=1e-11)


@given(four_bar_cases())
def test_a_four_bar_adds_its_closure_to_the_joint_it_drives(case):
    robot = case.robot
    assert robot.four_bar is not None
    shift = robot.four_bar.shift(case.q, np.zeros(3))
    s = robot.joint_map(case.q) + shift.value
    np.testing.assert_allclose(s, [plain.coordinates(case.description, q) for q in case.q], rtol=1e-11, atol=1e-11)
    by_q = np.array([plain.derivatives(lambda q: np.array(plain.coordinates(case.description, q)), q) for q in case.q])
    np.testing.assert_allclose(robot.joint_map.matrix + shift.by_joint, by_q, rtol=1e-9, atol=1e-10)


@given(cases(prismatic=False))
def test_no_point_of_the_tool_is_farther_than_the_reach(case):
    far = np.linalg.norm(plain.poses(case.description, case.q)[:, :3, 3], axis=1)
    assert (far <= case.robot.reach + 1e-12).all()


def limited() -> dict:
    return {
        "name": "limited",
        "joint": [
            {"name": "J1", "limits_deg": [-10, 20], "steps": [{"tx_mm": 100}]},
            {"name": "J2", "limits_deg": [-90, 90]},
            {"name": "L", "type": "prismatic", "limits_mm": [0, 500]},
        ],
        "coupled_limit": [{"of": "J2 - J1", "range_deg": [-30, 30]}],
    }


@pytest.mark.parametrize(
    ("q", "reason"),
    [
        ([21, 5, 0], r"J1 = 21\.000° is outside -10 to 20°"),
        ([-10.5, 0, 0], r"J1 = -10\.500° is outside -10 to 20°"),
        ([0, 40, 0], r"J2 - J1 = 40\.000° is outside -30 to 30°"),
        ([0, 0, 501], r"L = 501\.000 mm is outside 0 to 500 mm"),
    ],
)
def test_a_pose_outside_the_limits_is_named_with_value_and_range(q, reason):
    robot = robot_from(limited())
    scale = np.array([np.pi / 180, np.pi / 180, 1e-3])
    rows = np.array([[0, 0, 100], q, q]) * scale
    with pytest.raises(ReachError, match=rf"limited: pose 1: {reason} \(2 of 3 poses are outside limits\)"):
        robot.check_limits(rows)
    assert [row for row, _ in robot.outside_limits(rows)] == [1, 2]


def test_limits_themselves_are_inside():
    robot = robot_from(limited())
    q = np.array([[-10, 0, 0], [20, 50, 500], [20, -10, 0]]) * [np.pi / 180, np.pi / 180, 1e-3]
    robot.check_limits(q)
    np.testing.assert_allclose(
        robot.limits, np.array([[-10, 20], [-90, 90], [0, 500]]) * [[np.pi / 180], [np.pi / 180], [1e-3]]
    )
    assert robot.prismatic == (False, False, True)


def test_a_joint_without_limits_turns_freely():
    robot = robot_from({"name": "free", "joint": [{"name": "J1"}]})
    assert not robot.outside_limits(np.array([[1e3], [-1e3]]))


@given(cases())
def test_a_description_describes_the_same_robot_again(case):
    robot = case.robot
    again = robot_from(robot.description)
    assert again.description == robot.description
    assert again.digest == robot.digest
    np.testing.assert_array_equal(again.limits, robot.limits)
    T = [walk.poses(Chain.of(r.steps()), r.joint_map(case.q), np.zeros((0, 6))) for r in (robot, again)]
    np.testing.assert_array_equal(*T)


def test_the_digest_changes_with_any_number():
    description = irb6660_description()
    before = robot_from(description).digest
    assert before == load_robot("abb-irb6660-205-1.9").digest
    changed = {**description, "four_bar": {**description["four_bar"], "rod_mm": 700.001}}
    assert robot_from(changed).digest != before
