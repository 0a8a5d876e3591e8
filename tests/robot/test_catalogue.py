import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError, TaskcalError, UnknownName
from taskcal.robot.catalogue import catalogue_names, load_robot, robot_toml
from taskcal.robot.error_model import ErrorModel
from tests.laws import plain
from tests.laws.robots import NAMED, irb6660_positions

STABLE = {
    "abb-irb6660-205-1.9", "abb-irb6660-130-3.1", "abb-irb6660-100-3.3", "abb-irb120", "ur5", "ur10",
    "fanuc-r2000ic-165f", "barrett-wam", "kuka-kr16-2",
}  # fmt: skip


def test_the_catalogue_keeps_its_names():
    assert set(catalogue_names()) >= STABLE


def test_every_robot_loads_says_where_it_comes_from_and_moves():
    for name in catalogue_names():
        robot = load_robot(name)
        assert robot.name == name
        assert robot.source, name
        assert all(text.strip() for text in robot.source), name
        q = np.zeros((1, len(robot.joints)))
        T = ErrorModel(robot).poses(q)
        np.testing.assert_allclose(T, plain.poses(robot.description, q), atol=1e-12, err_msg=name)
        np.testing.assert_allclose(T[0, :3, :3] @ T[0, :3, :3].T, np.eye(3), atol=1e-12, err_msg=name)


def paper_pose(q, lengths):
    """Product of the matrices of Gutiérrez et al., entry by entry, with +cos q5 in row 3, column 2 of ⁴T₅."""
    RL1, d2, d3, d4, RL4, RL6 = lengths
    q1, q2, q3, q4, q5, q6 = q
    theta3 = q3 - q2
    c, s = np.cos, np.sin
    T01 = [[c(q1), -s(q1), 0, 0], [s(q1), c(q1), 0, 0], [0, 0, 1, RL1], [0, 0, 0, 1]]
    T12 = [[s(q2), c(q2), 0, d2], [0, 0, 1, 0], [c(q2), -s(q2), 0, 0], [0, 0, 0, 1]]
    T23 = [[c(theta3), -s(theta3), 0, d3], [s(theta3), c(theta3), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    T34 = [[c(q4), -s(q4), 0, d4], [0, 0, 1, RL4], [-s(q4), -c(q4), 0, 0], [0, 0, 0, 1]]
    T45 = [[c(q5), -s(q5), 0, 0], [0, 0, -1, 0], [s(q5), c(q5), 0, 0], [0, 0, 0, 1]]
    T56 = [[-c(q6), s(q6), 0, 0], [0, 0, 1, RL6], [s(q6), c(q6), 0, 0], [0, 0, 0, 1]]
    spindle = [[0, 0, 1, 0.25], [0, 1, 0, 0.03], [-1, 0, 0, 0.12], [0, 0, 0, 1]]
    return np.linalg.multi_dot([np.array(T, dtype=float) for T in (T01, T12, T23, T34, T45, T56, spindle)])


@pytest.mark.parametrize(
    ("name", "lengths"),
    [
        ("abb-irb6660-205-1.9", (0.8145, 0.3, 0.7, 0.28, 0.893, 0.2)),
        ("abb-irb6660-130-3.1", (0.8145, 0.3, 1.28, 0.28, 1.5055, 0.2)),
        ("abb-irb6660-100-3.3", (0.8145, 0.3, 1.28, 0.28, 1.7555, 0.2)),
    ],
)
def test_the_irb6660_is_the_publications_matrices(name, lengths):
    model = ErrorModel(load_robot(name))
    q = irb6660_positions(np.random.default_rng(0), 50)
    np.testing.assert_allclose(model.poses(q), [paper_pose(row, lengths) for row in q], atol=1e-12)


def test_the_irb6660s_parallelogram_is_nominally_exact():
    robot = load_robot("abb-irb6660-205-1.9")
    assert robot.four_bar is not None
    bar = robot.four_bar.bar
    assert (bar.crank, bar.rocker, bar.rod) == (0.5, 0.5, bar.arm)
    q = irb6660_positions(np.random.default_rng(1), 50)
    np.testing.assert_allclose(robot.four_bar.shift(q, np.zeros(3)).value, 0.0, atol=1e-14)


@pytest.mark.parametrize("name", NAMED)
def test_written_robot_file_is_the_same_robot(name, tmp_path):
    """A robot file written from a description is the same robot."""
    robot = load_robot(name)
    path = tmp_path / "robot.toml"
    path.write_text(robot_toml(dict(robot.description)), encoding="utf-8")
    again = load_robot(path)
    assert again.description == robot.description
    assert again.digest == robot.digest
    assert ErrorModel(again).parameters == ErrorModel(robot).parameters
    np.testing.assert_array_equal(again.limits, robot.limits)
    q = irb6660_positions(np.random.default_rng(2), 5)[:, [0, 1, 2, 3, 4, 5, 0][: len(robot.joints)]]
    np.testing.assert_array_equal(ErrorModel(again).poses(q), ErrorModel(robot).poses(q))


def test_the_kr16s_flange_is_where_its_published_joints_put_it():
    """Origins and axes of kr16_2_macro.xacro (kuka_experimental), one turn after the other."""
    joints = [
        ((0, 0, 0.675), (0, 0, -1)),
        ((0.26, 0, 0), (0, 1, 0)),
        ((0.68, 0, 0), (0, 1, 0)),
        ((0.67, 0, -0.035), (-1, 0, 0)),
        ((0, 0, 0), (0, 1, 0)),
        ((0, 0, 0), (-1, 0, 0)),
    ]
    robot = load_robot("kuka-kr16-2")
    q = np.random.default_rng(3).uniform(robot.limits[:, 0], robot.limits[:, 1], (20, 6))
    q[0], q[1] = 0.0, np.radians([0, -90, 90, 0, 0, 0])
    for row, T in zip(q, ErrorModel(robot).poses(q), strict=True):
        at, R = np.zeros(3), np.eye(3)
        for (origin, axis), angle in zip(joints, row, strict=True):
            at = at + R @ origin
            R = R @ Rotation.from_rotvec(np.array(axis) * angle).as_matrix()
        np.testing.assert_allclose(T[:3, 3], at + R @ [0.158, 0, 0], atol=1e-12)
        np.testing.assert_allclose(T[:3, :3], R @ Rotation.from_euler("y", 90, degrees=True).as_matrix(), atol=1e-12)
    # at home the arm stands upright and the forearm points forwards: 260 + 670 + 158 and 675 + 680 − 35 mm
    np.testing.assert_allclose(ErrorModel(robot).poses(q[1:2])[0, :3, 3], [1.088, 0, 1.32], atol=1e-12)
    np.testing.assert_allclose(robot.T_flange_tool, np.eye(4), atol=1e-15)


def test_an_unknown_robot_is_named_with_its_nearest():
    with pytest.raises(UnknownName, match=r"no robot 'ur50'.*; did you mean 'ur5'"):
        load_robot("ur50")


def test_a_table_is_pointed_to_its_import():
    with pytest.raises(
        TaskcalError, match=r"'arm\.csv' is a table; make a robot file of it: taskcal robots import arm\.csv"
    ):
        load_robot("arm.csv")


def test_a_missing_robot_file_says_so(tmp_path):
    with pytest.raises(FileError, match=r"none\.toml: cannot be read"):
        load_robot(tmp_path / "none.toml")
