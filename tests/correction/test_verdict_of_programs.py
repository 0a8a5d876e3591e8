"""A program is met where every motion on its part was read, corrected and assessed, and never by those alone that were."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.correction.cell import Cell, Measured
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.correction.verdict import judge
from taskcal.identification.calibration import COURSE_IN_DOUBT, FILE_IN_DOUBT, SCALE_IN_DOUBT
from taskcal.task.task import Task
from tests.correction.test_conformance import begun
from tests.robot_programs.conformance.cases import K1, P1, SENSOR, above, literal, move, program, put
from tests.robot_programs.conformance.languages import LANGUAGES

COARSE = Bounds(tolerance=1.0, shift=0.05, turn=0.2, joint=0.5)
"""Of a correction that keeps every motion whole and rejects none."""

ODD = {"APT": "INDIRV/1,0,0\nGOFWD/(CIRCLE/0,0,0,5),(LINE/0,0,0,1,1,1)", "CSV": "1.0,2.0,3.0,0,0,0,1,linear,other"}
"""A motion that nobody can resolve, in languages that have no sensors."""


def unread():
    return move(above(K1, SENSOR))


def sources_of(name, *more):
    """Two motions to a part, others, and two more; with the lines of the others."""
    tool, own = begun(name)[-1], () if name in ODD else more
    made = program(move(literal(0, 0, 0)), move(literal(50, 0, 0)), *own, *(move(literal(*xyz)) for xyz in LAST))
    first, *rest = LANGUAGES[name].written(made, tool, home=True)
    if name not in ODD:
        return [first, *rest], {one.line for one in more}
    lines = first.text.split("\n")
    if name == "CSV":  # with a column for the tool, which one motion may not have
        lines = [f"{line},{'tool' if line else ''}".strip(",") for line in lines]
    at = made.routines[-1].body[2].line - 1
    lines[at:at] = ODD[name].split("\n") if more else []
    return [replace(first, text="\n".join(lines))], {at + 1 + k for k in range(ODD[name].count("\n") + 1)}


LAST = (50, 40, 10), (0, 20, 30)


def measured(calibration, text):
    """A cell in which every tool and part of a program was measured, and is where the program has it."""
    tools, parts = {}, {}
    for one in text.motions:
        tools[one.tool.name.casefold()] = Measured(name=one.tool.name, in_flange=one.tool.T, uncertainty=1e-5)
        at = calibration.T_tracker_base @ one.part.T
        parts[one.part.name.casefold()] = Measured(name=one.part.name, in_tracker=at, uncertainty=1e-5)
    return Cell(tools=tools, parts=parts, controller="nominal")


def verdict_of(name, *more, cell=None, bounds=COARSE, remarks=(), **options):
    """The judgements of a program with some motions more, to a tolerance that its known error keeps by far."""
    calibration, tool = begun(name)[0], begun(name)[-1]
    calibration = replace(calibration, remarks=(*calibration.remarks, *remarks))
    text = LANGUAGES[name].reading(sources_of(name, *more)[0], tool, calibration.model.robot)
    cell = measured(calibration, text) if cell is None else cell
    correction = correct(calibration, text, cell=cell, bounds=bounds, accept_uncertain=True, **options)
    return judge(calibration, over_measured(calibration), correction, cell, accept_uncertain=True).judgements


def over_measured(calibration):
    """The task of the measured poses, to a tolerance that everything known keeps by far."""
    return Task(name="measured", poses=calibration.model.poses(calibration.q), joints=calibration.q, accuracy=1.0)


def said(judgement):
    return {reason.why: reason.detail for reason in judgement.reasons}


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_motion_that_was_not_read_is_part_of_the_verdict(name):
    """A program is met, and with one motion more that nobody can resolve it is not known: which, by file and line."""
    assert verdict_of(name)[2].decision == "met"
    one = unread()
    changed = verdict_of(name, one)[2]
    assert changed.decision == "not known"
    (first, *_), lines = sources_of(name, one)
    count, _, where = said(changed)["motions were not read"].partition(": ")
    assert count == "1"
    assert where in {f"{first.path}:{line}" for line in lines}


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_rejected_motion_is_part_of_the_verdict(name):
    judged = verdict_of(name, bounds=replace(COARSE, shift=1e-6))[2]
    assert judged.decision == "not known"
    assert said(judged)["motions were rejected"].startswith("4: ")


@pytest.mark.parametrize("name", ["RAPID", "KRL", "URScript"])
def test_a_motion_that_is_corrected_at_run_time_is_part_of_the_verdict(name):
    """It is not assessed; where tool and part are measured, which the function does not know, it is left, and not read."""
    for cell, why in ((Cell(), "motions are corrected at run time and not assessed"), (None, "motions were not read")):
        judged = verdict_of(name, put(P1, "x", SENSOR), move(P1), cell=cell, helper=True)[2]
        assert judged.decision == "not known"
        assert said(judged)[why].startswith("1: ")


@pytest.mark.parametrize("name", sorted(LANGUAGES.keys() - ODD.keys()))
def test_a_motion_to_stated_joints_names_no_place_on_the_part(name):
    """As to a home position, with which these programs begin: it may stay as it is."""
    judged = verdict_of(name, keep_joints=True)[2]
    assert judged.decision == "met", judged.reasons


@pytest.mark.parametrize("name", LANGUAGES)
def test_of_a_tool_of_which_nothing_was_measured_nothing_is_known(name):
    """Neither its point nor the program is met, nor not met, at any tolerance; the target is."""
    target, *others = verdict_of(name, cell=Cell(controller="nominal"))
    assert target.decision == "met"
    for one in others:
        assert one.decision == "not known"
        (reason,) = one.reasons
        assert reason.why == "nothing was measured of the tool"
        assert "as the controller has it" in reason.detail
        assert "reflectors" in reason.remedy


@pytest.mark.parametrize("doubt", [FILE_IN_DOUBT, SCALE_IN_DOUBT, COURSE_IN_DOUBT])
def test_nothing_is_met_by_a_calibration_in_doubt(doubt):
    """Rows that are held out do not show what is doubted: neither target, tool nor program is met, and why is said of each."""
    doubted = verdict_of("RAPID", remarks=[f"{doubt}and why"])
    for judgement, before in zip(doubted, verdict_of("RAPID"), strict=True):
        assert before.decision == "met"
        assert judgement.decision == "not known"
        assert said(judgement) == {"the calibration is in doubt": f"{doubt}and why"}


def test_many_motions_are_counted_and_the_first_named():
    detail = said(verdict_of("RAPID", *(unread() for _ in range(40)))[2])["motions were not read"]
    assert detail.startswith("40: m.mod:")
    assert detail.endswith(" and 28 more")


def test_an_override_is_named_and_without_it_nothing_is_met():
    """A correction that is smaller than its uncertainty."""
    calibration, *_, own = begun("RAPID")
    text = LANGUAGES["RAPID"].reading(sources_of("RAPID")[0], own)
    cell = measured(calibration, text)
    ((key, tool),) = cell.tools.items()
    cell = replace(cell, tools={key: replace(tool, uncertainty=0.05)})
    correction = correct(calibration, text, cell=cell, bounds=COARSE)
    assert correction.uncertain
    task = over_measured(calibration)
    withheld = judge(calibration, task, correction, cell)
    assert withheld.override is None
    assert said(withheld.judgements[2]).keys() == {"the correction is smaller than its uncertainty"}
    written = judge(calibration, task, correction, cell, accept_uncertain=True)
    assert written.override == withheld.judgements[2].reasons[0]
    assert written.judgements[2].decision == "met"
    assert np.isclose(written.judgements[2].budget.after, withheld.judgements[2].budget.after)
