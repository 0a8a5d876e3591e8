"""Links that warm up each in its own time."""

import numpy as np

from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import WarmUp
from taskcal.robot.error_model import ErrorModel
from taskcal_demo.true_robot import GROWING, UnevenExpansion


def test_expansion_in_one_time_is_warming_up(robot, q):
    """With one time constant for all it is `WarmUp` of the same joints."""
    tau = 1800.0
    uneven = UnevenExpansion(joints=GROWING, tolerance=1e-4, time_constants=(tau,) * 4)
    even = WarmUp(joints=GROWING, tolerance=1e-4, time_constant=tau, reference=0.0)
    conditions = Conditions(time=np.linspace(100.0, 7200.0, len(q)))
    models = [ErrorModel(robot, effects=(effect,)) for effect in (uneven, even)]
    assert models[0].names == models[1].names
    x = np.random.default_rng(0).normal(size=len(models[0])) * models[0].tolerances
    ours, theirs = (model.poses(q, x, conditions) for model in models)
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_each_link_grows_in_its_own_time(robot, q):
    uneven = UnevenExpansion(joints=GROWING, tolerance=1e-4, time_constants=(9000.0, 100.0, 1000.0, 10_000.0))
    model = ErrorModel(robot, effects=(uneven,))
    shares = []
    for joint in GROWING:
        x = np.zeros(len(model))
        x[model.names.index(f"{joint}.expansion")] = 1e-4
        at = [model.poses(q[:1], x, Conditions(time=np.array([t])))[0, :3, 3] for t in (0.0, 1000.0, 1e9)]
        shares.append(np.linalg.norm(at[1] - at[0]) / np.linalg.norm(at[2] - at[0]))
    np.testing.assert_allclose(shares, 1.0 - np.exp(-1000.0 / np.array([100.0, 1000.0, 10_000.0])), atol=1e-3)
