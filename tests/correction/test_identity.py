"""A calibration of zeros corrects nothing: programs of every language stay as they are, byte for byte."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Frame, Motion, Target
from robot_programs.core.source import Place, Source
from robot_programs.languages import Composition, language_of
from robot_programs.reading import parse_program
from robot_programs.tp.read import read_tp
from taskcal.correction.correct import correct
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure
from tests.laws.robots import industrial, industrial_positions
from tests.robot_programs.tp.generator import generate
from tests.robot_programs.tp.samples import R2000

TOOL = Frame(name="tGrip", T=se3.translation(0.02, -0.01, 0.12) @ se3.rotation("y", 0.3))
HOME = np.radians([10.0, 15.0, -20.0, 25.0, 50.0, -35.0])


@pytest.fixture(scope="module", params=[1])
def nothing(request):
    """A calibration of a random arm without defects that estimated none."""
    rng = np.random.default_rng(request.param)
    joints = [{**joint, "limits_deg": [-170.0, 170.0]} for joint in industrial(rng)["joint"]]
    model = ErrorModel(robot_from({**industrial(rng), "joint": joints, "tool": []}))
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), sigma=1e-6, uncertainty=1e-6)
    return identify(model, campaign, keep=[])


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


@pytest.mark.parametrize("name", ["p.mod", "p.src", "p.script", "p.csv", "p.apt"])
def test_a_program_of_any_language_stays_as_it_is(nothing, name):
    robot = nothing.model.robot
    source, frames = program_of(robot, name)
    program = parse_program((source,), robot=robot, **frames)
    assert len(program.motions) == 4
    found = correct(nothing, program)
    assert not found.rejected
    assert not len(found.corrected)
    assert found.sources[0].encode() == source.encode()
    assert found.after.length.max() < 1e-8


@pytest.fixture(scope="module")
def nothing_of_a_fanuc():
    """The same of the robot of the TP programs that tests have."""
    rng = np.random.default_rng(1)
    model = ErrorModel(R2000)
    low, high = np.radians([[-40, -20, -60, -90, -100, -90], [40, 40, 10, 90, -20, 90]])
    campaign, _ = measure(rng, model, rng.uniform(low, high, (30, 6)), sigma=1e-6, uncertainty=1e-6)
    return identify(model, campaign, keep=[])


def test_random_tp_programs_stay_as_they_are(nothing_of_a_fanuc):
    """Random TP programs stay as they are with the files of their frames."""
    lines = 0
    for seed in range(40):
        sources = generate(np.random.default_rng(seed), trouble=False)
        program = read_tp(sources, robot=R2000)
        if not program.motions:
            continue
        found = correct(nothing_of_a_fanuc, program)
        assert not len(found.corrected)
        assert [source.encode() for source in found.sources] == [source.encode() for source in sources]
        if not found.rejected:
            assert found.after.length.max() < 1e-8
            lines += sum(move.kind != "axes" for move in program.motions)
        if lines > 10:  # positions are random, and some beyond reach
            return
    raise AssertionError(f"only {lines} lines could be corrected")
