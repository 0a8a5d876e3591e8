"""Several moderate mistakes do not hide each other: rows that are clearly wrong are left out, sound ones are not."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

ERROR_M = 6e-5
"""Scale of the t-distributed error of single poses, metres per axis, as a good robot's."""

KINDS = {
    "one target": {},
    "two targets": {"targets": {"a": np.array([0.05, 0.0, 0.06]), "b": np.array([-0.06, 0.05, 0.0])}},
    "poses": {"pose": True},
    "sockets": {"observe": "socket"},
}  # fmt: skip


def measured(rng, rows, **kind):
    """A robot that is off by its tolerances, and whose poses err by themselves, t-distributed."""
    model = ErrorModel(load_robot("ur5"))
    q = rng.uniform(-1.5, 1.5, (rows, 6))
    campaign, _ = simulate(model, q, rng=rng, **kind)
    if campaign.tracked:
        tails = ERROR_M * np.sqrt(0.75) * rng.standard_t(8.0, campaign.points.shape)
        return model, replace(campaign, points=campaign.points + tails)
    reach = np.linalg.norm(model.poses(campaign.q)[:, :3, 3], axis=1)
    turned = campaign.q.copy()
    turned[:, 1] += ERROR_M * rng.standard_t(8.0, len(turned)) / reach
    return model, replace(campaign, q=turned)


def turn(model, campaign, rows, size, rng):
    """Joints 2 of some rows turned, so that the tool moves by so many metres."""
    q = campaign.q.copy()
    q[rows, 1] += size * rng.choice([-1.0, 1.0], len(rows)) / np.linalg.norm(model.poses(q[rows])[:, :3, 3], axis=1)
    return replace(campaign, q=q)


def move(campaign, rows, size, rng):
    """Points of some rows moved by so many metres."""
    way, points = rng.normal(size=(len(rows), 3)), campaign.points.copy()
    points[rows, 0] += size[:, None] * way / np.linalg.norm(way, axis=1)[:, None]
    return replace(campaign, points=points)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("rows", "count"), [(60, 6), (30, 3), (60, 2)])
def test_moderate_mistakes_are_left_out_and_sound_rows_are_not(kind, rows, count):
    visible = named = innocent = 0
    for seed in range(2):
        rng = np.random.default_rng([seed, count])
        model, campaign = measured(rng, rows, **KINDS[kind])
        wrong = rng.choice(rows, count, replace=False)
        size = rng.uniform(0.8e-3, 3e-3, count)
        spoilt = move(campaign, wrong, size, rng) if campaign.tracked else turn(model, campaign, wrong, size, rng)
        out = {row.row for row in identify(model, spoilt).left_out}
        visible, named = visible + count, named + len(out & set(wrong.tolist()))
        innocent += len(out - set(wrong.tolist()))
    assert named >= 0.95 * visible
    assert innocent <= 0.5


@pytest.mark.parametrize(("turned", "least", "most"), [(0.0, 0.0, 10.0), (2.6, 15.0, 40.0)])
def test_a_row_far_outside_the_others_has_to_be_farther_off(turned, least, most):
    """What no model has grows there: sound rows of measured robots are farther off than one between others."""
    rng = np.random.default_rng(5)
    model, q = ErrorModel(load_robot("ur5")), rng.uniform(-1.5, 1.5, (60, 6))
    q[7, 0] = turned
    campaign, _ = simulate(model, q, rng=rng)
    campaign = replace(campaign, points=campaign.points + ERROR_M * np.sqrt(0.75) * rng.standard_t(8.0, (60, 1, 3)))
    lengths = [
        row.studentised
        for size in np.geomspace(0.4e-3, 20e-3, 12)
        for row in identify(model, move(campaign, np.array([7]), np.array([size]), np.random.default_rng(0))).left_out
    ]
    assert least < min(lengths) < most


def test_predictions_are_those_of_the_sound_rows():
    """Six of sixty, from 0.6 mm on: the fit follows none of them."""
    rng = np.random.default_rng(3)
    model, campaign = measured(rng, 60)
    wrong = np.sort(rng.choice(60, 6, replace=False))
    found = identify(model, move(campaign, wrong, rng.uniform(0.6e-3, 3e-3, 6), rng))
    mask = np.zeros(60, dtype=bool)
    mask[wrong] = True
    right = identify(model, campaign.without(mask), gross_errors="keep")
    assert [row.row for row in found.left_out] == wrong.tolist()
    np.testing.assert_array_equal(found.z, right.z)


def test_it_does_not_depend_on_the_order_of_the_rows():
    rng = np.random.default_rng(5)
    model, campaign = measured(rng, 40)
    spoilt = move(campaign, np.array([3, 17, 30]), np.array([0.001, 0.4, 0.9]), rng)
    order = rng.permutation(40)
    found, turned = (identify(model, one) for one in (spoilt, spoilt.take(order)))
    assert {row.row for row in found.left_out} == {row.row for row in turned.left_out} == {3, 17, 30}


def test_of_many_rows_some_say_which_of_all_agree(monkeypatch):
    rng = np.random.default_rng(6)
    model, campaign = measured(rng, 240)
    wrong = np.sort(rng.choice(240, 20, replace=False))
    spoilt = move(campaign, wrong, rng.uniform(1e-3, 5e-2, 20), rng)
    monkeypatch.setattr(sys.modules[identify.__module__], "SAMPLE", 60)
    assert [row.row for row in identify(model, spoilt).left_out] == wrong.tolist()
