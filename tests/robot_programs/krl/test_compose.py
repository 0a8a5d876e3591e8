from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.program import Composition, Frame, Motion, Target
from robot_programs.core.source import Place
from robot_programs.krl.read import read_krl
from robot_programs.krl.rewrite import compose_krl
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import generators
from tests.robot_programs.krl.samples import milling

KR16 = load_robot("kuka-kr16-2")
HERE = Place(path=Path("x"), line=1)
NULL = Frame(name="", T=np.eye(4))


def move(kind: str, *, T=None, q=None, via=None, stops: bool = True, speed=None, in_hand: bool = False) -> Motion:
    end = Target(name="", T=T, q=q, posture=None, place=HERE)
    over = None if via is None else Target(name="", T=via, q=None, posture=None, place=HERE)
    return Motion(
        kind=kind, end=end, via=over, tool=NULL, part=NULL, part_in_hand=in_hand, speed=speed, stops=stops,
        follows=None, routine="", place=HERE,
    )  # fmt: skip


@given(generators)
def test_composed_program_reads_as_its_joint_positions(rng):
    """A measuring program reads as the joint positions it was given."""
    q = rng.uniform(KR16.limits[:, 0], KR16.limits[:, 1], (5, 6))
    notes = [f"pose {i}\nnext" for i in range(5)]
    source = compose_krl(
        Composition(name="measure", robot=KR16, motions=[move("axes", q=row) for row in q], notes=notes, wait_s=3.0)
    )
    program = read_krl([source])
    assert not program.diagnostics
    np.testing.assert_allclose([m.end.q for m in program.motions], q, atol=1.1e-8)
    assert all(m.kind == "axes" and m.stops for m in program.motions)
    lines = source.text.split("\r\n")
    assert (lines[7], lines[9]) == ("; pose 0 next", "WAIT SEC 3")
    assert "\n" not in source.text.replace("\r\n", "")


@given(generators)
def test_motions_to_poses_read_as_they_were_given(rng):
    q = rng.uniform(KR16.limits[:, 0], KR16.limits[:, 1], (3, 6))
    T = ErrorModel(KR16).poses(q)
    motions = [
        move("joint", T=T[0], stops=False),
        move("linear", T=T[1], speed=0.25, stops=False),
        move("circular", T=T[2], via=T[0], speed=0.25),
    ]
    program = read_krl([compose_krl(Composition(name="path", robot=KR16, motions=motions, q=q))])
    assert not program.diagnostics
    for given_move, read in zip(motions, program.motions, strict=True):
        assert (read.kind, read.stops, read.speed) == (given_move.kind, given_move.stops, given_move.speed)
        np.testing.assert_allclose(read.end.T, given_move.end.T, atol=5e-8)
    assert program.motions[0].end.posture.agrees(KR16, q[:1]).all()
    np.testing.assert_allclose(program.motions[2].via.T, T[0], atol=5e-8)


def test_a_program_that_was_read_can_be_composed_again():
    program = read_krl(milling())
    again = read_krl([compose_krl(Composition(name="again", robot=KR16, motions=program.motions))])
    for old, new in zip(program.motions, again.motions, strict=True):
        assert (new.kind, new.stops) == (old.kind, old.stops)
        if old.end.T is not None:
            flange = (m.flange(m.end.T) for m in (old, new))
            np.testing.assert_allclose(*flange, atol=2e-7)


@pytest.mark.parametrize(
    ("name", "motions", "message"),
    [
        ("3d", [], "'3d' is not a name of a KRL program"),
        ("a_name_of_more_than_24_letters", [], "at most 24"),
        (
            "part",
            [move("joint", T=np.eye(4))],
            "motion 0 drives all joints to a pose and does not say in which posture",
        ),
        ("part", [move("linear", T=np.eye(4), in_hand=True)], "motion 0 has its part in the robot's hand"),
    ],
)
def test_what_krl_cannot_say_is_refused(name, motions, message):
    with pytest.raises(TaskcalError, match=message):
        compose_krl(Composition(name=name, robot=KR16, motions=motions))


def test_a_robot_of_seven_axes_is_refused():
    with pytest.raises(TaskcalError, match="barrett-wam is not a robot of up to six turning axes"):
        compose_krl(Composition(name="part", robot=load_robot("barrett-wam"), motions=[]))
