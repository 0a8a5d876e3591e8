"""The steps of a search stand before it begins."""

import numpy as np
import pytest

from taskcal.identification.effects import search_steps, select_effects
from taskcal.identification.options import EffectSearch
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import SOFT, SPECTRUM, Compliance, EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


@pytest.mark.parametrize(
    ("search", "passed_over"),
    [
        (EffectSearch(candidates=(EncoderGain(), Compliance(), SOFT), folds=3), 0),
        (EffectSearch(effects=(EncoderGain(),), folds=2), 0),
        (EffectSearch(effects=(), folds=2), 0),
        pytest.param(EffectSearch(candidates=(SPECTRUM,), folds=2), 1, marks=pytest.mark.slow),
    ],
    ids=["candidates", "named", "none", "spectrum"],
)
def test_what_is_told_are_the_steps_in_their_order(search, passed_over):
    model, rng = ErrorModel(load_robot("abb-irb120")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-0.8, 0.8, (50, 6)), rng=rng)
    told: list[str] = []
    select_effects(model, campaign, search, progress=told.append)
    steps = search_steps(model, campaign, search)
    left = iter(steps)
    assert all(step in left for step in told)
    assert told[-1] == steps[-1]
    assert len(steps) - passed_over <= len(told) <= len(steps)
