"""What external axes carry, against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from taskcal.correction.cell import ExternalAxis, carried_part, carried_robot
from taskcal.geometry import se3


def random_pose(rng):
    return se3.pose(se3.exp(rng.uniform(-2, 2, 3)), rng.uniform(-2, 2, 3))


def random_axes(rng, carries):
    axes = []
    for number in range(1, 1 + int(rng.integers(1, 4))):
        direction = rng.normal(size=3)
        axes.append(
            ExternalAxis(
                number=number,
                carries=carries,
                turns=bool(rng.integers(2)),
                direction=direction / np.linalg.norm(direction),
                T_frame=random_pose(rng) if rng.integers(4) else None,
            )
        )
    return axes


def by_pinocchio(axes, positions):
    """Pose of the last axis' carriage: a chain of joints, each in the frame that the one before carries."""
    model, parent = pin.Model(), 0
    for axis in axes:
        joint = (pin.JointModelRevoluteUnaligned if axis.turns else pin.JointModelPrismaticUnaligned)(axis.direction)
        frame = np.eye(4) if axis.T_frame is None else axis.T_frame
        parent = model.addJoint(parent, joint, pin.SE3(frame), f"axis{axis.number}")
    data = model.createData()
    q = [np.radians(p) if axis.turns else p * 1e-3 for axis, p in zip(axes, positions, strict=False)]
    pin.forwardKinematics(model, data, np.array(q))
    return data.oMi[parent].homogeneous


@pytest.mark.parametrize("seed", range(8))
def test_the_part_is_where_a_chain_of_joints_carries_it(seed):
    rng = np.random.default_rng(seed)
    axes, positions = random_axes(rng, "part"), rng.uniform(-500, 500, 6)
    np.testing.assert_allclose(carried_part(axes, positions), by_pinocchio(axes, positions), atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_the_robot_is_where_a_chain_of_joints_carries_it(seed):
    rng = np.random.default_rng(seed)
    axes, positions = random_axes(rng, "robot"), rng.uniform(-500, 500, 6)
    base = random_pose(rng)
    home = by_pinocchio(axes, np.zeros(6))
    expected = (
        by_pinocchio(axes, positions) @ se3.inverse(home) @ base
    )  # the base stays where it is on the last carriage
    np.testing.assert_allclose(carried_robot(axes, positions) @ base, expected, atol=1e-12)
