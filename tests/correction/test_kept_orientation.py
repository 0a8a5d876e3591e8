"""Corrected KRL programs whose lines keep the orientation in which they begin ($ORI_TYPE=#CONSTANT)."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.geometry import se3
from taskcal.kinematics.inverse import solve_near
from taskcal.robot.error_model import ErrorModel
from tests.robot_programs.written import krl_frame, krl_joints

HOME = np.radians([[5.0, -75.0, 95.0, 10.0, 35.0, -15.0]])
COARSE = Bounds(tolerance=1.0, shift=0.05, turn=0.2, joint=0.5)


@pytest.mark.parametrize("seed", range(4))
def test_lines_end_in_the_orientation_of_their_start(seed, krl_calibration):
    """The controller drives the true tool to where each line wants it, turned as the corrected start, whatever A B C say."""
    rng, robot = np.random.default_rng(seed), krl_calibration.model.robot
    model, own = ErrorModel(robot), se3.inverse(robot.T_flange_tool)
    start = model.poses(HOME)[0] @ own
    wanted = [start]
    for _ in range(3):
        wanted.append(se3.pose(start[:3, :3], wanted[-1][:3, 3] + rng.uniform(-0.06, 0.06, 3)))
    turned = [
        se3.pose(T[:3, :3] @ Rotation.from_rotvec(rng.uniform(-0.5, 0.5, 3)).as_matrix(), T[:3, 3]) for T in wanted
    ]
    lines = [f"LIN {krl_frame(T)}" for T in turned[1:]]
    head = "DEF P( )\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n$VEL.CP=0.1\n"
    text = head + "\n".join(
        [f"PTP {krl_joints(HOME[0])}", f"PTP {krl_frame(start)}", "$ORI_TYPE=#CONSTANT", *lines, "END", ""]
    )
    found = correct(krl_calibration, read_krl([Source.of(Path("p.src"), text.encode())]), bounds=COARSE)
    assert not found.rejected
    assert len(found.corrected) == 5
    again = read_krl(found.sources)
    first = again.motions[1].end.T
    q = HOME
    for move, T in zip(again.motions[1:], wanted, strict=True):
        # as the controller moves: to the point's place, turned as at the start
        goal = se3.pose(first[:3, :3], move.end.T[:3, 3])
        np.testing.assert_allclose(move.end.T, goal, atol=1e-12)
        solution = solve_near(model, (goal @ robot.T_flange_tool)[None], q)
        assert solution.reached.all()
        q = solution.q
        true = krl_calibration.tool_in_base(q)[0] @ own
        # the correction's own turn, less than a milliradian, is not made: on shifts of a millimetre that is a micrometre or two
        assert np.linalg.norm(true[:3, 3] - T[:3, 3]) < 3e-6
        assert np.linalg.norm(se3.log(true[:3, :3] @ T[:3, :3].T)) < 1e-3
        assert np.linalg.norm(goal[:3, 3] - T[:3, 3]) > 1e-4  # it was moved
