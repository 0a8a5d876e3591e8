"""The search for hyperparameters comes to the same end from a sample of the rows, on rows that are kept and on streamed ones."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification import hyperparameters as hyperparameter_search
from taskcal.identification import identify as gross_errors
from taskcal.identification import problem
from taskcal.identification.identify import identify
from tests.identification.arms import arm, defects
from tests.laws.campaigns import measure
from tests.laws.robots import industrial_positions

KINDS = {"points": {"targets": 2, "lost": 0.2}, "poses": {"pose": True}}


def measured(kind: str, rows: int, seed: int = 0):
    rng, model = arm(seed)
    campaign, _ = measure(rng, model, industrial_positions(rng, rows), defects(rng, model), sigma=1e-4, **KINDS[kind])
    return model, campaign


def assert_alike(found, expected) -> None:
    """Both within what the search itself ends at: a thousandth of the variances."""
    deviation = np.sqrt(np.diag(expected.z_covariance))
    np.testing.assert_allclose(found.z / deviation, expected.z / deviation, atol=5e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(found.z_covariance)), deviation, rtol=5e-3)
    np.testing.assert_allclose(found.model_error, expected.model_error, rtol=2e-3)
    np.testing.assert_allclose(found.studentised, expected.studentised, rtol=2e-2)
    assert found.log_evidence == pytest.approx(expected.log_evidence, abs=1e-2)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_that_are_kept_and_streamed_ones_end_alike(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    model, campaign = measured(kind, 60)
    kept = identify(model, campaign)
    monkeypatch.setattr(problem, "MAX_CACHED_NUMBERS", 0)
    streamed = identify(model, campaign)
    assert streamed.rounds > 1
    assert_alike(kept, streamed)


@pytest.mark.parametrize("kind", KINDS)
def test_many_rows_begin_from_some_of_them_and_end_as_all_do(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    model, campaign = measured(kind, 400)
    expected = identify(model, campaign)
    begun: list[int] = []
    whole = hyperparameter_search.fit_with_hyperparameters

    def noted(part, *others):
        begun.append(len(part.q))
        return whole(part, *others)

    monkeypatch.setattr(hyperparameter_search, "SAMPLED_FROM", 300)
    monkeypatch.setattr(hyperparameter_search, "SAMPLE", 100)
    monkeypatch.setattr(hyperparameter_search, "fit_with_hyperparameters", noted)
    found = identify(model, campaign)
    assert begun == [100]
    assert found.rounds <= expected.rounds
    assert_alike(found, expected)


def test_sampling_of_large_campaign_rejects_same_gross_errors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Judging discrepant rows of a large campaign against a sample of its rows rejects the same rows."""
    model, campaign = measured("points", 400)
    points = campaign.points.copy()
    points[[5, 90, 333], 0] += [0.0, 0.4, 0.0]
    spoilt = replace(campaign, points=points)
    expected = identify(model, spoilt)
    monkeypatch.setattr(gross_errors, "SAMPLED_FROM", 300)
    monkeypatch.setattr(gross_errors, "SAMPLE", 100)
    found = identify(model, spoilt)
    assert [row.row for row in found.left_out] == [row.row for row in expected.left_out]
    assert {row.row for row in found.left_out} == set(np.flatnonzero(spoilt.valid[:, 0])) & {5, 90, 333}
    np.testing.assert_allclose(found.z, expected.z, rtol=1e-9, atol=1e-12)
