"""Spins of whole programs, judged by the joints that they lead to."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.apt.read import read_apt
from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from taskcal.correction.controller import with_spins, with_spins_near
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.kinematics.tracing import trace
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

ROBOT = load_robot("abb-irb6660-205-1.9")
TOOL = Frame(name="mill", T=ROBOT.T_flange_tool @ se3.translation(z=0.05) @ se3.rotation("y", 0.3))
PART = Frame(name="part", T=se3.pose(Rotation.from_euler("z", 30, degrees=True).as_matrix(), np.array([1.6, 0.1, 1.0])))


def program(text: str):
    return read_apt([Source.of(Path("path.apt"), text.encode())], tool=TOOL, part=PART)


def circle(n: int) -> str:
    angle = np.linspace(0, 2 * np.pi, n)
    rows = np.stack(
        [150 * np.cos(angle), 150 * np.sin(angle), 0 * angle, 0.3 * np.cos(angle), 0.3 * np.sin(angle)], axis=1
    )
    return "".join(f"GOTO/{','.join(f'{v:.6f}' for v in (*row, np.sqrt(0.91)))}\n" for row in rows)


@pytest.mark.slow
def test_spins_let_the_joints_follow_every_run():
    """Every run of motions can be followed by the robots joints."""
    given = program(circle(40) + "CIRCLE/0,0,0,0,0,1,5\nGOTO/0,0,100\n" + circle(5))
    spun = with_spins(given, ROBOT)
    assert (spun.sources, spun.diagnostics) == (given.sources, given.diagnostics)
    assert [move.follows for move in spun.motions] == [move.follows for move in given.motions]
    old, new = (np.array([m.end.T for m in p.motions]) for p in (given, spun))
    np.testing.assert_allclose(new[:, :, 2:], old[:, :, 2:], atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(new[:, :3, :3]), 1.0, atol=1e-12)
    model = ErrorModel(ROBOT)
    T = PART.T @ new @ se3.inverse(TOOL.T) @ ROBOT.T_flange_tool
    for run in (slice(0, 40), slice(40, 45)):
        assert trace(model, T[run], find_posture(model, T[run][0])).reached.all()
    assert spun.rewrite(ROBOT, {}) == given.sources


def test_spins_come_as_near_to_those_wanted_as_the_axes_allow():
    text = circle(5) + "GOTO/50,0,0,0,0,1\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,50),ON,(LINE/0,0,0,0,50,0)\n"
    read = program(text)
    spin, tilt = se3.rotation("z", 1.2), se3.rotation("x", 1e-3)
    paths = [[t.T @ spin @ tilt for t in (move.via, move.end) if t is not None] for move in read.motions]
    near = with_spins_near(read, paths)
    for old, new, wanted in zip(read.motions, near.motions, paths, strict=True):
        targets = [(t, n) for t, n in ((old.via, new.via), (old.end, new.end)) if t is not None]
        for (before, after), T in zip(targets, wanted, strict=True):
            np.testing.assert_allclose(after.T[:, 2:], before.T[:, 2:], atol=1e-12)
            np.testing.assert_allclose(after.T[:3, :3] @ tilt[:3, :3], T[:3, :3], atol=1e-6)
    assert near.sources == read.sources


@pytest.mark.slow
def test_spins_of_arcs_and_refusal_out_of_reach():
    """Arcs get spins too and a path out of reach is named by its line."""
    text = "GOTO/50,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,50),ON,(LINE/0,0,0,0,50,0)\n"
    arc = with_spins(program(text), ROBOT).motions[1]
    np.testing.assert_allclose(arc.via.T[:3, :3], arc.end.T[:3, :3], atol=1e-12)
    with pytest.raises(ReachError, match=r"path\.apt:1: of the motions from this line on: .* does not reach the start"):
        with_spins(program("GOTO/9000,0,0\n"), ROBOT)
