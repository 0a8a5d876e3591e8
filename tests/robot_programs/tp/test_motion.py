"""Motion instructions."""

import re

import pytest

from robot_programs.tp.listing import parse_motion
from tests.robot_programs.tp.samples import degrees


@pytest.mark.parametrize(
    ("text", "speed", "stops"),
    [
        ("L P[1] 500mm/sec FINE", 0.5, True),
        ("L P[1:over] 30cm/min CNT100 ACC50", 0.005, False),
        ("l p[ 1 ] 12.5inch/min CNT0", 12.5 * 0.0254 / 60, True),
        ("L P[1] R[4:v]mm/sec CNT R[5]", None, False),
        ("L P[1] max_speed FINE", None, True),
        ("L P[1] 2.5sec FINE", None, True),
        ("J P[1] 100% CNT 5", None, False),
        ("L P[1] WELD_SPEED CNT100 TB .10sec,CALL A INC", None, False),
    ],
)
def test_speed_and_end_of_a_motion(text, speed, stops):
    motion = parse_motion(text + "    ;", 100)
    assert motion is not None
    assert motion.obstacle == ""
    assert motion.speed == pytest.approx(speed)
    assert motion.stops is stops
    assert motion.operands[-1].number == 1
    start, end = motion.operands[-1].start - 100, motion.operands[-1].end - 100
    assert text[start].upper() == "P"
    assert text[end - 1] == "]"
    start, end = (place - 100 for place in motion.termination)
    assert text[start:end].upper().startswith(("FINE", "CNT"))


def test_a_turn_has_its_own_speed():
    motion = parse_motion("L P[1] 90deg/sec FINE ;", 0)
    assert motion is not None
    assert motion.speed is None
    assert motion.turn_speed == pytest.approx(degrees(90.0)[0])


def test_an_arc_has_two_positions():
    motion = parse_motion("C P[3:via]    \n       P[4] 500mm/sec CNT100 Offset,PR[2:up] ;", 0)
    assert motion is not None
    assert [operand.number for operand in motion.operands] == [3, 4]
    assert [(offset.in_tool, offset.register) for offset in motion.offsets] == [(False, 2)]


@pytest.mark.parametrize(
    ("text", "obstacle"),
    [
        ("C P[1] 500mm/sec FINE", "end of its arc"),
        ("L P[1 500mm/sec FINE", "bracket"),
        ("L P[1] FINE", "speed"),
        ("L P[1] 100mm/sec", "neither FINE nor CNT"),
        ("L P[1] 100mm/sec FINE INC", "INC"),
        ("L P[1] 100mm/sec CNT50 COORD[2]", "COORD"),
        ("L P[1] 100mm/sec FINE VOFFSET,VR[1]", "camera"),
        ("L P[1] 100mm/sec FINE Frobnicate[1]", "'Frobnicate\\[1\\]' is not provided for"),
        ("S P[1] 100mm/sec CNT100", "spline"),
    ],
)
def test_what_cannot_be_read_whole_says_why(text, obstacle):
    motion = parse_motion(text + " ;", 0)
    assert motion is not None
    assert re.search(obstacle, motion.obstacle), motion.obstacle


@pytest.mark.parametrize("text", ["  CALL L ;", "  P[1]=LPOS ;", "  LBL[1:L P] ;", "  !L P[1] 10mm/sec FINE ;", ""])
def test_other_instructions_are_no_motions(text):
    assert parse_motion(text, 0) is None


def test_a_computed_position_has_no_number():
    motion = parse_motion("L P[R[1:n]] 100mm/sec FINE ;", 0)
    assert motion is not None
    assert motion.operands[0].number is None


@pytest.mark.parametrize(
    ("ending", "distance"),
    [("FINE", 0.0), ("CNT0", 0.0), ("CD 25", 0.025), ("CNT50", None), ("CNT R[2]", None), ("CR50", None)],
)
def test_corner_size_is_known_as_a_distance(ending, distance):
    """The size of a corner is known where it is stated as a distance."""
    motion = parse_motion(f"L P[1] 500mm/sec {ending} ;", 0)
    assert (None if motion.zone is None else motion.zone.distance) == distance
