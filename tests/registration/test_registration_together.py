"""Registrations of many campaigns at once are those of each by itself."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.registration.consensus import TARGET_WITHIN, find_consensus
from taskcal.registration.together import register_together
from taskcal.virtual.cell import simulate
from tests.identification.arms import arm, defects


def campaigns_of(seed, robots=5, rows=30, spread=1.2):
    rng, model = arm(seed)
    middle = rng.uniform(-1.0, 1.0, len(model.robot.joints))
    out = []
    for _ in range(robots):
        q = middle + rng.uniform(-spread, spread, (rows, len(middle)))
        target = {"ball": rng.uniform(-0.2, 0.2, 3)}
        out.append(simulate(model, q, rng=rng, x=defects(rng, model), targets=target)[0])
    return model, out


def register(model, campaigns):
    T = np.stack([model.poses(one.q) for one in campaigns])
    return register_together(T, np.stack([one.points[:, 0] for one in campaigns]), model.robot.reach, TARGET_WITHIN), T


@given(st.integers(0, 10**6))
@settings(max_examples=15)
def test_frames_targets_and_agreement_are_those_of_the_consensus(seed):
    # with hardly any turn the target stays at the tool point
    model, campaigns = campaigns_of(seed, spread=(1.2, 0.3, 0.02)[seed % 3])
    found, T = register(model, campaigns)
    for i, campaign in enumerate(campaigns):
        alone = find_consensus(model, campaign, T[i])
        assert found.sound[i] == alone.of_all
        if alone.of_all:
            one = alone.registration
            np.testing.assert_allclose(found.T_tracker_base[i], one.T_tracker_base, rtol=0.0, atol=1e-8)
            np.testing.assert_allclose(found.target[i], one.T_tool_target[0, :3, 3], rtol=0.0, atol=1e-8)
            np.testing.assert_allclose(found.unobservable[i], one.unobservable, rtol=0.0, atol=1e-9)


def test_a_campaign_whose_rows_disagree_is_told_from_those_beside_it():
    model, campaigns = campaigns_of(4)
    campaigns[1].points[6] += 0.03
    campaigns[3].points[:, 0] = campaigns[3].points[::-1, 0]
    assert register(model, campaigns)[0].sound.tolist() == [True, False, True, False, True]


def test_points_along_a_line_and_a_target_that_is_too_far_are_not_relied_on():
    model, campaigns = campaigns_of(4, robots=2)
    T = np.stack([model.poses(one.q) for one in campaigns])
    points = np.stack([one.points[:, 0] for one in campaigns])
    assert not register_together(T, points, model.robot.reach, 0.01).sound.any()
    points[1] = points[1].mean(axis=0) + np.linspace(-0.5, 0.5, points.shape[1])[:, None] * [1.0, 0.0, 0.0]
    assert register_together(T, points, model.robot.reach, TARGET_WITHIN).sound.tolist() == [True, False]
