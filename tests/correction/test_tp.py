"""TP programs of a FANUC robot, corrected: frames of a backup, configurations, lines of their own."""

import numpy as np
import pytest

from robot_programs.core.program import Waypoint, angles
from robot_programs.tp.read import read_tp
from taskcal.correction.cell import Cell
from taskcal.correction.correct import correct
from taskcal.correction.correction import Bounds
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.correction.cells import REFLECTORS
from tests.correction.test_correct import true_poses
from tests.robot_programs.tp.samples import R2000, backup, degrees, joints, listing, pose

COARSE = Bounds(tolerance=1.0, shift=0.02)


@pytest.fixture(scope="module")
def calibration():
    """A robot with defects, identified from three reflectors."""
    rng = np.random.default_rng(3)
    q = rng.uniform(degrees(-40, -20, -60, -90, -100, -90), degrees(40, 40, 10, 90, -20, 90), (50, 6))
    model = ErrorModel(R2000)
    campaign, _ = simulate(model, q, rng=rng, targets=REFLECTORS)
    return identify(model, campaign)


@pytest.fixture(scope="module")
def program():
    """A square with an arc in user frame 1, from a position by joints."""
    first = read_tp(
        [listing(["J P[1] 100% FINE"], {"1": joints(0, 25, -30, 10, -60, 20)}), *backup()], robot=R2000
    ).motions[0]
    flange = ErrorModel(R2000).poses(first.end.q[None])[0] @ se3.inverse(R2000.T_flange_tool)
    T = first.target(flange)
    r, p, w = angles(T[:3, :3])
    x, y, z = T[:3, 3] * 1e3
    corners = {"2": (0, 0, 0), "3": (150, 0, 0), "4": (150, 100, 10), "5": (75, 130, 10), "6": (0, 100, 0)}
    positions = {"1": joints(0, 25, -30, 10, -60, 20)}
    positions |= {label: pose(x + a, y + b, z + c, w, p, r) for label, (a, b, c) in corners.items()}
    instructions = [
        "J P[1] 50% FINE",
        *(f"L P[{k}] 200mm/sec CNT50" for k in (2, 3, 4)),
        "C P[5]\r\n    :  P[6] 200mm/sec FINE",
    ]
    return read_tp([listing(instructions, positions), *backup()], robot=R2000)


def test_the_true_tool_goes_to_the_targets_of_a_tp_program(program, calibration):
    found = correct(calibration, program, bounds=COARSE)
    again = program.reread(found.sources)
    assert not program.diagnostics
    assert not again.diagnostics
    parts = np.array([move.part.T for move in program.motions[1:]])
    wanted = (parts @ np.array([move.end.T for move in program.motions[1:]]))[:, :3, 3]
    tip = [se3.inverse(R2000.T_flange_tool) @ move.tool.T for move in program.motions[1:]]
    after = (true_poses(calibration, again.motions[1:], R2000) @ tip)[:, :3, 3]
    # positions are written to 0.1 µm and 10⁻⁵ degrees
    np.testing.assert_allclose(after, wanted, atol=4e-7)
    before = (true_poses(calibration, program.motions[1:], R2000) @ tip)[:, :3, 3]
    assert np.linalg.norm(before - wanted, axis=1).min() > 2e-4


def test_a_tp_program_that_was_read_without_its_robot_is_refused(program, calibration):
    with pytest.raises(TaskcalError, match="read without its robot"):
        correct(calibration, read_tp(program.sources), bounds=COARSE)


def test_lines_and_arcs_are_divided_in_the_text(program, calibration):
    coarse = correct(calibration, program, bounds=COARSE)
    between = coarse.after.length[~coarse.after.at_target].max()
    fine = correct(calibration, program, bounds=Bounds(tolerance=between / 4.0, shift=0.02))
    again = program.reread(fine.sources)
    assert len(again.motions) == len(fine.motions) > len(program.motions)
    assert not again.diagnostics
    assert [move.kind for move in again.motions] == [move.kind for move in fine.motions]


def test_the_world_frame_is_stated_and_another_one_is_refused(program, calibration):
    found = correct(calibration, program, bounds=COARSE)
    assert any("[0.00, 0.00, -670.00] mm in the world, by FANUC's world frame" in text for text in found.statements)
    with pytest.raises(TaskcalError, match="by FANUC's world frame, on axis 1 at the height of axis 2"):
        correct(calibration, program, cell=Cell(T_world_base=se3.translation(z=0.5)), bounds=COARSE)


def test_corrected_positions_keep_their_configuration(program, calibration):
    found = correct(calibration, program, bounds=COARSE)
    again = program.reread(found.sources)
    seed = found.before.q[found.before.at_target]
    for move, q in zip(again.motions[1:], seed[1:], strict=True):
        assert move.end.posture.agrees(R2000, q[None])[0]


def test_a_corrected_home_position_is_written_by_joints(program):
    q = program.motions[0].end.q + degrees(0.01, 0, 0, 0, 0, 0)
    text = program.rewrite(R2000, {0: (Waypoint(kind="axes", q=q, T=None),)})[0].text
    assert "J1=   0.01000 deg" in text
