"""Joint speeds along lines and arcs, where the tool turns."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.correction.controller import TURN_SPEED_RAD_S, joint_motion, simulate_controller
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel

TURN = np.radians(1.0)
AXIS = np.array([0.0, 0.6, 0.8])


@pytest.fixture
def turn(make_moves, middle):
    """A joint motion, and a line of some length along which the tool turns by 1°."""

    def build(length, turn_speed):
        end = middle.copy()
        end[:3, :3] = se3.exp(TURN * AXIS) @ end[:3, :3]
        end[0, 3] += length
        return [replace(move, turn_speed=turn_speed) for move in make_moves([middle, end], speed=0.5)]

    return build


@pytest.mark.parametrize("length", [0.0, 1e-8, 1e-4])
@pytest.mark.parametrize("turn_speed", [0.2, None])
def test_a_reorientation_has_its_own_speed(robot, turn, length, turn_speed):
    """Joint rates are J⁻¹ times the turning of the tool, however short the way of its point."""
    motions = turn(length, turn_speed)
    trajectory = simulate_controller(robot, motions)
    found = joint_motion(robot, motions, trajectory)
    rate = turn_speed or TURN_SPEED_RAD_S
    J = ErrorModel(robot).joint_jacobian(trajectory.q)
    twist = np.concatenate([[length * rate / TURN, 0.0, 0.0], rate * AXIS])
    expected = np.abs(np.linalg.solve(J, np.broadcast_to(twist, (len(J), 6))[..., None])).max(axis=0)[:, 0]
    np.testing.assert_allclose(found.speed, expected, rtol=0.1, atol=0.01 * rate)
    assert found.turn_speed_assumed == (1 if turn_speed is None else None)


def test_the_path_speed_counts_where_it_takes_longer(robot, turn):
    motions = turn(0.2, TURN_SPEED_RAD_S)
    trajectory = simulate_controller(robot, motions)
    found = joint_motion(robot, motions, trajectory)
    faster = joint_motion(robot, [replace(m, turn_speed=10.0 * TURN_SPEED_RAD_S) for m in motions], trajectory)
    np.testing.assert_array_equal(found.speed, faster.speed)
    assert joint_motion(robot, [replace(m, turn_speed=None) for m in motions], trajectory).turn_speed_assumed is None


def test_the_motion_nearest_to_a_singular_posture_is_named(robot, make_moves, middle):
    """By the singular values of what the joints do to the tool, a metre counting as two radians."""
    poses = [middle @ se3.translation(0.0, 0.1 * k, 0.1 * (k % 2)) for k in range(4)]
    trajectory = simulate_controller(robot, make_moves(poses))
    found = joint_motion(robot, make_moves(poses), trajectory)
    q = np.concatenate([trajectory.q, trajectory.passes])
    move = np.concatenate([trajectory.move, np.arange(4)])
    values = np.linalg.svd(
        ErrorModel(robot).joint_jacobian(q) * np.array([2.0] * 3 + [1.0] * 3)[:, None], compute_uv=False
    )
    ratio = values[:, -1] / values[:, 0]
    assert np.ptp(ratio) > 0.01 * ratio.max()
    assert found.conditioning == pytest.approx(ratio.min(), rel=1e-6)
    assert found.nearest_singular == move[np.argmin(ratio)]
