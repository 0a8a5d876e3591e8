"""APT: rewriting touches nothing but the motions that change."""

import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from taskcal.errors import TaskcalError
from tests.robot_programs.apt.samples import CATIA, ROBOT, moved, read


def test_an_arc_becomes_two_arcs():
    program = read(CATIA)
    arc = program.motions[2]

    def around(angle: float) -> np.ndarray:
        target = 0.05 * np.array([np.cos(angle), np.sin(angle), 0.0])
        return moved(arc, target - arc.end.T[:3, 3], np.zeros(3)).T

    pieces = [
        Waypoint(
            kind="circular", q=np.zeros(6), T=around(end), via=Waypoint(kind="circular", q=np.zeros(6), T=around(via))
        )
        for via, end in ((-0.4, -1.0), (-2.5, -1.5 * np.pi))
    ]
    (source,) = program.rewrite(ROBOT, {2: tuple(pieces)})
    again = read(source.encode())
    assert not again.diagnostics
    assert [move.kind for move in again.motions] == ["linear", "linear", "circular", "circular"]
    np.testing.assert_allclose(again.motions[2].end.T[:3, 3], around(-1.0)[:3, 3], atol=2e-8)
    np.testing.assert_allclose(again.motions[3].end.T[:3, 3], arc.end.T[:3, 3], atol=2e-8)


def test_joint_positions_and_arcs_for_lines_are_refused():
    program = read("GOTO/1,2,3\n")
    T = program.motions[0].end.T
    with pytest.raises(TaskcalError, match=r"path\.apt:1: APT knows no joint positions; write the program in another"):
        program.rewrite(ROBOT, {0: (Waypoint(kind="axes", q=np.zeros(6), T=None),)})
    via = Waypoint(kind="circular", q=np.zeros(6), T=T)
    with pytest.raises(TaskcalError, match=r"path\.apt:1: a line cannot become an arc here"):
        program.rewrite(ROBOT, {0: (Waypoint(kind="circular", q=np.zeros(6), T=T, via=via),)})
