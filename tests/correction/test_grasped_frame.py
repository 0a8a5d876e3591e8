"""A tool that its reflectors tell."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.correction.cell import Measured
from taskcal.correction.frames import calibrate_frames, check_angles, fit_points, grasped_frame
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.catalogue import catalogue_names, load_robot
from tests.correction.cells import CUTTER, cells, reflectors_in, touches, turned


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
    spread = frames.spread(q)
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
