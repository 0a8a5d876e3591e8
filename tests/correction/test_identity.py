"""A calibration of zeros corrects nothing: programs of every language stay as they are, byte for byte."""

from functools import cache

import numpy as np
import pytest

from robot_programs.tp.read import read_tp
from taskcal.correction.correct import correct
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.correction.test_conformance import CASES_OF_WAYS, begun
from tests.laws.campaigns import measure
from tests.robot_programs.conformance.cases import CASES
from tests.robot_programs.conformance.languages import LANGUAGES, RUNNING
from tests.robot_programs.tp.generator import generate
from tests.robot_programs.tp.samples import R2000


@cache
def faultless(name):
    """A calibration of a language's robot without defects that estimated none."""
    rng, model = np.random.default_rng(1), ErrorModel(load_robot(LANGUAGES[name].robot))
    q = np.radians(LANGUAGES[name].home) + rng.uniform(-0.5, 0.5, (30, 6))
    campaign, _ = measure(rng, model, q, sigma=1e-6, uncertainty=1e-6)
    return identify(model, campaign, keep=[])


@pytest.mark.parametrize(("name", "case"), [one for one in RUNNING if one[1] in CASES_OF_WAYS])
def test_a_program_of_any_language_stays_as_it_is(name, case):
    """Loops are not written out, nor calls: nothing needs other numbers."""
    language, nothing, tool = LANGUAGES[name], faultless(name), begun(name)[-1]
    sources = language.written(CASES[case](), tool, home=True)
    found = correct(nothing, language.reading(sources, tool, nothing.model.robot))
    assert not found.rejected
    assert not len(found.corrected)
    assert [source.encode() for source in found.sources] == [source.encode() for source in sources]
    assert found.after.length.max() < 1e-8


def test_random_tp_programs_stay_as_they_are():
    """Random TP programs stay as they are with the files of their frames."""
    lines = 0
    for seed in range(40):
        sources = generate(np.random.default_rng(seed), trouble=False)
        program = read_tp(sources, robot=R2000)
        if not program.motions:
            continue
        found = correct(faultless("TP"), program)
        assert not len(found.corrected)
        assert [source.encode() for source in found.sources] == [source.encode() for source in sources]
        if not found.rejected:
            assert found.after.length.max() < 1e-8
            lines += sum(move.kind != "axes" for move in program.motions)
        if lines > 10:  # positions are random, and some beyond reach
            return
    raise AssertionError(f"only {lines} lines could be corrected")
