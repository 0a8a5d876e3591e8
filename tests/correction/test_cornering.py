"""The joints of a controller that rounds its corners, and programs that are corrected with rounded corners."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from robot_programs.core.program import Composition, Frame, Zone
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.rewrite import compose_rapid
from taskcal.correction.controller import CORNER_LOST, joint_motion, simulate_controller
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.correction.path import RoundedPath
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.robot.error_model import ErrorModel

MM = 1e-3


@pytest.fixture
def model(robot):
    return ErrorModel(robot)


@pytest.fixture(scope="module")
def square(make_moves, shifted):
    """Lines and an arc, the last motion one of the joints, with turns between them."""

    def build(zone):
        corners = [(0, 0, 0), (200, 0, 0), (200, 150, 20), (0, 150, 20), (0, 0, 0), (100, 50, 30)]
        turns = [(0, 0, 0), (0, 0, 0.1), (0.1, 0, 0.1), (0, 0.1, 0), (0, 0, 0), (0.05, 0, 0)]
        poses = [shifted(*corner) for corner in corners]
        for T, turn in zip(poses, turns, strict=True):
            T[:3, :3] = se3.exp(np.array(turn, dtype=float)) @ T[:3, :3]
        motions = make_moves(poses, vias={4: shifted(-60, 60, 0)})
        motions[5] = replace(motions[5], kind="joint")
        return [replace(move, zone=zone) for move in motions]

    return build


def test_joints_follow_the_rounded_path(robot, model, square):
    """The joints bring the nominal tool along the rounded path."""
    motions = square(Zone(distance=0.01, turn_distance=0.015))
    trajectory = simulate_controller(robot, motions)
    path = RoundedPath(segments=trajectory.segments, corners=trajectory.corners)
    assert trajectory.corners.after.tolist() == [-1, 2, 3, 4, 5, -1]
    np.testing.assert_allclose(model.poses(trajectory.q), path.at(trajectory.move, trajectory.share), atol=1e-8)
    m = np.arange(len(motions))
    np.testing.assert_allclose(model.poses(trajectory.passes), path.at(m, np.ones(len(m))), atol=1e-8)
    # targets are as without zones, though they are not met
    sharp = simulate_controller(robot, square(Zone()))
    np.testing.assert_allclose(trajectory.end, sharp.end, atol=1e-9)
    np.testing.assert_array_equal(sharp.passes, sharp.end)
    assert np.abs(trajectory.passes - trajectory.end)[1:5].max(axis=1).min() > 1e-4
    # each corner is looked at in its middle, and within both halves
    inside = path.inside(trajectory.move, trajectory.share)
    assert np.bincount(trajectory.move[inside], minlength=6).tolist()[1:5] == [2, 3, 3, 3]
    assert (np.diff(trajectory.move + 0.999 * trajectory.share) > 0.0).all()


def test_a_corner_out_of_reach_is_said_and_not_rounded(robot, model, make_moves, shifted):
    """A joint's limit lies between where the path to the target takes it and where the corner would."""
    points = [(0, -400, 0), (15, 0, 0), (0, 400, 0)]
    motions = [replace(move, zone=Zone(distance=1.0)) for move in make_moves([shifted(*point) for point in points])]
    sharp = simulate_controller(robot, [replace(move, zone=Zone()) for move in motions])
    middle = simulate_controller(robot, motions).passes[1]
    beyond = np.maximum(sharp.q.min(axis=0) - middle, middle - sharp.q.max(axis=0))
    j = int(np.argmax(beyond))
    assert beyond[j] > 1e-4
    limits = robot.limits.copy()
    side = 0 if middle[j] < sharp.q[:, j].min() else 1
    limits[j, side] = (sharp.q[:, j].min() if side == 0 else sharp.q[:, j].max()) + (0.5 - side) * -beyond[j]
    joints = tuple(replace(joint, limits=tuple(limits[k])) for k, joint in enumerate(robot.joints))
    narrow = replace(robot, joints=joints)
    trajectory, met = (
        simulate_controller(narrow, [replace(m, zone=zone) for m in motions]) for zone in (motions[1].zone, Zone())
    )
    assert not trajectory.rejected
    assert trajectory.warnings == {1: CORNER_LOST}
    np.testing.assert_array_equal(trajectory.passes, trajectory.end)
    np.testing.assert_array_equal(trajectory.move, met.move)
    np.testing.assert_array_equal(trajectory.q, met.q)


def test_the_joints_turn_no_faster_in_a_corner_than_beside_it(robot, square):
    rounded, sharp = square(Zone(distance=0.02)), square(Zone())
    found, whole = (joint_motion(robot, motions, simulate_controller(robot, motions)) for motions in (rounded, sharp))
    assert (found.speed < 1.01 * whole.speed).all()
    assert (found.speed > 0.9 * whole.speed).all()


@pytest.fixture(scope="module")
def pocket(robot, square, shifted):
    """The same as a RAPID module, with a zone at all targets."""

    def build(zone):
        part = Frame(name="wTable", T=shifted(-300, 20, -40))
        tool = Frame(name="tSpindle", T=robot.T_flange_tool)

        def there(target):
            return None if target is None else replace(target, T=se3.inverse(part.T) @ target.T)

        motions = [
            replace(move, tool=tool, part=part, end=there(move.end), via=there(move.via)) for move in square(Zone())
        ]
        posture = find_posture(ErrorModel(robot), motions[0].flange(motions[0].end.T) @ robot.T_flange_tool)
        source = compose_rapid(
            Composition(name="Pocket", robot=robot, motions=motions, q=np.tile(posture, (len(motions), 1)), zone=zone)
        )
        return read_rapid([source])

    return build


def test_zero_calibration_changes_no_byte_and_no_corner(pocket, nominal):
    """A calibration that found nothing changes no byte and no corner."""
    program = pocket("z10")
    found = correct(nominal, program)
    assert found.sources[0].text == program.sources[0].text
    assert found.before.length.max() < 1e-8
    assert found.before.turn.max() < 1e-7
    np.testing.assert_array_equal(found.after.error, found.before.error)
    assert (found.wanted.corners.after >= 0).sum() == 4


@pytest.fixture(scope="module")
def rounded(pocket, calibration):
    """Corrected with corners of 10 mm, its lines and arcs whole."""
    return correct(calibration, pocket("z10"), bounds=Bounds(tolerance=1e-3))


def test_a_corrected_corner_follows_the_programmed_one(rounded):
    """What is left of the errors is of second order in the size of the zone."""
    found = rounded
    corners = found.after.length[found.wanted.inside(found.after.move, found.after.share)]
    before = found.before.length[found.wanted.inside(found.before.move, found.before.share)]
    assert len(corners) > 10
    assert before.min() > 3e-4
    assert corners.max() < 0.03 * before.min()


def test_targets_that_are_put_in_leave_the_zones_as_they_are(robot, pocket, calibration):
    program = pocket("z100")
    whole, fine = (correct(calibration, program, bounds=Bounds(tolerance=t)) for t in (1e-3, 2e-6))
    assert len(fine.motions) > len(whole.motions) == len(program.motions)
    sizes = []
    for correction in (whole, fine):
        trajectory = simulate_controller(robot, correction.motions)
        ends = [k for k, (_, _, end) in enumerate(correction.origin) if end == 1.0]
        sizes.append(trajectory.corners.exit[ends] * trajectory.segments.length[ends][:, None])
    np.testing.assert_allclose(
        sizes[0], sizes[1], rtol=1e-3
    )  # cuts are laid on the programmed path, which is a little shorter
    said = [str(diagnostic) for diagnostic in fine.diagnostics if "leaves its path" in str(diagnostic)]
    assert said
    assert all("its rounded corners stay clear of further targets" in text for text in said)
    assert np.nanmax(sizes[0]) > 0.09
    assert fine.after.length[fine.after.at_target].max() < 1.1 * whole.after.length[whole.after.at_target].max()


def test_the_error_in_a_corner_is_that_of_the_true_robot_there(model, rounded, calibration):
    """Independently: the middle of the parabola, the joints there by another solver, and the true tool."""
    found, program = rounded, rounded.program
    part = program.motions[1].part.T
    errors = []
    for motions in (program.motions, found.motions):
        P = np.array([part @ move.end.T for move in motions])
        A, B = (P[2] + 10.0 * MM * (P[k] - P[2]) / np.linalg.norm(P[k, :3, 3] - P[2, :3, 3]) for k in (1, 3))
        goal = (A + 2.0 * P[2] + B) / 4.0
        first, second = (se3.log(P[2, :3, :3].T @ P[k, :3, :3]) for k in (1, 3))
        near, far = (15.0 * MM / 4.0 / np.linalg.norm(P[k, :3, 3] - P[2, :3, 3]) for k in (1, 3))
        R = P[2, :3, :3] @ se3.exp(near * first) @ se3.exp(far * second)

        def off(q, p=goal[:3, 3], R=R):
            T = model.poses(q[None])[0]
            return np.concatenate([T[:3, 3] - p, se3.log(T[:3, :3] @ R.T)])

        q = least_squares(off, found.before.q[0], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        errors.append((calibration.tool_in_base(q[None])[0][:3, 3], goal[:3, 3]))
    wanted = errors[0][1]
    for deviations, (true, _) in zip((found.before, found.after), errors, strict=True):
        row = np.flatnonzero(deviations.at_target & (deviations.move == 2))[0]
        np.testing.assert_allclose(part[:3, :3] @ deviations.error[row], true - wanted, atol=2e-7)
