"""Numbers of rewritten targets."""

import re

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.beside import ROBOT, Q, rewritten, shifted
from tests.robot_programs.rapid.samples import module


def test_numbers_that_stay_keep_their_text_and_the_quaternion_its_sign():
    declaration = "CONST robtarget p:=[[1.500,-0.0,7e1],[-0.707,0,-.7072136,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    body = "MoveL p,v100,fine,tool0;"
    assert "[[2.5,-0.0,7e1],[-0.707,0,-.7072136,0]" in rewritten(module(body, declaration), 0)
    program = read_rapid([module(body, declaration)])
    T = program.moves[0].end.T @ np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    text = program.rewrite(ROBOT, {0: (Waypoint(kind="linear", q=Q, T=T),)})[0].text
    q = [float(v) for v in re.search(r"7e1\],\[([^]]*)\]", text)[1].split(",")]
    assert q[0] < 0.0
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=6e-8)


def test_clones_are_written_in_the_style_of_their_declaration():
    declaration = (
        "PERS  robtarget p := [ [ 1.5, 2, 3 ],\n    [ 1,0,0,0 ], ! upright\n"
        "    [ 0,-2,2,0 ], [9E9,9E9,9E9,9E9,9E9,9E9] ] ; ! first\nVAR num n;"
    )
    after = rewritten(module("MoveL p,v100,fine,tool0;MoveL p,v5,fine,tool0;", declaration), 0)
    clone = "PERS  robtarget p_2 := [ [ 2.5, 2, 3 ],\n    [ 1,0,0,0 ], ! upright\n    [ 0,-2,2,0 ], [9E9,9E9,9E9,9E9,9E9,9E9] ];"
    assert f"! first\n{clone}\nVAR num n;" in after


def test_external_axes_keep_their_text():
    target = "[[0,0,0],[1,0,0,0],[0,-2,2,0],[ 100.50,9E9,9E+09,9E9,9E9,9E9]]"
    program = read_rapid([module(f"MoveL {target},v5,fine,tool0;")])
    waypoints = {0: shifted(program, 0)[0] * 2}
    assert program.rewrite(ROBOT, waypoints)[0].text.count("[100.50,9E9,9E+09,9E9,9E9,9E9]") == 1
    assert program.rewrite(ROBOT, waypoints)[0].text.count("[ 100.50,9E9,9E+09,9E9,9E9,9E9]") == 1
