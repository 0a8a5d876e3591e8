"""Corrected TP programs against another library: the controller's joints by Pinocchio, the true tool by the calibration."""

from functools import cache

import numpy as np
import pytest

from robot_programs.core.program import Frame
from robot_programs.reading import parse_program
from robot_programs.tp.listing import Configuration
from robot_programs.tp.read import read_tp
from taskcal.correction.cell import Cell, ExternalAxis
from taskcal.correction.correct import correct
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from tests.correction.by_pinocchio import COARSE, STEPS, TOOL, defective, meets, true_tool
from tests.robot_programs.tp.samples import R2000, backup, joints, listing
from tests.robot_programs.written import tp_angles

HOME = (5, 10, -20, 10, -50, 20)


@cache
def true_robot():
    return defective("fanuc-r2000ic-165f", np.radians(HOME))


STATIONS = (0.0, 250.0, -120.0)


def test_the_true_tool_of_a_tp_program_is_where_it_wants_it():
    """On a track; FANUC's frames count from axis 2's height, which the chain of the other library tells."""
    calibration, chain, q = true_robot()
    robot = calibration.model.robot
    chain.pose(q)
    world = se3.translation(0.0, 0.0, float(chain.data.oMi[2].translation[2]))
    flange = chain.pose(q) @ np.linalg.inv(robot.T_flange_tool)
    part = flange @ TOOL @ se3.translation(0.05, -0.03, 0.02) @ se3.rotation("x", 0.4)
    direction = np.array([0.6, 0.8, 0.0])
    parts = [np.linalg.inv(se3.translation(*direction * s * 1e-3)) @ part for s in STATIONS]
    wanted = [np.linalg.inv(at) @ se3.translation(*step) @ flange @ TOOL for step, at in zip(STEPS, parts, strict=True)]
    near = [chain.joints(se3.translation(*step) @ flange @ robot.T_flange_tool, q) for step in STEPS]
    positions = {
        str(k + 1): listed_pose(T, Configuration.parse("N U T, 0, 0, 0").of(robot, posture), s)
        for k, (T, posture, s) in enumerate(zip(wanted, near, STATIONS, strict=True))
    }
    track = ExternalAxis(number=1, carries="robot", slides_along=direction, T_frame=None, unit="")
    source = listing(["J P[1] 100% FINE", "L P[2] 100mm/sec FINE", "L P[3] 100mm/sec FINE"], positions)
    frames = {"tool": Frame(name="1", T=TOOL), "part": Frame(name="1", T=np.linalg.inv(world) @ part)}
    program = parse_program((source,), robot=robot, **frames)
    assert len(program.motions) == 3, program.diagnostics
    found = correct(calibration, program, cell=Cell(axes=(track,)), bounds=COARSE)
    assert not found.rejected
    again = parse_program(found.sources, robot=robot, **frames)
    for T, move, at, posture in zip(wanted, again.motions, parts, near, strict=True):
        got = np.linalg.inv(at) @ true_tool(calibration, chain, at @ move.end.T @ np.linalg.inv(TOOL), posture, TOOL)
        meets(got, T)
        assert np.abs(move.end.T[:3, 3] - T[:3, 3]).max() > 1e-5


def listed_pose(T, config, station):
    w, p, r = tp_angles(T)
    x, y, z = T[:3, 3] * 1e3
    return (
        f"   GP1:\r\n\tUF : 1, UT : 1,\t\tCONFIG : '{config}',\r\n\tX = {x:.6f}  mm,\tY = {y:.6f}  mm,\tZ = {z:.6f}  mm,\r\n"
        f"\tW = {w:.7f} deg,\tP = {p:.7f} deg,\tR = {r:.7f} deg,\r\n\tE1 = {station:.3f} mm\r\n"
    )


def test_the_world_frame_is_stated_and_another_one_or_none_is_refused():
    calibration, _, _ = true_robot()
    sources = [listing(["J P[1] 50% FINE"], {"1": joints(*HOME)}), *backup()]
    program = read_tp(sources, robot=R2000)
    found = correct(calibration, program, bounds=COARSE)
    assert any("[0.00, 0.00, -670.00] mm in the world, by FANUC's world frame" in text for text in found.statements)
    with pytest.raises(TaskcalError, match="by FANUC's world frame, on axis 1 at the height of axis 2"):
        correct(calibration, program, cell=Cell(T_world_base=se3.translation(z=0.5)), bounds=COARSE)
    with pytest.raises(TaskcalError, match="read without its robot"):
        correct(calibration, read_tp(sources), bounds=COARSE)
