"""The table of an elimination: what was published of each parameter beside what the poses say."""

import numpy as np
import pytest

from taskcal.analysis.identifiability import describe_combination, published_kept, tabulate_elimination
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import irb6660_positions


@pytest.mark.parametrize(
    ("terms", "words"),
    [
        ({}, ""),
        ({"a": 1.0}, "A"),
        ({"a": -1.0, "b": 0.25}, "−A + 0.25·b"),
        ({"b": 0.3, "a": -0.70001}, "0.3·b − 0.7·A"),
    ],
)
def test_a_combination_in_words(terms: dict[str, float], words: str) -> None:
    assert describe_combination(terms, {"a": "A"}) == words


def test_every_parameter_has_a_row_of_the_table() -> None:
    """Every parameter has a row and the fate that its poses give it."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    rng = np.random.default_rng(0)
    table = tabulate_elimination(model, {"some": irb6660_positions(rng, 30), "others": irb6660_positions(rng, 30)})
    assert [row.name for row in table.rows] == list(model.names)
    for label, found in table.eliminations.items():
        assert [row.name for row in table.rows if row.eliminated[label] == "kept"] == list(found.kept)
    dropped = {row.name for row in table.rows if row.published in ("zero", "redundant", "dropped")}
    assert dropped == set(model.robot.published.dropped)


def test_effects_are_no_part_of_the_published_choice() -> None:
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    assert published_kept(model + EncoderGain()) == published_kept(model)
    assert set(published_kept(model)) == set(model.names) - set(model.robot.published.dropped)
