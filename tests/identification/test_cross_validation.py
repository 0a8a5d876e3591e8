"""What is left out together, and the errors that a fit without it makes there."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.model_selection import GroupKFold

from taskcal.errors import CampaignError
from taskcal.identification.holdout import mean_over_rows, predict_left_out, split_postures
from taskcal.identification.identify import identify
from taskcal.planning.selection import select
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.task import Task
from tests.laws.campaigns import measure
from tests.laws.robots import generators, industrial, industrial_positions


def fold_of(q, folds, seed):
    out = np.full(len(q), -1)
    for fold, rows in enumerate(split_postures(q, folds, seed)):
        assert (out[rows] == -1).all()
        out[rows] = fold
    return out


@given(generators, st.integers(2, 6), st.integers(0, 99))
def test_folds_are_those_of_scikit_learn(rng, folds, seed):
    q = rng.uniform(-1.0, 1.0, (20, 3))
    q[7:10] = q[3]
    posture = np.arange(20)
    posture[7:10] = 3
    theirs = GroupKFold(folds, shuffle=True, random_state=seed).split(q, groups=posture)
    for ours, (_, left_out) in zip(split_postures(q, folds, seed), theirs, strict=True):
        np.testing.assert_array_equal(ours, left_out)


@given(generators, st.integers(2, 6))
def test_rows_of_one_posture_are_in_one_fold_wherever_it_lies(rng, folds):
    """A few hundredths of a degree apart, on whatever grid of half degrees the posture happens to be."""
    postures = np.radians(rng.integers(-300, 300, (15, 4)) * 0.5 + rng.choice([0.0, 0.25], (15, 4)))
    q = np.repeat(postures, 4, axis=0) + np.radians(rng.uniform(-0.02, 0.02, (60, 4)))
    fold = fold_of(q, folds, 0)
    assert set(fold) == set(range(folds))
    near = np.abs(q[:, None] - q).max(axis=2) < np.radians(0.5)
    assert (fold[:, None] == fold)[near].all()


def test_rows_that_follow_each_other_closely_are_one_posture():
    q = np.radians(np.r_[np.arange(10) * 0.4, 50.0, 60.0])[:, None]
    fold = fold_of(q, 3, 0)
    assert len(set(fold[:10])) == 1
    assert len(set(fold[9:])) == 3


@given(generators)
def test_folds_have_equal_pose_counts_and_depend_on_seed(rng):
    """Folds hold equally many distinct poses and change with the seed alone."""
    q = rng.uniform(-2, 2, (43, 6))
    fold = fold_of(q, 5, 3)
    assert sorted(np.bincount(fold)) == [8, 8, 9, 9, 9]
    np.testing.assert_array_equal(fold, fold_of(q, 5, 3))
    assert (fold != fold_of(q, 5, 4)).any()


def test_fewer_postures_than_folds_are_refused():
    q = np.repeat(np.eye(4), 6, axis=0)
    with pytest.raises(CampaignError, match="24 rows at 4 different poses are too few to leave out one part of 5"):
        split_postures(q, 5, 0)
    assert len(split_postures(q, 4, 0)) == 4


@pytest.mark.parametrize("kind", [{"targets": 3, "lost": 0.2}, {"pose": True}])
def test_cross_validation_predicts_each_point_out_of_fold(kind):
    """Every point is predicted by a fit that excludes its row."""
    rng = np.random.default_rng(0)
    model = ErrorModel(robot_from(industrial(rng)))
    campaign, _ = measure(
        rng, model, industrial_positions(rng, 24), rng.normal(size=len(model)) * model.tolerances, **kind
    )
    parts = split_postures(campaign.q, 3, 0)
    fit = partial(identify, model, model_error=0.0, prior_scale=1.0)
    errors = predict_left_out(fit, campaign, parts)
    np.testing.assert_array_equal(np.isfinite(errors), campaign.valid)
    for part in parts:
        rest, held = campaign.take(np.setdiff1d(np.arange(24), part)), campaign.take(part)
        predicted = fit(rest).predict(held.q)
        points = predicted[:, None, :3, 3] if "pose" in kind else predicted
        np.testing.assert_allclose(errors[part], np.linalg.norm(held.points - points, axis=2), atol=1e-13)


def test_the_standard_error_of_the_mean_counts_rows_not_targets():
    rng = np.random.default_rng(0)
    single = rng.normal(size=(40, 1))
    mean, error = mean_over_rows(single)
    assert mean == pytest.approx(single.mean())
    assert error == pytest.approx(single.std(ddof=1) / np.sqrt(40))
    np.testing.assert_allclose(mean_over_rows(np.repeat(single, 3, axis=1)), (mean, error))
    lost = np.repeat(single, 3, axis=1)
    lost[::2, 1:] = np.nan
    assert mean_over_rows(lost)[0] == pytest.approx(np.nanmean(lost))


@pytest.mark.slow
def test_selection_excludes_repeats_of_validation_poses():
    """Each posture has an error of its own: who has fitted it once predicts it better the second time."""
    rng = np.random.default_rng(0)
    model = ErrorModel(robot_from({**industrial(rng), "joint": industrial(rng)["joint"][:3]}))
    once = rng.uniform(-1.0, 1.0, (14, 3))
    campaign, _ = measure(rng, model, np.repeat(once, 4, axis=0), sigma=1e-6)
    own = rng.normal(scale=2e-4, size=(14, 1, 3))
    campaign.points[:] += np.repeat(own, 4, axis=0)
    q = rng.uniform(-1.0, 1.0, (40, 3))
    chosen = select(model, Task(name="listed", poses=model.poses(q), joints=q), campaign, folds=4)
    assert chosen.ladder[0].cross_validated > 1.1 * np.linalg.norm(own, axis=2).mean()
