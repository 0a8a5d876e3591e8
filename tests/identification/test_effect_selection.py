"""What geometry cannot explain enters where the data prove it, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from taskcal.identification.calibration_file import load_calibration
from taskcal.identification.effect_selection import explain
from taskcal.identification.identify import identify
from taskcal.measurement.virtual_cell import draw_defects, simulate
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import SOFT, Backlash, Compliance, Coupling, EncoderGain, Harmonics, Overshoot, candidates
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.file import robot_from
from tests.laws.fields import field_through

CHEAP = (EncoderGain(), Harmonics(orders=(1,), tolerance=1e-4), Compliance(), Coupling())
"""Few parameters, for tests that are not about those of many."""


def poses(robot, rng, count):
    limits = np.clip(robot.limits, -0.9, 0.9)
    return rng.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))


@pytest.fixture(scope="module")
def robot():
    return load_robot("abb-irb120")


def errors_of(fits, truth, unseen):
    return np.array([np.linalg.norm(fit.predict(unseen) - truth.points(unseen), axis=2).mean() for fit in fits])


@pytest.mark.long
def test_where_there_is_no_effect_the_prediction_is_that_of_geometry(robot):
    model, ratios, picked = ErrorModel(robot), [], 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        campaign, truth = simulate(model, poses(robot, rng, 60), rng=rng)
        found = explain(model, campaign)
        one, plain = errors_of((found.calibration, identify(model, campaign)), truth, poses(robot, rng, 100))
        ratios.append(one / plain)
        picked += bool(found.effects)
    assert np.median(ratios) < 1.02
    assert max(ratios) < 1.1
    assert picked <= 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "true",
    [
        Harmonics(orders=(1,)),
        Compliance(),
        *(pytest.param(effect, marks=pytest.mark.long) for effect in (EncoderGain(), Backlash(), Overshoot())),
    ],
    ids=lambda e: type(e).__name__,
)
def test_an_effect_is_found_among_all_and_predicts_nearly_as_if_it_had_been_told(robot, true):
    """What looking for all others costs is a few micrometres where nothing but the tracker errs besides."""
    model, errors = ErrorModel(robot), []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        q, unseen = poses(robot, rng, 80), poses(robot, rng, 100)
        conditions = conditions_in_order(robot, q)
        campaign, truth = simulate(model + true, q, rng=rng, conditions=conditions)
        found = explain(model, campaign)
        fits = found.calibration, identify(model + true, campaign), identify(model, campaign)
        errors.append(errors_of(fits, truth, unseen))
    error, best, without = np.mean(errors, axis=0)
    assert error < best + 5e-6
    assert error < 0.8 * without


@pytest.mark.slow
@pytest.mark.parametrize(
    "true",
    [
        pytest.param((), id="none", marks=pytest.mark.long),
        pytest.param((Harmonics(orders=(1, 2, 9)), EncoderGain()), id="two"),
    ],
)
def test_stated_regions_hold_as_often_as_they_say(robot, true):
    """Over virtual robots, of the true points at new poses."""
    model, inside = ErrorModel(robot), []
    truly = model
    for effect in true:
        truly = truly + effect
    for seed in range(5):
        rng = np.random.default_rng(seed)
        campaign, truth = simulate(truly, poses(robot, rng, 60), rng=rng)
        found, unseen = explain(model, campaign).calibration, poses(robot, rng, 200)
        error = (found.predict(unseen) - truth.points(unseen))[:, 0]
        C = found.predict_covariance(unseen)[:, 0]
        square = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
        inside.append(np.mean(square < chdtri(3, 0.05)))
    assert 0.92 < np.mean(inside) <= 1.0


@pytest.mark.slow
def test_a_coupled_wrist_with_a_long_tool_is_found():
    description = load_robot("abb-irb120").description
    long = robot_from({**description, "tool": [{"tx_mm": 200.0}, {"ty_mm": 80.0}, {"tz_mm": 150.0}]})
    model = ErrorModel(long)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        x = draw_defects(model + Coupling(), rng)
        x[-3:] = 1e-3, -5e-4, 1e-3
        campaign, _ = simulate(model + Coupling(), poses(long, rng, 60), rng=rng, x=x)
        found = explain(model, campaign, candidates=CHEAP, folds=3)
        assert found.effects == (Coupling(),)
        named = dict(zip(found.calibration.names, found.calibration.estimate, strict=True))
        assert named["J5.by_J4"] == pytest.approx(1e-3, abs=3e-4)


def test_candidates_suit_what_is_known_of_a_robot():
    def suited(robot):
        return {type(effect).__name__ for effect in candidates(robot, Conditions())}

    everywhere = {"EncoderGain", "Harmonics", "Compliance"}
    assert everywhere <= suited(load_robot("ur5"))
    assert not {"Coupling", "Spring", "MotorHarmonics"} & suited(load_robot("ur5"))  # its wrist's axes do not meet
    for name in ("abb-irb120", "fanuc-r2000ic-165f", "abb-irb6660-205-1.9", "barrett-wam"):
        assert "Coupling" in suited(load_robot(name))
    description = load_robot("ur5").description
    spring = {"rate_n_mm": 9.0, "free_length_mm": 100.0, "crank_mm": 90.0, "anchor_mm": 200.0, "aligned_deg": 0.0}
    joints = [{**description["joint"][0], "gear_ratio": 100.0}, *description["joint"][1:]]
    assert {"Spring", "MotorHarmonics"} <= suited(
        robot_from({**description, "joint": joints, "spring": {"joint": "J2", **spring}})
    )


def test_of_two_effects_with_the_same_parameters_the_likelier_takes_part(robot):
    model, rng = ErrorModel(robot), np.random.default_rng(2)
    campaign, _ = simulate(model + SOFT, poses(robot, rng, 60), rng=rng)
    one = Harmonics(orders=(1,))
    found = explain(model + one, campaign, candidates=(*CHEAP, SOFT), folds=3)
    names = found.calibration.model.names
    assert len(names) == len(set(names))
    assert not {Compliance(), SOFT} <= set(found.calibration.model.effects)
    assert found.calibration.model.effects[0] == one


def test_the_table_says_what_all_effects_and_each_of_them_are_worth(robot):
    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + Harmonics(orders=(1,)), poses(robot, rng, 80), rng=rng)
    found = explain(model, campaign, candidates=CHEAP, folds=4)
    first, whole = found.steps
    assert (first.name, first.accepted, first.log_evidence) == ("geometry", True, None)
    assert whole.accepted
    assert whole.log_evidence > 10
    assert whole.worth == pytest.approx(first.cross_validated - whole.cross_validated)
    assert {stage.name for stage in found.worths} == {effect.name for effect in CHEAP}
    assert [stage.accepted for stage in found.worths] == [True, False, False, False]
    assert found.worths[0].name == "gear harmonics of order 1"
    assert found.worths[0].worth == pytest.approx(found.worths[0].cross_validated - whole.cross_validated)
    assert [effect.name for effect in found.effects] == ["gear harmonics of order 1"]
    assert found.calibration.model.effects == CHEAP
    assert 5e-6 < found.tracker < 5e-5


def test_effects_and_field_survive_saving(robot, tmp_path):
    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + EncoderGain() + Harmonics(), poses(robot, rng, 60), rng=rng)
    fitted = identify(model + EncoderGain(), campaign)
    learned = field_through(campaign.q, fitted.residuals_on(campaign, frame="base")[:, 0])
    made = replace(fitted, field=learned)
    assert np.abs(made.predict(campaign.q) - fitted.predict(campaign.q)).max() > 1e-5
    made.save(tmp_path / "cal.json")
    loaded = load_calibration(tmp_path / "cal.json")
    unseen = poses(robot, rng, 30)
    assert loaded.model.effects == made.model.effects
    np.testing.assert_array_equal(loaded.predict(unseen), made.predict(unseen))
    np.testing.assert_array_equal(loaded.predict_covariance(unseen), made.predict_covariance(unseen))


def test_defects_are_drawn_for_effects_too(robot):
    model = ErrorModel(robot) + Harmonics()
    x = draw_defects(model, np.random.default_rng(0))
    assert np.all(x[len(ErrorModel(robot)) :] != 0.0)
