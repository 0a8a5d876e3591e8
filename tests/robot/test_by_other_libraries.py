"""Every robot of the catalogue by two other libraries, each with a formulation of its own.

Pinocchio walks a tree of joints; pytransform3d multiplies exponentials of the joints' screws about the base, at rest. Both get the
numbers of the robot's file, read plainly, and what a closed loop and couplings make of the controller's joints, solved plainly.
"""

import numpy as np
import pinocchio
from pytransform3d import transformations as pt

from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws import plain


def chain_of(description):
    """For each joint its fixed transform from the joint before and whether it slides; and from the last one to the tool."""
    placements, T = [], np.eye(4)
    for joint in description["joint"]:
        before, after = plain.around(joint)
        placements.append((T @ before, joint.get("type") == "prismatic"))
        T = after
    return placements, plain.product([T, *(plain.elementary(step) for step in description.get("tool", ()))])


def by_pinocchio(description, s):
    """Pose of the tool at chain coordinates, and the twists about its point by them, in base axes."""
    placements, T_tool = chain_of(description)
    model, last = pinocchio.Model(), 0
    for i, (placement, slides) in enumerate(placements):
        kind = pinocchio.JointModelPZ() if slides else pinocchio.JointModelRZ()
        last = model.addJoint(last, kind, pinocchio.SE3(placement), f"joint {i}")
    tool = model.addFrame(pinocchio.Frame("tool", last, pinocchio.SE3(T_tool), pinocchio.FrameType.OP_FRAME))
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, s)
    J = pinocchio.computeFrameJacobian(model, data, s, tool, pinocchio.LOCAL_WORLD_ALIGNED)
    return data.oMf[tool].homogeneous.copy(), J


def by_pytransform3d(description, s):
    """The same by the product of exponentials of the screws at rest (rotation first there)."""
    placements, T_tool = chain_of(description)
    at_rest, screws = np.eye(4), []
    for placement, slides in placements:
        at_rest = at_rest @ placement
        local = np.eye(6)[5 if slides else 2]
        screws.append(pt.adjoint_from_transform(at_rest) @ local)
    T, J = np.eye(4), np.empty((6, len(s)))
    for k, (screw, value) in enumerate(zip(screws, s, strict=True)):
        J[:, k] = pt.adjoint_from_transform(T) @ screw
        T = T @ pt.transform_from_exponential_coordinates(screw * value)
    T = T @ at_rest @ T_tool
    w, v = J[:3], J[3:]  # of what coincides with the base's origin
    return T, np.concatenate([v + np.cross(w, T[:3, 3], axis=0), w])


def test_a_robot_of_the_catalogue_has_their_poses_and_jacobians():
    for name in catalogue_names():
        assert_agrees_with_others(load_robot(name))


def assert_agrees_with_others(robot):
    model, description, rng = ErrorModel(robot), robot.description, np.random.default_rng(0)
    q = rng.uniform(*np.clip(robot.limits, -2.0, 2.0).T, size=(400, len(robot.joints)))
    q = q[robot.inside_limits(q)][:3]
    assert len(q) == 3
    T, J = model.poses(q), model.joint_jacobian(q)
    for row in range(len(q)):
        s = np.array(plain.coordinates(description, q[row]))
        by_joint = plain.derivatives(lambda v: np.array(plain.coordinates(description, v)), q[row])
        for other in (by_pinocchio, by_pytransform3d):
            pose, twists = other(description, s)
            np.testing.assert_allclose(T[row], pose, rtol=0.0, atol=1e-12, err_msg=robot.name)
            np.testing.assert_allclose(J[row], twists @ by_joint, rtol=0.0, atol=1e-11, err_msg=robot.name)
