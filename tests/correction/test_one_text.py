"""One text for many motions: written out where their corrections differ, as if the pallet had been written so."""

import pytest

from taskcal.correction.correct import correct
from taskcal.correction.correction import Bounds, Correction
from tests.correction.test_shared_targets import FREE, SLOW, krl, rapid  # noqa: F401

FREE_AND_FINE = Bounds(tolerance=5e-5, shift=0.02)

PALLET = [(i, j) for j in range(2) for i in range(3)]
RAPID_LOOP = (
    f"FOR j FROM 0 TO 1 DO\n  FOR i FROM 0 TO 2 DO ! a row\n    MoveL Offs(p1,i*60,j*-50,40),{SLOW}\n"
    f"    MoveL Offs(p1,i*60,j*-50,0),{SLOW}\n  ENDFOR\nENDFOR\nMoveL p2,{SLOW}"
)
RAPID_WHILE = (
    f"h:=0;\nWHILE h<3 DO\n  MoveL Offs(p1,h*60,0,40),{SLOW}\n  MoveL Offs(p1,h*60,0,0),{SLOW}\n  h:=h+1;\nENDWHILE"
)
RAPID_CALLS = "FOR i FROM 0 TO 2 DO\n  place i,-1;\nENDFOR\nplace 1,1;"
PLACE = f"PROC place(num i,num j)\nMoveL Offs(p1,i*60,j*-50,40),{SLOW}\nMoveL Offs(p1,i*60,j*-50,0),{SLOW}\nENDPROC\n"


def positions(found: Correction) -> set[tuple[float, ...]]:
    """Positions to which the corrected program goes, to a micrometre."""
    return {tuple(move.end.T[:3, 3].round(6).tolist()) for move in found.program.reread(found.sources).motions}


def written(cells, text):
    return "\n".join(text.format(i=i, j=j, SLOW=SLOW) for i, j in cells)


ONE_BY_ONE = "MoveL Offs(p1,{i}*60,{j}*-50,40),{SLOW}\nMoveL Offs(p1,{i}*60,{j}*-50,0),{SLOW}"


@pytest.mark.parametrize(
    ("main", "routines", "cells", "end"),
    [
        (RAPID_LOOP, "", PALLET, f"\nMoveL p2,{SLOW}"),
        (RAPID_WHILE, "", [(0, 0), (1, 0), (2, 0)], ""),
        (RAPID_CALLS, PLACE, [(0, -1), (1, -1), (2, -1), (1, 1)], ""),
    ],
)
def test_rapid_loop_is_corrected_as_if_written_out(main, routines, cells, end, rapid, calibration):  # noqa: F811
    found = correct(calibration, rapid(main, routines), bounds=FREE_AND_FINE)
    expected = correct(calibration, rapid(written(cells, ONE_BY_ONE) + end), bounds=FREE_AND_FINE)
    assert not found.rejected
    assert not expected.rejected
    assert positions(found) == positions(expected)


KRL_LOOP = [
    "DECL INT I,J", "FOR J=0 TO 1 ; rows", "  FOR I=0 TO 4 STEP 2", "    LIN XP1:{X I*20,Y J*-50,Z -40,A 0,B 0,C 0}",
    "    LIN XP1:{X I*20,Y J*-50,Z 0,A 0,B 0,C 0}", "  ENDFOR", "ENDFOR", "LIN XP2",
]  # fmt: skip
KRL_CALLS = [
    "DECL INT I", "FOR I=0 TO 2", "  PLACE (I)", "ENDFOR", "PLACE (-1)", "END", "DEF PLACE (N:IN)", "DECL INT N",
    "LIN XP1:{X N*60,Y 0,Z -40,A 0,B 0,C 0}", "LIN XP1:{X N*60,Y 0,Z 0,A 0,B 0,C 0}",
]  # fmt: skip


@pytest.mark.parametrize(
    ("lines", "cells", "end"),
    [
        (KRL_LOOP, [(i * 20, j) for j in range(2) for i in (0, 2, 4)], ["LIN XP2"]),
        (KRL_CALLS, [(0, 0), (60, 0), (120, 0), (-60, 0)], []),
    ],
)
def test_krl_loop_is_corrected_as_if_written_out(lines, cells, end, krl, calibration):  # noqa: F811
    found = correct(calibration, krl(*lines), bounds=FREE_AND_FINE)
    texts = [f"LIN XP1:{{X {x},Y {j}*-50,Z {z},A 0,B 0,C 0}}" for x, j in cells for z in (-40, 0)]
    expected = correct(calibration, krl(*texts, *end), bounds=FREE_AND_FINE)
    assert not found.rejected
    assert not expected.rejected
    assert positions(found) == positions(expected)


def test_coordinated_motion_is_corrected_at_its_points(rapid, calibration):  # noqa: F811
    coordinated = SLOW.replace("v50", "\\ID:=20,v50").removeprefix(",")
    programs = rapid(f"MoveL p1\\ID:=10,{SLOW}\nMoveL p2{coordinated}"), rapid(f"MoveL p1,{SLOW}\nMoveL p2,{SLOW}")
    found, plain = (correct(calibration, program, bounds=Bounds(tolerance=1e-6, shift=0.02)) for program in programs)
    assert found.pieces.tolist() == [1, 1]
    assert plain.pieces[1] > 1
    assert found.sources[0].text.count("\\ID:=") == 2
    assert positions(found) <= positions(plain)


def test_loop_stays_where_nothing_is_corrected(rapid, krl, nominal):  # noqa: F811
    for program in (rapid(RAPID_LOOP), krl(*KRL_CALLS)):
        assert [one.text for one in correct(nominal, program).sources] == [one.text for one in program.sources]
