"""The error to be expected along a program, and where it comes from."""

import numpy as np
import pytest

from taskcal.correction.correction import budget_of
from taskcal.correction.frames import SOURCES, Uncertainty


def variances(*micrometres):
    return uncertain(np.array([micrometres, micrometres], dtype=float) ** 2 * 1e-12)


def uncertain(values):
    known = np.isfinite(values).all(axis=1)
    return Uncertainty(variances=values, weights=known / max(known.sum(), 1), common=np.zeros((1, 1)))


def test_expected_errors_contain_the_uncertainty():
    """Expected errors contain the uncertainty before and after."""
    found = budget_of(np.array([3e-4, 3e-4]), np.zeros(2), variances(100, 200, 200, 0))
    assert found.uncertainty == pytest.approx(3e-4)
    assert found.after == pytest.approx(3e-4)
    assert found.before == pytest.approx(np.sqrt(2) * 3e-4)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert found.shares["tool"] == pytest.approx(4 / 9)


@pytest.mark.parametrize(("correction", "uncertain"), [(2.9e-4, True), (3.1e-4, False)])
def test_a_correction_below_its_uncertainty_is_uncertain(correction, uncertain):
    found = budget_of(np.array([correction]), np.zeros(1), variances(100, 200, 200, 0))
    assert found.uncertain is uncertain


@pytest.mark.parametrize(
    ("source", "words"),
    list(zip(SOURCES, ("measure more poses", "--effects auto", "the tool", "the part"), strict=True)),
)
def test_the_remedy_is_for_the_largest_share(source, words):
    found = budget_of(np.ones(1), np.ones(1), variances(*(200 if name == source else 100 for name in SOURCES)))
    assert words in found.remedy


def test_targets_that_are_not_known_do_not_count():
    some = uncertain(np.array([[100, 200, 200, 0], [np.nan] * 4]) ** 2 * 1e-12)
    assert budget_of(np.ones(1), np.ones(1), some).uncertainty == pytest.approx(3e-4)
    assert budget_of(np.zeros(0), np.zeros(0), uncertain(np.full((2, 4), np.nan))).after == 0.0


@pytest.mark.parametrize("model_error", ["A", "B"])
def test_uncertainty_of_targets_is_the_expected_error(model_error):
    """The uncertainty of targets is what is expected after the correction."""
    found = budget_of(np.full(2, 1e-3), np.full(2, 4e-5), variances(100, 200, 0, 50))
    budget = found.of_targets(model_error)
    assert budget.combined == pytest.approx(found.after)
    assert [(one.evaluation, round(one.deviation * 1e6)) for one in budget.contributions] == [
        ("A", 100), (model_error, 200), ("B", 50), ("B", 40),
    ]  # fmt: skip
