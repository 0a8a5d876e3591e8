import numpy as np
import pytest

from robot_programs.core.program import Waypoint, rotation
from robot_programs.krl.points import StatusTurn
from robot_programs.krl.read import KrlProgram, read_krl
from tests.robot_programs.krl.samples import ROBOT, Q, source

FRAMES = "$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}\n$BASE=$NULLFRAME\n"
POSE = "{X 900,Y 0.0,Z 800,A 0,B 90,C 0}"


def body(text: str, dat: str = "", newline: str = "\n") -> KrlProgram:
    sources = [source("part.src", f"DEF PART( )\n{text}\nEND\n", newline)]
    if dat:
        sources.append(source("part.dat", f"DEFDAT PART\n{dat}\nENDDAT\n", newline))
    return read_krl(sources)


def to(x: float, kind: str = "linear", via: Waypoint | None = None, q: np.ndarray = Q) -> Waypoint:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(0.0, 90.0, 0.0), [x, 0.0, 0.8]
    return Waypoint(kind=kind, q=q, T=T, via=via)


def line(program: KrlProgram, waypoints: dict[int, tuple[Waypoint, ...]], number: int, file: int = 0) -> str:
    return program.rewrite(ROBOT, waypoints)[file].text.splitlines()[number - 1]


def test_a_point_of_the_list_is_changed_there():
    program = body(f"{FRAMES}LIN XP1\nLIN XP2 C_DIS", f"DECL E6POS XP1={POSE} ; first\nDECL E6POS XP2={POSE}")
    src, dat = program.rewrite(ROBOT, {0: (to(0.901),)})
    assert src.text == program.sources[0].text
    assert dat.text.splitlines()[1] == "DECL E6POS XP1={X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0} ; first"
    assert dat.text.splitlines()[2] == f"DECL E6POS XP2={POSE}"


def test_a_point_that_other_motions_still_need_is_copied():
    program = body(f"{FRAMES}LIN XP1\n  lin xp1 C_DIS\nLIN XP1", f"DECL E6POS XP1={POSE}\nDECL E6POS XP1_2={POSE}")
    src, dat = program.rewrite(ROBOT, {0: (to(0.901),), 2: (to(0.902),)})
    assert src.text.splitlines()[3:6] == ["LIN XP1_3", "  lin xp1 C_DIS", "LIN XP1_4"]
    assert dat.text.splitlines()[1:4] == [
        f"DECL E6POS XP1={POSE}",
        "DECL E6POS XP1_3={X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0}",
        "DECL E6POS XP1_4={X 902.00000,Y 0.0,Z 800,A 0,B 90,C 0}",
    ]


def test_motions_that_agree_share_a_point():
    program = body(f"{FRAMES}LIN XP1\nLIN XP1\nLIN XP1", f"DECL E6POS XP1={POSE}")
    src, dat = program.rewrite(ROBOT, {0: (to(0.901),), 1: (to(0.902),), 2: (to(0.901),)})
    assert src.text.splitlines()[3:6] == ["LIN XP1", "LIN XP1_2", "LIN XP1"]
    assert "XP1={X 901.00000" in dat.text
    assert "XP1_2={X 902.00000" in dat.text


@pytest.mark.parametrize("use", ["$H_POS=XP1", "IF XP1.X > LIMIT THEN", "LIN_REL XP1"])
def test_a_point_that_is_used_otherwise_stays(use):
    program = body(f"{FRAMES}LIN XP1\n{use}", f"DECL E6POS XP1={POSE}")
    src, dat = program.rewrite(ROBOT, {0: (to(0.901),)})
    assert src.text.splitlines()[3] == "LIN XP1_2"
    assert f"XP1={POSE}" in dat.text


def test_points_of_others_are_written_into_the_motion():
    sources = [
        source("part.src", f"DEF PART( )\n{FRAMES}LIN XP1 C_DIS\nEND\n"),
        source("$config.dat", f"DEFDAT $CONFIG\nDECL E6POS XP1={POSE}\nENDDAT\n"),
    ]
    program = read_krl(sources)
    src, config = program.rewrite(ROBOT, {0: (to(0.901),)})
    assert src.text.splitlines()[3] == "LIN {X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS"
    assert config.text == sources[1].text


def test_a_point_that_is_declared_with_another_is_written_into_the_motion():
    program = body(f"{FRAMES}LIN XP1\nLIN XP1", f"DECL E6POS XP1={POSE},XP2={POSE}")
    src, dat = program.rewrite(ROBOT, {0: (to(0.901),)})
    assert src.text.splitlines()[3:5] == ["LIN {X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0}", "LIN XP1"]
    assert dat.text == program.sources[1].text


def test_an_added_frame_is_contained_in_the_copy():
    program = body(f"{FRAMES}LIN XP1\nLIN XP1:{{X 0,Y 0,Z 50}} C_DIS", f"DECL E6POS XP1={POSE}")
    T = program.motions[1].end.T
    np.testing.assert_allclose(T[:3, 3], [0.95, 0.0, 0.8], atol=1e-12)
    src, dat = program.rewrite(ROBOT, {1: (to(0.951),)})
    assert src.text.splitlines()[3:5] == ["LIN XP1", "LIN XP1_2 C_DIS"]
    assert "XP1_2={X 951.00000,Y 0.0,Z 800,A 0,B 90,C 0}" in dat.text


def test_names_stay_short_enough():
    long = "APPROACH_POSITION_NO_123"
    program = body(f"{FRAMES}LIN {long}\nLIN {long}", f"DECL E6POS {long}={POSE}")
    src, _ = program.rewrite(ROBOT, {0: (to(0.901),)})
    assert src.text.splitlines()[3] == "LIN APPROACH_POSITION_NO_1_2"


def test_waypoints_become_motions_before():
    text = f"{FRAMES}   slin {POSE} WITH $VEL=SVEL_CP(0.2,,L) ; along\nPTP {POSE} C_PTP"
    program = body(text, newline="\r\n")
    (src,) = program.rewrite(ROBOT, {0: (to(0.7), to(0.8), to(0.901)), 1: (to(0.85, "joint"), to(0.9, "joint"))})
    assert src.text.split("\r\n")[3:8] == [
        "   SLIN {X 700.00000,Y 0.0,Z 800,A 0,B 90,C 0} WITH $VEL=SVEL_CP(0.2,,L) C_SPL",
        "   SLIN {X 800.00000,Y 0.0,Z 800,A 0,B 90,C 0} WITH $VEL=SVEL_CP(0.2,,L) C_SPL",
        "   slin {X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0} WITH $VEL=SVEL_CP(0.2,,L) ; along",
        "PTP {X 850.00000,Y 0.0,Z 800,A 0,B 90,C 0} C_PTP",
        f"PTP {POSE} C_PTP",
    ]


def test_an_arc_can_be_divided_into_arcs_or_lines():
    program = body(f"{FRAMES}CIRC {{X 800,Y 50,Z 800}}, {POSE} C_DIS")
    first = to(0.85, "circular", via=to(0.82))
    (src,) = program.rewrite(ROBOT, {0: (first, to(0.9, "circular", via=to(0.88)))})
    assert src.text.splitlines()[3:5] == [
        "CIRC {X 820.00000,Y 0.0,Z 800,A 0,B 90,C 0}, {X 850.00000,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS",
        "CIRC {X 880.00000,Y 0.00000,Z 800}, {X 900,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS",
    ]
    (src,) = program.rewrite(ROBOT, {0: (to(0.85), to(0.9))})
    assert src.text.splitlines()[3:5] == [
        "LIN {X 850.00000,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS",
        "LIN {X 900,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS",
    ]


def test_joint_positions_may_take_the_place_of_a_pose():
    program = body(f"{FRAMES}PTP {{E6POS: X 900,Y 0,Z 800,A 0,B 90,C 0,S 2,T 35,E1 0.0}} C_PTP")
    q = np.radians([1.0, -90.0, 90.0, 0.0, 30.0, 0.0])
    assert line(program, {0: (Waypoint(kind="axes", q=q, T=None),)}, 4) == (
        "PTP {E6AXIS: A1 1.000000,A2 -90.000000,A3 90.000000,A4 0.000000,A5 30.000000,A6 0.000000,E1 0.0} C_PTP"
    )
    program = body("PTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0} C_PTP")
    assert (
        line(program, {0: (Waypoint(kind="axes", q=q, T=None),)}, 2)
        == "PTP {A1 1.000000,A2 -90,A3 90,A4 0,A5 30,A6 0} C_PTP"
    )


def test_status_and_turn_follow_the_joint_positions():
    program = body(f"{FRAMES}PTP {{X 900,Y 0,Z 800,A 0,B 90,C 0,S 18,T 'B1000010'}}")
    q = np.radians([-5.0, -70.0, 95.0, 10.0, -30.0, -20.0])
    status = StatusTurn(S=18, T=0b1000010).of(ROBOT, q)
    assert status == StatusTurn(S=0b10110, T=0b1110011)
    assert line(program, {0: (to(0.9, "joint", q=q),)}, 4) == "PTP {X 900,Y 0,Z 800,A 0,B 90,C 0,S 22,T 'B1110011'}"
