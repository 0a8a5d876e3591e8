"""What the noise can tell apart, as the terminal and the page of a sensitivity analysis show it."""

import numpy as np
import pytest

from taskcal.analysis.identifiability import find_distinguishable
from taskcal.report.sensitivity import count_distinguishable, tabulate_distinguishable


def test_the_weakest_directions_come_first_each_with_what_is_left_of_its_deviation():
    told_apart = find_distinguishable(np.diag([3.0, 1.0, 0.1]), ("a", "b", "c"), np.ones(3), 3, noise=0.5)
    table = tabulate_distinguishable(told_apart, {"a": "α"})
    assert [row[0] for row in table.rows] == ["c", "b", "α"]
    assert [float(row[1]) for row in table.rows] == pytest.approx([1.04**-0.5, 5**-0.5, 37**-0.5], abs=5e-4)
    assert [row[2] for row in table.rows] == ["no", "yes", "yes"]
    assert count_distinguishable(told_apart).startswith("2 of 3 directions are determined: ")


def test_few_directions_and_few_terms_of_each_are_shown():
    rng = np.random.default_rng(0)
    told_apart = find_distinguishable(rng.normal(size=(20, 9)), tuple("abcdefghi"), np.ones(9), 9, noise=1.0)
    table = tabulate_distinguishable(told_apart, {})
    assert len(table) == 5
    assert all(row[0].endswith(" …") and row[0].count("·") <= 5 for row in table.rows)
