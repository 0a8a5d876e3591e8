"""Effects of how a pose was reached: found where they are, and predicted under the same conditions."""

import numpy as np
import pytest

from taskcal.identification.calibration import load_calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Backlash, Effect, EncoderGain, Overshoot, Settling
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.virtual.cell import draw_defects, simulate
from tests.laws.campaigns import with_conditions
from tests.laws.robots import industrial, industrial_positions


def measured(seed: int, kind: type[Effect] = Backlash, b: float = 3e-4, count: int = 120):
    """A robot with backlash, or moves that do not settle, of the first three joints, measured in random order."""
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng))) + kind(joints=("J1", "J2", "J3"))
    x = draw_defects(model, rng)
    x[-3:] = b * rng.choice([-1.0, 1.0], 3)
    centres = np.array([[0.1, 0.0, 0.05], [-0.05, 0.1, 0.0], [0.0, -0.1, 0.1]])
    targets = {f"smr{i + 1}": centre for i, centre in enumerate(centres)}
    campaign, truth = simulate(model, industrial_positions(rng, count), rng=rng, x=x, targets=targets)
    return model, campaign, truth


@pytest.mark.parametrize("kind", [Backlash, Settling, Overshoot])
def test_identify_recovers_lost_motion_within_standard_errors(kind):
    """Identified lost motion is within its standard errors of the true value."""
    scaled = []
    for seed in range(8):
        model, campaign, truth = measured(seed, kind)
        found = identify(model, campaign)
        scaled.append((found.estimate[-3:] - truth.x[-3:]) / found.standard_errors[-3:])
        assert found.standard_errors[-3:].max() < 5e-5
    assert (np.abs(scaled) < 3.0).sum() >= 23  # of 24
    assert 0.75 < np.sqrt(np.mean(np.square(scaled))) < 1.25


def test_seen_from_the_other_side_the_backlash_changes_its_sign():
    model, campaign, _ = measured(0)
    there = identify(model, campaign)
    back = identify(model, with_conditions(campaign, approach=-campaign.approach))
    np.testing.assert_allclose(back.estimate[-3:], -there.estimate[-3:], atol=1e-9)
    np.testing.assert_allclose(back.estimate[:-3], there.estimate[:-3], atol=1e-9)


def test_evidence_tells_a_rest_of_the_move_from_lost_motion():
    for kind, other in ((Backlash, Settling), (Settling, Backlash), (Overshoot, Settling), (Settling, Overshoot)):
        model, campaign, _ = measured(3, kind)
        plain = ErrorModel(model.robot)
        assert identify(plain + kind(), campaign).log_evidence > identify(plain + other(), campaign).log_evidence + 10.0


def test_ways_compete_where_the_campaign_has_them():
    model, campaign, _ = measured(4)
    plain = ErrorModel(model.robot)
    candidates = (EncoderGain(), Backlash(), Settling(), Overshoot())
    known = explain(plain, campaign, candidates=candidates, folds=3)
    assert known.effects == (Backlash(),)
    unknown = explain(
        plain,
        with_conditions(campaign, approach=None, move=None),
        candidates=candidates,
        folds=3,
    )
    assert {stage.name for stage in known.worths} == {effect.name for effect in candidates}
    assert [stage.name for stage in unknown.stages] == ["geometry", "all effects", "encoder gain"]


def test_backlash_model_without_conditions_equals_geometry():
    """Without approach directions a model with lost motion predicts the same as the model without it."""
    model, campaign, _ = measured(0)
    blind = identify(model, with_conditions(campaign, approach=None))
    plain = identify(ErrorModel(model.robot), campaign)
    np.testing.assert_allclose(blind.estimate[:-3], plain.estimate, atol=1e-9)
    np.testing.assert_array_equal(blind.estimate[-3:], 0.0)


def test_holdout_predicts_rows_for_their_approach_direction(tmp_path):
    """Held-out rows are predicted for the approach direction with which they were measured."""
    model, campaign, _ = measured(1)
    fitted, held = campaign.split(0.4, np.random.default_rng(0))
    found = identify(model, fitted)
    assert validate(found, held).mean < 0.3 * validate(identify(ErrorModel(model.robot), fitted), held).mean
    found.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    np.testing.assert_array_equal(again.predict(held.q, held.conditions), found.predict(held.q, held.conditions))


def test_uncertainty_includes_approach_only_if_unknown():
    """Over both sides of every joint, errors of the middle spread as the covariance without conditions says."""
    model, _, truth = measured(2)
    rng = np.random.default_rng(5)
    found = identify(model, measured(2)[1])
    q = industrial_positions(rng, 400)
    sides = Conditions(approach=rng.choice([-1.0, 1.0], q.shape))
    error = found.predict(q) - truth.points(q, sides)
    unknown, known = found.predict_covariance(q), found.predict_covariance(q, sides)
    square = np.einsum("nti,ntij,ntj->nt", error, np.linalg.inv(unknown), error)
    assert square.mean() == pytest.approx(3.0, rel=0.15)
    assert np.trace(known, axis1=2, axis2=3).mean() < 0.2 * np.trace(unknown, axis1=2, axis2=3).mean()
