"""Motion instructions."""

import re

import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.flow import FlowStep
from robot_programs.core.form import Lit, Ref
from robot_programs.tp.listing import Listing
from robot_programs.tp.lower import MotionInstruction, lowered
from tests.laws.robots import generators
from tests.robot_programs.tp.samples import degrees

HEAD = "/PROG  A\n/MN\n   1:"


def parse_motion(text: str) -> MotionInstruction | None:
    """The motion that an instruction is; None where it is not one."""
    routines, _ = lowered({0: Listing(f"{HEAD}{text}\n/POS\n/END\n")})
    lines = [
        node.line
        for node in routines[0].nodes
        if isinstance(node, FlowStep) and isinstance(node.line, MotionInstruction)
    ]
    return lines[0] if lines else None


def speed_of(motion: MotionInstruction) -> float | None:
    stated = motion.settings.get("speed")
    return stated.value * motion.speed_unit if isinstance(stated, Lit) and motion.speed_unit else None


def shifts_of(motion: MotionInstruction) -> list[tuple[str, float]]:
    registers = [(kind, motion.settings[setting]) for kind, setting in motion.offsets]
    return [(kind, ref.path[0][0].value) for kind, ref in registers if isinstance(ref, Ref)]


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
        ("L P[1] WELD_SPEED CNT100 TB .10sec,CALL A", None, False),
    ],
)
def test_speed_and_end_of_a_motion(text, speed, stops):
    motion = parse_motion(text + "    ;")
    assert motion is not None
    assert motion.why == ""
    assert speed_of(motion) == pytest.approx(speed)
    assert motion.stops is stops
    assert motion.operands[-1].number == 1
    start, end = (place - len(HEAD) for place in (motion.operands[-1].start, motion.operands[-1].end))
    assert text[start].upper() == "P"
    assert text[end - 1] == "]"
    start, end = (place - len(HEAD) for place in motion.termination)
    assert text[start:end].upper().startswith(("FINE", "CNT"))


def test_a_turn_has_its_own_speed():
    motion = parse_motion("L P[1] 90deg/sec FINE ;")
    assert motion is not None
    assert speed_of(motion) is None
    assert motion.turn_speed == pytest.approx(degrees(90.0)[0])


def test_an_arc_has_two_positions():
    motion = parse_motion("C P[3:via]    \n    :  P[4] 500mm/sec CNT100 Offset,PR[2:up] ;")
    assert motion is not None
    assert [operand.number for operand in motion.operands] == [3, 4]
    assert shifts_of(motion) == [("Offset", 2)]


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
    motion = parse_motion(text + " ;")
    assert motion is not None
    assert re.search(obstacle, motion.why), motion.why


@pytest.mark.parametrize("text", ["  CALL L ;", "  P[1]=LPOS ;", "  LBL[1:L P] ;", "  !L P[1] 10mm/sec FINE ;", ""])
def test_other_instructions_are_no_motions(text):
    assert parse_motion(text) is None


def test_a_computed_position_has_no_number():
    motion = parse_motion("L P[R[1:n]] 100mm/sec FINE ;")
    assert motion is not None
    assert motion.operands[0].number is None


@pytest.mark.parametrize(
    ("ending", "distance"),
    [("FINE", 0.0), ("CNT0", 0.0), ("CD 25", 0.025), ("CNT50", None), ("CNT R[2]", None), ("CR50", None)],
)
def test_corner_size_is_known_as_a_distance(ending, distance):
    """The size of a corner is known where it is stated as a distance."""
    motion = parse_motion(f"L P[1] 500mm/sec {ending} ;")
    assert (None if motion.zone is None else motion.zone.distance) == distance


QUIET = [
    "ACC100", "ACC 50", "PTH", "Wjnt", "Skip,LBL[1]", "Skip,LBL[2],PR[1]=LPOS", "Arc Start[1]", "Weave Sine[1]",
    "Weave Figure 8[1]", "SPOT[SD=1,P=2,t=3]", "EV 50%", "AP_LD50", "TB 0.10sec,P-SPS", "TB   .10sec,CALL GRIP(1,R[2])",
    "TA 1.0 sec, CALL PROG-2", "DB  10.0mm,DO[1:open]=ON", "TA .5sec,DO[R[1]]=PULSE,0.2sec",
    "TB R[5]sec,CALL SR[1]", "TA 0.00sec,AO[1]=R[5]",
    "DB 5mm,POINT_LOGIC", "TB 0.1sec,DO[3]=(OFF)",
]  # fmt: skip
SHIFTS = ["Offset,PR[{}]", "Tool_Offset,PR[{}:up]"]
LEADING = [
    "INC",
    "COORD[2]",
    "RTCP",
    "VOFFSET,VR[1]",
    "Frobnicate[1]",
    "7",
    ",PR[3]",
    "ACC100,Offset,PR[2]",
    "TB",
    "TB 1sec",
    "Skip",
]


@given(generators)
def test_every_option_counts_wherever_it_stands(rng: np.random.Generator):
    """Shifts are found before and behind whatever else the line does, and what is not understood refuses it anywhere."""
    quiet = [QUIET[k] for k in rng.choice(len(QUIET), rng.integers(0, 6), replace=False)]
    shifts = [(k, int(rng.integers(1, 99))) for k in range(2) if rng.random() < 0.5]
    options = [*quiet, *(SHIFTS[k].format(number) for k, number in shifts)]
    line = "L P[1] 100mm/sec CNT50 " + " ".join(rng.permutation(options)) if options else "L P[1] 100mm/sec CNT50"
    motion = parse_motion(f"{line}    ;")
    assert motion is not None
    assert motion.why == "", line
    assert sorted(shifts_of(motion)) == [(SHIFTS[k].split(",")[0], number) for k, number in shifts]
    assert motion.wrist is ("Wjnt" in quiet)
    assert motion.ends is not any(one.startswith("Skip") for one in quiet)
    whole = [one for one in options if one != "ACC 50"]  # which would take a number behind it for its value
    whole.insert(int(rng.integers(len(whole) + 1)), str(rng.choice(LEADING)))
    wrong = parse_motion(f"L P[1] 100mm/sec CNT50 {' '.join(whole)}    ;")
    assert wrong is not None
    assert wrong.why, whole
