"""Laws of all languages, on random programs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Target, Waypoint
from tests.laws.robots import generators
from tests.robot_programs.fuzz import LANGUAGES, check_case, language, unchanged


@pytest.mark.parametrize("name", LANGUAGES)
@given(rng=generators)
def test_rewrite_keeps_every_byte_without_changes(name, rng):
    """Every byte stays where nothing is rewritten, and where motions get the ends that they have."""
    tested = language(name)
    sources = tested.generate(rng)
    program = tested.read(sources)
    for waypoints in ({}, unchanged(tested, program)):
        again = program.rewrite(tested.robot, waypoints)
        assert [source.encode() for source in again] == [source.encode() for source in sources]


def check(tested, new: Target, wanted: Target | Waypoint, exact: bool = False) -> None:
    """A target that is read again is that which was wanted, or that which it was."""
    if wanted.T is None:
        np.testing.assert_allclose(new.q, wanted.q, rtol=tested.place[0], atol=0.0 if exact else tested.joints)
        return
    if exact:
        np.testing.assert_array_equal(new.T, wanted.T)
        return
    share, metres = tested.place
    np.testing.assert_allclose(new.T[:3, 3], wanted.T[:3, 3], rtol=share, atol=metres)
    if new.free_spin:
        assert np.linalg.norm(np.cross(new.T[:3, 2], wanted.T[:3, 2])) < tested.turn
    else:
        assert Rotation.from_matrix(new.T[:3, :3].T @ wanted.T[:3, :3]).magnitude() < tested.turn


@pytest.mark.parametrize("name", LANGUAGES)
@settings(max_examples=40)
@given(rng=generators)
def test_rewrite_is_read_back_and_keeps_the_rest(name, rng):
    """Motions end where they were sent, in as many pieces as they were given; all others, and all else, are as they were."""
    tested = language(name)
    sources = tested.generate(rng)
    program = tested.read(sources)
    waypoints = dict(tested.waypoints(rng, program))
    for number in program.unwritable(tested.robot, waypoints, 0.0):
        del waypoints[number]
    after = program.rewrite(tested.robot, waypoints)
    assert [(one.encoding, one.newline) for one in after] == [(one.encoding, one.newline) for one in sources]
    again = program.reread(after)
    motions = iter(again.motions)
    for number, move in enumerate(program.motions):
        for waypoint in waypoints.get(number, (None,)):
            new = next(motions)
            assert (new.speed, new.routine) == (move.speed, move.routine)
            np.testing.assert_array_equal(new.tool.T, move.tool.T)
            last = waypoint is None or waypoint is waypoints[number][-1]
            assert new.stops == (move.stops and last)
            if waypoint is None:
                assert new.kind == move.kind
                check(tested, new.end, move.end, exact=not tested.leans(program, number))
                continue
            assert new.kind == waypoint.kind
            T_parts = np.linalg.inv(move.part.T) @ new.part.T
            if tested.as_wanted(program, number, -1):
                check(tested, replace(new.end, T=None if new.end.T is None else T_parts @ new.end.T), waypoint)
            if waypoint.via is not None and tested.as_wanted(program, number, 0):
                np.testing.assert_allclose((T_parts @ new.via.T)[:3, 3], waypoint.via.T[:3, 3], atol=3e-7)
                if new.via.posture is not None:
                    check(tested, new.via, waypoint.via)
            if tested.postures and new.end.posture is not None:
                assert new.end.posture.agrees(tested.robot, waypoint.q[None])[0]
    assert next(motions, None) is None
    more = len(again.diagnostics) - len(program.diagnostics)
    assert more == 0 or (more > 0 and name == "tp")  # each arc of several points is remarked


@pytest.mark.parametrize("name", LANGUAGES)
def test_damaged_program_keeps_every_byte_or_is_refused(name):
    """Damaged programs are read or refused with the name of a file, and keep every byte; those read can be rewritten."""
    outcomes = {check_case(language(name), seed) for seed in range(40)}
    assert "rewritten" in outcomes
