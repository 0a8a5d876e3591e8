"""The compiled walk against fresh memory and against plain NumPy."""

import numpy as np
import pytest

from benchmarks import plain_walk
from taskcal.geometry.chain import ErrorFrame, Fixed
from taskcal.geometry.normal_equations import normal_equations
from taskcal.identification.problem import FrameLayout, Problem, observe, whitener
from taskcal.measurement.registration import Registration
from taskcal.measurement.virtual_cell import TRACKER_POSE, draw_defects, simulate

NEAR_MEMORY = 3.0
"""Sensitivities take less than this many times the writing of their array."""


@pytest.fixture(scope="module")
def x(model):
    return draw_defects(model, np.random.default_rng(2))


def test_sensitivities_against_fresh_memory(race, model, joints, smoke):
    n = 1000 if smoke else 1_000_000
    q = joints(n)

    def write() -> np.ndarray:
        out = np.empty((n, 3, len(model)))
        out.fill(1.0)
        return out

    race(
        "sensitivities, 10⁶ poses",
        lambda: model.jacobian(q, angular=False),
        {"fresh memory": write},
        below=NEAR_MEMORY,
    )


@pytest.mark.parametrize("count", [60, 100_000])
def test_poses_against_numpy(race, model, joints, x, smoke, count):
    q, e, xi, steps = joints(300 if smoke else count), model.error_frames(x), x[-3:], list(model.steps)

    def plain() -> np.ndarray:
        return plain_walk.poses(steps, model.robot, q, e, xi)

    np.testing.assert_allclose(model.poses(q, x), plain(), rtol=0.0, atol=1e-12)
    race(f"poses, {count}", lambda: model.poses(q, x), {"NumPy": plain})


@pytest.mark.parametrize("count", [60, 100_000])
def test_sensitivities_against_numpy(race, model, joints, x, smoke, count):
    q, e, xi, steps = joints(300 if smoke else count), model.error_frames(x), x[-3:], list(model.steps)

    def plain() -> np.ndarray:
        out = np.empty((len(q), 3, len(model)))
        for rows, _, J in plain_walk.sensitivities(steps, model.robot, q, e, xi):
            out[rows] = J.transpose(2, 1, 0)
        return out

    np.testing.assert_allclose(model.jacobian(q, x, angular=False), plain(), rtol=0.0, atol=1e-12)
    race(f"sensitivities, {count}", lambda: model.jacobian(q, x, angular=False), {"NumPy": plain})


@pytest.mark.parametrize("count", [60, 100_000])
def test_normal_equations_against_numpy(race, model, joints, x, smoke, count):
    """45 parameters, tracker frame and target: JᵀWJ and JᵀWr of whitened points."""
    rng = np.random.default_rng(3)
    campaign = simulate(model, joints(300 if smoke else count), rng=rng)[0]
    here = Registration(
        T_tracker_base=TRACKER_POSE, T_tool_target=np.eye(4)[None], rms=0.0, unobservable=np.zeros((3, 3))
    )
    layout = FrameLayout(
        model=model, kept=np.arange(len(model)), registration=here, targets=campaign.targets, pose=False
    )
    problem = Problem(frames=layout, q=campaign.q, seen=observe(campaign), noise=campaign.covariances())
    white = whitener(problem.noise)
    z = layout.start()
    z[: len(x)] = x

    def streamed() -> tuple[float, np.ndarray, np.ndarray]:
        return normal_equations(problem.walked(z), problem.seen, white)

    steps = [Fixed(TRACKER_POSE), ErrorFrame(), *model.steps]
    e = np.concatenate([np.zeros((1, 6)), model.error_frames(x)])
    # the base frame comes first on the walk, after the parameters in z
    order = np.concatenate([6 + np.arange(len(model)), np.arange(6), 6 + len(model) + np.arange(3)])

    def plain() -> tuple[float, np.ndarray, np.ndarray]:
        cost, g, H = 0.0, np.zeros(len(z)), np.zeros((len(z), len(z)))
        for rows, end, J in plain_walk.sensitivities(steps, model.robot, campaign.q, e, x[-3:], extra=3):
            J[-3:] = end.R.transpose(1, 0, 2)
            W = white[rows, 0]
            flat = (W @ J.transpose(2, 1, 0)).reshape(-1, len(z))
            r = (W @ (campaign.points[rows, 0] - end.p.T)[:, :, None]).reshape(-1)
            cost += 0.5 * float(r @ r)
            g += flat.T @ r
            H += flat.T @ flat
        return cost, g[order], H[np.ix_(order, order)]

    (cost, g, H), (plain_cost, plain_g, plain_H) = streamed(), plain()
    scale = np.sqrt(np.maximum(np.diag(plain_H), 1.0))  # three of the tool's parameters move nothing
    assert cost == pytest.approx(plain_cost, rel=1e-9)
    np.testing.assert_allclose(g / scale, plain_g / scale, rtol=0.0, atol=1e-9 * np.sqrt(plain_cost))
    np.testing.assert_allclose(H / scale / scale[:, None], plain_H / scale / scale[:, None], rtol=0.0, atol=1e-9)
    race(f"normal equations, {count}", streamed, {"NumPy": plain})
