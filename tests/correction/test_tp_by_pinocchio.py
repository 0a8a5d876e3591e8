"""Corrected TP programs against another library: the controller's joints by Pinocchio, the true tool by the calibration."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame
from robot_programs.reading import parse_program
from robot_programs.tp.listing import Configuration
from taskcal.correction.cell import Cell, ExternalAxis
from taskcal.correction.correct import correct
from taskcal.geometry import se3
from tests.correction.by_pinocchio import COARSE, STEPS, TOOL, defective, true_tool
from tests.robot_programs.tp.samples import listing

R2000_HOME = (5, 10, -20, 10, -50, 20)


@pytest.mark.parametrize("stations", [None, (0.0, 250.0, -120.0)], ids=["standing", "on a track"])
def test_the_true_tool_of_a_tp_program_is_where_it_wants_it(stations):
    """FANUC's frames count from axis 2's height, which the chain of the other library tells."""
    calibration, chain, q = defective("fanuc-r2000ic-165f", np.radians(R2000_HOME))
    robot = calibration.model.robot
    chain.pose(q)
    world = se3.translation(0.0, 0.0, float(chain.data.oMi[2].translation[2]))
    flange = chain.pose(q) @ np.linalg.inv(robot.T_flange_tool)
    part = flange @ TOOL @ se3.translation(0.05, -0.03, 0.02) @ se3.rotation("x", 0.4)
    direction = np.array([0.6, 0.8, 0.0])
    parts = [np.linalg.inv(se3.translation(*direction * s * 1e-3)) @ part for s in stations or (0.0,) * 3]
    wanted = [np.linalg.inv(at) @ se3.translation(*step) @ flange @ TOOL for step, at in zip(STEPS, parts, strict=True)]
    near = [chain.joints(se3.translation(*step) @ flange @ robot.T_flange_tool, q) for step in STEPS]
    positions = {
        str(k + 1): "   GP1:\r\n" + listed_pose(T, Configuration.parse("N U T, 0, 0, 0").of(robot, posture))
        for k, (T, posture) in enumerate(zip(wanted, near, strict=True))
    }
    if stations:
        positions = {
            k: f"{text.rstrip()},\r\n\tE1 = {s:.3f} mm\r\n"
            for (k, text), s in zip(positions.items(), stations, strict=True)
        }
    track = ExternalAxis(number=1, carries="robot", turns=False, direction=direction, T_frame=None, unit="")
    source = listing(["J P[1] 100% FINE", "L P[2] 100mm/sec FINE", "L P[3] 100mm/sec FINE"], positions)
    frames = {"tool": Frame(name="1", T=TOOL), "part": Frame(name="1", T=np.linalg.inv(world) @ part)}
    program = parse_program((source,), robot=robot, **frames)
    assert len(program.motions) == 3, program.diagnostics
    found = correct(calibration, program, cell=Cell(axes=(track,) if stations else ()), bounds=COARSE)
    assert not found.rejected
    again = parse_program(found.sources, robot=robot, **frames)
    for T, move, at, posture in zip(wanted, again.motions, parts, near, strict=True):
        got = np.linalg.inv(at) @ true_tool(calibration, chain, at @ move.end.T @ np.linalg.inv(TOOL), posture, TOOL)
        np.testing.assert_allclose(got[:3, 3], T[:3, 3], atol=1e-6)
        np.testing.assert_allclose(got[:3, :3], T[:3, :3], atol=2e-6)
        assert np.abs(move.end.T[:3, 3] - T[:3, 3]).max() > 1e-5


def listed_pose(T, config):
    w, p, r = (np.degrees(v) for v in angles_of(T))
    x, y, z = T[:3, 3] * 1e3
    return (
        f"\tUF : 1, UT : 1,\t\tCONFIG : '{config}',\r\n\tX = {x:.6f}  mm,\tY = {y:.6f}  mm,\tZ = {z:.6f}  mm,\r\n"
        f"\tW = {w:.7f} deg,\tP = {p:.7f} deg,\tR = {r:.7f} deg\r\n"
    )


def angles_of(T):
    """W, P, R: turns about the fixed x, y and z, in this order."""
    return Rotation.from_matrix(T[:3, :3]).as_euler("xyz")
