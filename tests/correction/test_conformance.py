"""Programs of the conformance set, corrected in every language: the true tool goes where the machine of the small language goes.

The robots have defects, which a calibration knows; the joints to which their controllers go are Pinocchio's.
"""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from robot_programs.core.plan import WRITTEN_OUT
from robot_programs.tp.meaning import world_in_base
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from tests.correction.by_pinocchio import COARSE, defective, true_tool
from tests.robot_programs.conformance.cases import (
    C1,
    C2,
    CASES,
    K1,
    K2,
    ONE_TEXT,
    P1,
    SENSOR,
    UNWRITTEN,
    D,
    Q,
    above,
    call,
    copy,
    literal,
    loop,
    move,
    number,
    procedure,
    program,
    put,
    times,
    truth,
)
from tests.robot_programs.conformance.languages import LANGUAGES, RUNNING
from tests.robot_programs.small_language import Routine, Statement

FREE = Bounds(tolerance=1e-6, shift=0.05, turn=0.2)
CASES_OF_WAYS = [
    "points one after another", "one target of two motions", "shifted target", "target that is set", "array in a loop",
    "pallet by a counter", "pallet by a condition", "pick and approach", "call in a loop", "frame by its number",
    "tool by its number", "function of a target", "unknown condition that decides nothing",
]  # fmt: skip
"""One of each way in which numbers are written."""
SPINNING = ("APT",)
"""Languages that leave a rotation about the tool's axis to who drives the program, which the true tool's place depends on."""


@cache
def true_robot(language):
    return defective(LANGUAGES[language].robot, np.radians(LANGUAGES[language].home))


def begun(name):
    """A robot with its chain, and the tool that is at the origin of programs where it begins."""
    calibration, chain, home = true_robot(name)
    robot = calibration.model.robot
    world = world_in_base(robot) if name == "TP" else np.eye(4)
    return calibration, chain, world, robot.T_flange_tool @ np.linalg.inv(chain.pose(home)) @ world


@pytest.mark.parametrize(
    ("name", "case"),
    [one for one in RUNNING if one[1] in CASES_OF_WAYS and one not in UNWRITTEN and one[0] not in SPINNING],
)
def test_the_true_tool_goes_where_the_machine_goes(name, case):
    language, made = LANGUAGES[name], CASES[case]()
    calibration, chain, world, tool = begun(name)
    robot, home = calibration.model.robot, np.radians(language.home)
    text = language.reading(language.written(made, tool, home=True), tool, robot)
    done = truth(made)
    wanted = np.array(sorted({p for line, places in done.went.items() if line not in done.decided for p in places}))

    def true_tools(moves):
        goals = [one.flange(one.end.T) for one in moves if one.end.T is not None]
        return np.array([true_tool(calibration, chain, T, home, tool) for T in goals])

    def distances(tools):
        return np.array([np.linalg.norm((T - world)[:3, 3] * 1e3 - wanted, axis=1) for T in tools])

    found = correct(calibration, text, bounds=FREE)
    assert not found.rejected
    longer = [str(one) for one in found.diagnostics if f"lines longer: {WRITTEN_OUT}, where" in one.text]
    assert bool(longer) == (case in ONE_TEXT)
    read = language.reading(found.sources, tool, robot).motions
    tools = true_tools([one for one, (_, _, share) in zip(read, found.origin, strict=True) if share == 1.0])
    off = distances(tools)
    assert distances(true_tools(text.motions)).min() > 0.5
    assert off.min(axis=1).max() < 1e-3
    assert set(off.argmin(axis=1)) == set(range(len(wanted)))
    np.testing.assert_allclose(tools[:, :3, :3], np.broadcast_to(np.eye(3), (len(tools), 3, 3)), atol=2e-6)


@pytest.mark.parametrize("name", ["RAPID", "KRL", "URScript"])
def test_shared_number_gets_the_value_of_least_largest_error(name):
    """One target in three frames: one value where that is good enough, else the loop is written out."""
    language, made = (
        LANGUAGES[name],
        program(loop("for", "c1", 3, Statement("set frame", ("x", times(C1, 15))), move(K1))),
    )
    calibration, _, _, tool = begun(name)
    text = language.reading(language.written(made, tool, home=True), tool, calibration.model.robot)
    found, exact = (correct(calibration, text, bounds=replace(FREE, tolerance=t)) for t in (2e-4, 1e-7))
    mine, its = (
        np.array(
            [
                at.flange(at.end.T)[:3, 3]
                for at, (_, _, share) in zip(one.program.reread(one.sources).motions, one.origin, strict=True)
                if at.end.T is not None and share == 1.0
            ]
        )
        for one in (found, exact)
    )
    assert len(found.corrected) == len(exact.corrected) == len(text.motions) == 4
    lines = [sum(source.text.count("\n") for source in one.sources) for one in (text, found, exact)]
    assert lines[0] == lines[1] < lines[2]
    apart = np.linalg.norm(mine - its, axis=1)
    assert 1e-6 < apart.max() < 2e-4
    # the ends of a line of three: half of what is between them is the least largest error
    assert apart.max() < 0.55 * np.linalg.norm((mine - its)[0] - (mine - its)[2])


@pytest.mark.parametrize("name", sorted(LANGUAGES.keys() - SPINNING))
def test_lines_are_divided_in_the_text(name):
    """What is written reads as the motions that were meant, in the postures of their joints."""
    language, (calibration, _, _, tool) = LANGUAGES[name], begun(name)
    robot, made = (
        calibration.model.robot,
        program(*(move(literal(*xyz)) for xyz in ((0, 0, 0), (150, 0, 0), (150, 90, 20)))),
    )
    text = language.reading(language.written(made, tool, home=True), tool, robot)
    coarse = correct(calibration, text, bounds=replace(FREE, tolerance=1.0))
    between = coarse.after.length[~coarse.after.at_target].max()
    fine = correct(calibration, text, bounds=replace(FREE, tolerance=between / 5.0))
    assert len(fine.motions) > len(coarse.motions) == len(text.motions)
    again = language.reading(fine.sources, tool, robot)
    assert [one.text for one in again.diagnostics] == [one.text for one in text.diagnostics]
    for written, meant in zip(again.motions, fine.motions, strict=True):
        assert (written.kind, written.follows) == (meant.kind, meant.follows)
        if meant.end.T is not None:
            np.testing.assert_allclose(written.end.T, meant.end.T, atol=4e-7)
    whole, at = language.reading(coarse.sources, tool, robot).motions, coarse.before.at_target
    for i, q in zip(coarse.before.move[at], coarse.before.q[at], strict=True):
        assert whole[i].end.posture is None or whole[i].end.posture.agrees(robot, q[None])[0]


PIECES = {
    "direct": [move(K1)],
    "other frame": [Statement("set frame", ("x", number(20))), move(K1), Statement("set frame", ("x", number(0)))],
    "loop": [loop("for", "c1", 3, move(above(K1, times(C1, 15))))],
    "unread": [move(above(K1, SENSOR))],
    "second loop": [loop("for", "c2", 2, move(above(K1, times(C2, 9))))],
}


def share_of(calibration, share):
    """A calibration that found a share of the defects."""
    base, targets = calibration.layout.frames(share * calibration.z)
    return replace(calibration, z=share * calibration.z, T_tracker_base=base, T_tool_target=targets)


@pytest.mark.parametrize(("share", "tolerance"), [(0.1, 1e-4), (0.3, 1e-3), (0.3, 2e-5)])
@pytest.mark.parametrize("name", ["RAPID", "KRL", "URScript", "TP"])
def test_shifted_targets_are_corrected_or_as_they_were(name, share, tolerance):
    """Beside motions to the target itself, in another frame, and such as only the running program knows: each with a reason."""
    language, (calibration, _, _, tool) = LANGUAGES[name], begun(name)
    robot, own = calibration.model.robot, share_of(calibration, share)
    for count in (2, 3):
        for pieces in combinations(PIECES, count):
            routines = [Routine(f"r{k}", PIECES[piece]) for k, piece in enumerate(pieces)]
            made = program(*(call(one, K1, number(0)) for one in routines), routines=routines)
            text = language.reading(language.written(made, tool, home=True), tool, robot)
            found = correct(own, text, bounds=Bounds(tolerance=tolerance), accept_uncertain=True)
            assert found.rejected.keys().isdisjoint(found.corrected.tolist()), pieces
            again = found.program.reread(found.sources)
            assert len(again.motions) == len(found.motions), pieces
            for i, why in found.rejected.items():
                assert why
                (k,) = [k for k, (motion, _, end) in enumerate(found.origin) if motion == i and end == 1.0]
                assert np.abs(again.motions[k].end.T - found.program.motions[i].end.T).max() < 1e-9, pieces
            if "unread" not in pieces and "other frame" not in pieces and name != "TP":
                assert len(found.corrected) == len(found.program.motions), pieces


TOGETHER = {
    "shifted": program(move(above(K1, number(80))), move(K1), move(above(K1, number(60))), move(K2)),
    "given to a routine": program(
        call(r := procedure(move(above(Q, D)), move(Q), move(above(Q, number(60)))), K1, number(80)), move(K2), routines=[r]
    ),
    "copied": program(
        copy(P1, K1), put(P1, "z", ("+", ("part", P1, "z"), number(80))), move(P1), move(K1),
        put(P1, "z", ("-", ("part", P1, "z"), number(20))), move(P1), move(K2),
    ),
}  # fmt: skip
"""Three motions to one target, or above it, and one to another."""


def one_refused(calibration, text):
    """Which motions are refused where a bound refuses those that move farthest."""
    moved = correct(calibration, text, bounds=COARSE).shift
    cuts = np.unique(moved.round(9))
    assert len(cuts) > 2
    bounds = [replace(COARSE, shift=float(cut)) for cut in (cuts[1:] + cuts[:-1]) / 2]
    found = [correct(calibration, text, bounds=bound, accept_uncertain=True) for bound in bounds]
    return [set(range(len(moved))) - set(one.corrected.tolist()) for one in found]


@pytest.mark.parametrize("kind", TOGETHER)
@pytest.mark.parametrize("name", ["RAPID", "KRL", "URScript"])
def test_motions_to_one_target_are_corrected_together(name, kind):
    """Or none of them is. In TP the target above is another register's, or its Offset's: see test_shared_targets."""
    language, (calibration, _, _, tool) = LANGUAGES[name], begun(name)
    text = language.reading(language.written(TOGETHER[kind], tool, home=True), tool, calibration.model.robot)
    last = TOGETHER[kind].routines[-1].body[-1].line
    same = {i for i, one in enumerate(text.motions) if one.kind != "axes" and one.place.line != last}
    assert len(same) == 3
    cases = one_refused(calibration, text)
    assert all(same <= refused or not same & refused for refused in cases)
    assert any(same <= refused for refused in cases)


def test_variable_that_is_set_anew_is_another_target():
    """In KRL a motion that is known at run time only keeps those to what the variable held at last, and no others."""
    name = "KRL"
    turn = copy(P1, K1), put(P1, "x", ("+", ("part", P1, "x"), times(C1, 60))), move(P1)
    made = program(loop("for", "c1", 3, *turn), put(P1, "x", SENSOR), move(P1))
    language, (calibration, _, _, tool) = LANGUAGES[name], begun(name)
    text = language.reading(language.written(made, tool, home=True), tool, calibration.model.robot)
    found = correct(calibration, text, bounds=FREE)
    assert len(text.motions) == 4
    assert found.corrected.tolist() == [0, 1, 2]
