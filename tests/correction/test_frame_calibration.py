"""Which frame, which tool: calibrated frames of what is held and what stands still."""

from dataclasses import replace

import numpy as np
import pytest

from robot_programs.core.program import Frame
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.frames import calibrate_frames, fit_points
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from tests.correction.cells import REFLECTORS, cells

NAMES = (
    "as the controller has them",
    "reflectors and tracker",
    "reflectors and base",
    "touched",
    "by its tip",
    "stated in the flange",
)


@pytest.mark.parametrize("name", NAMES)
def test_tool_in_part_and_robot_tool_are_inverse(name, calibration, robot, measured, cutting):
    for move in (cutting, replace(cutting, part_in_hand=False)):
        frames = calibrate_frames(calibration, move, cells(calibration, robot, measured)[name])
        B = calibration.tool_in_base(measured)
        np.testing.assert_allclose(frames.placement.robot_tool(frames.placement.tool_in_part(B)), B, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_the_covariance_is_that_of_small_changes_of_the_estimate(
    name, calibration, robot, measured, cutting, perturbed
):
    """Against differences: every entry of the estimate is moved, and everything is related anew."""
    cell, q = cells(calibration, robot, measured)[name], measured[5:8]
    frames = calibrate_frames(calibration, cutting, cell)
    J = np.empty((len(q), 3, len(calibration.z)))
    for k in range(len(calibration.z)):
        h = 1e-6
        at = []
        for sign in (1.0, -1.0):
            z = calibration.z.copy()
            z[k] += sign * h
            other = perturbed(calibration, z)
            moved = calibrate_frames(other, cutting, cell)
            at.append(moved.placement.tool_in_part(other.tool_in_base(q))[:, :3, 3])
        J[:, :, k] = (at[0] - at[1]) / (2.0 * h)
    expected = J @ calibration.z_covariance @ np.swapaxes(J, 1, 2)
    R = frames.placement.tool_in_part(calibration.tool_in_base(q))[:, :3, :3]
    expected += R @ frames.grasped.covariance @ np.swapaxes(R, 1, 2)
    scale = np.abs(expected).max()
    # points that were touched fit a rigid motion only so far, which differences see and the derivative does not
    np.testing.assert_allclose(frames.covariance(q), expected, atol=(1e-3 if name == "touched" else 2e-5) * scale)


def test_what_is_not_known_of_the_part_counts_in_its_own_axes(calibration, robot, measured, cutting):
    """Beside the estimate's part: as small twists of the part about the tracker's origin move the tool in it."""
    frames = calibrate_frames(calibration, cutting, cells(calibration, robot, measured)["touched"])
    root = np.random.default_rng(3).normal(size=(6, 6)) * 1e-5
    there, q = calibration.T_tracker_base @ frames.fixed.T_base_fixed, measured[::12]

    def moved(twist):
        T = se3.inverse(calibration.T_tracker_base) @ se3.pose(se3.exp(twist[3:]), twist[:3]) @ there
        return replace(frames, fixed=replace(frames.fixed, T_base_fixed=T)).points(q)

    D = np.stack([(moved(1e-6 * e) - moved(-1e-6 * e)) / 2e-6 for e in np.eye(6)], axis=2)
    with_it, without = (
        replace(frames, fixed=replace(frames.fixed, covariance=C)).covariance(q)
        for C in (root @ root.T, np.zeros((6, 6)))
    )
    expected = D @ root @ root.T @ np.swapaxes(D, 1, 2)
    np.testing.assert_allclose(with_it - without, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", NAMES)
def test_the_uncertainty_of_a_pose_does_not_depend_on_the_others(name, calibration, robot, measured, cutting):
    """Whatever their number, that of the reflectors included."""
    frames = calibrate_frames(calibration, cutting, cells(calibration, robot, measured)[name])
    alone = np.concatenate([frames.variances(measured[[k]]) for k in range(4)])
    for count in (2, 3, 4):
        np.testing.assert_allclose(frames.variances(measured[:count]), alone[:count], rtol=1e-9, atol=1e-18)


def test_measured_relations_are_sharper_than_the_controllers(calibration, robot, measured, cutting):
    """What the data cannot tell apart, base and first axis, tool and last axis, cancels where both sides are measured."""
    spread = {
        name: float(
            np.sqrt(np.trace(calibrate_frames(calibration, cutting, cell).covariance(measured), axis1=1, axis2=2).max())
        )
        for name, cell in cells(calibration, robot, measured).items()
    }
    assert spread["reflectors and tracker"] < 0.1 * spread["as the controller has them"]
    assert spread["touched"] < spread["reflectors and base"]


@pytest.mark.parametrize("name", NAMES)
def test_the_variance_is_shared_out_among_its_sources(name, calibration, robot, measured, cutting):
    known = replace(calibration, model_error=(1e-4, 0.0))
    frame = calibrate_frames(known, cutting, cells(known, robot, measured)[name])
    shares = frame.variances(measured)
    assert np.all(shares >= 0.0)
    total = np.trace(frame.covariance(measured), axis1=1, axis2=2) + 3e-8
    np.testing.assert_allclose(shares.sum(axis=1), total)
    np.testing.assert_allclose(frame.variances(measured).sum(axis=1), total)
    geometry, model_error, tool, part = shares.mean(axis=0)
    assert model_error == pytest.approx(3e-8)
    # what the data cannot tell of base and first axis, of last axis and tool, goes where both are measured
    if name == "as the controller has them":
        assert min(tool, part) > geometry
    if name == "reflectors and tracker":
        assert tool + part < geometry


def test_what_is_stated_of_a_program_grows_beyond_the_measured_range(calibration, robot, measured, cutting):
    """As the regions of predicted points do."""
    within = replace(calibration, model_error=(1e-4, 0.0), range_growth=0.0)
    beyond = replace(within, range_growth=2.0)
    q = measured[:4] + 0.5 * np.ptp(measured, axis=0)
    growth = beyond.growth_at(q)
    assert growth.max() > 1.5
    cell = cells(within, robot, measured)["as the controller has them"]
    before, after = (calibrate_frames(one, cutting, cell) for one in (within, beyond))
    np.testing.assert_allclose(after.variances(q), growth[:, None] * before.variances(q), rtol=1e-6)
    np.testing.assert_allclose(after.spread(q), np.sqrt(growth)[:, None, None] * before.spread(q), rtol=1e-9)


def test_part_in_hand_is_the_inverse_view(calibration, robot, measured, make_moves, middle):
    """A part in hand is the same robot seen from the other side."""
    tool, part = Frame(name="disc", T=middle), Frame(name="blade", T=robot.T_flange_tool)
    (move,) = make_moves([np.eye(4)], tool=tool, part=part, in_hand=True)
    frames = calibrate_frames(calibration, move, Cell())
    B = calibration.tool_in_base(measured)
    np.testing.assert_allclose(frames.placement.tool_in_part(B), se3.inverse(B) @ middle, atol=1e-12)
    np.testing.assert_allclose(
        move.target(ErrorModel(robot).poses(measured) @ se3.inverse(robot.T_flange_tool)),
        se3.inverse(ErrorModel(robot).poses(measured)) @ middle,
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("tool", "part", "message"),
    [
        (Measured(name="cutter", in_tracker=np.eye(4)), None, "held by the robot"),
        (None, Measured(name="part", in_flange=np.eye(4)), "stands still"),
        (Measured(name="cutter", in_target=np.eye(4)), None, "from points"),
        (Measured(name="cutter", reflectors={"a": np.zeros(3), "x": np.ones(3)}), None, "it takes 3"),
        (
            Measured(name="cutter", reflectors={n: p * 1.2 for n, p in REFLECTORS.items()}),
            None,
            "do not fit: .* check their names and units",
        ),
    ],
)
def test_what_was_measured_must_fit_to_what_it_is_used_for(tool, part, message, calibration, cutting):
    cell = Cell(tools={"cutter": tool} if tool else {}, parts={"part": part} if part else {})
    with pytest.raises(TaskcalError, match=message):
        calibrate_frames(calibration, cutting, cell)


def test_points_are_fitted_by_a_rigid_motion():
    rng = np.random.default_rng(3)
    T = se3.pose(se3.exp(rng.normal(size=3)), rng.normal(size=3))
    points = rng.normal(size=(5, 3))
    found, misfit = fit_points(points, se3.apply(T, points))
    np.testing.assert_allclose(found, T, atol=1e-12)
    assert misfit < 1e-12
    with pytest.raises(TaskcalError, match="in a line"):
        fit_points(np.outer(np.arange(4.0), [1.0, 2.0, 3.0]), points[:4])
