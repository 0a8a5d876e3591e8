"""What instructions mean, and why some motions stay as they are."""

import numpy as np
import pytest

from robot_programs.rapid.read import read_rapid
from tests.robot_programs.rapid.samples import NINE, POINTS, module, reasons, source


@pytest.mark.parametrize(
    ("declarations", "body", "reason"),
    [
        ("VAR" + POINTS.splitlines()[0][5:], "p1:=CRobT();MoveL p1,v100,fine,tool0;", "'p1' is assigned to in part.mod:4"),
        ("VAR" + POINTS.splitlines()[0][5:], "p1.trans:=CPos();MoveL p1,v100,fine,tool0;", "CPos() is known only at run time"),
        ("VAR" + POINTS.splitlines()[0][5:], "Elsewhere p1;MoveL p1,v100,fine,tool0;", "'p1' is assigned to in part.mod:4"),
        (POINTS, "MoveL p1,v100,fine,tool0\\Mine:=10;", "\\mine is not provided for"),
        (
            f'{POINTS}PERS wobjdata wTable:=[FALSE,FALSE,"STN_1",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n',
            "MoveL p1\\ID:=10,v100,fine,tool0\\WObj:=wTable;",
            "'wTable' moves with STN_1",
        ),
        (POINTS, "MoveL p1,v100,fine,tool0\\WObj:=w7;", "unknown work object 'w7'"),
        (POINTS, "MoveL p1,v100,fine,tool0\\WObj:=p2;", "'p2' is robtarget, not wobjdata"),
        (POINTS, "MoveL *,v100,fine,tool0;", ""),
        (POINTS, "MoveL p1{2},v100,fine,tool0;", ""),
        (POINTS, "MoveAbsJ p1,v100,fine,tool0;", "'p1' is robtarget, not jointtarget"),
        (POINTS, "MoveL Offs(p1,0,0),v100,fine,tool0;", "Offs() is not given a target and three distances"),
        (POINTS, "PDispSet shift;MoveL p1,v100,fine,tool0;", "a program displacement may shift it (PDispSet in part.mod:13)"),
        ("", f"MoveL [[0,0,0],[1,1,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "is not a unit quaternion: its length is 1.414"),
        ("", f"MoveL [[0,0],[1,0,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "is not made of 3 numbers"),
        ("", f"MoveL [[0,0,9E9],[1,0,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "is out of any range"),
        ("", f"MoveAbsJ [[0,0,0,0,0,9E9],{NINE}],v100,fine,tool0;", "does not say the position of every axis"),
        ("CONST num a:=b;CONST num b:=a;", f"MoveL [[a,0,0],[1,0,0,0],[0,0,0,0],{NINE}],v100,fine,tool0;", "in a circle"),
        (POINTS, "MoveL p1,v100,fine,CTool();", "CTool() is known only at run time"),
        (POINTS, "SomeGlue p1,v100,fine,tool0;", "SomeGlue stays as it is: this motion is not read"),
        (POINTS, "TriggL p1,v100,fine,tool0;", "it has 4 arguments instead of 5"),
        (POINTS, "ArcL p1,v100,seam1,fine,tool0;", "it has 5 arguments instead of 6 or 7"),
        (POINTS, "ArcL p1,v100,seam1,weld1\\Corr,fine,tool0;", "\\Corr corrects its path at run time"),
    ],
)  # fmt: skip
def test_reasons_for_leaving_a_motion(declarations, body, reason):
    program = read_rapid([module(body, declarations)])
    assert not program.motions
    assert any(reason in text for text in reasons(program)), reasons(program)


def test_the_reorientation_speed_is_v_ori():
    slow = "CONST speeddata slow:=[50,20,5000,1000];\n"
    motions = ["p1,slow,fine", "p2,slow\\V:=7,fine", "p3,[50,30,1,1],fine", "p4,unheardof,fine"]
    program = read_rapid([module("".join(f"MoveL {move},tool0;" for move in motions), POINTS + slow)])
    assert [move.turn_speed for move in program.motions] == [pytest.approx(np.radians(v)) for v in (20, 20, 30)] + [
        None
    ]


def test_speeds_and_stops():
    motions = ["p1,vmax,z0", "p2,v5\\V:=12,z10\\Z:=3", "p3,v50,z10\\Inpos:=inpos50", "p4,v7000,zMine"]
    program = read_rapid([module("".join(f"MoveL {move},tool0;" for move in motions), POINTS)])
    assert [move.speed for move in program.motions] == [None, 0.012, 0.05, 7.0]
    assert [move.turn_speed for move in program.motions] == [None] + [pytest.approx(np.radians(500.0))] * 3
    assert [move.stops for move in program.motions] == [False, False, True, True]
    assert "the zone of a motion is not known, which is taken as a stop: 'zMine'" in reasons(program)[0]


def test_zones_have_sizes_for_the_tool_point_and_for_its_turning():
    """Technical reference manual, RAPID, data type zonedata, and argument Z of MoveL."""
    own = "CONST zonedata tight:=[FALSE,5,2,2,0.5,2,0.5];\nVAR num n:=1;\n"
    zones = ["z0", "z10", "z10\\Z:=3", "tight", "z5\\Z:=n", "fine", "[FALSE,4,6,6,1,6,1]", "z5\\Z:=later()"]
    program = read_rapid([module("".join(f"MoveL p1,v100,{zone},tool0;" for zone in zones), POINTS + own)])
    found = [move.zone for move in program.motions]
    assert found[-1] is None
    sizes = [(zone.distance * 1e3, zone.turn_distance * 1e3, np.degrees(zone.angle)) for zone in found[:-1]]
    expected = [(0.3, 0.3, 0.03), (10, 15, 1.5), (3, 15, 1.5), (5, 5, 0.5), (1, 8, 0.8), (0, 0, 0), (4, 6, 1)]
    np.testing.assert_allclose(sizes, expected, atol=1e-12)
    assert [move.stops for move in program.motions] == [False] * 5 + [True, False, False]


def test_external_axes_are_read_where_there_are_some():
    body = "MoveL [[0,0,0],[1,0,0,0],[0,0,0,0],[100,9E9,-3.5,9E9,9E9,9E9]],v5,fine,tool0;\nMoveL p1,v5,fine,tool0;"
    program = read_rapid([module(body, POINTS)])
    np.testing.assert_equal(program.motions[0].external, [100.0, np.nan, -3.5, np.nan, np.nan, np.nan])
    assert np.isnan(program.motions[1].external).all()
    assert not program.diagnostics


# Which declaration a name stands for.


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
    assert [move.end.T[0, 3] for move in program.motions] == pytest.approx([0.01, 0.02])
    assert reasons(program) == [
        "c.mod:3: MoveL stays as it is: 'p1' is not declared in the files; pass the module that declares it"
    ]


def test_names_declared_twice_are_refused():
    """Names of one scope that are declared twice are not guessed."""
    program = read_rapid([module("MoveL p1,v5,fine,tool0;", POINTS + POINTS)])
    assert "'p1' is declared 2 times" in reasons(program)[0]
