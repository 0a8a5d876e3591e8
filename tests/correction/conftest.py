from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Frame, Motion, Target
from robot_programs.core.source import Place
from taskcal.correction.controller import simulate_controller
from taskcal.correction.subdivision import Nodes, Subdivision
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import conditions_in_order
from taskcal.robot.effects import Backlash, Compliance
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task
from tests.correction.cells import CUTTER, PART, REFLECTORS


@pytest.fixture(scope="session")
def robot():
    return load_robot("abb-irb6660-205-1.9")


@pytest.fixture(scope="session")
def measured(robot):
    """Joint positions of a campaign over the reference task."""
    return reach_task(ErrorModel(robot), reference_task(np.radians(20.0)), 60, seed=4).q


@pytest.fixture(scope="session")
def calibration(robot, measured):
    """A robot with defects and drives that yield, identified from three reflectors."""
    model = ErrorModel(robot) + Compliance()
    campaign, _ = simulate(model, measured, rng=np.random.default_rng(4), targets=REFLECTORS)
    return identify(model, campaign)


@pytest.fixture(scope="session")
def krl_calibration():
    """The same of a robot of KUKA's, from postures all over its workspace."""
    model = ErrorModel(load_robot("kuka-kr16-2")) + Compliance()
    rng = np.random.default_rng(6)
    q = rng.uniform(*(0.5 * np.clip(model.robot.limits, -3.0, 3.0)).T, size=(40, 6))
    campaign, _ = simulate(model, q, rng=rng, targets=REFLECTORS)
    return identify(model, campaign)


@pytest.fixture(scope="session")
def lost_motion(robot, measured):
    """A robot with defects and lost motion, identified from three reflectors and the order of the poses."""
    model = ErrorModel(robot) + Backlash(tolerance=5e-5)
    conditions = conditions_in_order(robot, measured)
    rng = np.random.default_rng(5)
    campaign, _ = simulate(model, measured, rng=rng, targets=REFLECTORS, conditions=conditions)
    return identify(model, campaign)


@pytest.fixture(scope="session")
def nominal(robot, measured):
    """A calibration that found nothing."""
    model = ErrorModel(robot)
    campaign, _ = simulate(model, measured, rng=np.random.default_rng(4), x=np.zeros(len(model)))
    return identify(model, campaign, keep=[])


@pytest.fixture(scope="session")
def middle(robot, measured):
    """A pose of the robot's own tool in the middle of the task."""
    T = ErrorModel(robot).poses(measured)
    return se3.pose(T[0, :3, :3], T[:, :3, 3].mean(axis=0))


def line_of(number: int) -> Place:
    return Place(path=Path("part.csv"), line=number)


@pytest.fixture(scope="session")
def make_moves(robot):
    """Motions to poses of the robot's own tool; the first is a joint motion, the others lines or arcs after it."""

    def build(poses, *, vias=None, tool=None, part=None, in_hand=False, speed=0.05):
        tool = tool or Frame(name="spindle", T=robot.T_flange_tool)
        part = part or Frame(name="base", T=np.eye(4))
        vias = vias or {}

        def target(T, i):
            return Target(name="", T=T, q=None, posture=None, place=line_of(i + 1))

        return [
            Motion(
                kind="joint" if i == 0 else "circular" if i in vias else "linear",
                end=target(T, i),
                via=target(vias[i], i) if i in vias else None,
                tool=tool,
                part=part,
                part_in_hand=in_hand,
                speed=speed,
                stops=False,
                follows=i - 1 if i else None,
                routine="main",
                place=line_of(i + 1),
            )
            for i, T in enumerate(poses)
        ]

    return build


@pytest.fixture(scope="session")
def shifted(middle):
    """The middle pose, moved by millimetres in base axes."""

    def build(*offset_mm):
        return se3.translation(*(np.array(offset_mm) * 1e-3)) @ middle

    return build


@pytest.fixture(scope="session")
def perturbed():
    """A calibration at another estimate, its frames included."""

    def build(calibration, z):
        base, targets = calibration.layout.frames(z)
        return replace(calibration, z=z, T_tracker_base=base, T_tool_target=targets)

    return build


@pytest.fixture
def corrected(robot, make_moves, shifted):
    """Three motions, each moved, turned and bent by known amounts at its end."""

    def build(shift, turn, joint):
        trajectory = simulate_controller(robot, make_moves([shifted(20 * k, 0, 0) for k in range(3)]))
        wanted, m = trajectory.segments.end, 3
        turned = se3.exp(np.array(turn)[:, None] * [0.0, 0.6, 0.8]) @ wanted[:, :3, :3]
        nodes = Nodes(
            move=np.arange(m),
            share=np.ones(m),
            q=trajectory.end + np.array(joint)[:, None] * [0.0, 0.5, 0.0, -1.0, 0.0, 0.0],
            reached=np.ones(m, dtype=bool),
            wanted=wanted,
            T=se3.pose(turned, wanted[:, :3, 3] + np.array(shift)[:, None] * [0.0, 1.0, 0.0]),
        )
        pieces, deviation = np.ones(m, dtype=np.int64), np.zeros(m)
        return trajectory, Subdivision(pieces=pieces, nodes=nodes, deviation=deviation, tolerance=2e-5)

    return build


@pytest.fixture(scope="session")
def cutting(robot, make_moves, middle):
    """A motion with a cutter on a part."""
    tool, part = Frame(name="Cutter", T=robot.T_flange_tool @ CUTTER), Frame(name="PART", T=PART)
    return make_moves([se3.inverse(PART) @ middle @ CUTTER], tool=tool, part=part)[0]
