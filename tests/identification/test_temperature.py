"""A robot that grows with the temperature, or by warming up: found, predicted at other temperatures, and refused without any."""

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import EncoderGain, Thermal, WarmUp
from taskcal.robot.effects import candidates as default_candidates
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.virtual.cell import Truth, draw_defects, simulate
from tests.laws.campaigns import with_conditions
from tests.laws.robots import industrial, industrial_positions

EFFECT = Thermal(reference=26.0)
TARGETS = {"smr1": [0.1, 0.0, 0.05], "smr2": [-0.05, 0.1, 0.0], "smr3": [0.0, -0.1, 0.1]}


def measured(seed: int, count: int = 100, coldest: float = 20.0) -> tuple[ErrorModel, Campaign, Truth]:
    """A robot drawn with its expansion and its drift, measured while it warms up by 12 K."""
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng))) + EFFECT
    x = draw_defects(model, rng)
    conditions = Conditions(temperature=coldest + 12.0 * (1.0 - np.exp(-3.0 * np.linspace(0.0, 1.0, count))))
    targets = {name: np.array(centre) for name, centre in TARGETS.items()}
    campaign, truth = simulate(
        model, industrial_positions(rng, count), rng=rng, x=x, targets=targets, conditions=conditions
    )
    return model, campaign, truth


@pytest.fixture(scope="module")
def found() -> tuple[Calibration, Campaign, Truth]:
    model, campaign, truth = measured(1)
    return identify(model, campaign), campaign, truth


def test_expansion_and_drift_are_within_standard_errors():
    """Identified expansion and drift are within their standard errors of the true values."""
    scaled: list[np.ndarray] = []
    for seed in range(8):
        model, campaign, truth = measured(seed)
        fit = identify(model, campaign)
        scaled.append((fit.estimate[-7:] - truth.x[-7:]) / fit.standard_errors[-7:])
        expansion = model.names.index("thermal.expansion")
        assert fit.standard_errors[expansion] < 0.1 * EFFECT.tolerance
    assert np.abs(scaled).max() < 4.0
    assert (np.abs(scaled) < 3.0).sum() >= 55
    assert 0.7 < np.sqrt(np.mean(np.square(scaled))) < 1.3


def test_other_temperatures_are_validated_as_such(found):
    """Thirty degrees beyond the reference, where the robot without temperatures is half a millimetre off."""
    calibration, _, truth = found
    q = industrial_positions(np.random.default_rng(7), 50)
    hot = Conditions(temperature=np.full(len(q), 56.0))
    later, _ = simulate(
        truth.model,
        q,
        rng=np.random.default_rng(8),
        x=truth.x,
        targets={name: np.array(centre) for name, centre in TARGETS.items()},
        conditions=hot,
    )
    assert later.temperature is not None
    told, blind = (
        validate(calibration, later),
        validate(calibration, with_conditions(later, temperature=None)),
    )
    assert told.mean < 0.15 * blind.mean
    assert blind.mean > 2e-4
    error = later.points - calibration.predict(q, hot)
    covariance = calibration.predict_covariance(q, hot) + later.covariances()
    square = np.einsum("nti,ntij,ntj->nt", error, np.linalg.inv(covariance), error)
    assert square.mean() < 3.0 * 2.0


def test_saved_calibration_predicts_equally_at_any_temperature(found, tmp_path):
    """A saved calibration gives the same predictions at every temperature."""
    calibration, campaign, _ = found
    calibration.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    assert again.model.effects == (EFFECT,)
    np.testing.assert_array_equal(
        again.predict(campaign.q, campaign.conditions), calibration.predict(campaign.q, campaign.conditions)
    )
    at_reference = Conditions(temperature=np.full(len(campaign), EFFECT.reference))
    np.testing.assert_array_equal(again.predict(campaign.q, at_reference), again.predict(campaign.q))


def test_the_choice_of_the_reference_changes_hardly_a_prediction():
    """By a tenth of its uncertainty at most: lengths and base take up what expansion and drift are worth between both."""
    model, campaign, _ = measured(2)
    here = identify(model, campaign)
    there = identify(ErrorModel(model.robot) + Thermal(reference=22.0), campaign)
    moved = there.predict(campaign.q, campaign.conditions) - here.predict(campaign.q, campaign.conditions)
    uncertainty = np.sqrt(np.trace(here.predict_covariance(campaign.q, campaign.conditions), axis1=2, axis2=3))
    assert (np.linalg.norm(moved, axis=2) < 0.1 * uncertainty).all()
    expansion = model.names.index("thermal.expansion")
    assert abs(there.estimate[expansion] - here.estimate[expansion]) < 0.1 * here.standard_errors[expansion]
    assert np.abs(there.predict(campaign.q) - here.predict(campaign.q)).max() > 1e-4


def test_without_temperatures_there_is_no_thermal_fit():
    model, campaign, _ = measured(0, count=20)
    with pytest.raises(CampaignError, match="virtual cell has no temperatures, which the effect 'thermal' needs"):
        identify(model, with_conditions(campaign, temperature=None))
    gaps = campaign.temperature.copy()
    gaps[3:5] = np.nan
    with pytest.raises(CampaignError, match=r"row 3 \(id 3\) has no temperature.*2 of 20 rows"):
        identify(model, with_conditions(campaign, temperature=gaps))


def test_temperatures_compete_where_they_are_known_and_vary():
    model, campaign, _ = measured(3, count=60)
    plain = ErrorModel(model.robot)
    candidates = (EncoderGain(), EFFECT)
    assert explain(plain, campaign, candidates=candidates, folds=3).effects == (EFFECT,)
    for temperature in (None, np.full(60, 23.0), np.where(np.arange(60) == 5, np.nan, campaign.temperature)):
        quiet = explain(
            plain,
            with_conditions(campaign, temperature=temperature),
            candidates=candidates,
            folds=3,
        )
        assert [stage.name for stage in quiet.stages] == ["geometry", "all effects", "encoder gain"]


def warming(seed: int, count: int = 100) -> tuple[ErrorModel, Campaign, Truth]:
    """A robot drawn with its expansion, measured in its first two hours at work."""
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng))) + WarmUp(time_constant=2400.0, reference=7200.0)
    x = draw_defects(model, rng)
    targets = {name: np.array(centre) for name, centre in TARGETS.items()}
    conditions = Conditions(time=np.linspace(0.0, 7200.0, count))
    campaign, truth = simulate(
        model, industrial_positions(rng, count), rng=rng, x=x, targets=targets, conditions=conditions
    )
    return model, campaign, truth


def test_a_robot_that_warms_up_is_found_from_the_time_at_work(tmp_path):
    scaled: list[np.ndarray] = []
    for seed in range(5):
        model, campaign, truth = warming(seed)
        fit = identify(model, campaign)
        scaled.append((fit.estimate[-7:] - truth.x[-7:]) / fit.standard_errors[-7:])
    assert np.abs(scaled).max() < 4.0
    assert (np.abs(scaled) < 3.0).sum() >= 34
    fit.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    cold = Conditions(time=np.zeros(len(campaign)))
    np.testing.assert_array_equal(again.predict(campaign.q, cold), fit.predict(campaign.q, cold))
    assert np.linalg.norm(fit.predict(campaign.q, cold) - fit.predict(campaign.q), axis=2).mean() > 5e-5


def test_warming_up_is_proven_with_one_of_its_time_constants():
    model, campaign, _ = warming(2, count=60)
    candidates = (EncoderGain(), *(WarmUp(time_constant=c, reference=7200.0) for c in (1200.0, 10800.0)))
    found = explain(ErrorModel(model.robot), campaign, candidates=candidates, folds=3)
    assert [type(effect) for effect in found.effects] == [WarmUp]
    assert found.worths[0].name.startswith("warming up in ")
    with pytest.raises(
        CampaignError, match="virtual cell has no times, which the effect 'warmup' needs; add a column time_s"
    ):
        identify(model, with_conditions(campaign, time=None))


def competing(model: ErrorModel, campaign) -> set[str]:
    """Which kinds of effects compete by default."""
    return {type(effect).__name__ for effect in default_candidates(model.robot, campaign.conditions)}


def test_expansion_is_candidate_only_if_temperatures_differ():
    """Expansion is a default candidate only if the temperatures of the campaign differ."""
    model, campaign, _ = measured(3, count=40)
    plain = ErrorModel(model.robot)
    kinds = competing(plain, campaign)
    assert "Thermal" in kinds
    for temperature in (None, np.full(40, 23.0)):
        assert competing(plain, with_conditions(campaign, temperature=temperature)) == kinds - {"Thermal"}
