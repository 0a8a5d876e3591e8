"""Corrected programs against another library: the controller's joints by Pinocchio, the true tool by the calibration."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from taskcal.correction.correct import correct
from taskcal.correction.correction import Bounds
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.measurement.virtual_cell import simulate
from taskcal.programs.languages import Composition, language_of
from taskcal.programs.program import Frame, Move, Target
from taskcal.programs.reading import parse_program
from taskcal.programs.source import Place
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.correction.cells import REFLECTORS

HOME = {"abb-irb120": (0, 20, 10, 10, 50, -20), "kuka-kr16-2": (10, -70, 90, 10, 50, -20)}
TOOL = se3.translation(0.02, -0.01, 0.12) @ se3.rotation("y", 0.3)


class Chain:
    """A serial robot in Pinocchio."""

    def __init__(self, robot):
        self.map, self.model, parent = robot.joint_map, pin.Model(), 0
        placement = np.eye(4)
        for joint in robot.joints:
            for part in joint.before:
                placement = placement @ part.transform
            parent = self.model.addJoint(parent, pin.JointModelRZ(), pin.SE3(placement), joint.name)
            placement = np.eye(4)
            for part in joint.after:
                placement = placement @ part.transform
        self.data, self.last = self.model.createData(), parent
        nominal, q = ErrorModel(robot), np.zeros((1, 6))
        self.T_tool = np.eye(4)
        self.T_tool = np.linalg.inv(self.pose(q[0])) @ nominal.poses(q)[0]
        other = np.linspace(-0.4, 0.5, 6)
        np.testing.assert_allclose(self.pose(other), nominal.poses(other[None])[0], atol=1e-12)

    def pose(self, q):
        pin.forwardKinematics(self.model, self.data, self.map(q[None])[0])
        return self.data.oMi[self.last].homogeneous @ self.T_tool

    def joints(self, T, q):
        """Joint positions at a pose of the tool, by Newton steps from near ones."""
        goal, q = pin.SE3(T @ np.linalg.inv(self.T_tool)), np.array(q)
        for _ in range(50):
            s = self.map(q[None])[0]
            pin.forwardKinematics(self.model, self.data, s)
            error = pin.log6(self.data.oMi[self.last].inverse() * goal).vector
            if np.abs(error).max() < 1e-13:
                break
            J = pin.computeJointJacobian(self.model, self.data, s, self.last) @ self.map.matrix
            q += np.linalg.solve(J, error)
        return q


@pytest.fixture(scope="module", params=HOME)
def true_robot(request):
    """A calibration of a robot with defects, its chain, and where a program begins."""
    robot = load_robot(request.param)
    q = np.radians(HOME[request.param])
    rng, model = np.random.default_rng(7), ErrorModel(robot)
    campaign, _ = simulate(model, q + rng.uniform(-0.5, 0.5, (50, 6)), rng=rng, targets=REFLECTORS)
    return identify(model, campaign), Chain(robot), q


@pytest.mark.parametrize(("name", "in_hand"), [("p.mod", False), ("p.mod", True), ("p.src", False), ("p.csv", False)])
def test_the_true_tool_is_where_the_program_wants_it(true_robot, name, in_hand):
    calibration, chain, q = true_robot
    robot = calibration.model.robot
    flange = chain.pose(q) @ np.linalg.inv(robot.T_flange_tool)
    # what is held and what stands still; the program's points are the tool in the part
    held = TOOL if name != "p.csv" else robot.T_flange_tool
    standing = flange @ held @ se3.translation(0.05, -0.03, 0.02) @ se3.rotation("x", 0.4)
    tool, part = (standing, held) if in_hand else (held, standing)
    frames = Frame(name="tGrip", T=tool), Frame(name="wPart", T=part)
    home = Target(name="", T=None, q=q, posture=None, place=Place(path=Path(name), line=1))
    moves = [
        Move(
            kind="axes", end=home, via=None, tool=frames[0], part=frames[1], part_in_hand=in_hand, speed=None, stops=True,
            follows=None, routine="p", place=home.place,
        )
    ]  # fmt: skip
    for i, (x, y, z) in enumerate([(0, 0, 0), (0.05, 0, 0), (0.05, 0.04, 0.01)]):
        T = np.linalg.inv(standing) @ se3.translation(x, y, z) @ flange @ held
        place = Place(path=Path(name), line=1)
        end = Target(name="", T=np.linalg.inv(T) if in_hand else T, q=None, posture=None, place=place)
        moves.append(
            Move(
                kind="linear" if i else "joint", end=end, via=None, tool=frames[0], part=frames[1], part_in_hand=in_hand,
                speed=0.1, stops=True, follows=i, routine="p", place=place,
            )
        )  # fmt: skip
    at = np.stack([q, *(chain.joints(move.flange(move.end.T) @ robot.T_flange_tool, q) for move in moves[1:])])
    language = language_of(Path(name))
    source = language.compose(Composition(name="p", robot=robot, moves=moves, q=at))
    surroundings = {} if language.declares_frames else {"tool": frames[0], "part": frames[1]}
    program = parse_program((source,), robot=robot, **surroundings)
    assert [move.part_in_hand for move in program.moves] == [in_hand] * 4
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0, shift=0.05, turn=0.2))
    assert not found.rejected
    again = parse_program(found.sources, robot=robot, **surroundings)
    for wanted, move, near in list(zip(moves, again.moves, at, strict=True))[1:]:
        driven = chain.joints(move.flange(move.end.T) @ robot.T_flange_tool, near)
        true = calibration.tool_in_base(driven[None])[0] @ np.linalg.inv(robot.T_flange_tool)
        got = np.linalg.inv(true @ part) @ tool if in_hand else np.linalg.inv(part) @ true @ tool
        np.testing.assert_allclose(got[:3, 3], wanted.end.T[:3, 3], atol=1e-6)
        np.testing.assert_allclose(got[:3, :3], wanted.end.T[:3, :3], atol=2e-6)
        assert np.abs(move.end.T - wanted.end.T).max() > 1e-5
