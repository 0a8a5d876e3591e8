"""The page of what can be told apart."""

import numpy as np

from taskcal.analysis.identifiability import tabulate_elimination
from taskcal.analysis.sensitivity import MeasuringNoise, sensitivity
from taskcal.report.sensitivity import sensitivity_page, tabulate_distinguishable
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import ModelError


def test_the_page_says_what_the_noise_tells_apart_and_how_large_it_is():
    model = ErrorModel(load_robot("ur5"))
    q = np.random.default_rng(0).uniform(-1.5, 1.5, size=(20, 6))
    table = tabulate_elimination(model, {"poses": q})
    noise = MeasuringNoise(tracker=3e-5, model_error=ModelError(position=4e-4, source="a guess"))
    told_apart = table.eliminations["poses"].distinguishable(noise=noise.total)
    page = sensitivity_page(
        sensitivity(model, q), table, told_apart, noise, maps=None, poses="20 poses", version="0"
    ).html()
    assert 0 < told_apart.count < table.eliminations["poses"].rank
    assert f"{told_apart.count} of {table.eliminations['poses'].rank} directions are determined" in page
    assert "0.401 mm per axis at every pose: tracker 0.03 mm, model error 0.4 mm (a guess)" in page
    assert all(cell in page for row in tabulate_distinguishable(told_apart, {}).rows for cell in row[1:])
