"""Rows that a fit does not see: which they are, and what is kept of them."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.identification.calibration import load_calibration
from taskcal.identification.holdout import folds_of, hold_out, rows_held_out, with_held_out
from taskcal.identification.identify import fit_nominal, identify
from taskcal.identification.options import FitOptions, Holdout
from taskcal.identification.validation import validate
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure
from tests.laws.robots import generators, industrial, industrial_positions

OPTIONS = FitOptions(model_error=2e-5, prior_scale=1.0)


def unmeasured(q):
    return Campaign(
        ids=tuple(map(str, range(len(q)))), q=q, targets=("tool",), points=np.zeros((len(q), 1, 3))
    )  # fmt: skip


def case(kind=None, rows=40, seed=0):
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng)))
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, industrial_positions(rng, rows), x, sigma=5e-5, **(kind or {}))
    fit = partial(identify, model, options=OPTIONS)
    return model, campaign, fit, lambda part: fit_nominal(model, part, OPTIONS)


@given(generators, st.sampled_from(["neighbours", "blocks", "rows"]), st.floats(0.05, 0.95))
def test_holdout_share_is_approximate_and_set_by_seed(rng, by, share):
    """About the requested share is held out, and the seed alone determines the rows."""
    campaign = unmeasured(rng.uniform(-2, 2, (60, 6)))
    chosen = [rows_held_out(Holdout(share=share, by=by, seed=seed), campaign) for seed in (1, 1, 2, 3, 4)]
    np.testing.assert_array_equal(*chosen[:2])
    assert abs(len(chosen[0]) - share * 60) <= 2.5
    assert by == "neighbours" or 0 < len(chosen[0]) < 60
    if 0.2 < share < 0.8:
        assert any(not np.array_equal(chosen[0], other) for other in chosen[2:])


@given(generators, st.sampled_from(["neighbours", "blocks", "rows"]), st.integers(2, 12))
def test_folds_hold_every_row_once_and_about_as_many_rows(rng, by, folds):
    campaign = unmeasured(rng.uniform(-2, 2, (60, 6)))
    parts = folds_of(Holdout(folds=folds, by=by), campaign)
    assert len(parts) == folds
    assert sorted(np.concatenate(parts)) == list(range(60))
    assert np.ptp([len(part) for part in parts]) <= 4


def test_neighbours_and_blocks_are_held_out_whole():
    q = np.linspace(0, 2, 60)[:, None] * np.ones(6)
    campaign = unmeasured(q)
    for by in ("neighbours", "blocks"):
        out = rows_held_out(Holdout(share=0.3, by=by), campaign)
        np.testing.assert_array_equal(out // 3, np.repeat(np.unique(out // 3), 3))
    # a trajectory in the order of the rows: nothing else is near
    assert len(rows_held_out(Holdout(share=0.3, by="rows"), campaign)) == 18


@pytest.mark.parametrize("kind", [{"targets": 3, "lost": 0.2}, {"pose": True, "rotation_sigma": 1e-4}])
def test_holdout_share_is_predicted_by_returned_calibration(kind):
    """The held-out share is predicted by the calibration that is returned."""
    _, campaign, fit, nominal = case(kind)
    calibration = hold_out(fit, campaign, Holdout(share=0.3), nominal)
    kept = calibration.held_out
    assert kept is not None
    rest = np.setdiff1d(np.arange(len(campaign)), kept.rows)
    assert list(calibration.ids) == [campaign.ids[i] for i in rest]
    np.testing.assert_array_equal(calibration.q, campaign.q[rest])
    unseen = validate(calibration, campaign.take(kept.rows))
    assert kept.validation.summary() == pytest.approx(unseen.summary())
    np.testing.assert_allclose(kept.validation.components, unseen.components, atol=1e-12)
    before = validate(nominal(campaign.take(rest)), campaign.take(kept.rows))
    assert kept.nominal_validation.summary() == pytest.approx(before.summary())


def test_holdout_folds_are_out_of_sample_and_fit_uses_all_rows():
    """Folds are predicted by fits that exclude them, and the returned calibration uses all rows."""
    _, campaign, fit, nominal = case()
    calibration = hold_out(fit, campaign, Holdout(folds=3), nominal)
    kept = calibration.held_out
    assert kept is not None
    assert len(calibration.ids) == len(campaign) == len(kept)
    np.testing.assert_allclose(calibration.z, fit(campaign).z, rtol=1e-12)
    for part in range(3):
        rows = kept.rows[kept.part == part]
        rest = campaign.take(np.setdiff1d(np.arange(len(campaign)), rows))
        expected = fit(rest).residuals_on(campaign.take(rows), frame="base")
        np.testing.assert_allclose(kept.residuals[kept.part == part], expected, atol=1e-12)
        assert kept.part_means[part] == pytest.approx(np.linalg.norm(expected, axis=2).mean())
    assert kept.summary()["folds"] == kept.summary()["parts"] == 3
    assert kept.part_means.min() <= kept.validation.mean <= kept.part_means.max()


def test_the_standard_error_counts_parts_whose_rows_err_together():
    _, campaign, fit, nominal = case()
    rng = np.random.default_rng(0)
    calibration = hold_out(fit, campaign, Holdout(share=0.5), nominal)
    own = rng.uniform(1.0, 3.0, 30)
    together = np.repeat(own, 4)[:, None, None] * np.array([1.0, 0.0, 0.0])
    held_out = replace(
        calibration.held_out,
        rows=np.arange(120), part=np.repeat(np.arange(30), 4), residuals=together, nominal=together,
        inside=None, rotation_inside=None,
    )  # fmt: skip
    assert held_out.standard_error == pytest.approx(own.std(ddof=1) / np.sqrt(30))
    apart = replace(held_out, part=np.arange(120))
    assert apart.standard_error == pytest.approx(together[:, 0, 0].std(ddof=1) / np.sqrt(120))
    assert np.isnan(replace(held_out, part=np.zeros(120, dtype=int)).standard_error)


@pytest.mark.parametrize("holdout", [Holdout(share=0.3), Holdout(folds=2, by="blocks"), None])
def test_what_was_held_out_is_saved_with_the_calibration(tmp_path, holdout):
    _, campaign, fit, nominal = case({"targets": 2, "lost": 0.1}, rows=30)
    if holdout is None:
        calibration = with_held_out(fit(campaign.take(slice(5, None))), campaign, np.arange(5), nominal)
    else:
        calibration = hold_out(fit, campaign, holdout, nominal)
    calibration.save(tmp_path / "cal.json")
    loaded = load_calibration(tmp_path / "cal.json")
    np.testing.assert_array_equal(loaded.q, calibration.q)
    assert loaded.held_out is not None
    assert calibration.held_out is not None
    assert (loaded.held_out.by, loaded.held_out.folds) == (calibration.held_out.by, calibration.held_out.folds)
    for name in ("rows", "part", "residuals", "nominal"):
        np.testing.assert_array_equal(getattr(loaded.held_out, name), getattr(calibration.held_out, name))


def test_a_wrong_row_is_left_out_of_the_nominal_fit_as_well():
    _, campaign, _, nominal = case()
    fit = partial(identify, case()[0])
    points = campaign.points.copy()
    out = rows_held_out(Holdout(share=0.3), campaign)
    bad = int(np.setdiff1d(np.arange(len(campaign)), out)[0])
    points[bad] += 5.0
    right = hold_out(fit, campaign, Holdout(share=0.3), nominal).held_out
    wrong = hold_out(fit, replace(campaign, points=points), Holdout(share=0.3), nominal)
    assert [row.row for row in wrong.left_out] == [bad]
    assert right is not None
    assert wrong.held_out is not None
    assert wrong.held_out.nominal_validation.mean == pytest.approx(right.nominal_validation.mean, rel=0.3)


def test_what_cannot_be_held_out_is_refused():
    q = np.repeat(np.eye(4), 6, axis=0)
    with pytest.raises(CampaignError, match="24 rows at 4 different poses are too few to hold out one part of 5"):
        folds_of(Holdout(folds=5), unmeasured(q))
    with pytest.raises(CampaignError, match="all 3 rows are one pose"):
        rows_held_out(Holdout(share=0.4), unmeasured(np.ones((3, 6))))
    with pytest.raises(CampaignError, match=r"holding out 0.001 of 24 rows leaves 24 to fit and 0 to test"):
        rows_held_out(Holdout(share=0.001), unmeasured(q))
    _, campaign, fit, nominal = case()
    out = rows_held_out(Holdout(share=0.3), campaign)
    points = campaign.points.copy()
    points[out] = np.nan
    with pytest.raises(CampaignError, match="in none of the 12 rows that are held out was anything measured"):
        hold_out(fit, replace(campaign, points=points), Holdout(share=0.3), nominal)


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"by": "blocks"}, "by / share / folds: nothing is held out; give share or folds too"),
        ({"share": 0.3, "folds": 5}, "use share or folds, not both"),
        ({"share": 1.0}, "share: 1 is not between 0 and 1"),
        ({"folds": 1}, "folds: 1 is not 2 or more"),
    ],
)
def test_a_holdout_without_meaning_is_refused(choice, message):
    with pytest.raises(ValueError, match=message):
        Holdout(**choice)


def test_to_hold_nothing_out_is_refused():
    _, campaign, fit, nominal = case()
    with pytest.raises(ValueError, match="holds nothing out"):
        hold_out(fit, campaign, Holdout(), nominal)
