"""A tool that its reflectors tell."""

import numpy as np

from taskcal.correction.frames import calibrate_frames
from taskcal.geometry import se3
from tests.correction.cells import CUTTER, cells, reflectors_in


def test_a_cutter_known_by_its_reflectors_is_where_they_say(calibration, robot, measured, cutting):
    """Moving the estimated reflectors on the tool, by what the data cannot tell, moves the cutter along."""
    frames = calibrate_frames(calibration, cutting, cells(calibration, robot, measured)["reflectors and tracker"])
    there = se3.apply(frames.grasped.T_tool_grasped, np.array(list(reflectors_in(CUTTER).values())))
    np.testing.assert_allclose(there, calibration.T_tool_target[:, :3, 3], atol=1e-4)
