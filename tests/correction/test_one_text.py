"""One text for many motions, and constants that name targets: what is corrected, and what stays with them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from robot_programs.core.program import Waypoint
from robot_programs.core.written_out import Shared, least_worst
from taskcal.correction.correct import correct
from taskcal.correction.correction import Correction
from taskcal.correction.options import Bounds
from taskcal.geometry import se3
from tests.correction.test_shared_targets import FREE, SLOW, rapid  # noqa: F401

FREE_AND_FINE = Bounds(tolerance=5e-6, shift=0.02)


def positions(found: Correction) -> set[tuple[float, ...]]:
    """Positions to which the corrected program goes, to a micrometre."""
    motions = found.program.reread(found.sources).motions
    return {tuple(move.end.T[:3, 3].round(6).tolist()) for move in motions if move.end.T is not None}


def test_variable_that_is_set_anew_is_another_target(rapid, calibration):  # noqa: F811
    """What is known at run time only is no target of motions to what the variable held before."""
    turns = f"FOR i FROM 0 TO 2 DO\n  put:=p1;\n  put.trans.x:=put.trans.x+i*60;\n  MoveL put,{SLOW}\nENDFOR\n"
    program = rapid(f"{turns}put:=CRobT();\nMoveL put,{SLOW}", "VAR robtarget put;\n")
    assert len(program.motions) == 3
    assert correct(calibration, program, bounds=FREE_AND_FINE).corrected.tolist() == [0, 1, 2]


@pytest.mark.parametrize(("zone", "corrected"), [("z10", set()), ("fine", {"p2"})])
def test_path_with_a_motion_that_stays_is_left_whole(zone, corrected, rapid, calibration):  # noqa: F811
    """A WHILE with a label is not written out, nor has it an array; a motion that follows without a stop stays with it."""
    turn = f"MoveL Offs(p1,h*60,0,0),{SLOW.replace('fine', zone)}\nodd:\nh:=h+1;\n"
    loop = f"h:=0;\nWHILE h<3 DO\n{turn}ENDWHILE\n"
    program = rapid(f"{loop}MoveL p2,{SLOW}")
    found = correct(calibration, program, bounds=FREE_AND_FINE)
    assert len(program.motions) == 4
    assert {program.motions[i].end.name for i in found.corrected} == corrected
    assert any("is of one path with the motion in m.mod:" in why for why in found.rejected.values()) != bool(corrected)


def test_least_worst_value_is_that_of_a_general_optimiser():
    """The middle of random positions, against SciPy's least bound on all distances."""
    points = np.random.default_rng(3).normal(size=(8, 3))
    waypoints = {i: (Waypoint(kind="linear", q=np.zeros(6), T=se3.translation(*p)),) for i, p in enumerate(points)}
    bound = {"type": "ineq", "fun": lambda x: x[3] - np.linalg.norm(points - x[:3], axis=1)}
    least = minimize(lambda x: x[3], [*points.mean(axis=0), 3.0], method="SLSQP", constraints=bound).fun
    group = [Shared(number=i) for i in waypoints]
    got = least_worst(group, waypoints, 1.04 * least)
    assert max(np.linalg.norm(got[i][0].T[:3, 3] - p) for i, p in enumerate(points)) == pytest.approx(least, rel=0.03)
    assert not least_worst(group, waypoints, 0.99 * least)


def test_coordinated_motion_is_corrected_at_its_points(rapid, calibration):  # noqa: F811
    coordinated = SLOW.replace("v50", "\\ID:=20,v50").removeprefix(",")
    programs = rapid(f"MoveL p1\\ID:=10,{SLOW}\nMoveL p2{coordinated}"), rapid(f"MoveL p1,{SLOW}\nMoveL p2,{SLOW}")
    found, plain = (correct(calibration, program, bounds=Bounds(tolerance=1e-6, shift=0.02)) for program in programs)
    assert found.pieces.tolist() == [1, 1]
    assert plain.pieces[1] > 1
    assert found.sources[0].text.count("\\ID:=") == 2
    assert positions(found) <= positions(plain)


# Constants that name targets.

NAMED = "CONST robtarget {0};\n"
LISTS = {
    "a list": ("all{3}:=[p1,p2,p1]", "all{i}", ["p1", "p2", "p1"]),
    "a list of lists": ("all{3,1}:=[[p2],[p1],[p2]]", "all{i,1}", ["p2", "p1", "p2"]),
    "names of names": ("pA:=p1", "all{i}", ["p1", "p2", "p2"]),
}


@pytest.mark.parametrize("motion", ["MoveL {0},v50,fine,tMill\\WObj:=wobj0;", "MoveJ {0},v50,z10,tMill;", "go {0};"])
@pytest.mark.parametrize("kind", LISTS)
def test_named_targets_are_corrected_where_their_numbers_stand(kind, motion, rapid, calibration):  # noqa: F811
    declared, element, names = LISTS[kind]
    more = "all{3}:=[pA,p2,p2]" if kind == "names of names" else ""
    data = "".join(NAMED.format(one) for one in (declared, more) if one)
    go = f"PROC go(robtarget p)\nMoveL p,{SLOW}\nENDPROC\n"
    loop = f"FOR i FROM 1 TO 3 DO\n  {motion.format(element)}\nENDFOR"
    program = with_data(rapid(loop, go), data)
    plain = rapid("\n".join(f"MoveJ {name},v50,fine,tMill;" for name in ("p1", "p2")))
    found, expected = (correct(calibration, one, bounds=FREE_AND_FINE) for one in (program, plain))
    assert not found.rejected
    assert positions(found) == positions(expected)
    assert found.added_lines == 0
    was, now = (one.sources[0].text.split("\n") for one in (program, found))
    changed = [line for line, other in zip(was, now, strict=True) if line != other]
    assert all(line.startswith(("CONST robtarget p1:=", "CONST robtarget p2:=")) for line in changed)
    assert len(changed) == len(set(names))


@pytest.mark.parametrize(
    "other",
    [
        "x:=all{2};\nSetIt x;", "MoveL p2,v50,fine,tMill\\WObj:=wElse;", "MoveL Offs(all{2},0,0,30),v50,fine,tMill;",
        "MoveL Offs(p2,0,AInput(ai1),30),v50,fine,tMill;", "h:=p2.trans.x;\nMoveL Offs(p1,h,0,0),v50,fine,tMill;",
        "MoveC all{1},all{2},v50,fine,tMill;", "MoveL all{2},v50,fine,tMill\\WObj:=wElse;", "p9:=all{2};\nMoveL p9,v50,fine,tMill;",
    ],
)  # fmt: skip
def test_a_named_target_that_something_else_reads_keeps_its_numbers_or_all_agree(other, rapid, calibration):  # noqa: F811
    """Whatever reads it reads what it did, or is corrected as it would be alone."""
    data = (
        NAMED.format("all{2}:=[p1,p2]")
        + 'PERS wobjdata wElse:=[FALSE,TRUE,"",[[9,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'
    )
    data += "VAR robtarget x;\nVAR robtarget p9;\n"
    program = with_data(rapid(f"FOR i FROM 1 TO 2 DO\n  MoveL all{{i}},{SLOW}\nENDFOR\n{other}"), data)
    found = correct(calibration, program, bounds=FREE_AND_FINE)  # checks what it reads
    again = found.program.reread(found.sources)
    for k, (i, _, share) in enumerate(found.origin):
        if share == 1.0 and i in found.rejected:
            assert np.abs(again.motions[k].end.T - found.program.motions[i].end.T).max() < 1e-9
    read = [
        line
        for line in other.split("\n")
        if "AInput" in line or "SetIt" in line or (":=" in line and "Move" not in line)
    ]
    if read:  # these read the numbers as they were
        literal = next(line for line in program.sources[0].text.split("\n") if line.startswith("CONST robtarget p2:="))
        assert literal in found.sources[0].text


def with_data(program, data):
    """A program with more declarations at its start."""
    source = program.sources[0]
    return program.reread((replace(source, text=source.text.replace("MODULE m\n", f"MODULE m\n{data}", 1)),))
