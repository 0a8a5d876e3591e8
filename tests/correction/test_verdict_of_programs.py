"""A program is met where every motion on its part was read, corrected and assessed, and never by those alone that were."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Frame, Motion, Target
from robot_programs.core.source import Place, Source
from robot_programs.languages import Composition, language_of
from robot_programs.reading import parse_program
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.correction.verdict import judge
from taskcal.geometry import se3
from taskcal.identification.calibration import COURSE_IN_DOUBT, FILE_IN_DOUBT, SCALE_IN_DOUBT
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.task import Task
from tests.laws.calibrations import calibrated
from tests.laws.robots import industrial
from tests.robot_programs.tp.samples import R2000, backup, listing, pose

COARSE = Bounds(tolerance=1.0, shift=0.05, turn=0.2, joint=0.5)
"""Of a correction that keeps every motion whole and rejects none."""

TOOL = Frame(name="tGrip", T=se3.translation(0.02, -0.01, 0.12) @ se3.rotation("y", 0.3))
HOME = np.radians([10.0, 15.0, -20.0, 25.0, 50.0, -35.0])

UNREAD = {
    "p.mod": "    Ask pAny;\n    MoveL pAny,v100,fine,tGrip\\WObj:=wPart;\n",
    "p.src": "LIN XANY:{X 0,Y 0,Z 0,A 0,B 0,C 0}\n",
    "p.script": "  movel(pose_inv(seen()), v=0.1)\n",
    "p.csv": ",linear,1.0,2.0,3.0,0,0,0,1,100,yes,tOther\n",
    "p.apt": "INDIRV/1,0,0\nGOFWD/(CIRCLE/0,0,0,5),(LINE/0,0,0,1,1,1)\n",
    "p.ls": "   3:L PR[99] 100mm/sec FINE    ;\r\n",
}
"""What is written before the third motion, by language: one that nobody can resolve."""

WHOLE = tuple(UNREAD)


@pytest.fixture(scope="module")
def calibrations():
    """Of a random arm with a spherical wrist, and of the robot of the TP programs that tests have."""
    arm = industrial(np.random.default_rng(1))
    joints = [{**joint, "limits_deg": [-170.0, 170.0]} for joint in arm["joint"]]
    own, fanuc = calibrated(robot_from({**arm, "joint": joints, "tool": []})), calibrated(R2000)
    return {name: fanuc if name == "p.ls" else own for name in UNREAD}


def program_of(robot, name):
    """A joint motion and lines on a part that stands turned, in the language of a file's name."""
    flange = ErrorModel(robot).poses(HOME[None])[0]
    part = Frame(name="wPart", T=flange @ TOOL.T @ se3.translation(0.05, -0.03, 0.02) @ se3.rotation("x", 0.4))
    place = Place(path=Path(name), line=1)
    motions, steps = [], [(0.0, 0.0, 0.0), (0.05, 0.0, 0.0), (0.05, 0.04, 0.01), (0.0, 0.02, 0.03)]
    for i, step in enumerate(steps):
        T = se3.inverse(part.T) @ se3.translation(*step) @ flange @ TOOL.T
        end = Target(name="", T=T, q=None, posture=None, place=place)
        motions.append(
            Motion(
                kind="linear" if i else "joint", end=end, via=None, tool=TOOL, part=part, part_in_hand=False, speed=0.1,
                stops=True, follows=i - 1 if i else None, routine="p", place=place,
            )
        )  # fmt: skip
    if name.endswith(".apt"):
        lines = ["GOTO/" + ",".join(f"{v:.9f}" for v in (*m.end.T[:3, 3] * 1e3, *-m.end.T[:3, 2])) for m in motions]
        text = "\n".join(["UNITS/MM", "MULTAX/ON", "FEDRAT/600,MMPM", *lines, "FINI", ""])
        return Source.of(Path(name), text.encode()), {"tool": TOOL, "part": part}
    language = language_of(Path(name))
    at = np.tile(HOME, (len(motions), 1))
    source = language.compose(Composition(name="p", robot=robot, motions=motions, q=at))
    return source, {} if language.declares_frames else {"tool": TOOL, "part": part}


def text_of(name, robot):
    """A program of four motions on a part, and the frames that its language does not declare."""
    if name != "p.ls":
        source, frames = program_of(robot, name)
        text = source.text
        if name == "p.csv":  # with a column for the tool, which one motion may not have
            first, *lines = text.splitlines()
            text = "\n".join([f"{first},tool", *(f"{line},tGrip" for line in lines), ""])
        return text, frames
    corners = {str(k): pose(200.0 + 40.0 * k, 100.0, 300.0 + 10.0 * k) for k in (1, 2, 3, 4)}
    return listing(["J P[1] 50% FINE", *(f"L P[{k}] 100mm/sec FINE" for k in (2, 3, 4))], corners).text, {}


def third_motion(text):
    """Where the third motion begins."""
    return [
        m.start()
        for m in re.finditer("(?m)^.*(Move[JL] |PTP {|LIN {|move[jl][(]|,(joint|linear),|GOTO/|:[JL] P)", text)
    ][2]


def with_line(line):
    """What writes a line before the third motion."""
    return lambda text: text[: third_motion(text)] + line + text[third_motion(text) :]


def read(name, robot, text, frames):
    source = Source.of(Path(name if name != "p.ls" else "mill.ls"), text.encode())
    more = backup() if name == "p.ls" else []
    return parse_program((source, *more), robot=robot, **frames)


def measured(calibration, program):
    """A cell in which every tool and part of a program was measured, and is where the program has it."""
    tools, parts = {}, {}
    for move in program.motions:
        tools[move.tool.name.casefold()] = Measured(name=move.tool.name, in_flange=move.tool.T, uncertainty=1e-5)
        at = calibration.T_tracker_base @ move.part.T
        parts[move.part.name.casefold()] = Measured(name=move.part.name, in_tracker=at, uncertainty=1e-5)
    return Cell(tools=tools, parts=parts, controller="nominal")


def verdict_of(calibrations, name, change=lambda text: text, cell=None, bounds=COARSE, **options):
    """The judgements of a program in the language of a file's name, to a tolerance that its known error keeps by far."""
    calibration = calibrations[name]
    robot = calibration.model.robot
    text, frames = text_of(name, robot)
    program = read(name, robot, change(text), frames)
    cell = measured(calibration, read(name, robot, text, frames)) if cell is None else cell
    correction = correct(calibration, program, cell=cell, bounds=bounds, accept_uncertain=True, **options)
    task = over_measured(calibration)
    return judge(calibration, task, correction, cell, accept_uncertain=True).judgements


def over_measured(calibration):
    """The task of the measured poses, to a tolerance that everything known keeps by far."""
    return Task(name="measured", poses=calibration.model.poses(calibration.q), joints=calibration.q, accuracy=1.0)


def said(judgement):
    return {reason.why: reason.detail for reason in judgement.reasons}


@pytest.mark.parametrize("name", WHOLE)
def test_a_motion_that_was_not_read_is_part_of_the_verdict(name, calibrations):
    """A program is met, and with one motion more that nobody can resolve it is not known: which, by file and line."""
    assert verdict_of(calibrations, name)[2].decision == "met"
    changed = verdict_of(calibrations, name, with_line(UNREAD[name]))[2]
    assert changed.decision == "not known"
    text, _ = text_of(name, calibrations[name].model.robot)
    first = text[: third_motion(text)].count("\n") + 1
    count, _, where = said(changed)["motions were not read"].partition(": ")
    assert count == "1"
    assert where in {
        f"{'mill.ls' if name == 'p.ls' else name}:{first + line}" for line in range(UNREAD[name].count("\n"))
    }


@pytest.mark.parametrize("name", WHOLE)
def test_a_rejected_motion_is_part_of_the_verdict(name, calibrations):
    judged = verdict_of(calibrations, name, bounds=replace(COARSE, shift=1e-6))[2]
    assert judged.decision == "not known"
    assert said(judged)["motions were rejected"].startswith("4: ")


@pytest.mark.parametrize("name", ["p.mod", "p.src", "p.script"])
def test_a_motion_that_is_corrected_at_run_time_is_part_of_the_verdict(name, calibrations):
    """It is not assessed; where tool and part are measured, which the function does not know, it is left, and not read."""
    for cell, why in ((Cell(), "motions are corrected at run time and not assessed"), (None, "motions were not read")):
        judged = verdict_of(calibrations, name, with_line(UNREAD[name]), cell, helper=True)[2]
        assert judged.decision == "not known"
        assert said(judged)[why].startswith("1: ")


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("p.mod", "    MoveAbsJ [[10,20,-30,20,50,-30],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tGrip;\n"),
        ("p.src", "PTP {A1 10,A2 -60,A3 70,A4 20,A5 50,A6 -30}\n"),
        ("p.script", "  movej([0.2, -1.0, 1.2, 0.3, 0.9, -0.5])\n"),
    ],
)
def test_a_motion_to_stated_joints_names_no_place_on_the_part(name, line, calibrations):
    """As to a home position: it may stay as it is."""
    judged = verdict_of(calibrations, name, with_line(line), keep_joints=True)[2]
    assert judged.decision == "met", judged.reasons


@pytest.mark.parametrize("name", WHOLE)
def test_of_a_tool_of_which_nothing_was_measured_nothing_is_known(name, calibrations):
    """Neither its point nor the program is met, nor not met, at any tolerance; the target is."""
    target, *others = verdict_of(calibrations, name, cell=Cell(controller="nominal"))
    assert target.decision == "met"
    for one in others:
        assert one.decision == "not known"
        (reason,) = one.reasons
        assert reason.why == "nothing was measured of the tool"
        assert "as the controller has it" in reason.detail
        assert "reflectors" in reason.remedy


@pytest.mark.parametrize("doubt", [FILE_IN_DOUBT, SCALE_IN_DOUBT, COURSE_IN_DOUBT])
def test_nothing_is_met_by_a_calibration_in_doubt(doubt, calibrations):
    """Rows that are held out do not show what is doubted: neither target, tool nor program is met, and why is said of each."""
    sound = calibrations["p.mod"]
    doubted = {"p.mod": replace(sound, remarks=(*sound.remarks, f"{doubt}and why"))}
    for judgement, before in zip(verdict_of(doubted, "p.mod"), verdict_of(calibrations, "p.mod"), strict=True):
        assert before.decision == "met"
        assert judgement.decision == "not known"
        assert said(judgement) == {"the calibration is in doubt": f"{doubt}and why"}


def test_many_motions_are_counted_and_the_first_named(calibrations):
    ask, unread = UNREAD["p.mod"].splitlines(keepends=True)
    detail = said(verdict_of(calibrations, "p.mod", with_line(ask + 40 * unread))[2])["motions were not read"]
    assert detail.startswith("40: p.mod:")
    assert detail.endswith(" and 28 more")


def test_an_override_is_named_and_without_it_nothing_is_met(calibrations):
    """A correction that is smaller than its uncertainty."""
    calibration = calibrations["p.mod"]
    program, frames = program_of(calibration.model.robot, "p.mod")
    program = parse_program((program,), robot=calibration.model.robot, **frames)
    cell = measured(calibration, program)
    tool = replace(cell.tools["tgrip"], uncertainty=0.05)
    cell = replace(cell, tools={"tgrip": tool})
    correction = correct(calibration, program, cell=cell, bounds=COARSE)
    assert correction.uncertain
    task = over_measured(calibration)
    withheld = judge(calibration, task, correction, cell)
    assert withheld.override is None
    assert said(withheld.judgements[2]).keys() == {"the correction is smaller than its uncertainty"}
    written = judge(calibration, task, correction, cell, accept_uncertain=True)
    assert written.override == withheld.judgements[2].reasons[0]
    assert written.judgements[2].decision == "met"
    assert np.isclose(written.judgements[2].budget.after, withheld.judgements[2].budget.after)
