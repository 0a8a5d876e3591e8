"""The lines of a robot end where its model has them, and links keep their lengths."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.mechanism import trace_skeleton
from taskcal.robot.robot import Robot
from tests.laws.robots import NAMED, Case, cases


def _poses(robot: Robot) -> np.ndarray:
    """The robot in the middle of its limits, and near it."""
    middle = np.where(np.isfinite(robot.limits).all(axis=1), robot.limits.mean(axis=1), 0.0)
    return middle + np.random.default_rng(0).uniform(-0.1, 0.1, (4, len(robot.joints)))


@given(cases())
def test_the_lines_end_at_the_tool_and_are_one_way(case: Case) -> None:
    assert_lines_end_at_the_tool(case.robot, case.q)


@pytest.mark.parametrize("name", [*NAMED, "denso-hsr065a1"])
def test_the_lines_of_a_named_robot_end_at_its_tool(name: str) -> None:
    assert_lines_end_at_the_tool(load_robot(name), _poses(load_robot(name)))


def assert_lines_end_at_the_tool(robot: Robot, q: np.ndarray) -> None:
    drawn = trace_skeleton(robot, q)
    np.testing.assert_allclose(drawn.tool, ErrorModel(robot).poses(q), atol=1e-12)
    np.testing.assert_allclose(drawn.links[-1][:, -1], drawn.tool[:, :3, 3], atol=1e-12)
    for before, after in zip(drawn.links, drawn.links[1:], strict=False):
        slid = np.linalg.norm(before[:, -1] - after[:, 0], axis=1)
        assert slid.max() < 1e-12


def test_bars_of_a_loop_have_its_lengths() -> None:
    robot = load_robot("abb-irb6660-205-1.9")
    assert robot.four_bar is not None
    q = _poses(robot)
    bar, drawn = robot.four_bar.bar, trace_skeleton(robot, q)
    lengths = [np.linalg.norm(np.diff(ends, axis=1)[:, 0], axis=1) for ends in drawn.loop]
    for length, nominal in zip(lengths, (bar.crank, bar.rod, bar.rocker), strict=True):
        np.testing.assert_allclose(length, nominal, atol=1e-9)


def test_an_open_chain_has_no_loop() -> None:
    assert not trace_skeleton(load_robot("ur5"), np.zeros((1, 6))).loop
