"""Robots with defects, as a calibration knows them, and their controllers' joints by another library."""

import numpy as np
import pinocchio as pin

from taskcal.correction.options import Bounds
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.correction.cells import REFLECTORS

STEPS = ((0, 0, 0), (0.05, 0, 0), (0.05, 0.04, 0.01))
COARSE = Bounds(tolerance=1.0, shift=0.05, turn=0.2)
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


def defective(name, q):
    robot = load_robot(name)
    rng, model = np.random.default_rng(7), ErrorModel(robot)
    campaign, _ = simulate(model, q + rng.uniform(-0.5, 0.5, (50, 6)), rng=rng, targets=REFLECTORS)
    return identify(model, campaign), Chain(robot), q


def true_tool(calibration, chain, goal, near, tool):
    """Where the true tool is when the controller goes to a pose of the flange."""
    T_flange_tool = calibration.model.robot.T_flange_tool
    driven = chain.joints(goal @ T_flange_tool, near)
    return calibration.tool_in_base(driven[None])[0] @ np.linalg.inv(T_flange_tool) @ tool


def meets(got, wanted):
    """A pose is where it should be."""
    np.testing.assert_allclose(got[:3, 3], wanted[:3, 3], atol=1e-6)
    np.testing.assert_allclose(got[:3, :3], wanted[:3, :3], atol=2e-6)
