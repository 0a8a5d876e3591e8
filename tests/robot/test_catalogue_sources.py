"""Robots of the catalogue against descriptions and data sheets by others."""

import numpy as np
import pytest

from taskcal.kernels.chain import Joint
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.urdf import describe_tree
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from tests.laws.urdfs import Referee

FORWARD = np.eye(7)
COUPLED = np.eye(6)
COUPLED[2, 1] = -1.0
OPPOSED = np.eye(6)
OPPOSED[2, 1] = 1.0

DESCRIBED = {
    "abb-irb120": ("abb_irb120_3_58", "base_link", "tool0", None, 1e-9),
    "abb-irb2400-12-1.55": ("abb_irb2400_parallelogram", "base_link", "tool0", COUPLED, 1e-9),
    "abb-irb6640-185-2.8": ("abb_irb6640_mimic", "base_link", "tool0", None, 1e-9),
    "abb-irb6700-235-2.65": ("abb_irb6700_235_265", "base_link", "tool0", None, 1e-9),
    "denso-hsr065a1": ("denso_hsr065a1_scara_prismatic", "world", "J4", None, 1e-9),
    "doosan-m1013": ("doosan_m1013", "base_link", "link_6", None, 1e-3),
    "fanuc-lrmate-200id": ("fanuc_lrmate200id", "base", "tool0", OPPOSED, 1e-9),
    "fanuc-m900ia-260l": ("fanuc_m900ia260l_mimic", "base", "tool0", OPPOSED, 1e-9),
    "franka-fr3": ("franka_fr3_hand_mimic", "base", "fr3_link8", None, 1e-9),
    "kinova-gen3": ("kinova_gen3_7dof", "base_link", "tool_frame", None, 5e-5),
    "kuka-kr6-r900-sixx": ("kuka_kr6r900sixx", "base_link", "tool0", None, 1e-9),
    "motoman-sia20d": ("motoman_sia20d_7axis", "base_link", "tool0", None, 1e-9),
    "staubli-rx160": ("staubli_rx160", "base_link", "tool0", None, 1e-9),
    "techman-tm5-900": ("techman_tm5_900", "base", "flange", None, 5e-6),
    "ufactory-xarm6": ("xarm6", "link_base", "link_eef", None, 1e-4),
    "ur10e": ("ur10e", "base", "tool0", None, 1e-8),
    "ur5": ("ur5_yaml_calibration", "base", "tool0", None, 1e-8),
}
"""File, base, tip, the file's joints by the controller's, and metres that its rounded right angles cost."""


@pytest.mark.realdata
@pytest.mark.parametrize("name", DESCRIBED)
def test_a_robot_stands_where_another_description_of_it_does(name, data_folder):
    file, base, tip, by_controller, within = DESCRIBED[name]
    robot = load_robot(name)
    joints = len(robot.joints)
    tree = Referee(data_folder / "urdf" / f"{file}.urdf").tree
    other = robot_from(describe_tree(tree, base=base, tip=tip))
    limits = np.clip(robot.limits, -3.0, 3.0)
    q = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (20, joints))
    theirs = q if by_controller is None else q @ by_controller.T
    np.testing.assert_allclose(ErrorModel(robot).poses(q), ErrorModel(other).poses(theirs), rtol=0.0, atol=within * 2.0)
    if by_controller is None and name not in ("kinova-gen3", "abb-irb120", "ur5"):
        np.testing.assert_allclose(robot.limits, other.limits, atol=2e-3)


@pytest.mark.realdata
def test_panda_agrees_with_the_measured_ones_urdf(data_folder):
    """The panda stands where its measured ones nominal description does."""
    tree = Referee(data_folder / "panda_sockets" / "nominal.urdf").tree
    last = [joint for joint in tree.path_to(tree.leaves[0]) if joint.moves][-1].child
    other, robot = robot_from(describe_tree(tree, tip=last)), load_robot("franka-panda")
    q = np.random.default_rng(0).uniform(robot.limits[:, 0], robot.limits[:, 1], (20, 7))
    flange = np.eye(4)
    flange[2, 3] = 0.107
    np.testing.assert_allclose(ErrorModel(robot).poses(q), ErrorModel(other).poses(q) @ flange, atol=1e-6)


REACH = {
    "abb-irb120": 580.0,
    "abb-irb1200-5-0.9": 901.0,
    "abb-irb4600-60-2.05": 2050.0,
    "abb-irb6640-185-2.8": 2800.0,
    "abb-irb6700-235-2.65": 2650.0,
    "comau-racer7-1.4": 1436.0,
    "fanuc-m20ia": 1811.0,
    "kawasaki-rs007n": 730.0,
    "kuka-kr120-r2500-pro": 2496.0,
    "kuka-kr16-2": 1611.0,
    "kuka-kr6-r900-sixx": 901.0,
    "motoman-gp12": 1440.0,
    "staubli-rx160": 1600.0,
}
"""Millimetres from axis 1 to the wrist's centre, as the makers' data sheets have it."""


@pytest.mark.parametrize("name", REACH)
def test_the_reach_is_that_of_the_data_sheet(name):
    assert reach(load_robot(name)) * 1e3 == pytest.approx(REACH[name], rel=4e-3)


def reach(robot: Robot) -> float:
    """From axis 1 to where axis 5 crosses axis 4, with the arm stretched, metres."""
    T, at = np.eye(4), []
    for step in robot.steps():
        if isinstance(step, Joint):
            at.append(T.copy())
        else:
            T = T @ step.transform
    shoulder, elbow, wrist = (at[k][:3, 3] for k in (1, 2, 4))
    out = shoulder - at[0][:3, 3]
    across = at[1][:3, 2]
    flat = lambda v: np.linalg.norm(v - across * (v @ across))  # noqa: E731
    return float(np.hypot(*out[:2]) + flat(elbow - shoulder) + flat(wrist - elbow))


UR = {
    "ur3e": (151.85, -243.55, -213.2, 131.05, 85.35, 92.1),
    "ur5e": (162.5, -425.0, -392.2, 133.3, 99.7, 99.6),
    "ur10e": (180.7, -612.7, -571.55, 174.15, 119.85, 116.55),
    "ur20": (236.3, -862.0, -728.7, 201.0, 159.3, 154.3),
}
"""d1 a2 a3 d4 d5 d6 of Universal Robots' support page on DH parameters, millimetres."""


@pytest.mark.parametrize("name", UR)
def test_a_ur_stretched_out_is_as_long_as_its_table_says(name):
    d1, a2, a3, d4, d5, d6 = (value * 1e-3 for value in UR[name])
    T = ErrorModel(load_robot(name)).poses(np.zeros((1, 6)))[0]
    np.testing.assert_allclose(T[:3, 3], [a2 + a3, -(d4 + d6), d1 - d5], atol=1e-12)


def test_the_catalogue_holds_the_makers_that_are_met_most():
    from taskcal.robot.catalogue import catalogue_names

    names = catalogue_names()
    assert len(names) >= 25
    for maker in (
        "abb",
        "comau",
        "kuka",
        "fanuc",
        "staubli",
        "motoman",
        "ur",
        "kawasaki",
        "meca",
        "franka",
        "doosan",
        "ufactory",
    ):
        assert any(name.startswith(maker) for name in names), maker
    coupled = [
        name for name in names if np.count_nonzero(load_robot(name).joint_map.matrix) > len(load_robot(name).joints)
    ]
    assert len(coupled) >= 5
