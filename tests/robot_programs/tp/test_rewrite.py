"""Rewriting touches nothing but the motions that change."""

import re

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.core.source import Source
from robot_programs.tp.read import read_tp
from taskcal.errors import TaskcalError
from tests.robot_programs.tp.generator import moved
from tests.robot_programs.tp.samples import POSITIONS, R2000, backup, degrees, listing, pose, read

SET = ("  UFRAME_NUM=1", "  UTOOL_NUM=1")
Q = degrees(0, 10, -20, 0, -60, 0)


def to(move, shift_mm, kind=None):
    return moved(move, np.array(shift_mm) * 1e-3, np.zeros(3)) if kind is None else Waypoint(kind=kind, q=Q, T=None)


def test_only_numbers_of_a_position_change():
    program = read(*SET, "L P[2:start] 100mm/sec FINE")
    (source, *_) = program.rewrite(R2000, {0: (to(program.motions[0], [0.1, 0.0, 0.0]),)})
    before, after = program.sources[0].text.splitlines(), source.text.splitlines()
    changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert changed == [(
        "\tX =   100.000  mm,\tY =   200.000  mm,\tZ =   300.000  mm,",
        "\tX =  100.1000  mm,\tY =   200.000  mm,\tZ =   300.000  mm,",
    )]  # fmt: skip


def test_a_position_that_others_still_need_is_copied():
    program = read(
        *SET, "L P[2:start] 100mm/sec FINE", "L P[3] 100mm/sec FINE", "L P[2:start] 100mm/sec FINE Offset,PR[2]"
    )
    text = program.rewrite(R2000, {0: (to(program.motions[0], [0.1, 0.0, 0.0]),)})[0].text
    assert re.findall(r"L (P\[\S+\])", text) == ["P[6]", "P[3]", "P[2:start]"]
    assert text.index("P[5]{") < text.index('P[6:"start"]{') < text.index("/END")
    both = {0: (to(program.motions[0], [0.1, 0, 0]),), 2: (to(program.motions[2], [0.1, 0, 0]),)}
    text = program.rewrite(R2000, both)[0].text
    assert re.findall(r"L (P\[\S+\])", text) == ["P[2:start]", "P[3]", "P[2:start]"]


def test_most_motions_to_a_position_get_theirs_in_its_place():
    """The others share a copy where they need the same."""
    program = read(*SET, *(f"L P[2:start] {speed}mm/sec FINE" for speed in (10, 20, 30, 40, 50)))
    shifts = (0.1, 0.3, 0.3, 0.1, 0.3)
    paths = {i: (to(move, [x, 0, 0]),) for i, (move, x) in enumerate(zip(program.motions, shifts, strict=True))}
    text = program.rewrite(R2000, paths)[0].text
    assert re.findall(r"L (P\[\S+\])", text) == ["P[6]", "P[2:start]", "P[2:start]", "P[6]", "P[2:start]"]
    assert "P[7" not in text


def test_inserted_lines_renumber_the_rest():
    """A motion that needs more points gets lines before its own and the rest new numbers."""
    program = read(*SET, "L P[2:start] 100mm/sec FINE ACC50", "C P[3]\r\n    :  P[4] 90mm/sec FINE", "  DO[1]=ON")
    line = tuple(to(program.motions[0], [x, 0, 0]) for x in (-2.0, -1.0, 0.0))
    arc = tuple(to(program.motions[1], [x, 0, 0]) for x in (-1.0, 0.0))
    text = program.rewrite(R2000, {0: line, 1: arc})[0].text
    body = text[text.index("/MN") : text.index("/POS")].splitlines()[1:]
    assert body == [
        "   1:  UFRAME_NUM=1    ;",
        "   2:  UTOOL_NUM=1    ;",
        "   3:L P[6] 100mm/sec CNT100 ACC50    ;",
        "   4:L P[7] 100mm/sec CNT100 ACC50    ;",
        "   5:L P[2:start] 100mm/sec FINE ACC50    ;",
        "   6:C P[8]",
        "    :  P[9] 90mm/sec CNT100    ;",
        "   7:C P[3]",
        "    :  P[4] 90mm/sec FINE    ;",
        "   8:  DO[1]=ON    ;",
    ]
    assert "LINE_COUNT\t= 8;" in text


def test_inserted_lines_end_with_a_semicolon():
    """A motion without number and semicolon is not continued by its new points."""
    whole = listing(["J P[1] 10% FINE"], POSITIONS)
    source = Source.of(whole.path, whole.text.replace("   1:J P[1] 10% FINE    ;", "    :J P[1] 10% FINE").encode())
    program = read_tp([source, *backup()], robot=R2000)
    changed = program.rewrite(R2000, {0: (Waypoint(kind="axes", q=Q, T=None), Waypoint(kind="axes", q=2 * Q, T=None))})
    assert [move.end.q[1] for move in program.reread(changed).motions] == [Q[1], 2 * Q[1]]


def test_conditions_under_a_motion_keep_their_own_numbers():
    lines = ["L P[2] 100mm/sec FINE\r\n      1:  TC_ONLINE (DI[1]) ;\r\n       ------", "L P[3] 100mm/sec FINE"]
    program = read(*SET, *lines)
    text = program.rewrite(R2000, {0: (to(program.motions[0], [-1, 0, 0]), to(program.motions[0], [0, 0, 0]))})[0].text
    assert "      1:  TC_ONLINE" in text
    assert "   5:L P[3]" in text


def test_a_register_becomes_a_position():
    program = read("  UFRAME_NUM=2", "  UTOOL_NUM=1", "L PR[5] 100mm/sec FINE", "J PR[1:home] 10% FINE")
    home = Waypoint(kind="axes", q=degrees(20.001, 0, 0, 0, -90, 0), T=None)
    text = program.rewrite(R2000, {0: (to(program.motions[0], [0.1, 0, 0]),), 1: (home,)})[0].text
    assert "L P[6] 100mm/sec FINE" in text
    assert "J P[7] 10% FINE" in text
    again = read_tp([program.sources[0].of(program.sources[0].path, text.encode()), *program.sources[1:]], robot=R2000)
    assert again.motions[0].part.name == "UFRAME 2"
    np.testing.assert_allclose(again.motions[1].end.q, home.q, atol=1e-7)


def test_lines_to_joints_are_written_as_joints():
    program = read("L P[1] 100mm/sec FINE")
    q = degrees(0.5, 10, -20, 0, -60, 0)
    text = program.rewrite(R2000, {0: (Waypoint(kind="linear", q=q, T=program.motions[0].end.T),)})[0].text
    assert "J1=   0.50000 deg," in text


def test_turns_follow_the_posture():
    program = read("J P[2] 10% FINE", positions={"2": pose(100, 200, 300, configuration="N U T, 0, 0, 0")})
    q = degrees(0, 10, -20, 0, -60, 180.5)
    text = program.rewrite(R2000, {0: (Waypoint(kind="joint", q=q, T=program.motions[0].end.T),)})[0].text
    assert "CONFIG : 'N U T, 0, 0, 0'" in text  # within a degree of the border the old turn may stay
    q = degrees(0, 10, -20, 0, -60, 185)
    text = program.rewrite(R2000, {0: (Waypoint(kind="joint", q=q, T=program.motions[0].end.T),)})[0].text
    assert "CONFIG : 'N U T, 0, 0, 1'" in text


def test_extended_axes_go_along_with_new_points():
    inside = pose(100, 200, 300).rstrip() + ",\r\n\tE1=   900.000  mm\r\n"
    program = read("L P[2] 100mm/sec FINE", positions={"2": inside})
    assert program.motions[0].external == (900.0,)
    first = Waypoint(kind="linear", q=Q, T=program.motions[0].end.T, external=(850.0,))
    text = program.rewrite(R2000, {0: (first, to(program.motions[0], [0, 0, 0]))})[0].text
    assert re.search(r"E1= +850\.00000  mm", text)
    assert "E1=   900.000  mm" in text


def test_a_motion_keeps_its_kind():
    program = read("L P[2] 100mm/sec FINE", positions={"2": pose(100, 200, 300)})
    with pytest.raises(TaskcalError, match=r"mill.ls:6: the motion cannot become one of another kind"):
        program.rewrite(R2000, {0: (to(program.motions[0], [0, 0, 0], kind="axes"),)})
