import numpy as np
import pytest

from robot_programs.rapid.resolve import Confdata
from taskcal.robot.catalogue import load_robot

IRB120 = load_robot("abb-irb120")
IRB6660 = load_robot("abb-irb6660-205-1.9")


def of(robot, degrees, like=None) -> tuple[int, int, int, int]:
    c = Confdata.of(robot, np.radians(np.array(degrees, dtype=float)), like)
    return c.cf1, c.cf4, c.cf6, c.cfx


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        ([0, 0, 0, 0, 30, 0], (0, 0, 0, 0)),
        ([45, 0, 0, 100, 30, 359], (0, 1, 3, 0)),
        ([-1, 0, 0, -91, -30, -361], (-1, -2, -5, 1)),
        # the lower arm stands upright, the forearm leads back over axis 1; 70 mm to 302 mm at the elbow make 77° the border
        ([0, 0, -100, 0, 30, 0], (0, 0, 0, 6)),
        ([0, 0, -76, 0, 30, 0], (0, 0, 0, 0)),
        ([0, 0, -78, 0, 30, 0], (0, 0, 0, 6)),
        ([0, 60, -120, 0, 30, 0], (0, 0, 0, 2)),
        ([0, -80, -20, 0, 30, 0], (0, 0, 0, 4)),
        ([0, -60, -105, 0, -30, 0], (0, 0, 0, 7)),
    ],
)
def test_hand_made_postures_of_the_irb_120(degrees, expected):
    assert of(IRB120, degrees) == expected


def test_edges_keep_what_was_stated():
    like = Confdata(cf1=-1, cf4=0, cf6=0, cfx=1)
    nearly = [-1e-9, 0, 0, 90 + 1e-9, 1e-9, -1e-9]
    assert of(IRB120, nearly, like) == (-1, 0, 0, 1)
    assert of(IRB120, nearly) == (0, 1, 0, 0)
    assert of(IRB120, [-0.001, 0, 0, 90.001, 1, -0.001], like) == (-1, 1, -1, 0)


def test_a_parallel_rod_has_no_use_for_cfx():
    q = np.radians([10.0, 20, 10, 30, -40, 50])
    assert Confdata.of(IRB6660, q, Confdata(cf1=0, cf4=0, cf6=0, cfx=5)).cfx == 5
    assert Confdata(cf1=0, cf4=0, cf6=0, cfx=7).agrees(IRB6660, q[None])[0]
    assert not Confdata(cf1=0, cf4=1, cf6=0, cfx=7).agrees(IRB6660, q[None])[0]


def test_configuration_without_usual_wrist_is_its_quadrants():
    """A robot without the usual wrist is told by its quadrants alone."""
    ur5 = load_robot("ur5")
    q = np.radians([10.0, -80, 60, -100, -40, 50])
    assert of(ur5, np.degrees(q)) == (0, -2, 0, 0)
    assert Confdata(cf1=0, cf4=-2, cf6=0, cfx=3).agrees(ur5, q[None])[0]


def test_a_robot_of_seven_joints_agrees_with_anything():
    wam = load_robot("barrett-wam")
    q = np.zeros((2, len(wam.joints)))
    assert Confdata(cf1=3, cf4=3, cf6=3, cfx=3).agrees(wam, q).all()
