"""A model with effects goes the whole road: what is stated of it holds, and it is chosen from like any other."""

import numpy as np
import pytest

from taskcal.analysis.identifiability import identifiability
from taskcal.analysis.sensitivity import sensitivity
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.planning.selection import select
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task

TASK = reference_task(np.radians(20.0))


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return ErrorModel(load_robot("abb-irb6660-205-1.9")) + Compliance() + Harmonics() + EncoderGain()


def test_stated_uncertainty_holds_with_effects(model):
    poses = reach_task(model, TASK, 260, seed=1).q
    rng, distances, lengths = np.random.default_rng(0), [], []
    order = rng.permutation(len(poses))
    for seed in range(6):
        campaign, truth = simulate(model, poses[order[:60]], rng=np.random.default_rng(seed))
        fitted, new = identify(model, campaign, model_error=0.0, prior_scale=1.0), poses[order[60:]]
        error = (truth.points(new) - fitted.predict(new))[:, 0]
        covariance = fitted.predict_covariance(new)[:, 0]
        distances.append(np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0]).mean())
        lengths.append(np.linalg.norm(error, axis=1).mean())
        assert validate(fitted, campaign).mean < 5e-5
    assert 0.5 < np.mean(distances) / 3.0 < 1.6
    assert np.mean(lengths) < 2.5e-5


def test_effects_compete_in_a_selection(model):
    found = select(model, TASK, count=60, hyperparameters=Hyperparameters.of_deviations((2e-5,)))
    assert len(found.ladder) == len(model) + 1
    assert {*found.kept, *found.dropped} == set(model.names)
    assert {*found.kept} & {*model.effect_names}
    assert found.references["published"][0] == 33
    assert found.ladder[0].expected > select(model, TASK, count=60, model_error=0.0).ladder[0].expected


def test_analysis_has_a_column_for_every_parameter_of_effects(model):
    q = reach_task(model, TASK, 40, seed=1).q
    S, found = sensitivity(model, q), identifiability(model, q)
    assert S.matrix.shape == (len(q), 3, len(model))
    assert found.rank == len(found.kept) < len(model)
    assert {*found.kept, *found.zero, *found.dependent} == set(model.names)
    for name, terms in found.dependent.items():
        combined = sum(c * S.matrix[..., model.names.index(other)] for other, c in terms.items())
        column = S.matrix[..., model.names.index(name)]
        np.testing.assert_allclose(combined, column, atol=1e-6 * np.abs(column).max())
