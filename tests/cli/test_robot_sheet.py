"""What is said of a robot is what its model has."""

import json

import numpy as np
import pytest

from taskcal.cli.commands.robots import describe
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel


@pytest.mark.parametrize(
    ("name", "notes"),
    [
        ("ur5", []),
        ("abb-irb6660-205-1.9", ["parallelogram in its drive", "with a tool", "parameters published"]),
        ("denso-hsr065a1", ["sliding joints"]),
    ],
)
def test_joints_limits_and_parameters_are_those_of_the_robot(name: str, notes: list[str]) -> None:
    robot = load_robot(name)
    sheet = json.loads(json.dumps(describe(robot)))
    model = ErrorModel(robot)
    assert set(notes) <= set(sheet["notes"])
    assert [joint["name"] for joint in sheet["joint_table"]] == list(robot.joint_names)
    for joint, limits, slides in zip(sheet["joint_table"], robot.limits, robot.prismatic, strict=True):
        shown = np.array(joint["limits_mm"]) / 1e3 if slides else np.radians(joint["limits_deg"])
        np.testing.assert_allclose(shown, limits, atol=1e-9)
    assert [p["name"] for p in sheet["parameters"]] == list(model.names)
    np.testing.assert_allclose([p["tolerance"] for p in sheet["parameters"]], model.tolerances * 1e3, atol=1e-8)
