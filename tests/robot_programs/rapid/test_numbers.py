"""Numbers of rewritten targets."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.program import Waypoint
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.values import quaternion_texts, real
from tests.robot_programs.rapid.beside import ROBOT, Q, rewritten, shifted
from tests.robot_programs.rapid.samples import module


def test_unchanged_numbers_keep_text_and_sign():
    """Numbers that stay keep their text and the quaternion its sign."""
    declaration = "CONST robtarget p:=[[1.500,-0.0,7e1],[-0.707,0,-.7072136,0],[0,-2,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    body = "MoveL p,v100,fine,tool0;"
    assert "[[2.5,-0.0,7e1],[-0.707,0,-.7072136,0]" in rewritten(module(body, declaration), 0)
    program = read_rapid([module(body, declaration)])
    T = program.motions[0].end.T @ np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
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


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-1e-9, "0"), (-0.0, "0"), (600.0, "600"), (0.1, "0.1"), (1711.03125, "1711.0312"), (-12.34567, "-12.34567"),
     (9e9, "9E+09"), (1e6, "1000000"), (0.00002, "0.00002")],
)  # fmt: skip
def test_numbers_by_hand(value, text):
    assert real(value, 5) == text


@given(st.floats(-1e6, 1e6))
def test_the_text_gives_the_single_precision_value_back(value):
    text = real(value, 6)
    assert np.float32(text) == np.float32(round(value, 6))
    assert len(text.strip("-0.").replace(".", "")) <= 9


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_quaternions_stay_of_unit_length(q):
    unit = np.array(q) / np.linalg.norm(q)
    written = np.array([float(text) for text in quaternion_texts(tuple(unit))])
    np.testing.assert_allclose(written, unit, atol=1.2e-7)
    assert abs(np.linalg.norm(written) - 1.0) < 6.1e-8
