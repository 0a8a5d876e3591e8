"""Touching off removes what the robot's errors at the marks have in common, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from robot_programs.rapid.read import read_rapid
from taskcal.correction.controller import simulate_controller
from taskcal.correction.path import Placement
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from taskcal_demo.closed_loop import MARKS, touch_off
from taskcal_demo.milling import milling_program
from taskcal_demo.procedure import reference_task


@pytest.fixture(scope="module")
def motions(robot):
    return read_rapid((milling_program(robot, reference_task(), 2).source,)).motions


def touched_error(robot, motions, displaced):
    """Where the true cutter is at the targets of the touched-off program, less where it is wanted, metres."""
    inward = se3.inverse(robot.T_flange_tool)
    placements = {
        (m.tool.name, m.part.name): Placement(
            T_tool_grasped=inward @ m.tool.T, T_base_fixed=m.part.T, part_in_hand=False
        )
        for m in motions
    }
    nominal = ErrorModel(robot)

    def true_poses(q):
        return displaced @ nominal.poses(q)

    trajectory = simulate_controller(robot, motions)
    frames = {}
    again = []
    for i, move in enumerate(motions):
        if move.kind == "axes":
            again.append(move)
            continue
        key = move.tool.name, move.part.name
        if key not in frames:
            frames[key] = touch_off(robot, move, trajectory.end[i], placements[key], true_poses, MARKS).T
        again.append(replace(move, part=replace(move.part, T=frames[key])))
    out = []
    for move, end, wanted in zip(motions, simulate_controller(robot, again).end, trajectory.segments.end, strict=True):
        if move.kind != "axes":
            at = placements[move.tool.name, move.part.name].tool_in_part(true_poses(end[None]))[0]
            out.append(at[:3, 3] - wanted[:3, 3])
    return np.array(out)


def test_a_base_that_is_shifted_is_touched_off_whole(robot, motions):
    displaced = se3.translation(2e-3, -1e-3, 1.5e-3)
    assert np.abs(touched_error(robot, motions, displaced)).max() < 1e-8


def test_touch_off_removes_base_rotation_to_second_order(robot, motions):
    """Touch-off removes the rotation of a base except for second-order terms."""
    displaced = se3.pose(se3.exp(np.array([1e-3, -5e-4, 8e-4])), np.zeros(3))
    assert np.abs(touched_error(robot, motions, displaced)).max() < 5e-6


def test_lengths_that_are_wrong_are_not(robot, motions):
    grown = np.diag([1.001, 1.001, 1.001, 1.0])
    assert np.abs(touched_error(robot, motions, grown)).max() > 2e-5
