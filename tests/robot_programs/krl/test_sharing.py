"""Texts that stand for several motions: rewritten where all of them can be, left where not."""

import re

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.krl.read import KrlProgram
from taskcal.errors import TaskcalError
from tests.robot_programs.krl.samples import FRAMES, POSE, ROBOT, Q, read

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
    assert not program.unwritable(ROBOT, waypoints, 0.0)
    after = program.rewrite(ROBOT, waypoints)
    assert after[0].text == program.sources[0].text
    again = program.reread(after)
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.802, 0.804, 0.806], atol=1e-9)


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ("FOR I=1 TO 3\nLIN Q[I]\nENDFOR\nP=Q[1]\nLIN P", "and the numbers in part.dat:3 have to stay for part.src:9"),
        (
            "FOR I=1 TO 3\nLIN Q[I]\nENDFOR\n$BASE=BASE_DATA[1]\nFOR I=1 TO 3\nLIN Q[I]\nENDFOR",
            "and the numbers in part.dat:3 have to stay for part.src:11",
        ),
    ],
)  # fmt: skip
def test_what_would_move_others_is_left_and_says_why(lines, why):
    program = read(f"{DECLARED}{FRAMES}{lines}", dat=POINTS)
    waypoints = moved(program, 1e-3, 2e-3, 3e-3)
    cannot = program.unwritable(ROBOT, waypoints, 0.0)
    assert set(cannot) == {0, 1, 2}
    assert why in cannot[0]
    with pytest.raises(TaskcalError, match=rf"part\.src:\d+: {re.escape(cannot[0])}"):
        program.rewrite(ROBOT, waypoints)


def test_shared_text_is_not_divided():
    """A motion of several is not divided and keeps those that count from others."""
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 2\nLIN Q[I]\nLIN_REL {{Z 5}}\nENDFOR", dat=POINTS)
    waypoints = moved(program, 1e-3)
    assert "counts from where it ends" in program.unwritable(ROBOT, waypoints, 0.0)[0]
    program = read(f"{DECLARED}{FRAMES}FOR I=1 TO 2\nLIN Q[I]\nENDFOR", dat=POINTS)
    (path,) = moved(program, 1e-3).values()
    assert "none gets points of its own" in program.unwritable(ROBOT, {0: path * 2}, 0.0)[0]


def test_own_text_follows_shared_elements():
    """A text of its own goes with the elements that others share, as long as it needs the same."""
    body = f"{DECLARED}{FRAMES}LIN Q[2]\nFOR I=1 TO 3\nLIN Q[I]\nENDFOR"
    program = read(body, dat=POINTS)
    waypoints = moved(program, 2e-3, 1e-3, 2e-3, 3e-3)
    again = program.reread(program.rewrite(ROBOT, waypoints))
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.804, 0.802, 0.804, 0.806], atol=1e-9)
    assert again.sources[0].text == program.sources[0].text
    waypoints = moved(program, 1e-3, 1e-3, 2e-3, 3e-3)
    assert not program.unwritable(ROBOT, waypoints, 0.0)
    again = program.reread(program.rewrite(ROBOT, waypoints))
    np.testing.assert_allclose([m.end.T[2, 3] for m in again.motions], [0.803, 0.802, 0.804, 0.806], atol=1e-9)
    assert "LIN {" in again.sources[0].text
