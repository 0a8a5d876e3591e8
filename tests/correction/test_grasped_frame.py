"""A tool that its reflectors tell."""

from dataclasses import replace

import numpy as np

from taskcal.correction.frames import calibrate_frames, fit_points
from taskcal.geometry import se3
from tests.correction.cells import CUTTER, cells, reflectors_in


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
