"""The calibration of a robot of the same make helps a fit of few rows; one of another kind changes nothing."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.effects import explain
from taskcal.identification.group_model import geometry_alone
from taskcal.identification.identify import identify
from taskcal.identification.layout import layout_of, prior_of
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import problem_of
from taskcal.identification.sibling import SPECIMEN_WIDTH, expecting
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

MODEL = ErrorModel(load_robot("abb-irb120"))
LIMITS = np.clip(MODEL.robot.limits, -1.5, 1.5)
NEW = 60


def robot(seed: int, rows: int, *, size: float = 0.5, white: float = 1e-4, model: ErrorModel = MODEL):
    """Rows of a robot whose defects are so many tolerances large, and others of it."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(LIMITS[:, 0], LIMITS[:, 1], (rows + NEW, 6))
    x = size * rng.normal(size=len(model)) * model.tolerances
    campaign, _ = simulate(model, q, rng=rng, x=x, model_error=white)
    return campaign.take(np.arange(rows)), campaign.take(np.arange(rows, rows + NEW))


def judged(calibration: Calibration, new) -> tuple[float, float]:
    """Mean error, metres, and share of the points inside their regions."""
    error = calibration.residuals_on(new)[:, 0]
    C = calibration.predict_covariance(new.q)[:, 0] + new.covariances()[:, 0]
    square = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
    return float(np.linalg.norm(error, axis=1).mean()), float((square < chdtri(3, 0.05)).mean())


@pytest.fixture(scope="module")
def sibling() -> Calibration:
    return identify(MODEL, robot(1000, 60)[0])


@pytest.mark.parametrize(("rows", "robots"), [(15, 25), pytest.param(15, 200, marks=pytest.mark.long)])
def test_regions_of_few_rows_hold_what_they_say_with_and_without_a_sibling(sibling, rows, robots):
    """Of robots with a model error, which 15 rows leave uncertain; with a sibling the error is no larger."""
    found = []
    for seed in range(robots):
        campaign, new = robot(seed, rows)
        found.append([judged(identify(MODEL, campaign, like=like), new) for like in (None, sibling)])
    error, inside = np.moveaxis(np.array(found), 2, 0)
    assert np.all(np.abs(inside.mean(axis=0) - 0.95) < 0.03), inside.mean(axis=0)
    assert error[:, 1].mean() < 1.005 * error[:, 0].mean()


def test_a_robot_of_another_kind_changes_nothing(sibling):
    """Its defects are ten times as large, its model error is too: what is found is the same to the bit, and a remark says why."""
    other = identify(MODEL, robot(1001, 60, size=5.0, white=1e-3)[0])
    campaign, _ = robot(3, 15)
    without, helped = identify(MODEL, campaign), identify(MODEL, campaign, like=other)
    np.testing.assert_array_equal(helped.z, without.z)
    np.testing.assert_array_equal(helped.z_spread, without.z_spread)
    assert helped.model_error == without.model_error
    assert "were not taken" in helped.remarks[-1]
    told = helped.provenance.options["like"]
    assert not told["taken"]
    assert told["log_evidence_gain"] < -3.0
    taken = identify(MODEL, campaign, like=sibling).provenance.options["like"]
    assert taken["taken"]
    assert taken["campaign_digest"] == sibling.provenance.campaign_digest


@pytest.mark.parametrize("known", [0.0, 0.01, 1.0])
def test_sizes_of_a_sibling_count_as_a_measurement_of_these(sibling, known):
    """What was expected, times what its rows told of its own size, on a grid: nothing where they learnt nothing of it."""
    p, scale = len(MODEL), 3.0
    spread = np.zeros_like(sibling.z_spread)
    spread[range(p), range(p)] = (
        np.sqrt(1.0 - known) * scale * MODEL.tolerances
    )  # posterior deviations, the prior's at most
    like = replace(sibling, prior_scale=scale, z_spread=spread)
    campaign, _ = robot(7, 15)
    layout = layout_of(MODEL, np.arange(p), register(MODEL, campaign), campaign, fixed=False)
    one = geometry_alone(problem_of(layout, campaign, None), prior_of(layout, "tolerances"), FitOptions())
    one = replace(one, groups=replace(one.groups, location=np.array([0.5]), spread=np.array([[4.0]])))
    told = expecting(one, like).groups
    theta = np.linspace(-20.0, 20.0, 20001)
    variance = SPECIMEN_WIDTH**2 + (1.0 / (0.5 * p * known**2) if known else np.inf)
    density = np.exp(-((theta - 0.5) ** 2) / 8.0 - (theta - 2.0 * np.log(scale)) ** 2 / (2.0 * variance))
    mean = np.average(theta, weights=density)
    assert told.location[0] == pytest.approx(mean, abs=1e-4)
    assert told.spread[0, 0] == pytest.approx(np.average((theta - mean) ** 2, weights=density), rel=1e-4)


@pytest.mark.long
def test_effects_of_few_rows_are_no_worse_with_any_sibling():
    """With all effects: over ten robots that have gains, with a sibling and with one whose gains are twenty times as large."""
    gain = EncoderGain()
    true = MODEL + gain
    likes = [
        explain(MODEL, robot(seed, 60, size=size, model=true)[0], candidates=(gain,)).calibration
        for seed, size in ((1000, 0.5), (1001, 10.0))
    ]
    found = []
    for seed in range(10):
        campaign, new = robot(seed, 15, model=true)
        fits = [explain(MODEL, campaign, candidates=(gain,), like=like).calibration for like in (None, *likes)]
        found.append([judged(fit, new) for fit in fits])
    error, inside = np.moveaxis(np.array(found), 2, 0)
    assert np.all(error.mean(axis=0)[1:] < 1.02 * error.mean(axis=0)[0]), error.mean(axis=0)
    assert np.all(inside.mean(axis=0) > 0.9), inside.mean(axis=0)


def test_a_calibration_that_says_nothing_of_this_robot_is_refused(sibling, tmp_path):
    """The message names what differs; a file is named."""
    campaign, _ = robot(4, 15)
    wam = ErrorModel(load_robot("barrett-wam"))
    rng = np.random.default_rng(0)
    measured, _ = simulate(wam, rng.uniform(-1.0, 1.0, (15, 7)), rng=rng)
    with pytest.raises(TaskcalError, match=r"their joints differ \(7 joints and 6\)"):
        identify(wam, measured, like=sibling)
    with pytest.raises(TaskcalError, match="estimates none of this model's parameters"):
        identify(MODEL, campaign, like=identify(MODEL, campaign, keep=[]))
    with pytest.raises(ValueError, match="a sibling tells the size of the prior"):
        identify(MODEL, campaign, prior=None, like=sibling)
    with_effects = replace(sibling, group_deviations=MODEL.tolerances)
    with_effects.save(tmp_path / "auto.json")
    with pytest.raises(
        TaskcalError, match=r"auto\.json .* not the sizes of geometry alone: identify with --effects auto"
    ):
        identify(MODEL, campaign, like=load_calibration(tmp_path / "auto.json"))


def test_what_came_of_a_sibling_is_in_the_file(sibling, tmp_path):
    sibling.save(tmp_path / "other.json")
    found = identify(MODEL, robot(5, 15)[0], like=load_calibration(tmp_path / "other.json"))
    found.save(tmp_path / "cal.json")
    told = json.loads((tmp_path / "cal.json").read_text())["provenance"]["options"]["like"]
    assert told["file"] == "other.json"
    assert told["taken"]
    assert load_calibration(tmp_path / "cal.json").summary()["like"] == told
    assert "expected as those of other.json" in found.remarks[-1]


def test_a_sibling_of_another_kind_of_fit_is_said_not_to_be_used(sibling):
    """Effects that are not there are not taken, so that a calibration with sizes of effects tells nothing of the geometry's."""
    effects = replace(sibling, group_deviations=MODEL.tolerances)
    found = explain(MODEL, robot(6, 15)[0], candidates=(EncoderGain(),), folds=3, like=effects).calibration
    told = found.provenance.options["like"]
    assert "taken" in told
    assert ("was not used" in found.remarks[-1]) == (not found.model.effects)
