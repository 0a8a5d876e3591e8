"""Points that leave components out, and motions by a distance."""

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.krl.read import read_krl
from taskcal.geometry import se3
from tests.robot_programs.fuzz import nearby
from tests.robot_programs.krl.samples import CONFIG_DAT, FRAMES, POSE, ROBOT, read, source, texts


def ends(body: str) -> np.ndarray:
    program = read(FRAMES + body)
    assert not texts(program)
    return np.array([move.end.T[:3, 3] * 1e3 for move in program.motions])


def test_what_a_point_leaves_out_is_as_it_was_before():
    body = f"LIN {POSE}\nLIN {{Z 700}}\nLIN {{X 850,A 10,B 80,C 0}}\nLIN {{Y 5}}"
    np.testing.assert_allclose(ends(body), [[900, 0, 800], [900, 0, 700], [850, 0, 700], [850, 5, 700]])
    program = read(FRAMES + body)
    np.testing.assert_allclose(program.motions[3].end.T[:3, :3], program.motions[2].end.T[:3, :3], atol=1e-15)
    turned = read("PTP {A1 1,A2 -90,A3 90,A4 0,A5 30,A6 0}\nPTP {A1 20,A5 40}").motions[1]
    np.testing.assert_allclose(np.degrees(turned.end.q), [20, -90, 90, 0, 40, 0])


def test_a_distance_is_along_the_base_or_the_tool():
    np.testing.assert_allclose(ends(f"LIN {POSE}\nLIN_REL {{X 10,Z -5}} C_DIS")[1], [910, 0, 795])
    along_tool = ends(f"LIN {POSE}\nLIN_REL {{X 10}} C_DIS #TOOL")[1]
    np.testing.assert_allclose(along_tool, [900, 0, 790])  # B 90 turns the tool's x down
    turned = read("PTP {A1 1,A2 -90,A3 90,A4 0,A5 30,A6 0}\nPTP_REL {A1 20,A5 -5}").motions[1]
    np.testing.assert_allclose(np.degrees(turned.end.q), [21, -90, 90, 0, 25, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("body", "why"),
    [
        (f"LIN {POSE}\n$BASE={{X 1,Y 0,Z 0,A 0,B 0,C 0}}\nLIN {{Z 700}}", "that is not known"),
        (f"LIN {POSE}\nLIN {{Z 700,A 10}}", "of its angles it states A only"),
        (f"LIN {POSE}\nLIN_REL {{A 10}}", "turns the tool by angles that are not added here"),
        (f"LIN {POSE}\nLIN_REL {{A 10}} #TOOL", "write a motion to a complete point"),
        (f"LIN {POSE}\nCIRC_REL {{X 5,Y 5}},{{X 10,C 90}}", "turns the tool by angles that are not added here"),
        (f"LIN {POSE}\nCIRC_REL {{A1 5}},{{X 10}}", "its distance is not stated by X, Y and Z"),
        (f"LIN {POSE}\nLIN_REL {{X 10,E1 5}}", "it moves E1 by a distance that is not added here"),
        (f"LIN {POSE}\nPTP_REL {{E1 5}}", "it moves E1 by a distance that is not added here"),
        (f"LIN {POSE}\nLIN_REL {{X W}}", "X is 'W', and W is not in the files given"),
    ],
)
def test_what_it_counts_from_has_to_be_known(body, why):
    program = read(FRAMES + body)
    assert len(program.motions) == 1
    assert why in texts(program)[0]


def test_the_points_of_a_spline_are_read_and_it_stays_whole():
    body = f"LIN {POSE}\nSPLINE\nSPL {{X 910,Y 0,Z 800,A 0,B 90,C 0}}\nSLIN {{X 920,Y 0,Z 800,A 0,B 90,C 0}}\nENDSPLINE\nLIN {POSE}"
    program = read(FRAMES + body)
    assert [move.follows for move in program.motions] == [None, None, None, 2]
    assert [move.divisible for move in program.motions] == [True, False, False, True]
    T = se3.translation(0.001, 0.0, 0.0) @ program.motions[1].end.T
    (source, *_) = program.rewrite(ROBOT, {1: (Waypoint(kind="linear", q=np.zeros(6), T=T),)})
    assert "SPL {X 911" in source.text
    assert source.text.count("SPL") == program.sources[0].text.count("SPL")


@pytest.mark.parametrize("keyword", ["CIRC_REL", "SCIRC_REL"])
def test_relative_arc_counts_both_points_from_its_start(keyword):
    """KUKA.PLC mxAutomation (Beckhoff TF5120, KRC_MoveCircRelative): both positions are relative to where the motion starts."""
    program = read(f"{FRAMES}LIN {POSE}\n{keyword} {{X 20,Y 20}},{{Y 40,Z -1}} C_DIS")
    assert not texts(program)
    assert program.rewrite(ROBOT, {})[0].text == program.sources[0].text
    arc = program.motions[1]
    Ry = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # B 90
    for pose, mm in ((arc.via.T, [920, 20, 800]), (arc.end.T, [900, 40, 799])):
        np.testing.assert_allclose(pose[:3, 3] * 1e3, mm, atol=1e-9)
        np.testing.assert_allclose(pose[:3, :3], Ry, atol=1e-12)
    T = se3.translation(0.001, 0.0, 0.0)
    waypoints = {0: (Waypoint(kind="linear", q=np.zeros(6), T=T @ program.motions[0].end.T),)}
    (source, *_) = again = program.rewrite(ROBOT, waypoints)
    assert f"\n{keyword.removesuffix('_REL')} {{E6POS: X 920" in source.text.replace("\r", "")
    kept = program.reread(again).motions[1]
    np.testing.assert_allclose(kept.end.T, arc.end.T, atol=1e-8)
    np.testing.assert_allclose(kept.via.T, arc.via.T, atol=1e-8)


def test_a_distance_that_is_a_product_is_one_step():
    np.testing.assert_allclose(ends(f"LIN {POSE}\nLIN_REL {{X 10}}:{{X 5}}")[1], [915, 0, 800])


def test_external_axes_stay_where_a_distance_does_not_move_them():
    program = read(f"{FRAMES}LIN {POSE[:-1]},E1 50}}\nLIN_REL {{X 10,E1 0}}")
    assert [bool(np.isnan(move.external[0])) for move in program.motions] == [False, True]


def test_a_point_of_a_spline_that_is_written_whole_stays_one():
    program = read(f"{FRAMES}SPLINE\nSPL {POSE}\nSPL {{X 910}}\nENDSPLINE")
    T = se3.translation(0.001, 0.0, 0.0) @ program.motions[1].end.T
    (source, *_) = program.rewrite(ROBOT, {1: (Waypoint(kind="linear", q=np.zeros(6), T=T),)})
    assert "SPL {E6POS: X 911.0" in source.text
    assert "SLIN" not in source.text


def test_a_motion_to_where_the_robot_is_moves_nothing():
    program = read(f"{FRAMES}PTP $POS_ACT\nLIN {POSE}\nPTP $AXIS_ACT\nLIN {{Z 700}}")
    assert not texts(program)
    assert [move.follows for move in program.motions] == [None, 0]


def test_components_of_the_parameters_count():
    text = f"FDAT_ACT={{TOOL_NO 1,BASE_NO 0}}\nFDAT_ACT.BASE_NO=1\nBAS(#FRAMES)\nLIN {POSE}"
    (move,) = read(text).motions
    assert move.part.name == "BASE_DATA[1]"


def test_what_the_controller_s_own_routine_changes_is_known():
    bas = "GLOBAL DEF BAS( )\nTOOL_DATA[1]=X\nEND\n"
    program = read_krl(
        [
            source("part.src", f"DEF PART( )\nBAS(#TOOL,1)\nBAS(#BASE,0)\nLIN {POSE}\nEND\n"),
            source("bas.src", bas),
            source("$config.dat", CONFIG_DAT),
        ]
    )
    assert len(program.motions) == 1


def circle(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centre of a circle, and its two axes as long as its radius, millimetres."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2] * rng.uniform(20.0, 200.0)
    return rng.uniform([850.0, -50.0, 750.0], [950.0, 50.0, 850.0]), axes


def point(xyz: np.ndarray) -> str:
    return "{{X {:.6f},Y {:.6f},Z {:.6f},A 10,B 85,C 0}}".format(*xyz)


@pytest.mark.parametrize("seed", range(20))
def test_arc_ends_at_its_angle(seed):
    """On the circle through its points, counted from where it begins; and is written as an arc to its own end."""
    rng = np.random.default_rng(seed)
    centre, axes = circle(rng)
    at = lambda degrees: centre + np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))]) @ axes  # noqa: E731
    via, angle = rng.uniform(20.0, 170.0), rng.uniform(10.0, 340.0) * rng.choice([-1.0, 1.0])
    last = via + rng.uniform(20.0, 170.0)
    body = f"LIN {point(at(0.0))}\nCIRC {point(at(via))},{point(at(last))}, CA {angle:.6f} C_DIS\nLIN {POSE}"
    program = read(FRAMES + body)
    arc = program.motions[1]
    np.testing.assert_allclose(arc.via.T[:3, 3] * 1e3, at(0.5 * angle), atol=1e-3)
    np.testing.assert_allclose(arc.end.T[:3, 3] * 1e3, at(angle), atol=1e-3)
    assert program.rewrite(ROBOT, {})[0].text == program.sources[0].text
    for changed in ([0], [1], [0, 1]):
        wanted = {i: (nearby(rng, program.motions[i]),) for i in changed}
        sources = program.rewrite(ROBOT, wanted)
        assert "CA" not in sources[0].text.partition("CIRC")[2]
        assert "C_DIS" in sources[0].text
        again = program.reread(sources)
        for i, motion in enumerate(again.motions):
            waypoint = wanted.get(i, (program.motions[i].own_waypoint(),))[0]
            np.testing.assert_allclose(motion.end.T, waypoint.T, atol=1e-8)
            if i == 1:
                np.testing.assert_allclose(motion.via.T[:3, 3], waypoint.via.T[:3, 3], atol=1e-8)


@pytest.mark.parametrize(
    ("arc", "says"),
    [
        ("CIRC {X 950,Y 50,Z 800},{X 1000,Y 0,Z 800,A 0,B 90,C 0}, CA 360", "CA 360 is not between"),
        ("CIRC {X 950,Y 50,Z 800},{X 1000,Y 0,Z 800,A 0,B 80,C 0}, CA 90", "the tool turns along it"),
        ("CIRC {X 950,Y 0,Z 800},{X 1000,Y 0,Z 800,A 0,B 90,C 0}, CA 90", "are on no circle"),
        ("CIRC {X 950,Y 50,Z 800},{X 1000,Y 0,Z 800,A 0,B 90,C 0}, CA $ANIN[1]", "known only at run time"),
    ],
)
def test_arc_of_another_kind_to_an_angle_stays(arc, says):
    """A whole turn, one that turns the tool, and points on a line."""
    program = read(f"{FRAMES}LIN {POSE}\n{arc}")
    assert len(program.motions) == 1
    assert says in texts(program)[0]
