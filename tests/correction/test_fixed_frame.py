"""A part that the robot touched."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.correction.cell import Cell
from taskcal.correction.frames import calibrate_frames, fit_points
from taskcal.geometry import se3
from tests.correction.cells import PART, cells


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
