"""APT: rewriting touches nothing but the motions that change."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.program import Waypoint
from taskcal.errors import FileError, TaskcalError
from tests.laws.robots import generators
from tests.robot_programs.apt.generator import generate
from tests.robot_programs.apt.samples import CATIA, ROBOT, moved, points, read
from tests.robot_programs.fuzz import damaged

programs = generators.map(generate)


@given(generators.map(lambda rng: generate(rng, trouble=False)), generators)
def test_rewrite_is_read_back_and_keeps_the_rest(data, rng):
    """Rewritten motions are read back and all others stay where they were."""
    program = read(data)
    chosen = [n for n in range(len(program.motions)) if rng.random() < 0.5]
    waypoints = {
        n: (moved(program.motions[n], rng.uniform(1e-5, 1e-3, 3), rng.uniform(-1e-3, 1e-3, 3)),) for n in chosen
    }
    if any(m.kind == "circular" for m in program.motions):
        shift = rng.uniform(1e-5, 1e-3, 3)
        waypoints = {n: (moved(m, shift, np.zeros(3)),) for n, m in enumerate(program.motions)}
    (source,) = program.rewrite(ROBOT, waypoints)
    again = read(source.encode())
    assert [m.kind for m in again.motions] == [m.kind for m in program.motions]
    assert len(again.diagnostics) == len(program.diagnostics)
    for n, (old, new) in enumerate(zip(program.motions, again.motions, strict=True)):
        wanted = waypoints[n][0] if n in waypoints else Waypoint(kind=old.kind, q=np.zeros(6), T=old.end.T)
        np.testing.assert_allclose(new.end.T[:3, 3], wanted.T[:3, 3], atol=2e-8)
        if len(program.instructions[n].numbers) == 6:
            np.testing.assert_allclose(new.end.T[:3, 2], wanted.T[:3, 2], atol=2e-6)
        if wanted.via is not None:
            np.testing.assert_allclose(new.via.T[:3, 3], wanted.via.T[:3, 3], atol=3e-7)
    wipe = lambda text: re.sub(r"[-+.\d]+", "#", text)  # noqa: E731
    if not any(i.relative or i.half for i in program.instructions):
        assert wipe(source.text) == wipe(program.sources[0].text)


@given(programs, generators)
def test_more_waypoints_are_more_statements(data, rng):
    program = read(data)
    if not program.motions:
        return
    n = int(rng.integers(len(program.motions)))
    move = program.motions[n]
    middle, end = (
        Waypoint(kind="linear", q=np.zeros(6), T=moved(move, d, np.zeros(3)).T) for d in (np.full(3, 1e-3), np.zeros(3))
    )
    (source,) = program.rewrite(ROBOT, {n: (middle, end)})
    again = read(source.encode())
    assert len(again.motions) == len(program.motions) + 1
    np.testing.assert_allclose(again.motions[n].end.T[:3, 3], middle.T[:3, 3], atol=2e-8)
    np.testing.assert_allclose(np.delete(points(again), n, axis=0), points(program), atol=2e-8)
    assert [m.speed for m in again.motions[n : n + 2]] == [move.speed] * 2


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


damages = st.lists(st.tuples(st.integers(0, 800), st.binary(max_size=3), st.integers(0, 6)), min_size=1, max_size=4)


@given(programs, damages)
def test_damaged_program_keeps_every_byte_or_is_refused(data, damages):
    """Damaged programs are read with remarks or refused but never changed."""
    data = damaged(data, damages)
    program, refusal = None, ""
    try:
        program = read(data)
    except FileError as error:
        refusal = str(error)
    if program is None:
        assert "binary" in refusal
    else:
        assert program.rewrite(ROBOT, {})[0].encode() == data
        assert len(program.motions) == len(program.instructions)
