"""What the noise can tell apart, as the terminal and the page of a sensitivity analysis show it."""

import numpy as np
import pytest

from taskcal.analysis.elimination_table import tabulate_elimination
from taskcal.analysis.measuring_noise import MeasuringNoise
from taskcal.analysis.sensitivity import sensitivity
from taskcal.analysis.told_apart import find_told_apart
from taskcal.presentation.sensitivity_report import sensitivity_html
from taskcal.presentation.told_apart_table import count_told_apart, tabulate_told_apart
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.model_error import ModelError


def test_the_weakest_directions_come_first_each_with_what_is_left_of_its_deviation():
    told_apart = find_told_apart(np.diag([3.0, 1.0, 0.1]), ("a", "b", "c"), np.ones(3), 3, noise=0.5)
    table = tabulate_told_apart(told_apart, {"a": "α"})
    assert [row[0] for row in table.rows] == ["c", "b", "α"]
    assert [float(row[1]) for row in table.rows] == pytest.approx([1.04**-0.5, 5**-0.5, 37**-0.5], abs=5e-4)
    assert [row[2] for row in table.rows] == ["no", "yes", "yes"]
    assert count_told_apart(told_apart).startswith("2 of 3: ")


def test_few_directions_and_few_terms_of_each_are_shown():
    rng = np.random.default_rng(0)
    told_apart = find_told_apart(rng.normal(size=(20, 9)), tuple("abcdefghi"), np.ones(9), 9, noise=1.0)
    table = tabulate_told_apart(told_apart, {})
    assert len(table) == 5
    assert all(row[0].endswith(" …") and row[0].count("·") <= 5 for row in table.rows)


def test_the_page_says_what_the_noise_tells_apart_and_how_large_it_is():
    model = ErrorModel(load_robot("ur5"))
    q = np.random.default_rng(0).uniform(-1.5, 1.5, size=(20, 6))
    table = tabulate_elimination(model, {"poses": q})
    noise = MeasuringNoise(tracker=3e-5, model_error=ModelError(position=4e-4, source="a guess"))
    told_apart = table.eliminations["poses"].told_apart(noise=noise.total)
    page = sensitivity_html(sensitivity(model, q), table, told_apart, noise, maps=None, poses="20 poses", version="0")
    assert 0 < told_apart.count < table.eliminations["poses"].rank
    assert f"{told_apart.count} of {table.eliminations['poses'].rank}: less than half" in page
    assert "0.401 mm per axis at every pose: tracker 0.03 mm, model error 0.4 mm (a guess)" in page
    assert all(cell in page for row in tabulate_told_apart(told_apart, {}).rows for cell in row[1:])
