"""What is planned is written, and what is left stays, whatever motions of a program share."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest

from robot_programs.core.plan import Wanted, expect_written, plan
from robot_programs.core.program import Program, Waypoint
from robot_programs.core.robot import NO_ROBOT
from robot_programs.rapid.read import read_rapid
from taskcal_groundwork.errors import InputError
from tests.robot_programs import small_language as small
from tests.robot_programs.conformance.languages import LANGUAGES
from tests.robot_programs.rapid.samples import POINTS, module

TOLERANCE_M = 1e-4
WRITTEN_M = 1e-6
"""Programs state micrometres."""


def request_of(seed: int, refused: float):
    """Ends near those of a program, apart from each other by up to three tolerances; some motions are refused."""

    def asked(program: Program) -> Wanted:
        rng = np.random.default_rng(seed)
        waypoints = dict[int, tuple[Waypoint, ...]]()
        stays = {i: "is refused" for i in range(len(program.motions)) if rng.uniform() < refused}
        for i, motion in enumerate(program.motions):
            T = motion.end.T.copy()
            T[:3, 3] += rng.uniform(0.0, 3.0) * TOLERANCE_M * np.array([1.0, 0.0, 0.0])
            waypoints[i] = (Waypoint(kind="linear", q=np.zeros(6), T=T),)
        rest = {i: path for i, path in waypoints.items() if i not in stays}
        return Wanted(program=program, robot=NO_ROBOT, waypoints=rest, refused=stays, tolerance=TOLERANCE_M)

    return asked


LEAST = {"RAPID": (40, 60, 3), "KRL": (40, 60, 3), "URScript": (80, 60, 3), "TP": (160, 40, 0)}
"""Random programs, least motions that are written, and least programs of which text is written out."""


@pytest.mark.parametrize("name", LEAST)
@pytest.mark.parametrize("refused", [0.0, 0.2])
def test_what_is_planned_is_written_and_what_is_left_stays(name, refused):
    seeds, least_written, least_longer = LEAST[name]
    written = longer = 0
    for seed in range(seeds):
        made = small.random_program(Random(seed), sensors=False, jumps=seed % 2 == 1)
        if not LANGUAGES[name].write.takes(made):
            continue
        given = LANGUAGES[name].reading(LANGUAGES[name].written(made))
        chosen = plan(given, request_of(seed, refused))
        request = chosen.wanted
        assert chosen.written.keys() | chosen.left.keys() == set(range(len(request.program.motions)))
        assert not chosen.written.keys() & chosen.left.keys()
        assert {i: str(chosen.left[i]) for i in request.refused} == request.refused
        assert chosen.of_text <= chosen.left.keys() - request.refused.keys()
        again = request.program.reread(chosen.text)
        for i, (new, old) in enumerate(zip(again.motions, request.program.motions, strict=True)):
            wanted = request.waypoints[i][0].T if i in chosen.written else old.end.T
            off = np.linalg.norm(new.end.T[:3, 3] - wanted[:3, 3])
            assert off <= (TOLERANCE_M if i in chosen.written else 0.0) + WRITTEN_M, (seed, i)
            if i in chosen.eased:
                assert abs(np.linalg.norm(chosen.written[i][0].T[:3, 3] - wanted[:3, 3]) - chosen.eased[i]) < 1e-12
        written += len(chosen.written)
        longer += bool(chosen.ways)
        assert bool(chosen.ways) == (request.program is not given)
    assert written > least_written
    assert longer >= least_longer


@pytest.mark.parametrize(
    ("off_mm", "number", "fine"), [(0.0, 1, True), (0.02, 1, True), (0.05, 1, False), (0.02, 0, False)]
)
def test_what_reads_beside_its_place_is_an_error(off_mm, number, fine):
    """A target that was to be written, or one that was to stay, to which no tolerance applies."""
    motions = read_rapid(
        [module("MoveL p1,v5,fine,tool0;MoveL p2,v5,fine,tool0;MoveL p3,v5,fine,tool0;", POINTS)]
    ).motions
    before = motions[:2]
    path = tuple(Waypoint(kind="linear", q=np.zeros(6), T=motions[i].end.T) for i in (1, 2))
    shift = np.zeros((4, 4))
    shift[0, 3] = off_mm * 1e-3
    end = replace(motions[0 if number == 0 else 2].end, T=motions[0 if number == 0 else 2].end.T + shift)
    after = [replace(one, end=end) if one.end.name == end.name else one for one in motions]
    if fine:
        expect_written(before, after, {1: path}, 2e-5)
    else:
        with pytest.raises(InputError, match=rf"part.mod:13: the program as written reads {off_mm:.3f} mm beside"):
            expect_written(before, after, {1: path}, 2e-5)
    with pytest.raises(InputError, match="reads as 3 motions instead of 2"):
        expect_written(before, after, {}, 2e-5)
