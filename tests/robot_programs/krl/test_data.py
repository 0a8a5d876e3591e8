"""Points that data lists state."""

import pytest

from robot_programs.krl.read import read_krl
from tests.robot_programs.krl.samples import CONFIG_DAT, source
from tests.robot_programs.krl.small_programs import FRAMES, POSE, read, texts


@pytest.mark.parametrize(
    "change", ["XP1.X=5", "XP1=XP2", "MEASURE(XP1)", "N=MEASURE(1,XP1)", "XP1={X 1,Y 0,Z 0,A 0,B 0,C 0}"]
)
def test_points_that_the_program_changes_are_no_constants(change):
    program = read(f"{FRAMES}LIN XP1\n{change}", dat=f"DECL E6POS XP1={POSE}\nDECL E6POS XP2={POSE}")
    assert not program.moves
    assert "XP1 is changed by the program, at part.src:5" in texts(program)[0]


@pytest.mark.parametrize(
    ("change", "stays"), [("BASE_DATA[2].X=5", True), ("BASE_DATA[1].X=5", False), ("BASE_DATA[N]=F", False)]
)
def test_elements_of_an_array_change_one_by_one(change, stays):
    program = read(f"$TOOL=$NULLFRAME\n$BASE=BASE_DATA[1]\nLIN {POSE}\n{change}")
    assert len(program.moves) == stays


def test_own_points_come_before_those_of_the_system_and_local_ones_before_both():
    shared = CONFIG_DAT.replace("ENDDAT", "DECL E6POS XP1={X 1,Y 0,Z 0,A 0,B 0,C 0}\nENDDAT")
    (move,) = read(f"{FRAMES}LIN XP1", dat="DECL E6POS XP1={X 2,Y 0,Z 0,A 0,B 0,C 0}", config=shared).moves
    assert move.end.T is not None
    assert move.end.T[0, 3] == pytest.approx(0.002)
    (move,) = read(f"{FRAMES}LIN XP1", config=shared).moves
    assert move.end.T is not None
    assert move.end.T[0, 3] == pytest.approx(0.001)
    assert not read(f"DECL E6POS XP1\n{FRAMES}LIN XP1", config=shared).moves


def test_points_of_another_program_are_its_own():
    other = source("other.dat", f"DEFDAT OTHER\nDECL E6POS XP1={POSE}\nDECL GLOBAL E6POS XP2={POSE}\nENDDAT\n")
    src = source("part.src", f"DEF PART( )\n{FRAMES}LIN XP1\nLIN XP2\nEND\n")
    program = read_krl([src, other])
    assert [m.end.name for m in program.moves] == ["XP2"]
