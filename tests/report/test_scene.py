"""A scene has the robot at measured poses, an arrow for each error, the tracker, and the workspace; any robot has one."""

import json
from typing import Literal

import numpy as np
import pytest

from taskcal.identification.validation import measured_errors
from taskcal.report.scene import MAX_ARROWS, MAX_POSES, nice_scale, robot_scene, spread_rows, workspace_layer
from taskcal.task.workspace import Workspace
from tests.laws.calibrations import calibrated


@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "barrett-wam"])
def test_robot_scene_has_all_measured_points(name: str) -> None:
    calibration = calibrated(name, poses=25)
    errors = measured_errors(calibration)
    assert errors is not None
    scene = robot_scene(calibration, errors, None)
    content = json.loads(json.dumps(scene.content(), allow_nan=False))
    layers = {layer["label"]: layer for layer in content["layers"]}
    n = int(np.isfinite(errors.after[..., 0]).sum())
    assert len(content["poses"]) == len(errors.q)
    assert (
        len(layers["error, nominal (registered)"]["by"])
        == len(layers["error, calibrated"]["by"])
        == len(layers["measured points"]["at"])
        == n
    )
    np.testing.assert_allclose(layers["error, calibrated"]["by"], 1e3 * errors.after.reshape(-1, 3), atol=1e-5)
    np.testing.assert_allclose(layers["measured points"]["at"], 1e3 * errors.points.reshape(-1, 3), atol=0.051)
    assert any(layer["kind"] == "marker" for layer in content["layers"])
    joints = len(calibration.model.robot.joints)
    assert all(len(pose["joints"]) == joints and len(pose["links"]) == joints + 1 for pose in content["poses"])
    assert all(len(pose["loop"]) == (3 if calibration.model.robot.four_bar else 0) for pose in content["poses"])


@pytest.mark.parametrize(("shape", "strokes"), [("box", 6), ("cylinder", 6)])
def test_workspace_layer_has_no_gaps(shape: Literal["box", "cylinder"], strokes: int) -> None:
    size = np.array([0.4, 0.4, 0.2])
    space = Workspace(
        T_base_frame=np.eye(4), shape=shape, center=np.zeros(3), size=size, turned=np.eye(3), orientations=()
    )
    layer = workspace_layer(space)
    assert len(layer["at"]) == strokes
    drawn = np.concatenate([np.array(stroke) for stroke in layer["at"]])
    assert np.isfinite(drawn).all()
    np.testing.assert_allclose(np.ptp(drawn, axis=0), size * 1e3, atol=0.11)


def test_scene_thins_large_campaigns_evenly() -> None:
    rows = spread_rows(10 * MAX_ARROWS, MAX_ARROWS)
    assert len(rows) == MAX_ARROWS
    assert (rows[0], rows[-1]) == (0, 10 * MAX_ARROWS - 1)
    assert np.ptp(np.diff(rows)) <= 1
    assert len(spread_rows(7, MAX_POSES)) == 7


def test_nice_scale_is_round() -> None:
    assert [nice_scale(value) for value in (0.0, 1.4, 700.0, 1e9)] == [1.0, 1.0, 500.0, 10000.0]
