"""What is planned for the motions of a program is written in every language, and read again."""

from collections import Counter

import numpy as np
import pytest

from robot_programs.core.plan import TABLED, Wanted, plan
from robot_programs.core.program import Program, Waypoint
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal_groundwork.errors import InputError
from tests.robot_programs.conformance.cases import (
    C1,
    CASES,
    K1,
    K2,
    ONE_TEXT,
    UNREAD,
    UNWRITTEN,
    above,
    let,
    loop,
    move,
    number,
    times,
)
from tests.robot_programs.conformance.cases import program as program_of
from tests.robot_programs.conformance.languages import LANGUAGES, RUNNING, refused
from tests.robot_programs.small_language import Statement

TOLERANCE_M, WRITTEN_M = 1e-6, 1e-6
"""No value is good enough for two motions; programs state micrometres."""


def request_of(program: Program, robot) -> Wanted:
    """Each motion is to end elsewhere, by its own way."""
    waypoints = dict[int, tuple[Waypoint, ...]]()
    for i, motion in enumerate(program.motions):
        T = motion.end.T.copy()
        T[:3, 3] += 1e-4 * np.array([1.0 + i, 2.0 - i, 0.5])
        waypoints[i] = (Waypoint(kind=motion.kind, q=np.zeros(6), T=T),)
    return Wanted(program=program, robot=robot, waypoints=waypoints, refused={}, tolerance=TOLERANCE_M)


@pytest.mark.parametrize(("name", "case"), RUNNING)
def test_motions_are_written_where_they_are_to_end(name, case):
    """Those that stay share their target with one that is not read, or are in the table; no other moves."""
    language = LANGUAGES[name]
    robot = load_robot(language.robot)
    program = language.reading(language.written(CASES[case]()), robot=robot)
    assert [one.text for one in program.rewrite(robot, {})] == [one.text for one in program.sources]
    chosen = plan(program, lambda text: request_of(text, robot))
    again = chosen.wanted.program.reread(chosen.text)
    for i, (new, old) in enumerate(zip(again.motions, chosen.wanted.program.motions, strict=True)):
        wanted = chosen.written[i][0].T if i in chosen.written else old.end.T
        np.testing.assert_allclose(new.end.T[:3, 3], wanted[:3, 3], atol=WRITTEN_M, err_msg=str(new.place))
    kept = {i for i in chosen.left if "shares its target with the motion in" in str(chosen.left[i])}
    assert not kept or refused(program) or chosen.left.keys() > kept
    assert bool(chosen.ways) == (case in ONE_TEXT and (name, case) not in {*UNWRITTEN, *UNREAD})
    if (name, case) in UNWRITTEN:
        assert chosen.left.keys() > kept, "the gap is closed: take it out of the table"
    else:
        assert chosen.left.keys() == kept


@pytest.mark.parametrize("name", ["RAPID", "KRL", "URScript", "TP"])
def test_a_text_of_several_motions_is_written_if_they_agree(name):
    """Where each of them needs other numbers, or one alone does, it stays with the reason."""
    language = LANGUAGES[name]
    robot = load_robot(language.robot)
    row = loop("for", "c1", 3, Statement("set frame", ("x", times(C1, 15))), move(K1))
    program = language.reading(language.written(program_of(row)), robot=robot)

    def paths(*by_mm: float) -> dict[int, tuple[Waypoint, ...]]:
        poses = [se3.translation(mm * 1e-3) @ motion.end.T for mm, motion in zip(by_mm, program.motions, strict=False)]
        return {i: (Waypoint(kind="linear", q=np.zeros(6), T=T),) for i, T in enumerate(poses)}

    same = paths(0.1, 0.1, 0.1)
    assert not program.unwritable(robot, same, 0.0)
    for i, motion in enumerate(program.reread(program.rewrite(robot, same)).motions):
        np.testing.assert_allclose(motion.end.T, same[i][0].T, atol=WRITTEN_M)
    for other in (paths(0.1, 0.2, 0.3), paths(0.1)):
        cannot = program.unwritable(robot, other, 0.0)
        assert cannot.keys() == other.keys()
        assert set(cannot.values()) == {"its text stands for 3 motions, which need different numbers"}
        with pytest.raises(InputError, match="its text stands for 3 motions"):
            program.rewrite(robot, other)


@pytest.mark.parametrize("name", ["RAPID", "KRL", "URScript"])
def test_a_target_stays_below_an_approach_that_is_not_read(name):
    """The motion to another target is written. In TP the height is set in a register of its own, which is another target."""
    language = LANGUAGES[name]
    program = language.reading(language.written(CASES["unknown height above a target"]()))
    assert [motion.end.T[0, 3] * 1e3 for motion in program.motions] == pytest.approx([11.0, 44.0])
    chosen = plan(program, lambda text: request_of(text, load_robot(language.robot)))
    assert chosen.left.keys() == {0}
    assert f":{min(refused(program))}, which stays" in str(chosen.left[0])


@pytest.mark.parametrize("name", ["RAPID", "KRL"])
def test_targets_of_a_long_loop_stand_in_an_array(name, monkeypatch):
    """Where a loop is too long to be written out, and its targets are found by its counters."""
    monkeypatch.setattr("robot_programs.core.written_out.MAX_NEW_LINES", 20)
    language = LANGUAGES[name]
    long = [let("n2", ("+", ("read", "n2"), number(k))) for k in range(12)]
    row = loop("for", "c1", 6, move(above(K1, times(C1, 20))), *long)
    program = language.reading(language.written(program_of(row, move(K2))))
    chosen = plan(program, lambda text: request_of(text, load_robot(language.robot)))
    assert (chosen.ways, chosen.left) == ((TABLED,), {})
    again = program.reread(chosen.text)
    assert len(again.motions) == len(chosen.written)
    for i, motion in enumerate(again.motions):
        np.testing.assert_allclose(motion.end.T[:3, 3], chosen.written[i][0].T[:3, 3], atol=WRITTEN_M)


@pytest.mark.parametrize(("name", "added"), [("RAPID", 1), ("URScript", 0)])
def test_most_motions_to_a_target_get_theirs_in_its_place(name, added):
    """Others get a clone where it is declared; where an instruction states it, they state their own."""
    language = LANGUAGES[name]
    program = language.reading(language.written(program_of(move(K1), move(K1), move(K1), move(K1))))
    shifts = (1e-4, 3e-4, 3e-4, 3e-4)

    def wanted(text: Program) -> Wanted:
        ends = {i: motion.end.T + 0.0 for i, motion in enumerate(text.motions)}
        for i, T in ends.items():
            T[0, 3] += shifts[i]
        paths = {i: (Waypoint(kind="linear", q=np.zeros(6), T=T),) for i, T in ends.items()}
        return Wanted(
            program=text, robot=load_robot(language.robot), waypoints=paths, refused={}, tolerance=TOLERANCE_M
        )

    chosen = plan(program, wanted)
    assert not chosen.left
    again = program.reread(chosen.text)
    for new, old, shift in zip(again.motions, program.motions, shifts, strict=True):
        np.testing.assert_allclose(new.end.T[0, 3] - old.end.T[0, 3], shift, atol=WRITTEN_M)
    assert sum(chosen.added_lines.values()) == added
    before, after = (Counter(of[0].text.splitlines()) for of in (program.sources, chosen.text))
    assert (before - after).total() == 2
