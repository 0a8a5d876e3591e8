"""A nominal controller: the joints to which it drives in a program, and how fast."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from robot_programs.core.program import Frame
from robot_programs.rapid.resolve import Confdata
from taskcal.correction.controller import TURN_SPEED_RAD_S, joint_motion, simulate_controller
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_postures
from taskcal.robot.error_model import ErrorModel


@pytest.fixture(scope="session")
def model(robot):
    return ErrorModel(robot)


@dataclass(frozen=True)
class Elbow:
    """A posture whose joint 5 has a sign."""

    sign: float

    def agrees(self, robot, q):
        return np.sign(q[:, 4]) == self.sign


def test_every_target_is_met_with_its_tool_and_part(robot, model, make_moves, shifted):
    part = se3.pose(se3.exp(np.array([0.1, 0.2, -0.4])), np.array([1.2, 0.3, 0.9]))
    tool = se3.translation(x=0.1, z=0.3) @ robot.T_flange_tool
    poses = [shifted(0, 0, 0), shifted(100, 20, 0), shifted(150, 80, 30)]
    inward = se3.inverse(robot.T_flange_tool) @ tool
    programmed = [se3.inverse(part) @ T @ inward for T in poses]
    motions = make_moves(programmed, tool=Frame(name="t", T=tool), part=Frame(name="p", T=part))
    trajectory = simulate_controller(robot, motions)
    assert not trajectory.rejected
    np.testing.assert_allclose(model.poses(trajectory.end), np.array(poses), atol=1e-8)
    np.testing.assert_allclose(trajectory.start[1:], trajectory.end[:-1])
    assert np.isnan(trajectory.start[0]).all()


def test_samples_lie_on_lines_and_arcs_and_end_in_the_target(robot, model, make_moves, shifted):
    poses = [shifted(0, 0, 0), shifted(100, 0, 0), shifted(200, 0, 0)]
    trajectory = simulate_controller(robot, make_moves(poses, vias={2: shifted(150, 50, 0)}))
    on_line, on_arc = trajectory.move == 1, trajectory.move == 2
    p = (model.poses(trajectory.q)[:, :3, 3] - poses[0][:3, 3]) * 1e3
    np.testing.assert_allclose(p[on_line, 1:], 0.0, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(p[on_arc] - [150.0, 0.0, 0.0], axis=1), 50.0, atol=1e-5)
    assert trajectory.share[np.flatnonzero(on_line)[-1]] == trajectory.share[np.flatnonzero(on_arc)[-1]] == 1.0
    np.testing.assert_array_equal(trajectory.q[np.flatnonzero(on_arc)[-1]], trajectory.end[2])
    # never farther apart than the ways are looked at
    assert np.diff(p[on_arc], axis=0).__abs__().max() < 20.0


def test_a_change_of_tool_starts_where_the_tool_before_ended(robot, make_moves, shifted):
    longer = Frame(name="longer", T=robot.T_flange_tool @ se3.translation(z=0.05))
    motions = make_moves([shifted(0, 0, 0), shifted(50, 0, 0)])
    motions[1] = replace(motions[1], tool=longer)
    trajectory = simulate_controller(robot, motions)
    np.testing.assert_allclose(trajectory.segments.start[1], motions[0].end.T @ se3.translation(z=0.05), atol=1e-12)


def test_the_posture_that_the_program_says_is_taken(robot, model, make_moves, middle):
    postures = find_postures(model, middle)
    assert {-1.0, 1.0} <= set(np.sign(postures[:, 4]))
    for sign in (-1.0, 1.0):
        (move,) = make_moves([middle])
        move = replace(move, end=replace(move.end, posture=Elbow(sign)))
        q = simulate_controller(robot, [move]).end[0]
        assert np.sign(q[4]) == sign
        np.testing.assert_allclose(model.poses(q[None])[0], middle, atol=1e-8)


def test_a_posture_that_is_not_there_is_refused(robot, make_moves, middle, shifted):
    first, second = make_moves([middle, shifted(30, 0, 0)])
    trajectory = simulate_controller(robot, [replace(first, end=replace(first.end, posture=Elbow(0.5))), second])
    assert (
        "in which the robot does not reach it inside its joint limits; it does so in other postures"
        in trajectory.rejected[0]
    )
    assert not re.search(r"\d{3,}", trajectory.rejected[0]), (
        "a count of the postures that were tried says nothing to a user"
    )
    # what follows from an unknown place is found by itself, and has no way
    assert np.isfinite(trajectory.end[1]).all()
    assert not len(trajectory.move)


@pytest.mark.parametrize(("off", "binds", "taken"), [(30.0, True, True), (60.0, True, False), (60.0, False, True)])
def test_nearest_posture_is_taken_as_the_controller_does(off, binds, taken, robot, make_moves, middle, model):
    """A target whose configuration is one quadrant off: up to 45° it is accepted, and always where nothing checks it."""
    (move,) = make_moves([middle])
    own = min(find_postures(model, middle), key=lambda p: abs(p[0]))
    stated = Confdata.of(robot, own)
    # the part is turned with axis 1, so that the posture stands so far beyond the quadrant that is stated
    turn = np.radians(off) + (stated.cf1 + 1) * np.pi / 2 - own[0]
    part = Frame(name="base", T=se3.pose(se3.exp(np.array([0.0, 0.0, turn])), np.zeros(3)))
    move = replace(move, part=part, end=replace(move.end, posture=stated, posture_binds=binds))
    trajectory = simulate_controller(robot, [move])
    text = trajectory.warnings[0] if taken else trajectory.rejected[0]
    assert bool(np.isfinite(trajectory.end[0]).all()) is taken
    assert f"states the posture {stated}" in text
    assert f"{off:.0f}° from it" in text


def test_line_to_another_posture_is_reported(robot, make_moves, middle, shifted):
    """A line that leads to another posture than it says is remarked."""
    first, second = make_moves([middle, shifted(30, 0, 0)])
    sign = float(np.sign(simulate_controller(robot, [first, second]).end[1][4]))
    trajectory = simulate_controller(robot, [first, replace(second, end=replace(second.end, posture=Elbow(-sign)))])
    assert not trajectory.rejected
    assert "the path leads there in another" in trajectory.warnings[1]


def test_joint_positions_are_taken_as_they_are_or_refused(robot, make_moves, middle):
    (move,) = make_moves([middle])
    q = np.radians([10.0, 20.0, 30.0, 0.0, -40.0, 0.0])
    to_joints = replace(move, kind="axes", end=replace(move.end, T=None, q=q))
    trajectory = simulate_controller(robot, [to_joints])
    np.testing.assert_array_equal(trajectory.end[0], q)
    short = replace(to_joints, end=replace(to_joints.end, q=q[:5]))
    assert "has 5 joint positions" in simulate_controller(robot, [short]).rejected[0]
    outside = replace(to_joints, end=replace(to_joints.end, q=q + 2.0))
    assert "is outside" in simulate_controller(robot, [outside]).rejected[0]


def test_nothing_is_driven_in_an_empty_program(robot):
    trajectory = simulate_controller(robot, [])
    assert not len(trajectory.move)
    assert trajectory.end.shape == (0, 6)


# Joint speeds along lines and arcs, where the tool turns.


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
