"""Which declaration a name stands for."""

import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.diagnosed import reasons
from tests.robot_programs.rapid.samples import POINTS, module, source


def test_each_module_has_its_own_local_data():
    one = source(
        f"MODULE a\nLOCAL {POINTS.splitlines()[0]}\nPROC pa()\nMoveL p1,v5,fine,tool0;\nENDPROC\nENDMODULE", "a.mod"
    )
    two = source(
        f"MODULE b\nLOCAL {POINTS.splitlines()[1].replace('p2', 'p1')}\nPROC pb()\nMoveL p1,v5,fine,tool0;\nENDPROC\nENDMODULE",
        "b.mod",
    )
    three = source("MODULE c\nPROC pc()\nMoveL p1,v5,fine,tool0;\nENDPROC\nENDMODULE", "c.mod")
    program = read_rapid([one, two, three])
    assert [move.end.T[0, 3] for move in program.moves] == pytest.approx([0.01, 0.02])
    assert reasons(program) == [
        "c.mod:3: MoveL stays as it is: 'p1' is not declared in the files; pass the module that declares it"
    ]


def test_names_of_one_scope_that_are_declared_twice_are_not_guessed():
    program = read_rapid([module("MoveL p1,v5,fine,tool0;", POINTS + POINTS)])
    assert "'p1' is declared 2 times" in reasons(program)[0]
