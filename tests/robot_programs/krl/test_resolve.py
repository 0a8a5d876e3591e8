"""What the lines of a program mean, and why some motions stay as they are."""

import re

import numpy as np
import pytest

from robot_programs.krl.read import read_krl
from tests.robot_programs.fuzz import nearby
from tests.robot_programs.krl.samples import CONFIG_DAT, FRAMES, POSE, ROBOT, read, source, texts


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (f"LIN {POSE}", r"part\.src:2: LIN stays as it is: \$TOOL is not set before it"),
        (f"$TOOL=TOOL_DATA[9]\nLIN {POSE}", r"TOOL_DATA\[9\] is not in the files given; pass \$config\.dat"),
        (f"$TOOL=TOOL_DATA[N]\nLIN {POSE}", "which element of TOOL_DATA is meant is known only at run time"),
        (f"BAS(#TOOL,N)\nLIN {POSE}", "which element of TOOL_DATA is meant is not stated as a number"),
        (f"{FRAMES}$BASE.X=$ANIN[1]\nLIN {POSE}", r"\$ANIN\[1\] is known only at run time"),
        (f"{FRAMES}CIRC {{X 1,Y 2,Z 3,E1 N}},{POSE}", "E1 is 'N', which is not a number"),
        (f"{FRAMES}BAS(#INITMOV,0)\nLIN {POSE}", r"BAS\(#INITMOV\) resets tool and base"),
        (f"{FRAMES}BAS(#EX_BASE,1)\n$IPO_MODE=#TCP\nLIN {POSE}", "the base is one that moves"),
        (f"{FRAMES}$ROBROOT.Z=500\nLIN {POSE}", r"\$ROBROOT is changed by the program, at part\.src:"),
        (f"{FRAMES}LIN XP1", r"XP1 is not in the files given; pass the \.dat that states it"),
        (f"{FRAMES}LIN_REL {{X 10}}", "counts from where the motion before ended, and that is not known"),
        (f"{FRAMES}LIN {{X 10,Y 2,Z 3}}", "A is not stated, and it counts from where the motion before ended"),
        (f"DECL E6POS XP1\n{FRAMES}XP1.X=5\nLIN XP1", "XP1 is a variable of the program's own"),
        (
            f"FDAT_ACT={{TOOL_NO 1,BASE_NO 1}}\nFDAT_ACT.TOOL_NO=N\nBAS(#FRAMES)\nLIN {POSE}",
            "is not stated as a number",
        ),
        (f"{FRAMES}LIN {{A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}}", "LIN is given axis positions"),
        (f"{FRAMES}PTP {{A1 0,A2 0}}", "A3 is not stated"),
        (f"{FRAMES}LIN {{X 1,Y 2,Z 3,A 0,B 0,C 0,E1 EWAIT}}", "E1 is 'EWAIT', which is not a number"),
        (f"{FRAMES}SPL {POSE}", "it is part of no SPLINE block"),
        (f"{FRAMES}IF $IN[1] THEN\n$BASE=BASE_DATA[1]\nENDIF\nLIN {POSE}", "set in one branch of the IF before"),
        (f"{FRAMES}LOOP\nLIN {POSE}\n$BASE=BASE_DATA[1]\nENDLOOP", "set further down in the same loop"),
        (
            f"{FRAMES}LOOP\nIF $IN[1] THEN\nEXIT\nENDIF\n$BASE=BASE_DATA[1]\nENDLOOP\nLIN {POSE}",
            "set further down in the same loop",
        ),
        (f"{FRAMES}AGAIN:\nLIN {POSE}\n$BASE=BASE_DATA[1]\nGOTO AGAIN", "can be reached by a GOTO"),
        (f"{FRAMES}IF $IN[1] THEN\nINSIDE:\nLIN {POSE}\nENDIF\nGOTO INSIDE", "can be reached by a GOTO"),
        (f"$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n$IPO_MODE=MODE\nLIN {POSE}", r"\$IPO_MODE\) is not stated"),
    ],
)
def test_unresolved_motions_are_left_with_a_reason(body, reason):
    """Motions that the text does not tell are left with a reason."""
    program = read(body)
    assert not program.motions
    (diagnostic,) = program.diagnostics
    assert re.search(reason, str(diagnostic))


@pytest.mark.parametrize("frame", ["$NULLFRAME", "$WORLD"])
@pytest.mark.parametrize("point", [f"{{}}:{POSE}", f"{POSE}:{{}}", f"{{}}:{POSE}:{{}}"])
def test_zero_frame_is_known_in_a_motion(frame, point):
    """KUKA System Software, system variables: $NULLFRAME is the zero frame."""
    program = read(f"{FRAMES}LIN {point.replace('{}', frame)}\nLIN {POSE}")
    assert not program.diagnostics
    computed, stated = program.motions
    np.testing.assert_allclose(computed.end.T, stated.end.T, atol=1e-12)
    waypoint = nearby(np.random.default_rng(1), computed)
    again = program.reread(program.rewrite(ROBOT, {0: (waypoint,)}))
    np.testing.assert_allclose(again.motions[0].end.T, waypoint.T, atol=1e-7)
    assert (frame in again.sources[0].text.splitlines()[3]) == point.startswith(POSE)  # what is added to numbers stays


def test_zero_frame_is_a_point():
    point, distance = read(f"{FRAMES}LIN $NULLFRAME\nLIN_REL $NULLFRAME").motions
    np.testing.assert_array_equal(point.end.T, np.eye(4))
    np.testing.assert_array_equal(distance.end.T, np.eye(4))


# Points that data lists state.


@pytest.mark.parametrize(
    "change", ["XP1.X=5", "XP1=XP2", "MEASURE(XP1)", "N=MEASURE(1,XP1)", "XP1={X 1,Y 0,Z 0,A 0,B 0,C 0}"]
)
def test_points_that_the_program_changes_are_no_constants(change):
    program = read(f"{FRAMES}LIN XP1\n{change}", dat=f"DECL E6POS XP1={POSE}\nDECL E6POS XP2={POSE}")
    assert not program.motions
    assert "XP1 is changed by the program, at part.src:5" in texts(program)[0]


@pytest.mark.parametrize(
    ("change", "stays"), [("BASE_DATA[2].X=5", True), ("BASE_DATA[1].X=5", False), ("BASE_DATA[N]=F", False)]
)
def test_elements_of_an_array_change_one_by_one(change, stays):
    program = read(f"$TOOL=$NULLFRAME\n$BASE=BASE_DATA[1]\nLIN {POSE}\n{change}")
    assert len(program.motions) == stays


def test_data_are_found_locally_before_the_system():
    """Own points come before those of the system and local ones before both."""
    shared = CONFIG_DAT.replace("ENDDAT", "DECL E6POS XP1={X 1,Y 0,Z 0,A 0,B 0,C 0}\nENDDAT")
    (move,) = read(f"{FRAMES}LIN XP1", dat="DECL E6POS XP1={X 2,Y 0,Z 0,A 0,B 0,C 0}", config=shared).motions
    assert move.end.T is not None
    assert move.end.T[0, 3] == pytest.approx(0.002)
    (move,) = read(f"{FRAMES}LIN XP1", config=shared).motions
    assert move.end.T is not None
    assert move.end.T[0, 3] == pytest.approx(0.001)
    assert not read(f"DECL E6POS XP1\n{FRAMES}LIN XP1", config=shared).motions


def test_points_of_another_program_are_its_own():
    other = source("other.dat", f"DEFDAT OTHER\nDECL E6POS XP1={POSE}\nDECL GLOBAL E6POS XP2={POSE}\nENDDAT\n")
    src = source("part.src", f"DEF PART( )\n{FRAMES}LIN XP1\nLIN XP2\nEND\n")
    program = read_krl([src, other])
    assert [m.end.name for m in program.motions] == ["XP2"]
