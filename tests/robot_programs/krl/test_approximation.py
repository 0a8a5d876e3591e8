"""How near KRL motions pass by their targets: $APO, by hand and by KUKA's inline forms."""

import numpy as np
import pytest

from robot_programs.core.program import THROUGH_TARGET
from robot_programs.krl.read import read_krl
from tests.robot_programs.krl.samples import FRAMES, POSE, handling, read


def sizes(program):
    """Distance in millimetres and share of every motion's zone; None where it is not known."""
    return [None if m.zone is None else (round(m.zone.distance * 1e3, 9), m.zone.share) for m in program.motions]


@pytest.mark.parametrize(
    ("body", "distance"),
    [
        ("$APO.CDIS=12.5\nLIN {P} C_DIS", 12.5),
        ("$APO={CDIS 4,CPTP 20}\nLIN {P} C_DIS", 4.0),
        ("$APO.CDIS=4\n$APO={CPTP 20}\nLIN {P} C_DIS", 4.0),
        ("$APO.CDIS=7\nPTP {P} C_DIS", 7.0),
        ("$APO.CDIS=7\nSLIN {P} WITH $APO.CDIS=3 C_SPL", 3.0),
        ("$APO.CDIS=0\nLIN {P} C_DIS", 0.0),
        ("$APO.CDIS=7\n$APO.CVEL=50\nLIN {P} C_DIS C_DIS", 7.0),
        ("LIN {P} C_DIS", None),
        ("$APO.CDIS=A\nLIN {P} C_DIS", None),
        ("$APO.CDIS=7\nBAS(#INITMOV,0)\n{F}LIN {P} C_DIS", None),
        ("$APO.CDIS=7\nIF $IN[1] THEN\n$APO.CDIS=8\nENDIF\nLIN {P} C_DIS", None),
        ("$APO.CDIS=7\nLIN {P} C_VEL", None),
        ("$APO.CDIS=7\nLIN {P} C_ORI", None),
    ],
)
def test_a_distance_is_that_of_the_line_before(body, distance):
    program = read(FRAMES + body.replace("{P}", POSE).replace("{F}", FRAMES))
    (found,) = sizes(program)
    assert found == (None if distance is None else (distance, np.inf))
    assert not program.motions[0].stops


def test_a_share_of_motions_of_the_joints_is_of_half_their_way():
    program = read(f"{FRAMES}$APO.CPTP=50\nPTP {POSE} C_PTP\nLIN {POSE} C_PTP\nPTP {POSE} C_PTP C_DIS\nPTP {POSE}")
    assert sizes(program) == [(np.inf, 0.25), None, None, (0.0, np.inf)]
    assert program.motions[-1].zone is THROUGH_TARGET


def test_the_inline_forms_set_it_from_their_parameters():
    """As KUKA's bas.src does: APO_DIST of PDAT counts in percent, that of LDAT in millimetres."""
    program = read_krl(handling())
    by_target = {move.end.name: move for move in program.motions}
    assert by_target["XP4"].zone.distance == pytest.approx(0.05)
    passing = [move for move in program.motions if move.end.name == "XP1" and not move.stops]
    assert [move.zone.share for move in passing] == [0.5]


@pytest.mark.parametrize("function", ["SAPO", "SAPO_PTP"])
def test_motions_of_one_line_take_it_from_their_own_parameters(function):
    body = f"{FRAMES}$APO.CDIS=1\nSLIN {POSE} WITH $APO={function}(LC1) C_DIS\nLIN {POSE} C_DIS"
    program = read(body, "DECL LDAT LC1={VEL 2.0,ACC 100.0,APO_DIST 30.0,APO_FAC 50.0}")
    assert sizes(program) == [(30.0, np.inf), (1.0, np.inf)]


def test_what_a_routine_sets_holds_behind_its_call():
    body = f"{FRAMES}$APO.CDIS=1\nSETS()\nLIN {POSE} C_DIS\nEND\nDEF SETS()\n$APO.CDIS=6"
    assert sizes(read(body)) == [(6.0, np.inf)]
