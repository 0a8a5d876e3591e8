"""Paths of CAM systems that become programs of a controller: every motion keeps its kind, in the controller's own words."""

import re

import numpy as np
import pytest

from robot_programs.core.program import Frame
from robot_programs.reading import read_program
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.geometry import se3
from tests.correction.test_correct import write_path

WORDS = {
    "out.mod": {"joint": "MoveJ", "linear": "MoveL", "circular": "MoveC", "axes": "MoveAbsJ"},
    "out.src": {"joint": "PTP", "linear": "LIN", "circular": "CIRC", "axes": "PTP"},
}


def words_of(text: str) -> list[str]:
    """The words of the motions, in the order of the text."""
    return re.findall(r"^\s*(Move\w+|PTP|LIN|CIRC)\b", text, re.MULTILINE)


def rewritten_as(program, calibration, into: str) -> list[str]:
    return words_of(correct(calibration, program, bounds=Bounds(tolerance=1e-2), into=into).sources[0].text)


@pytest.mark.parametrize("into", WORDS)
def test_motions_of_a_table_keep_their_kind(tmp_path, calibration, robot, shifted, into):
    poses = [shifted(x, y, 0) for x, y in ((0, 0), (40, 0), (40, 30), (60, -20), (80, 0), (90, 10))]
    kinds = ["joint", "linear", "joint", "via", "circular", "linear"]
    path = write_path(tmp_path / "path.csv", poses, kinds)
    expected = [WORDS[into][kind] for kind in kinds if kind != "via"]
    assert rewritten_as(read_program(path, robot=robot), calibration, into) == expected


@pytest.mark.parametrize("into", WORDS)
def test_motions_to_joint_positions_keep_their_kind(tmp_path, calibration, robot, into):
    path = tmp_path / "path.csv"
    path.write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,5,-40,10\n3,12,22,6,-42,12\n")
    found = correct(calibration, read_program(path, robot=robot), into=into)
    assert words_of(found.sources[0].text) == [WORDS[into]["axes"]] * 2
    if into.endswith(".src"):
        assert found.sources[0].text.count("A1 ") == 2, "joint positions, not poses"


@pytest.mark.parametrize("into", WORDS)
def test_motions_of_a_tool_path_keep_their_kind(tmp_path, calibration, robot, middle, into):
    """A line, and the quarter of a circle; the file's tool axis points against the tool's z axis."""
    path = tmp_path / "path.apt"
    path.write_text(
        "GOTO/0,0,0,0,0,1\nGOTO/50,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,50),ON,(LINE/0,0,0,0,50,0)\nGOTO/0,80,0\n"
    )
    part = Frame(name="part", T=middle @ se3.pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3)))
    program = read_program(path, robot=robot, tool=Frame(name="spindle", T=robot.T_flange_tool), part=part)
    expected = [WORDS[into][kind] for kind in ("linear", "linear", "circular", "linear")]
    assert rewritten_as(program, calibration, into) == expected


@pytest.mark.parametrize("into", WORDS)
def test_new_corners_are_reported_with_their_distance(tmp_path, calibration, robot, shifted, into):
    """At a right angle, zones of 0.3 mm pass by at a quarter of the square's diagonal."""
    poses = [shifted(x, y, 0) for x, y in ((0, 0), (40, 0), (40, 30), (90, 30), (90, 80))]
    path = write_path(tmp_path / "path.csv", poses)
    found = correct(calibration, read_program(path, robot=robot), into=into)
    (said,) = found.diagnostics
    assert "passes by at 0.106 mm, the farthest of 3 corners" in str(said)
    at_target = found.after.length[found.after.at_target]
    np.testing.assert_allclose(at_target[1:4], 0.3e-3 * np.sqrt(2.0) / 4.0, rtol=0.01)
    whole = correct(calibration, read_program(path, robot=robot))
    assert not whole.diagnostics
    assert whole.after.length[whole.after.at_target].max() < 1e-8
