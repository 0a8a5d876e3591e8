"""Corrected URScript programs against another library: a UR5's joints by Pinocchio, its true tool by the calibration."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.reading import parse_program
from taskcal.correction.cell import load_cell
from taskcal.correction.correct import correct
from taskcal.errors import TaskcalError
from tests.correction.by_pinocchio import COARSE, TOOL, defective, true_tool
from tests.robot_programs.written import urscript_joints as joints
from tests.robot_programs.written import urscript_pose as pose

HOME = np.radians([10.0, -70.0, 90.0, -100.0, -80.0, 20.0])


@pytest.fixture(scope="module")
def true_robot():
    """A calibration of a UR5 with defects, its chain, and where programs begin."""
    return defective("ur5", HOME)


def corrected(calibration, *lines, **given):
    """A program, its motions, and those of the corrected one."""
    text = "".join(f"  {line}\n" for line in lines)
    source = Source.of(Path("p.script"), f"def p():\n{text}end\n".encode())
    program = parse_program((source,), robot=calibration.model.robot, **given)
    found = correct(calibration, program, bounds=COARSE)
    assert not found.rejected
    assert len(found.corrected) == len(program.motions)
    return found, program.motions, parse_program(found.sources, robot=calibration.model.robot, **given).motions


def test_joints_drive_the_true_tool_where_the_nominal_one_was(true_robot):
    """Of motions of the joints, and of lines to joints."""
    calibration, chain, q = true_robot
    other = q + 0.05
    _, motions, again = corrected(
        calibration, f"set_tcp({pose(TOOL)})", f"movej({joints(q)})", f"movel({joints(other)})"
    )
    for near, move in zip((q, other), again, strict=True):
        driven = move.end.q if move.end.q is not None else chain.joints(move.end.T @ np.linalg.inv(TOOL), near)
        got = calibration.tool_in_base(driven[None])[0]
        np.testing.assert_allclose(got[:3, 3], chain.pose(near)[:3, 3], atol=1e-6)
    assert motions[1].end.posture is not None


def test_its_logic_is_not_lost_in_a_new_program(true_robot):
    """As that of TP, it says no frames of its own, and yet is more than a path."""
    calibration, _, q = true_robot
    source = Source.of(Path("p.script"), f"def p():\n  movej({joints(q)})\nend\n".encode())
    program = parse_program((source,), robot=calibration.model.robot)
    with pytest.raises(TaskcalError, match=r"p\.script is URScript, whose logic a new program would lose"):
        correct(calibration, program, into="p.src")


def test_the_tool_of_a_program_without_one_comes_from_the_cell_file(true_robot, tmp_path):
    calibration, chain, q = true_robot
    quaternion = Rotation.from_matrix(TOOL[:3, :3]).as_quat().tolist()
    mm = (TOOL[:3, 3] * 1e3).tolist()
    text = f'[[tool]]\nname = "mill"\ncontroller = {{ position_mm = {mm}, quaternion = {quaternion} }}\n'
    (tmp_path / "cell.toml").write_text(text)
    measured = load_cell(tmp_path / "cell.toml").tool("mill")
    tool, wanted = Frame(name="mill", T=measured.controller), chain.pose(q) @ TOOL
    line = f"movej(get_inverse_kin({pose(wanted)}, qnear={joints(q)}))"
    _, _, (move,) = corrected(calibration, line, tool=tool)
    got = true_tool(calibration, chain, move.end.T @ np.linalg.inv(TOOL), q, TOOL)
    np.testing.assert_allclose(got[:3, 3], wanted[:3, 3], atol=1e-6)


AT_RUN_TIME = """def cell():  # palletising
  set_tcp(TCP)
  global home = HOME
  global slot = FIRST
  camera = rpc_factory("xmlrpc", "http://127.0.0.1:8080")
  def fetch(target):
    movel(target, a=1.2, v=0.1, r=0.01)
  end
  movej(home)
  movel(slot)
  seen = pose_trans(p[0.1, 0.2, 0, 0, 0, 0], camera.get_pose())
  fetch(seen)
  fetch(slot)
  movej(get_inverse_kin(seen, qnear=home), a=1.4)
  beside = get_inverse_kin(seen, home)
  movej(beside)
  here = get_actual_tcp_pose()
  movel(pose_trans(here, p[0, 0, 0.05, 0, 0, 0]))
  movec(seen, seen)
  movej(camera.get_joints())
  movel(camera.get_pose())
  force_mode(here, [0,0,1,0,0,0], [0,0,1,0,0,0], 2, [0.1,0.1,0.1,0.1,0.1,0.1])
  movel(seen)
  end_force_mode()
end
"""


def test_targets_of_the_running_program_alone_get_a_function(true_robot):
    """Those that it computes, by whatever way they come to a motion; of others, none that is right already or shifted."""
    calibration, chain, q = true_robot
    text = (
        AT_RUN_TIME.replace("TCP", pose(TOOL), 1)
        .replace("HOME", joints(q))
        .replace("FIRST", pose(chain.pose(q) @ TOOL))
    )
    program = parse_program((Source.of(Path("p.script"), text.encode()),), robot=calibration.model.robot)
    found = correct(calibration, program, bounds=COARSE, helper=True)
    (source,) = found.sources
    before, after = text.splitlines(), source.text.splitlines()
    added = len(after) - len(before)
    assert after[0] == before[0]
    assert all(not line or line.startswith("  ") for line in after[1 : 1 + added])
    changed = [new.strip() for old, new in zip(before[1:], after[1 + added :], strict=True) if old != new]
    here = "get_target_joint_positions()"
    assert changed[0] == f"movel(taskcal_corrected(target, {here}), a=1.2, v=0.1, r=0.01)"
    assert changed[1].startswith("movej([")  # own numbers: qnear keeps those of home, and the function those of slot
    assert changed[2].startswith("movel(p[")
    assert changed[3:] == [
        "movej(get_inverse_kin(taskcal_corrected(seen, home), qnear=home), a=1.4)",
        "movej(taskcal_corrected_joints(beside))",
    ]
    left = {one.place.line for one in found.diagnostics if "not corrected at run time" in one.text}
    assert left == {18, 19, 20, 21, 23}
    assert [place.line for place in found.helper.motions] == [7, 14, 16]
    again = parse_program(found.sources, robot=calibration.model.robot)
    assert [move.kind for move in again.motions] == [move.kind for move in found.motions]
    kept = correct(calibration, program, bounds=COARSE, helper=True, keep_joints=True)
    assert "movej(beside)" in kept.sources[0].text


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("def p():\n  movel(pose_inv(f()))\nend\n", "def p():\n  # "),
        ("def p(): movel(pose_inv(f()))\nend\np()\n", "def p():\n# "),
        ("def go(x):\n  movel(x)\nend\ngo(pose_inv(f()))\n", "# "),
        ("movel(pose_inv(f()))\n", "# "),
    ],
)
def test_function_stands_where_all_motions_see_it(text, first, true_robot, tmp_path):
    calibration, _, _ = true_robot
    program = parse_program((Source.of(Path("p.script"), text.encode()),), robot=calibration.model.robot)
    (path,) = correct(calibration, program, helper=True).write(tmp_path / "q.script")
    source = Source.of(path, path.read_bytes())
    assert source.text.startswith(f"{first}Taskcal")
    assert not parse_program((source,), robot=calibration.model.robot).motions


STEERED = {
    "servoj": "servoj([0.1, -1.2, 1.6, -1.7, -1.4, 0.3], t=0.1)", "servoc": "servoc(p[0.3, 0.1, 0.3, 0, 3.1, 0], a=1.2, v=0.25)",
    "servol": "servol(p[0.3, 0.1, 0.3, 0, 3.1, 0])", "speedj": "speedj([0.1, 0, 0, 0, 0, 0], 0.5, 1)",
    "speedl": "speedl([0.0, 0.0, 0.02, 0, 0, 0], 0.5, 1)", "speedl of a camera": "speedl(camera.get_twist(), 0.5, 1)",
    "move_until_contact": "move_until_contact([0, 0, -0.02, 0, 0, 0])", "screw_driving": "screw_driving(p[0, 0, 0.1, 0, 0, 0], 2)",
}  # fmt: skip


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize("inside", [("", ""), ("while True:", "end"), ("if get_standard_digital_in(0):", "end")])
@pytest.mark.parametrize("name", STEERED)
def test_steered_motions_stay_beside_a_helper_with_the_reason(name, inside, wrapped, true_robot):
    calibration, _, q = true_robot
    lines = ["def p():", f"set_tcp({pose(TOOL)})", f"movej({joints(q)})"]
    lines += ["movel(pose_inv(camera.get_pose()))"] if wrapped else []
    lines += [inside[0], STEERED[name], inside[1], "end", ""]
    source = Source.of(Path("p.script"), "\n".join(lines).encode())
    program = parse_program((source,), robot=calibration.model.robot)
    found = correct(calibration, program, bounds=COARSE, helper=True)
    assert STEERED[name] in found.sources[0].text.split("\n")
    assert ("movel(taskcal_corrected(pose_inv(" in found.sources[0].text) == wrapped
    said = [one for one in found.diagnostics if "is not corrected at run time" in one.text]
    assert [one.place.line for one in said] == [lines.index(STEERED[name]) + 1]
    assert "steered while it goes" in said[0].text
