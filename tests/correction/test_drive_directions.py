"""In which direction drives turn along a program, and what a correction makes of it."""

from dataclasses import replace

import numpy as np

from robot_programs.reading import read_program
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.controller import drive_directions, simulate_controller, uses_directions
from taskcal.correction.correct import correct
from taskcal.correction.frames import calibrate_frames
from taskcal.correction.options import Bounds
from taskcal.robot.conditions import MAX_REST_MOTION, Conditions, drive_motion
from tests.correction.test_correct import true_poses, write_path


def zigzag(shifted):
    return [shifted(x, y, 0) for x, y in ((0, 0), (90, 0), (90, 10), (0, 10), (0, 20), (90, 20))]


def came_from(driven, end):
    """Sign of a drive's motion to a sample from where it was last so far away that it cannot have been at rest."""
    away = driven[end] - driven[:end]
    return np.sign(away[np.abs(away) > 2 * MAX_REST_MOTION][-1])


def test_directions_are_those_of_the_moves_between_targets(robot, make_moves, shifted):
    """Where no drive turns over on the way from one target to the next, and each moves by more than at rest."""
    motions = make_moves(zigzag(shifted))
    trajectory = simulate_controller(robot, motions)
    found = drive_directions(robot, motions, trajectory).at(np.arange(6), np.ones(6)).approach
    turned = np.diff(trajectory.end @ drive_motion(robot).T, axis=0)
    np.testing.assert_array_equal(found[0], 0.0)  # nobody knows from where the first target was reached
    clear = np.abs(turned) > 1e-2
    assert clear.sum() > 8
    np.testing.assert_array_equal(found[1:][clear], np.sign(turned)[clear])
    assert (found[1:][clear] > 0).any()
    assert (found[1:][clear] < 0).any()


def test_reversing_drive_turns_over_evenly(robot, make_moves, shifted):
    """A drive that turns over does so evenly and one at rest does not."""
    motions = make_moves(zigzag(shifted))
    trajectory = simulate_controller(robot, motions)
    directions = drive_directions(robot, motions, trajectory)
    assert np.abs(directions.approach).max() <= 1.0
    step = np.abs(np.diff(trajectory.q @ drive_motion(robot).T, axis=0))
    shares = np.linspace(0.0, 1.0, 401)
    along = directions.at(np.full(401, 3), shares).approach
    np.testing.assert_allclose(along[0], directions.at(np.array([2]), np.ones(1)).approach[0], atol=1e-6)
    assert np.abs(np.diff(along, axis=0)).max() < 0.1
    # a tremble below what a controller reports of a joint at rest turns nothing over
    q = trajectory.q + 0.4 * MAX_REST_MOTION * (-1.0) ** np.arange(len(trajectory.q))[:, None]
    trembling = drive_directions(robot, motions, replace(trajectory, q=q)).approach
    assert (step > 20 * MAX_REST_MOTION).any()
    assert (np.sign(trembling[2:]) == np.sign(directions.approach[2:])).mean() > 0.9


def test_after_a_gap_nothing_is_known(robot, make_moves, shifted):
    motions = make_moves(zigzag(shifted))
    motions[3] = replace(motions[3], follows=None, kind="joint")
    directions = drive_directions(robot, motions, simulate_controller(robot, motions))
    np.testing.assert_array_equal(directions.at(np.array([3]), np.ones(1)).approach, 0.0)
    assert np.abs(directions.at(np.array([4]), np.ones(1)).approach).max() == 1.0


def test_corrected_targets_are_met_from_each_side(tmp_path, lost_motion, robot, shifted):
    """The true robot's drives stand where the controller, running the corrected program, drove them to last."""
    program = read_program(write_path(tmp_path / "zigzag.csv", zigzag(shifted)), robot=robot)
    assert uses_directions(lost_motion.model)
    correction = correct(lost_motion, program, bounds=Bounds(tolerance=1.0))
    wanted = np.array([move.end.T for move in program.motions])[1:, :3, 3]
    trajectory = simulate_controller(robot, correction.motions)
    driven = np.concatenate([trajectory.end[:1], trajectory.q]) @ drive_motion(robot).T
    ends = [np.flatnonzero(trajectory.move == move)[-1] + 1 for move in range(1, 6)]
    sides = Conditions(approach=np.array([[came_from(column, end) for column in driven.T] for end in ends]))
    # a drive that is just turning over at a target stands between its sides
    over = (
        np.abs(drive_directions(robot, correction.motions, trajectory).at(np.arange(1, 6), np.ones(5)).approach) == 1.0
    ).all(axis=1)
    assert over.sum() >= 3
    reached = lost_motion.tool_in_base(trajectory.end[1:], sides)[:, :3, 3]
    # drives turn over a little elsewhere in the corrected program than in the one that was given
    np.testing.assert_allclose(reached[over], wanted[over], atol=1e-6)
    in_the_middle = true_poses(lost_motion, correction.motions, robot)[1:, :3, 3]
    off = np.linalg.norm(in_the_middle - wanted, axis=1)
    assert off.max() > 2e-5
    assert correction.after.length[correction.after.at_target].max() < 5e-9


def test_no_lost_motion_needs_no_directions(calibration):
    """A calibration without lost motion asks for no directions."""
    assert not uses_directions(calibration.model)


def test_lines_stay_within_the_tolerance_where_drives_turn_over(tmp_path, lost_motion, robot, shifted):
    program = read_program(write_path(tmp_path / "zigzag.csv", zigzag(shifted)), robot=robot)
    correction = correct(lost_motion, program, bounds=Bounds(tolerance=1e-5))
    assert not correction.rejected
    assert correction.after.length.max() < 1.2e-5
    assert correction.pieces.max() < 100


def test_touched_part_counts_the_drives_directions(calibration, lost_motion, robot, measured, make_moves, middle):
    """Touched in another order, points are reached from other sides; without lost motion that is all the same."""
    touches, probe = measured[[0, 9, 23, 41]], Measured(name="probe", controller=robot.T_flange_tool)
    move = make_moves([middle])[0]

    def place(known, q):
        part = Measured(name="base", touched=q, touched_with="probe")
        cell = Cell(tools={"probe": probe}, parts={"base": part})
        return calibrate_frames(known, move, cell).placement.T_base_fixed[:3, 3]

    again = touches[[0, 2, 1, 3]]
    np.testing.assert_allclose(place(calibration, again), place(calibration, touches), atol=1e-12)
    assert np.linalg.norm(place(lost_motion, again) - place(lost_motion, touches)) > 1e-5


def test_uncertainty_counts_the_lost_motions(lost_motion, measured, make_moves, middle):
    """The uncertainty counts what is not known of the lost motion."""
    frames = calibrate_frames(lost_motion, make_moves([middle])[0], Cell())
    q = measured[:5]
    not_told = frames.variances(q, Conditions(approach=np.zeros_like(q)))
    told = frames.variances(q, Conditions(approach=np.ones_like(q)))
    assert (not_told[:, :2].sum(axis=1) > 1.05 * told[:, :2].sum(axis=1)).all()
