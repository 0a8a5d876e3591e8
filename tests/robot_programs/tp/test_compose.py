"""New TP programs."""

import numpy as np
import pytest

from robot_programs.reading import compose_program, motions_to_joints
from robot_programs.tp.read import read_tp
from taskcal.errors import TaskcalError
from tests.robot_programs.tp.samples import R2000, degrees, read

Q = np.stack([degrees(0, 10, -20, 0, -60, 0), degrees(10, -20, 5, 170, 45, -200.5)])


def test_a_measuring_program_is_read_back():
    source = compose_program(
        "Measure.ls", R2000, motions_to_joints(R2000, Q, "Measure.ls"), notes=["pose 1", "pose 2"], wait_s=2.0
    )
    program = read_tp([source], robot=R2000)
    assert program.diagnostics == ()
    np.testing.assert_allclose([move.end.q for move in program.motions], Q, atol=1e-7)
    assert all(move.stops and move.kind == "axes" for move in program.motions)
    assert "   2:J P[1] 10% FINE ;\r\n   3:  WAIT   2.00(sec) ;\r\n" in source.text
    assert "LINE_COUNT\t= 6;" in source.text


def test_motions_to_poses_are_refused():
    motions = read("L P[2] 10mm/sec FINE").motions
    with pytest.raises(
        TaskcalError, match="motion 0 goes to a pose in 'UFRAME 1'; a TP program does not state its frames"
    ):
        compose_program("new.ls", R2000, motions)


def test_the_name_is_one_that_a_controller_takes():
    with pytest.raises(TaskcalError, match="'1st' is not a name of a TP program"):
        compose_program("1st.ls", R2000, motions_to_joints(R2000, Q, "1st.ls"))
