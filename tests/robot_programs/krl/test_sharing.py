"""Texts that stand for several motions: rewritten where all of them can be, left where not."""

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.krl.read import KrlProgram
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from tests.robot_programs.krl.rewriting import Q
from tests.robot_programs.krl.small_programs import FRAMES, POSE, read

KR16 = load_robot("kuka-kr16-2")
DECLARED = "DECL E6POS P\nINT I\n"
POINTS = "\n".join(["DECL E6POS Q[3]", *(f"Q[{i}]={POSE.replace('Z 800', f'Z {800 + i}')}" for i in (1, 2, 3))])


def moved(program: KrlProgram, *by: float) -> dict[int, tuple[Waypoint, ...]]:
    """Waypoints of the first motions, shifted along z, metres."""
    out: dict[int, tuple[Waypoint, ...]] = {}
    for i, dz in enumerate(by):
        T = program.motions[i].end.T.copy()
        T[2, 3] += dz
        out[i] = (Waypoint(kind=program.motions[i].kind, q=Q, T=T),)
    return out


def test_elements_get_their_numbers_in_the_data_list():
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 3\nLIN Q[I]\nENDFOR", dat=POINTS)
    waypoints = moved(program, 1e-3, 2e-3, 3e-3)
    assert not program.unwritable(KR16, waypoints, 0.0)
    after = program.rewrite(KR16, waypoints)
    assert after[0].text == program.sources[0].text
    again = program.reread(after)
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.802, 0.804, 0.806], atol=1e-9)


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ("FOR I=1 TO 3\nLIN Q[I]\nENDFOR\nP=Q[1]\nLIN P", "its target Q[1] is read for something else in part.src:9, too"),
        ("FOR I=1 TO 3\nLIN Q[I]\nENDFOR\n$BASE=BASE_DATA[1]\nFOR I=1 TO 3\nLIN Q[I]\nENDFOR", "has its target Q[1] in common"),
        ("FOR I=1 TO 3\nP=Q[I]\nLIN P\nENDFOR", "its text stands for 3 motions to different places"),
        (f"FOR I=1 TO 3\nBAS(#VEL_CP,I)\nLIN {POSE}\nENDFOR", "its text stands for 3 motions, which need different numbers"),
    ],
)  # fmt: skip
def test_what_would_move_others_is_left_and_says_why(lines, why):
    program = read(f"{DECLARED}{FRAMES}{lines}", dat=POINTS)
    waypoints = moved(program, 1e-3, 2e-3, 3e-3)
    cannot = program.unwritable(KR16, waypoints, 0.0)
    assert set(cannot) == {0, 1, 2}
    assert why in cannot[0]
    with pytest.raises(TaskcalError, match=r"cannot be rewritten: .*; leave it out"):
        program.rewrite(KR16, waypoints)


def test_shared_text_is_rewritten_if_all_motions_agree():
    """A text is rewritten where all of its motions need the same."""
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 2\nBAS(#VEL_CP,I)\nLIN {POSE}\nENDFOR")
    waypoints = moved(program, 1e-3, 1e-3)
    assert not program.unwritable(KR16, waypoints, 0.0)
    again = program.reread(program.rewrite(KR16, waypoints))
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.801, 0.801], atol=1e-9)
    assert [m.speed for m in again.motions] == [1.0, 2.0]


def test_shared_text_is_not_divided():
    """A motion of several is not divided and keeps those that count from others."""
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 2\nLIN Q[I]\nLIN_REL {{Z 5}}\nENDFOR", dat=POINTS)
    waypoints = moved(program, 1e-3)
    assert "counts from where it ends" in program.unwritable(KR16, waypoints, 0.0)[0]
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 2\nLIN Q[I]\nENDFOR", dat=POINTS)
    (path,) = moved(program, 1e-3).values()
    assert "cannot become other ones" in program.unwritable(KR16, {0: path * 2}, 0.0)[0]


def test_own_text_follows_shared_elements():
    """A text of its own goes with the elements that others share."""
    body = f"{DECLARED}{FRAMES}LIN Q[2]\nFOR I=1 TO 3\nLIN Q[I]\nENDFOR"
    program = read(body, dat=POINTS)
    waypoints = moved(program, 2e-3, 1e-3, 2e-3, 3e-3)
    again = program.reread(program.rewrite(KR16, waypoints))
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.804, 0.802, 0.804, 0.806], atol=1e-9)
    assert again.sources[0].text == program.sources[0].text
    assert "Q[2] in common" in program.unwritable(KR16, moved(program, 1e-3, 1e-3, 2e-3, 3e-3), 0.0)[0]
