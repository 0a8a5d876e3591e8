"""Which frame, which tool: calibrated frames of what is held and what stands still."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.correction.cell import Cell, Measured
from taskcal.correction.fixed_frame import nominal_flange
from taskcal.correction.frame_calibration import calibrate_frames
from taskcal.correction.rigid_motion import fit_points
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.programs.program import Frame
from taskcal.robot.error_model import ErrorModel
from tests.correction.conftest import REFLECTORS

CUTTER = se3.pose(se3.exp(np.array([0.1, -0.4, 0.2])), np.array([0.02, 0.03, 0.18]))
"""A cutter's frame in the robot's own tool."""

PART = se3.pose(se3.exp(np.array([0.02, 0.03, 0.5])), np.array([1.6, 0.1, 1.3]))


def reflectors_in(T_tool_grasped):
    """Reflector centres in what is held."""
    return {name: se3.apply(se3.inverse(T_tool_grasped), point) for name, point in REFLECTORS.items()}


def cells(calibration, robot, measured):
    cutter = Measured(name="cutter", reflectors=reflectors_in(CUTTER))
    tracked = Measured(name="part", in_tracker=calibration.T_tracker_base @ PART)
    touched = Measured(name="part", touched=measured[[0, 9, 23, 41]], touched_with="probe")
    probe = Measured(name="probe", controller=robot.T_flange_tool @ se3.translation(z=0.05))
    stated = Measured(name="cutter", in_flange=robot.T_flange_tool @ CUTTER, uncertainty=2e-5)
    return {
        "as the controller has them": Cell(),
        "reflectors and tracker": Cell(tools={"cutter": cutter}, parts={"part": tracked}),
        "reflectors and base": Cell(tools={"cutter": cutter}),
        "touched": Cell(tools={"cutter": cutter, "probe": probe}, parts={"part": touched}),
        "stated in the flange": Cell(tools={"cutter": stated}, parts={"part": tracked}),
    }


NAMES = (
    "as the controller has them",
    "reflectors and tracker",
    "reflectors and base",
    "touched",
    "stated in the flange",
)


@pytest.fixture(scope="session")
def cutting(robot, make_moves, middle):
    """A motion with a cutter on a part."""
    tool, part = Frame(name="Cutter", T=robot.T_flange_tool @ CUTTER), Frame(name="PART", T=PART)
    return make_moves([se3.inverse(PART) @ middle @ CUTTER], tool=tool, part=part)[0]


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
    if name == "stated in the flange":
        expected += 2e-5**2 * np.eye(3)
    scale = np.abs(expected).max()
    # points that were touched fit a rigid motion only so far, which differences see and the derivative does not
    np.testing.assert_allclose(frames.covariance(q), expected, atol=(1e-3 if name == "touched" else 2e-5) * scale)


@pytest.mark.parametrize("name", NAMES)
def test_the_uncertainty_of_a_pose_does_not_depend_on_the_others(name, calibration, robot, measured, cutting):
    """Whatever their number, that of the reflectors included."""
    frames = calibrate_frames(calibration, cutting, cells(calibration, robot, measured)[name])
    alone = np.concatenate([frames.variances(measured[[k]]) for k in range(4)])
    for count in (2, 3, 4):
        np.testing.assert_allclose(frames.variances(measured[:count]), alone[:count], rtol=1e-9, atol=1e-18)


def test_a_cutter_known_by_its_reflectors_is_where_they_say(calibration, robot, measured, cutting):
    """Moving the estimated reflectors on the tool, by what the data cannot tell, moves the cutter along."""
    frames = calibrate_frames(calibration, cutting, cells(calibration, robot, measured)["reflectors and tracker"])
    there = se3.apply(frames.grasped.T_tool_grasped, np.array(list(reflectors_in(CUTTER).values())))
    np.testing.assert_allclose(there, calibration.T_tool_target[:, :3, 3], atol=1e-4)


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
    np.testing.assert_allclose(frame.uncertainty(measured) ** 2, total)
    geometry, model_error, tool, part = shares.mean(axis=0)
    assert model_error == pytest.approx(3e-8)
    # what the data cannot tell of base and first axis, of last axis and tool, goes where both are measured
    if name == "as the controller has them":
        assert min(tool, part) > geometry
    if name == "reflectors and tracker":
        assert tool + part < geometry


def test_a_part_touched_by_the_robot_is_right_where_it_was_touched(calibration, robot, measured, cutting):
    """A controller's frame set from three touched points carries the robot's own errors: there they cancel."""
    q = measured[[0, 9, 23]]
    probe = robot.T_flange_tool @ se3.translation(z=0.05)
    cell = cells(calibration, robot, measured)["touched"]
    touched = replace(cell.parts["part"], touched=q)
    frames = calibrate_frames(calibration, cutting, Cell(tools=cell.tools, parts={"part": touched}))
    believed = se3.inverse(PART) @ nominal_flange(robot, q) @ probe
    flange = calibration.tool_in_base(q) @ se3.inverse(_own_tool(calibration))
    truly = se3.inverse(frames.fixed.T_base_fixed) @ flange @ probe
    # three points of a robot that is not rigid in its errors fit a rigid motion only so far
    assert np.linalg.norm(truly[:, :3, 3] - believed[:, :3, 3], axis=1).max() < 3e-4


@pytest.mark.parametrize(("model_error", "repeats"), [(0.0, 0.0), (1e-4, 0.0), (0.0, 5e-5), (1e-4, 5e-5)])
def test_stated_and_true_errors_on_a_touched_part_agree(
    model_error, repeats, calibration, robot, measured, cutting, perturbed
):
    """True robots drawn from the calibration's own covariance touch the part, off by model error and touch, and work on it."""
    rng = np.random.default_rng(11)
    known = replace(calibration, model_error=(model_error, 0.0))
    touches, q = measured[[0, 9, 23, 41]], measured[[5, 17, 33, 50]]
    cell = cells(known, robot, measured)["touched"]
    cell = Cell(tools=cell.tools, parts={"part": replace(cell.parts["part"], touched=touches, uncertainty=repeats)})
    stated = calibrate_frames(known, cutting, cell)
    probe = robot.T_flange_tool @ se3.translation(z=0.05)
    believed = (nominal_flange(robot, touches) @ probe)[:, :3, 3]
    placed = stated.placement.tool_in_part(known.tool_in_base(q))[:, :3, 3]
    root = np.linalg.cholesky(known.z_covariance + 1e-24 * np.eye(len(known.z)))
    errors = []
    for _ in range(150):
        true = perturbed(known, known.z + root @ rng.normal(size=len(known.z)))
        cutter = calibrate_frames(true, cutting, cell).grasped.T_tool_grasped
        flange = true.tool_in_base(touches) @ se3.inverse(_own_tool(true))
        tips = (flange @ probe)[:, :3, 3]
        tips += np.hypot(model_error, repeats) * rng.normal(size=tips.shape)
        part = fit_points(believed, tips)[0] @ cutting.part.T
        tool = true.tool_in_base(q) @ cutter
        tool[:, :3, 3] += model_error * rng.normal(size=(len(q), 3))
        errors.append((se3.inverse(part) @ tool)[:, :3, 3] - placed)
    achieved = np.sqrt(np.mean(np.sum(np.square(errors), axis=2)))
    assert 0.9 < achieved / np.sqrt(np.mean(stated.uncertainty(q) ** 2)) < 1.1


def _own_tool(calibration):
    """The calibrated tool in the flange, from the model's own poses."""
    model = calibration.model
    q = np.zeros((1, len(model.robot.joints)))
    without = calibration.estimate.copy()
    without[[i for i, name in enumerate(model.names) if name.startswith("tool.")]] = 0.0
    flange = model.poses(q, without)[0] @ se3.inverse(model.robot.T_flange_tool)
    return se3.inverse(flange) @ model.poses(q, calibration.estimate)[0]


def test_a_part_in_hand_is_the_same_robot_seen_from_the_other_side(calibration, robot, measured, make_moves, middle):
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
