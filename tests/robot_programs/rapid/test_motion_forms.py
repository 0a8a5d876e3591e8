"""Motion instructions with arguments of their own: read as the motion they are, and written with all else they say."""

import re

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import MOTION_FORMS
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from tests.robot_programs.rapid.samples import POINTS, ROBOT, Q, module

TEXTS = {
    "MoveL p3,v100,z10,tool0;": ("linear", 0.1, True, False),
    "TriggL p3,v100,gunOn,z10,tool0;": ("linear", 0.1, False, False),
    "TriggJ\\Conc,p3,v100,gunOn\\T2:=gunOff,fine,tool0;": ("joint", 0.1, False, True),
    "TriggC p2,p3,v100,gunOn,z10,tool0;": ("circular", 0.1, False, False),
    "MoveLDO p3,v100,z10,tool0,doGun,1;": ("linear", 0.1, False, False),
    "MoveJAO p3,v100,z10,tool0,aoGun,5.2;": ("joint", 0.1, False, False),
    "MoveCGO p2,p3,v100,z10,tool0\\WObj:=wobj0,goGun\\Value:=3;": ("circular", 0.1, False, False),
    'MoveLSync p3,v100,z10,tool0,"glue";': ("linear", 0.1, False, False),
    "SearchL\\SStop,diFound,p9,p3,v100,tool0;": ("linear", 0.1, False, True),
    "SearchC diFound,p9,p2,p3,v100,tool0;": ("circular", 0.1, False, True),
    "ArcLStart p3,v100,seam1,weld1,z10,tool0;": ("linear", 0.1, False, False),
    "ArcL p3,v100,seam1,weld1\\Weave:=weave1,z10,tool0;": ("linear", None, True, False),
    "ArcCEnd p2,p3,v100,seam1,weld1,fine,tool0;": ("circular", None, False, True),
}
"""Kind, speed, whether it may be divided, and whether it stops."""


@pytest.mark.parametrize("text", TEXTS)
def test_every_form_is_the_motion_to_its_target(text):
    program = read_rapid([module(text, POINTS)])
    assert not program.diagnostics
    (move,) = program.motions
    assert (move.kind, move.speed, move.divisible, move.stops) == TEXTS[text]
    assert move.end.name == "p3"
    assert (move.via.name if move.via else "p2") == "p2"
    assert move.tool.name == "tool0"


def test_an_old_seam_is_known_by_its_options():
    """Before ArcLStart and ArcLEnd, options said where a seam begins and ends; such instructions are not repeated."""
    for option, repeats in (("On", False), ("Off", False), ("", True)):
        text = f"ArcL{chr(92) + option + ',' if option else ''} p3,v100,seam1,weld1,weave1,z10,tool0;"
        (move,) = read_rapid([module(text, POINTS)]).motions
        assert move.divisible is repeats


@pytest.mark.parametrize("text", TEXTS)
def test_numbers_alone_change_in_every_form(text):
    program = read_rapid(
        [module(text.replace("p3", "[[30,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"), POINTS)]
    )
    (move,) = program.motions
    T = se3.translation(0.001, 0.0, 0.0) @ move.end.T
    via = None if move.via is None else Waypoint(kind=move.kind, q=Q, T=move.via.T)
    (source,) = program.rewrite(ROBOT, {0: (Waypoint(kind=move.kind, q=Q, T=T, via=via),)})
    again = program.reread((source,)).motions[0]
    np.testing.assert_allclose(again.end.T[:3, 3], T[:3, 3], atol=1e-8)
    assert re.sub(r"-?\d+", "#", source.text) == re.sub(r"-?\d+", "#", program.sources[0].text)


def test_a_trigger_is_not_written_as_another_kind_of_motion():
    program = read_rapid([module("TriggL p3,v100,gunOn,z10,tool0;", POINTS)])
    with pytest.raises(TaskcalError, match="TriggL is not written as another kind of motion"):
        program.rewrite(ROBOT, {0: (Waypoint(kind="axes", q=Q, T=None),)})


def test_a_routine_of_the_program_may_have_the_name_of_a_form():
    text = "ArcL p3,v100,1,2,z10,tool0;\nENDPROC\nPROC ArcL(robtarget p,speeddata v,num a,num b,zonedata z,PERS tooldata t)"
    program = read_rapid([module(text, POINTS)])
    assert not program.motions


def test_the_forms_have_the_arguments_that_they_are_told_by():
    assert MOTION_FORMS["movel"].counts == (4,)
    assert MOTION_FORMS["movecdo"].counts == (7,)
    assert MOTION_FORMS["searchc"].counts == (6,)
    assert MOTION_FORMS["arclstart"].counts == (6, 7)
    assert "arcl1start" not in MOTION_FORMS
    assert {"arcl1", "arclstart2", "arccend"} <= MOTION_FORMS.keys()


def test_external_axes_alone_are_no_motion_of_the_robot():
    program = read_rapid([module("MoveL p1,v5,fine,tool0;MoveExtJ jOut,vrot10,fine;MoveL p2,v5,fine,tool0;", POINTS)])
    assert [move.follows for move in program.motions] == [None, None]
    assert not program.diagnostics
