"""Values that the text gives."""

import numpy as np
import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.diagnosed import NINE
from tests.robot_programs.rapid.samples import module


def test_elements_of_a_table_are_named_by_row_and_column():
    values = ",".join(f"[[{x},0,0],[1,0,0,0],[0,0,0,0],{NINE}]" for x in range(6))
    rows = values.replace("]],[[", "]]|[[").split("|")
    table = f"CONST robtarget t{{2,3}}:=[[{','.join(rows[:3])}],[{','.join(rows[3:])}]];"
    (move,) = read_rapid([module("MoveL t{2,1},v5,fine,tool0;", table)]).motions
    assert move.end.name == "t{2,1}"
    assert move.end.T[0, 3] == pytest.approx(0.003)


def test_components_of_records_of_the_program():
    declarations = (
        "RECORD station robtarget pick; num id; ENDRECORD\n"
        f"CONST station s{{2}}:=[[[[1,2,3],[1,0,0,0],[0,0,0,0],{NINE}],1],[[[4,5,6],[1,0,0,0],[0,0,0,0],{NINE}],2]];\n"
    )
    body = "MoveL s{2}.pick,v5,fine,tool0;MoveL Offs(S{last-1}.Pick,0,0,1),v5,fine,tool0;"
    move, shifted = read_rapid([module(body, declarations + "CONST num last:=2;")]).motions
    assert (move.end.name, shifted.end.name) == ("s{2}.pick", "s{1}.pick")
    np.testing.assert_allclose(move.end.T[:3, 3], [0.004, 0.005, 0.006])
