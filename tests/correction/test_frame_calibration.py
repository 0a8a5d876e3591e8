"""Which frame, which tool: calibrated frames of what is held and what stands still."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.frames import calibrate_frames, check_angles, fit_points, grasped_frame, rigid_twists
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from tests.correction.cells import CUTTER, PART, REFLECTORS, cells, reflectors_in, touches, turned
from tests.laws.robots import generators

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
        return replace(frames, fixed=replace(frames.fixed, T_base_fixed=T)).points(frames.moved(q))

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
    np.testing.assert_allclose(
        after.spread(after.moved(q)), np.sqrt(growth)[:, None, None] * before.spread(before.moved(q)), rtol=1e-9
    )


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


# Rigid motions nearest to how points move.


@given(generators)
def test_points_moved_rigidly_give_the_motion_and_its_twist(rng):
    points, at = rng.uniform(-1.0, 1.0, (5, 3)), rng.uniform(-1.0, 1.0, 3)
    R, p = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
    T, farthest = fit_points(points, points @ R.T + p)
    np.testing.assert_allclose(T[:3, :3], R, atol=1e-9)
    np.testing.assert_allclose(T[:3, 3], p, atol=1e-9)
    assert farthest < 1e-9
    v, w = rng.normal(size=(2, 3))
    moved = v + np.cross(w, points - at)
    twist = rigid_twists(points[None], moved[None, :, :, None], at[None])[0, :, 0]
    np.testing.assert_allclose(se3.by_twist(points - at) @ twist, moved, atol=1e-8)


@pytest.mark.parametrize("points", [np.outer([0.0, 1.0, 2.0], [1.0, 2.0, 3.0]), np.zeros((3, 3))])
def test_points_that_locate_no_frame_are_refused(points):
    with pytest.raises(TaskcalError, match="lie in a line or at one place"):
        fit_points(points, points)


# A tool that its reflectors tell.


def test_a_cutter_known_by_its_reflectors_is_where_they_say(calibration, robot, measured, cutting):
    """Moving the estimated reflectors on the tool, by what the data cannot tell, moves the cutter along."""
    frames = calibrate_frames(calibration, cutting, cells(calibration, robot, measured)["reflectors and tracker"])
    there = se3.apply(frames.grasped.T_tool_grasped, np.array(list(reflectors_in(CUTTER).values())))
    np.testing.assert_allclose(there, calibration.T_tool_target[:, :3, 3], atol=1e-4)


def test_a_tool_is_as_uncertain_as_reflectors_placed_anew_make_it(calibration, robot, measured, cutting):
    """Each reflector is off on the tool by the stated uncertainty on each axis: against fits to drawn ones."""
    u, rng = 3e-5, np.random.default_rng(2)
    whole = cells(calibration, robot, measured)["reflectors and tracker"]
    cutter = replace(whole.tools["cutter"], uncertainty=u)
    stated = calibrate_frames(calibration, cutting, replace(whole, tools={"cutter": cutter})).grasped
    own = np.array(list(cutter.reflectors.values()))
    there = se3.apply(stated.T_tool_grasped, own)
    drawn = [fit_points(own + u * rng.normal(size=own.shape), there)[0] for _ in range(4000)]
    origin = se3.apply(se3.inverse(stated.T_tool_grasped), np.array(drawn)[:, :3, 3])
    np.testing.assert_allclose(np.cov(origin.T), stated.covariance, atol=0.06 * np.abs(stated.covariance).max())


def test_the_spread_has_the_covariance_of_what_is_held(calibration, robot, measured, cutting):
    """Independent causes add in squares to what is not known of the tool in the part, but for the part itself."""
    whole = cells(calibration, robot, measured)["reflectors and tracker"]
    cutter = replace(whole.tools["cutter"], uncertainty=1e-3)
    frames = calibrate_frames(calibration, cutting, replace(whole, tools={"cutter": cutter}))
    tracked = replace(frames, fixed=replace(frames.fixed, covariance=np.zeros((6, 6))))
    q = measured[:12]
    spread = frames.spread(frames.moved(q))
    covariance = tracked.covariance(q)
    np.testing.assert_allclose(spread @ np.swapaxes(spread, 1, 2), covariance, atol=1e-9 * np.abs(covariance).max())


def test_a_tip_that_touched_one_point_is_found(calibration, robot, measured, cutting):
    """Whatever the controller has for its place; how it is turned, the controller says."""
    known = replace(calibration, model_error=(1e-9, 0.0))
    tool = cells(calibration, robot, measured)["by its tip"].tool("cutter")
    off = robot.T_flange_tool @ CUTTER @ se3.translation(x=0.02, y=-0.03, z=0.05)
    found, expected = (grasped_frame(known, tool, T) for T in (off, robot.T_flange_tool @ CUTTER))
    np.testing.assert_allclose(found.T_tool_grasped[:3, 3], CUTTER[:3, 3], atol=1e-9)
    np.testing.assert_allclose(found.T_tool_grasped, expected.T_tool_grasped, atol=1e-12)


def test_a_tip_is_as_uncertain_as_touches_repeat(calibration, robot, measured):
    """Each touch misses the point by the stated uncertainty on each axis: against tips of drawn ones."""
    u, rng, count = 2e-4, np.random.default_rng(6), 300
    known = replace(calibration, model_error=(0.0, 0.0))
    q, T = turned(known, measured), robot.T_flange_tool @ CUTTER
    at = (known.tool_in_base(q[:1]) @ CUTTER)[0, :3, 3]
    drawn = touches(
        known,
        np.tile(q, (count, 1)),
        CUTTER[:3, 3],
        np.repeat(at[None], count * len(q), axis=0) + u * rng.normal(size=(count * len(q), 3)),
    ).reshape(count, *q.shape)
    tips = [grasped_frame(known, Measured(name="cutter", tip=one), T).T_tool_grasped[:3, 3] for one in drawn]
    exact = Measured(name="cutter", tip=touches(known, q, CUTTER[:3, 3], at), uncertainty=u)
    # in the tool's axes, as the spread of tips is; the frame's own are turned against them
    frame = grasped_frame(known, exact, T)
    R = frame.T_tool_grasped[:3, :3]
    stated = R @ frame.covariance @ R.T
    np.testing.assert_allclose(np.cov(np.array(tips).T), stated, atol=0.25 * np.abs(stated).max())
    # without a statement, what the touches scatter stands for it
    scattered = [grasped_frame(known, Measured(name="cutter", tip=one), T).covariance for one in drawn]
    np.testing.assert_allclose(R @ np.mean(scattered, axis=0) @ R.T, stated, atol=0.1 * np.abs(stated).max())


@pytest.mark.parametrize(("spoil", "why"), [("still", "hardly turned"), ("moved", "in one point"), ("five", "angles")])
def test_touches_that_tell_no_tip_are_refused(calibration, robot, measured, spoil, why):
    tip = cells(calibration, robot, measured)["by its tip"].tool("cutter").tip.copy()
    if spoil == "still":
        tip = tip[[0, 0, 0, 0]]
    if spoil == "moved":
        tip[2, 0] += np.radians(1.0)
    if spoil == "five":
        tip = tip[:, :5]
    with pytest.raises(TaskcalError, match=why):
        grasped_frame(calibration, Measured(name="cutter", tip=tip), robot.T_flange_tool)


def test_angles_alone_are_refused_of_a_robot_that_slides(robot):
    sliding = next(one for one in map(load_robot, catalogue_names()) if True in one.prismatic)
    q = np.zeros((4, len(sliding.joints)))
    with pytest.raises(TaskcalError, match="slides"):
        check_angles(sliding, "tip_deg", "cutter", q)
    check_angles(robot, "tip_deg", "cutter", np.zeros((4, len(robot.joints))))


# A part that the robot touched.


def test_touched_part_is_right_where_touched(calibration, robot, measured, cutting):
    """A controller's frame set from three touched points carries the robot's own errors: there they cancel."""
    q = measured[[0, 9, 23]]
    probe = robot.T_flange_tool @ se3.translation(z=0.05)
    cell = cells(calibration, robot, measured)["touched"]
    touched = replace(cell.parts["part"], touched=q)
    frames = calibrate_frames(calibration, cutting, Cell(tools=cell.tools, parts={"part": touched}))
    believed = se3.inverse(PART) @ _flange(robot, q) @ probe
    flange = calibration.tool_in_base(q) @ se3.inverse(_own_tool(calibration))
    truly = se3.inverse(frames.fixed.T_base_fixed) @ flange @ probe
    # three points of a robot that is not rigid in its errors fit a rigid motion only so far
    assert np.linalg.norm(truly[:, :3, 3] - believed[:, :3, 3], axis=1).max() < 3e-4


@pytest.mark.parametrize(
    ("model_error", "repeats"),
    [
        pytest.param(0.0, 0.0, marks=pytest.mark.long),
        pytest.param(1e-4, 0.0, marks=pytest.mark.long),
        pytest.param(0.0, 5e-5, marks=pytest.mark.long),
        (1e-4, 5e-5),
    ],
)
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
    believed = (_flange(robot, touches) @ probe)[:, :3, 3]
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
    assert 0.9 < achieved / np.sqrt(stated.variances(q).sum(axis=1).mean()) < 1.1


def _own_tool(calibration):
    """The calibrated tool in the flange, from the model's own poses."""
    model = calibration.model
    q = np.zeros((1, len(model.robot.joints)))
    without = calibration.estimate.copy()
    without[[i for i, name in enumerate(model.names) if name.startswith("tool.")]] = 0.0
    flange = model.poses(q, without)[0] @ se3.inverse(model.robot.T_flange_tool)
    return se3.inverse(flange) @ model.poses(q, calibration.estimate)[0]


def _flange(robot, q):
    """Poses of the nominal robot's flange."""
    return robot.tool_poses(q) @ se3.inverse(robot.T_flange_tool)
