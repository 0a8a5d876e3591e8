import re

import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.program import Motion, Waypoint, rotation
from robot_programs.core.source import Source
from robot_programs.krl.read import KrlProgram, read_krl
from robot_programs.krl.rewrite import Status
from taskcal.robot.catalogue import load_robot
from tests.laws.robots import generators
from tests.robot_programs.krl.generator import generate
from tests.robot_programs.krl.rewriting import Q, nearby, nearby_waypoints
from tests.robot_programs.krl.samples import handling, milling, source

KR16 = load_robot("kuka-kr16-2")
_NUMBER = re.compile(r"-?[0-9]+(?:\.[0-9]+)?")
FRAMES = "$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}\n$BASE=$NULLFRAME\n"
POSE = "{X 900,Y 0.0,Z 800,A 0,B 90,C 0}"


def check(move: Motion, wanted: Waypoint) -> None:
    assert move.kind == wanted.kind
    if wanted.T is None:
        np.testing.assert_allclose(move.end.q, wanted.q, atol=1.1e-8)
        return
    np.testing.assert_allclose(move.end.T[:3, 3], wanted.T[:3, 3], atol=1.1e-8)
    np.testing.assert_allclose(move.end.T[:3, :3], wanted.T[:3, :3], atol=5e-8)
    if move.end.posture is not None:
        assert move.end.posture.agrees(KR16, wanted.q[None]).all()
    assert (move.via is None) == (wanted.via is None)
    if wanted.via is not None:
        np.testing.assert_allclose(move.via.T[:3, 3], wanted.via.T[:3, 3], atol=1.1e-8)


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
    return program.rewrite(KR16, waypoints)[file].text.splitlines()[number - 1]


@given(generators)
def test_rewrite_is_read_back_and_keeps_the_rest(rng):
    """Rewritten programs read as what was wanted and the rest as before."""
    sources = generate(rng).sources
    program = read_krl(sources)
    waypoints = nearby_waypoints(rng, program, most=3)
    after = program.rewrite(KR16, waypoints)
    again = program.reread(after)
    assert len(again.motions) == len(program.motions) + sum(len(path) - 1 for path in waypoints.values())
    motions = iter(again.motions)
    for i, old in enumerate(program.motions):
        if i not in waypoints:
            unchanged(next(motions), old, written=program.sites[i].leans)
            continue
        for j, wanted in enumerate(waypoints[i]):
            new = next(motions)
            check(new, wanted)
            assert new.stops == (old.stops and j == len(waypoints[i]) - 1)
            assert (new.speed, new.routine) == (old.speed, old.routine)
            np.testing.assert_allclose(new.tool.T, old.tool.T)
            np.testing.assert_allclose(new.part.T, old.part.T)
    for before, now in zip(sources, after, strict=True):
        assert now.encoding == before.encoding
        assert now.newline == before.newline


def unchanged(new: Motion, old: Motion, *, written: bool = False) -> None:
    """A motion stays; where it is written whole, because the one that it counts from moved, to the digits written."""
    assert new.end.posture == old.end.posture
    for a, b in ((new.end, old.end), (new.via, old.via)):
        assert (a is None) == (b is None)
        if a is not None and b is not None:
            here, there = a.T if a.T is not None else a.q, b.T if b.T is not None else b.q
            np.testing.assert_allclose(here, there, rtol=0.0, atol=2e-8 if written else 0.0)


@pytest.mark.parametrize("sources", [handling(), milling()])
def test_only_the_numbers_of_points_change(sources):
    rng = np.random.default_rng(0)
    program = read_krl(sources)
    own = [i for i, site in enumerate(program.sites) if not site.leans]  # others are written whole
    alone = [i for i in own if program.motions[i].end.name in ("", "XP4", "XP5") and program.motions[i].kind != "axes"]
    after = program.rewrite(KR16, {i: (nearby(rng, program.motions[i]),) for i in alone})
    for before, now in zip(sources, after, strict=True):
        assert _NUMBER.sub("#", now.text) == _NUMBER.sub("#", before.text)


def test_a_point_of_the_list_is_changed_there():
    program = body(f"{FRAMES}LIN XP1\nLIN XP2 C_DIS", f"DECL E6POS XP1={POSE} ; first\nDECL E6POS XP2={POSE}")
    src, dat = program.rewrite(KR16, {0: (to(0.901),)})
    assert src.text == program.sources[0].text
    assert dat.text.splitlines()[1] == "DECL E6POS XP1={X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0} ; first"
    assert dat.text.splitlines()[2] == f"DECL E6POS XP2={POSE}"


def test_a_point_that_other_motions_still_need_is_copied():
    program = body(f"{FRAMES}LIN XP1\n  lin xp1 C_DIS\nLIN XP1", f"DECL E6POS XP1={POSE}\nDECL E6POS XP1_2={POSE}")
    src, dat = program.rewrite(KR16, {0: (to(0.901),), 2: (to(0.902),)})
    assert src.text.splitlines()[3:6] == ["LIN XP1_3", "  lin xp1 C_DIS", "LIN XP1_4"]
    assert dat.text.splitlines()[1:4] == [
        f"DECL E6POS XP1={POSE}",
        "DECL E6POS XP1_3={X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0}",
        "DECL E6POS XP1_4={X 902.00000,Y 0.0,Z 800,A 0,B 90,C 0}",
    ]


def test_motions_that_agree_share_a_point():
    program = body(f"{FRAMES}LIN XP1\nLIN XP1\nLIN XP1", f"DECL E6POS XP1={POSE}")
    src, dat = program.rewrite(KR16, {0: (to(0.901),), 1: (to(0.902),), 2: (to(0.901),)})
    assert src.text.splitlines()[3:6] == ["LIN XP1", "LIN XP1_2", "LIN XP1"]
    assert "XP1={X 901.00000" in dat.text
    assert "XP1_2={X 902.00000" in dat.text


@pytest.mark.parametrize("use", ["$H_POS=XP1", "IF XP1.X > LIMIT THEN", "LIN_REL XP1"])
def test_a_point_that_is_used_otherwise_stays(use):
    program = body(f"{FRAMES}LIN XP1\n{use}", f"DECL E6POS XP1={POSE}")
    src, dat = program.rewrite(KR16, {0: (to(0.901),)})
    assert src.text.splitlines()[3] == "LIN XP1_2"
    assert f"XP1={POSE}" in dat.text


def test_a_point_of_two_motions_becomes_two_where_they_disagree():
    program = body(f"{FRAMES}LIN XP1\nLIN {POSE}\nLIN XP1", f"DECL E6POS XP1={POSE}")
    sources = program.rewrite(KR16, {0: (to(0.901),), 2: (to(0.902),)})
    again = read_krl(sources)
    assert [move.end.T[0, 3] for move in again.motions] == pytest.approx([0.901, 0.9, 0.902], abs=1e-8)
    names = [move.end.name for move in again.motions]
    assert names[0] == "XP1"
    assert names[2] not in ("", "XP1")
    assert sources[1].text.count("E6POS") == 2


def test_rewrite_copies_a_point_that_another_motion_needs():
    """A point of two motions keeps its numbers for the one that stays."""
    program = body(f"{FRAMES}LIN XP1\nLIN {POSE}\nLIN XP1", f"DECL E6POS XP1={POSE}")
    for changed, stays in ((0, 2), (2, 0)):
        for way in ({changed: (to(0.901),)}, {changed: (to(0.901),), stays: (to(0.9),)}):
            again = read_krl(program.rewrite(KR16, way))
            assert again.motions[changed].end.T[0, 3] == pytest.approx(0.901, abs=1e-8)
            assert again.motions[stays].end.T[0, 3] == pytest.approx(0.9, abs=1e-8)
            assert again.motions[stays].end.name == "XP1"


def test_points_of_others_are_written_into_the_motion():
    sources = [
        source("part.src", f"DEF PART( )\n{FRAMES}LIN XP1 C_DIS\nEND\n"),
        source("$config.dat", f"DEFDAT $CONFIG\nDECL E6POS XP1={POSE}\nENDDAT\n"),
    ]
    program = read_krl(sources)
    src, config = program.rewrite(KR16, {0: (to(0.901),)})
    assert src.text.splitlines()[3] == "LIN {X 901.00000,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS"
    assert config.text == sources[1].text


def test_an_added_frame_is_contained_in_the_copy():
    program = body(f"{FRAMES}LIN XP1\nLIN XP1:{{X 0,Y 0,Z 50}} C_DIS", f"DECL E6POS XP1={POSE}")
    T = program.motions[1].end.T
    np.testing.assert_allclose(T[:3, 3], [0.95, 0.0, 0.8], atol=1e-12)
    src, dat = program.rewrite(KR16, {1: (to(0.951),)})
    assert src.text.splitlines()[3:5] == ["LIN XP1", "LIN XP1_2 C_DIS"]
    assert "XP1_2={X 951.00000,Y 0.0,Z 800,A 0,B 90,C 0}" in dat.text


def test_names_stay_short_enough():
    long = "APPROACH_POSITION_NO_123"
    program = body(f"{FRAMES}LIN {long}\nLIN {long}", f"DECL E6POS {long}={POSE}")
    src, _ = program.rewrite(KR16, {0: (to(0.901),)})
    assert src.text.splitlines()[3] == "LIN APPROACH_POSITION_NO_1_2"


def test_waypoints_become_motions_before():
    text = f"{FRAMES}   slin {POSE} WITH $VEL=SVEL_CP(0.2,,L) ; along\nPTP {POSE} C_PTP"
    program = body(text, newline="\r\n")
    (src,) = program.rewrite(KR16, {0: (to(0.7), to(0.8), to(0.901)), 1: (to(0.85, "joint"), to(0.9, "joint"))})
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
    (src,) = program.rewrite(KR16, {0: (first, to(0.9, "circular", via=to(0.88)))})
    assert src.text.splitlines()[3:5] == [
        "CIRC {X 820.00000,Y 0.0,Z 800,A 0,B 90,C 0}, {X 850.00000,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS",
        "CIRC {X 880.00000,Y 0.00000,Z 800}, {X 900,Y 0.0,Z 800,A 0,B 90,C 0} C_DIS",
    ]
    (src,) = program.rewrite(KR16, {0: (to(0.85), to(0.9))})
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
    status = Status(S=18, T=0b1000010).of(KR16, q)
    assert status == Status(S=0b10110, T=0b1110011)
    assert line(program, {0: (to(0.9, "joint", q=q),)}, 4) == "PTP {X 900,Y 0,Z 800,A 0,B 90,C 0,S 22,T 'B1110011'}"


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_letters_of_any_encoding_survive(encoding, newline, tmp_path):
    text = newline.join(["DEF PART( ) ; Größe", *FRAMES.split("\n")[:-1], f"LIN {POSE} ; über", "END"])
    given_source = Source.of(tmp_path / "PART.SRC", text.encode(encoding))
    program = read_krl([given_source])
    (after,) = program.rewrite(KR16, {0: (to(0.901),)})
    assert after.encode() == text.replace("X 900,", "X 901.00000,").encode(encoding)
