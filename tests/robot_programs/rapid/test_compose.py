from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.program import Composition, Frame, Motion, Target
from robot_programs.core.source import Place
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Configuration
from robot_programs.rapid.rewrite import MAX_LINE_LENGTH, compose_rapid
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from tests.laws.chains import rigid
from tests.laws.robots import generators

ROBOT = load_robot("abb-irb120")
NOWHERE = Place(path=Path("given"), line=1)
HAND, BASE = Frame(name="", T=np.eye(4)), Frame(name="", T=np.eye(4))


def to_axes(q, stops=True, speed=None) -> Motion:
    end = Target(name="", T=None, q=np.asarray(q), posture=None, place=NOWHERE)
    return Motion(
        kind="axes", end=end, via=None, tool=HAND, part=BASE, part_in_hand=False, speed=speed, stops=stops, follows=None,
        routine="", place=NOWHERE,
    )  # fmt: skip


def to_pose(rng, kind, tool, part, in_hand=False, speed=0.1) -> Motion:
    def target() -> Target:
        posture = Configuration(cf1=-1, cf4=0, cf6=2, cfx=1)
        return Target(name="", T=rigid(rng), q=None, posture=posture, place=NOWHERE)

    return Motion(
        kind=kind, end=target(), via=target() if kind == "circular" else None, tool=tool, part=part, part_in_hand=in_hand,
        speed=speed, stops=False, follows=None, routine="", place=NOWHERE,
    )  # fmt: skip


def test_a_measuring_program():
    q = np.radians([[0, -10, 20, 30.5, 40, -50], [10, -10, 20, 30, 40, -50]])
    source = compose_rapid(
        Composition(
            name="MEASURE", robot=ROBOT, motions=[to_axes(row) for row in q], notes=["pose 1", "pose 2"], wait_s=3.0
        )
    )
    assert source.path == Path("MEASURE.mod")
    assert source.text.split("\r\n") == [
        "MODULE MEASURE",
        "  CONST jointtarget j10:=[[0,-10,20,30.5,40,-50],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];",
        "  CONST speeddata vTool:=[250,500,5000,1000];",
        "  CONST jointtarget j20:=[[10,-10,20,30,40,-50],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];",
        "",
        "  PROC MEASURE_run()",
        "    ! pose 1",
        "    MoveAbsJ j10,vTool,fine,tool0;",
        "    WaitTime 3;",
        "    ! pose 2",
        "    MoveAbsJ j20,vTool,fine,tool0;",
        "    WaitTime 3;",
        "  ENDPROC",
        "ENDMODULE",
        "",
    ]


@given(generators)
def test_what_is_composed_is_read_again(rng):
    frames = [Frame(name="tGun", T=rigid(rng)), Frame(name="my tool", T=rigid(rng)), HAND]
    parts = [Frame(name="tGun", T=rigid(rng)), BASE]
    motions = [to_axes(rng.uniform(-2, 2, 6), stops=bool(k % 2)) for k in range(3)]
    for kind in ("joint", "linear", "circular"):
        pick = lambda some: some[int(rng.integers(len(some)))]  # noqa: E731
        motions.append(to_pose(rng, kind, pick(frames), pick(parts), speed=float(rng.choice([0.1, 0.0333, 2.5]))))
    motions.append(to_pose(rng, "linear", frames[0], parts[0], in_hand=True))
    source = compose_rapid(Composition(name="Job", robot=ROBOT, motions=motions, zone="z5"))
    assert max(map(len, source.text.splitlines())) <= MAX_LINE_LENGTH
    program = read_rapid([source])
    assert not program.diagnostics
    for found, move in zip(program.motions, motions, strict=True):
        assert (found.kind, found.stops, found.part_in_hand) == (move.kind, move.stops, move.part_in_hand)
        assert found.speed == pytest.approx(0.25 if move.speed is None else move.speed)
        np.testing.assert_allclose(found.tool.T, move.tool.T, atol=3e-7)
        np.testing.assert_allclose(found.part.T, move.part.T, atol=3e-7)
        if move.end.T is None:
            np.testing.assert_allclose(found.end.q, move.end.q, atol=2e-7)
        else:
            np.testing.assert_allclose(found.end.T, move.end.T, atol=3e-7)
            assert found.end.posture == move.end.posture
        if move.via is not None:
            np.testing.assert_allclose(found.via.T, move.via.T, atol=3e-7)


def test_joint_positions_decide_the_configuration():
    rng = np.random.default_rng(0)
    q = np.radians([[-100.0, 0, 0, 95, -5, 185]])
    (move,) = read_rapid(
        [compose_rapid(Composition(name="Job", robot=ROBOT, motions=[to_pose(rng, "joint", HAND, BASE)], q=q))]
    ).motions
    assert str(move.end.posture) == "[-2,1,2,1]"


@pytest.mark.parametrize("name", ["", "3d", "my program", "x" * 29, "module", "größe"])
def test_names_that_rapid_does_not_allow(name):
    with pytest.raises(TaskcalError, match="is not a name of a RAPID module"):
        compose_rapid(Composition(name=name, robot=ROBOT, motions=[]))


def test_a_robot_of_seven_joints_is_refused():
    with pytest.raises(TaskcalError, match="six turning axes"):
        compose_rapid(Composition(name="Job", robot=load_robot("barrett-wam"), motions=[]))


def test_long_comments_are_broken():
    source = compose_rapid(
        Composition(name="Job", robot=ROBOT, motions=[to_axes(np.zeros(6))], notes=["word " * 80 + "\nend"])
    )
    assert max(map(len, source.text.splitlines())) <= MAX_LINE_LENGTH
    assert not read_rapid([source]).diagnostics
