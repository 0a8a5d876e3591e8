"""A cutter in the hand and a part that stands still, as cells know them in several ways."""

import numpy as np

from taskcal.correction.cell import Cell, Measured
from taskcal.geometry import se3
from taskcal.kinematics.inverse import solve_near

REFLECTORS = {"a": np.zeros(3), "b": np.array([0.1, 0.0, 0.05]), "c": np.array([0.0, 0.1, 0.02])}

CUTTER = se3.pose(se3.exp(np.array([0.1, -0.4, 0.2])), np.array([0.02, 0.03, 0.18]))
"""A cutter's frame in the robot's own tool."""


PART = se3.pose(se3.exp(np.array([0.02, 0.03, 0.5])), np.array([1.6, 0.1, 1.3]))


def reflectors_in(T_tool_grasped):
    """Reflector centres in what is held."""
    return {name: se3.apply(se3.inverse(T_tool_grasped), point) for name, point in REFLECTORS.items()}


def touches(calibration, q, tip, at):
    """Joint positions near some at which a point of the calibrated robot's tool is at places in its base."""
    T = calibration.tool_in_base(q)
    T[:, :3, 3] = at - T[:, :3, :3] @ tip
    reached = solve_near(calibration.model, T, q, calibration.estimate)
    assert reached.reached.all()
    return reached.q


def turned(calibration, measured):
    """Joint positions that turn the tool in many ways, near the middle of the task."""
    middle = calibration.tool_in_base(measured[:1])[0, :3, 3]
    rotation = se3.exp(np.radians(25.0) * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0.7, 0.7, 0], [0, 0, 1]]))
    T = se3.pose(calibration.tool_in_base(measured[:1])[0, :3, :3] @ rotation, np.repeat(middle[None], 5, axis=0))
    return solve_near(calibration.model, T, np.repeat(measured[:1], len(T), axis=0), calibration.estimate).q


def cells(calibration, robot, measured):
    cutter = Measured(name="cutter", reflectors=reflectors_in(CUTTER))
    tracked = Measured(name="part", in_tracker=calibration.T_tracker_base @ PART)
    touched = Measured(name="part", touched=measured[[0, 9, 23, 41]], touched_with="probe")
    probe = Measured(name="probe", controller=robot.T_flange_tool @ se3.translation(z=0.05))
    q = turned(calibration, measured)
    at = (calibration.tool_in_base(q[:1]) @ CUTTER)[0, :3, 3]
    by_tip = Measured(name="cutter", tip=touches(calibration, q, CUTTER[:3, 3], at))
    stated = Measured(name="cutter", in_flange=robot.T_flange_tool @ CUTTER, uncertainty=2e-5)
    return {
        "as the controller has them": Cell(),
        "reflectors and tracker": Cell(tools={"cutter": cutter}, parts={"part": tracked}),
        "reflectors and base": Cell(tools={"cutter": cutter}),
        "touched": Cell(tools={"cutter": cutter, "probe": probe}, parts={"part": touched}),
        "by its tip": Cell(tools={"cutter": by_tip}, parts={"part": tracked}),
        "stated in the flange": Cell(tools={"cutter": stated}, parts={"part": tracked}),
    }
