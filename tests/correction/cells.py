"""A cutter in the hand and a part that stands still, as cells know them in several ways."""

import numpy as np

from taskcal.correction.cell import Cell, Measured
from taskcal.geometry import se3

REFLECTORS = {"a": np.zeros(3), "b": np.array([0.1, 0.0, 0.05]), "c": np.array([0.0, 0.1, 0.02])}

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
