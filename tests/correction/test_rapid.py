"""RAPID programs, corrected: frames by name, configurations, shared targets, arcs."""

import re

import numpy as np
import pytest

from taskcal.correction.correct import correct
from taskcal.correction.correction import Bounds
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.programs.program import Frame
from taskcal.programs.rapid.compose import compose_rapid
from taskcal.programs.rapid.configuration import Configuration
from taskcal.programs.rapid.read import read_rapid
from taskcal.robot.error_model import ErrorModel
from tests.correction.test_correct import true_poses


@pytest.fixture
def program(robot, shifted, make_moves):
    """A square and an arc, back to its first corner, with a tool and a work object of their own."""
    part = Frame(name="wTable", T=shifted(-300, 20, -40))
    tool = Frame(name="tSpindle", T=robot.T_flange_tool)
    corners = [(0, 0, 0), (200, 0, 0), (200, 150, 20), (0, 150, 20), (0, 0, 0)]
    poses = [se3.inverse(part.T) @ shifted(*corner) for corner in corners]
    via = {4: se3.inverse(part.T) @ shifted(-60, 60, 0)}
    moves = make_moves(poses, vias=via, tool=tool, part=part)
    posture = find_posture(ErrorModel(robot), moves[0].flange(poses[0]) @ robot.T_flange_tool)
    source = compose_rapid("Pocket", robot, moves, q=np.tile(posture, (len(moves), 1)))
    return read_rapid([source])


def test_the_true_tool_goes_to_the_targets_of_a_rapid_program(program, calibration, robot):
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    again = read_rapid(found.sources)
    assert not program.diagnostics
    assert not again.diagnostics
    wanted = np.array([move.end.T for move in program.moves])
    parts = np.array([move.part.T for move in program.moves])
    after = true_poses(calibration, again.moves, robot)
    # positions are written in single precision, 1.2e-4 mm at 1 m
    np.testing.assert_allclose(after[:, :3, 3], (parts @ wanted)[:, :3, 3], atol=2e-7)
    before = true_poses(calibration, program.moves, robot)
    assert np.linalg.norm(before[:, :3, 3] - (parts @ wanted)[:, :3, 3], axis=1).min() > 3e-4


def test_only_numbers_of_targets_change(program, calibration):
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    number = re.compile(r"-?\d+(\.\d+)?")
    before, after = program.sources[0].text.splitlines(), found.sources[0].text.splitlines()
    assert len(before) == len(after)
    for old, new in zip(before, after, strict=True):
        assert number.sub("#", old) == number.sub("#", new)
        assert old == new or "robtarget" in old or old.startswith("    [")


def test_the_configurations_are_those_of_the_joints(program, calibration, robot):
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    again = read_rapid(found.sources)
    seed = found.before.q[found.before.at_target]
    for move, q in zip(again.moves, seed, strict=True):
        assert move.end.posture.agrees(robot, q[None])[0]
        assert move.end.posture == Configuration.of(robot, q, move.end.posture)


def test_lines_and_arcs_are_divided_in_the_text(program, calibration):
    coarse = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    between = coarse.after.length[~coarse.after.at_target].max()
    fine = correct(calibration, program, bounds=Bounds(tolerance=between / 10.0))
    again = read_rapid(fine.sources)
    assert len(again.moves) == len(fine.moves) > len(program.moves)
    assert not again.diagnostics
    for written, meant in zip(again.moves, fine.moves, strict=True):
        assert written.kind == meant.kind
        assert written.follows == meant.follows
        np.testing.assert_allclose(written.end.T, meant.end.T, atol=3e-7)
