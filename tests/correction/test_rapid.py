"""RAPID programs, corrected: frames by name, configurations, shared targets, arcs."""

import re
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Composition, Frame
from robot_programs.core.source import Source
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Configuration
from robot_programs.rapid.rewrite import compose_rapid
from taskcal.correction.correct import correct
from taskcal.correction.correction import Bounds
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
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
    motions = make_moves(poses, vias=via, tool=tool, part=part)
    posture = find_posture(ErrorModel(robot), motions[0].flange(poses[0]) @ robot.T_flange_tool)
    source = compose_rapid(
        Composition(name="Pocket", robot=robot, motions=motions, q=np.tile(posture, (len(motions), 1)))
    )
    return read_rapid([source])


def test_the_true_tool_goes_to_the_targets_of_a_rapid_program(program, calibration, robot):
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    again = read_rapid(found.sources)
    assert not program.diagnostics
    assert not again.diagnostics
    wanted = np.array([move.end.T for move in program.motions])
    parts = np.array([move.part.T for move in program.motions])
    after = true_poses(calibration, again.motions, robot)
    # positions are written in single precision, 1.2e-4 mm at 1 m
    np.testing.assert_allclose(after[:, :3, 3], (parts @ wanted)[:, :3, 3], atol=2e-7)
    before = true_poses(calibration, program.motions, robot)
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
    for move, q in zip(again.motions, seed, strict=True):
        assert move.end.posture.agrees(robot, q[None])[0]
        assert move.end.posture == Configuration.of(robot, q, move.end.posture)


def test_lines_and_arcs_are_divided_in_the_text(program, calibration):
    coarse = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    between = coarse.after.length[~coarse.after.at_target].max()
    fine = correct(calibration, program, bounds=Bounds(tolerance=between / 10.0))
    again = read_rapid(fine.sources)
    assert len(again.motions) == len(fine.motions) > len(program.motions)
    assert not again.diagnostics
    for written, meant in zip(again.motions, fine.motions, strict=True):
        assert written.kind == meant.kind
        assert written.follows == meant.follows
        np.testing.assert_allclose(written.end.T, meant.end.T, atol=3e-7)


def test_the_true_tool_goes_to_targets_that_calls_and_loops_give(program, calibration, robot):
    """The corners of the square by a routine with an approach, the others by a loop over an array."""
    text = program.sources[0].text
    head = text[: text.index("  PROC")] if "  PROC" in text else text[: text.index("PROC")]
    names = re.findall(r"robtarget (\w+)", head)[:3]
    elements = ",".join(re.search(rf"robtarget {name}\s*:=\s*(.*?);", head, re.DOTALL)[1] for name in names)
    end = "v100,fine,tSpindle\\WObj:=wTable;"
    lines = [
        f"CONST robtarget row{{3}}:=[{elements}];", "PROC main()", f"MoveJ {names[0]},{end}", f"pick {names[1]};",
        f"pick {names[2]};", "FOR i FROM 1 TO Dim(row,1) DO", f"MoveL row{{i}},{end}", "ENDFOR", "ENDPROC",
        "PROC pick(robtarget p)", f"MoveL Offs(p,0,0,5),{end}", f"MoveL p,{end}", "ENDPROC", "ENDMODULE",
    ]  # fmt: skip
    shared = read_rapid([Source.of(Path("shared.mod"), (head + "\n".join(lines)).encode())])
    assert not shared.diagnostics
    assert sorted(move.texts_motions for move in shared.motions) == [1, 2, 2, 2, 2, 3, 3, 3]
    found = correct(calibration, shared, bounds=Bounds(tolerance=1e-4))
    assert not found.rejected
    again = read_rapid(found.sources)
    order = np.argsort([move.kind != "joint" for move in shared.motions], kind="stable")  # to begin with a posture
    after = true_poses(calibration, [again.motions[i] for i in order], robot)
    wanted = np.array([shared.motions[i].part.T @ shared.motions[i].end.T for i in order])
    off = np.linalg.norm(after[:, :3, 3] - wanted[:, :3, 3], axis=1)
    carried = np.array([shared.motions[i].end.name == "" for i in order])
    assert carried.sum() == 2
    assert off[~carried].max() < 3e-7
    assert off[carried].max() < 1e-4
