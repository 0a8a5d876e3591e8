"""The closed form of the expected task error, against simulation and against itself done the long way."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from taskcal.identification.identify import identify
from taskcal.planning.expected_error import design
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task


@pytest.fixture(scope="module")
def cell():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    task = reference_task(np.radians(20.0))
    measured, unseen = reach_task(model, task, 40), reach_task(model, task, 60, seed=3)
    campaign, _ = simulate(model, measured.q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    return model, measured, unseen, design(model, campaign, unseen)


FEW_LEFT = ("J1", "J2", "J3", "tool", "J5")


@pytest.mark.parametrize(
    ("dropped", "robots"),
    [
        (FEW_LEFT, 50),
        *(
            pytest.param(dropped, 200, marks=pytest.mark.long)
            for dropped in ((), ("J2.tz", "J3.tz", "J6"), ("J4.rx", "J3.ry", "J2.tx", "loop"), FEW_LEFT)
        ),
    ],
)
def test_the_expected_error_is_the_mean_over_simulated_robots(cell, dropped, robots):
    model, measured, unseen, made = cell
    kept = np.setdiff1d(np.arange(len(model)), model.indices(dropped) if dropped else [])
    squares = []
    for seed in range(robots):
        campaign, truth = simulate(model, measured.q, rng=np.random.default_rng(seed))
        keep = [model.names[i] for i in kept]
        found = identify(model, campaign, keep=keep, model_error=0.0, prior_scale=1.0, gross_errors="keep")
        squares.append(np.sum((found.predict(unseen.q) - truth.points(unseen.q)) ** 2, axis=2).mean())
    mean, standard_error = np.mean(squares), np.std(squares) / np.sqrt(len(squares))
    assert abs(mean - made.expected_error(kept) ** 2) < 4.0 * standard_error


def test_elimination_drops_least_significant_parameter(cell):
    """Every step of the elimination drops the parameter with the smallest effect on the task error."""
    model, _, _, made = cell
    order, errors = made.ladder()
    kept = set(range(len(model)))
    for step, gone in enumerate(order):
        assert errors[step] == pytest.approx(made.expected_error(np.array(sorted(kept))), rel=1e-9)
        if step % 7 == 0:
            best = min(made.expected_error(np.array(sorted(kept - {j}), dtype=int)) for j in kept)
            assert made.expected_error(np.array(sorted(kept - {gone}), dtype=int)) <= best * (1 + 1e-6)
        kept.remove(gone)
    assert not kept
    assert errors[-1] == pytest.approx(made.before, rel=1e-9)


def test_with_the_right_prior_the_full_model_is_the_best(cell):
    _, _, _, made = cell
    _, errors = made.ladder()
    assert np.all(errors >= errors[0] * (1 - 1e-9))
    assert np.all(np.diff(errors) >= -1e-9 * errors[0])


def test_the_bound_is_the_posterior_covariance_of_the_fit(cell):
    model, measured, unseen, made = cell
    campaign, _ = simulate(model, measured.q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    found = replace(
        identify(model, campaign, model_error=0.0, prior_scale=1.0), range_growth=0.0
    )  # of what no model has
    spread = found.predict_covariance(unseen.q, model_error=False)
    posterior = np.sqrt(np.trace(spread, axis1=2, axis2=3).mean())
    assert posterior == pytest.approx(made.expected_error(np.arange(len(model))), rel=1e-3)


def measured_design(model, kind: str):
    """Designs of every kind of campaign: poses, several targets with lost beams, one orientation."""
    spread = 0.0 if kind == "one orientation" else np.radians(20.0)
    task = reference_task(spread)
    q, goal = reach_task(model, task, 30).q, reach_task(model, task, 25, seed=4)
    goal = replace(goal, weights=np.arange(1.0, 26.0) / np.arange(1.0, 26.0).sum())
    several = kind == "several targets"
    targets = {"a": np.array([0.1, 0.0, 0.0]), "b": np.array([0.0, 0.1, 0.05]), "c": np.array([0.0, -0.1, 0.2])}
    campaign, _ = simulate(
        model, q, rng=np.random.default_rng(0), x=np.zeros(len(model)), pose=kind == "poses",
        targets=targets if several else None, lost=0.2 if several else 0.0,
    )  # fmt: skip
    return campaign, goal, design(model, campaign, goal)


KINDS = ("one target", "one orientation", "several targets", "poses")


@pytest.mark.parametrize("kind", KINDS)
def test_task_error_is_weighted_mean_over_poses(cell, kind):
    """The error over the task is the weighted mean of the errors at its poses."""
    model = cell[0]
    _, goal, made = measured_design(model, kind)
    rng = np.random.default_rng(5)
    for size in (0, 7, 30, len(model)):
        kept = np.sort(rng.permutation(len(model))[:size])
        at = made.expected_at(goal.q, kept)
        assert np.sqrt(goal.weights @ at**2) == pytest.approx(made.expected_error(kept), rel=1e-6)
    assert np.sqrt(goal.weights @ made.expected_at(goal.q) ** 2) == pytest.approx(made.before, rel=1e-6)
    assert made.ladder()[1][-1] == pytest.approx(made.before, rel=1e-9)


@pytest.mark.parametrize("kind", ["one target", "several targets", "poses"])
def test_expected_error_equals_joint_least_squares(cell, kind):
    """Against one big least-squares problem in which tracker frame and targets are parameters with a very wide prior."""
    model = cell[0]
    campaign, goal, made = measured_design(model, kind)
    layout, z = made.layout, made.layout.start()
    h, n = 1e-6, len(layout.names)

    def jacobian(q):
        rows = []
        for k in range(n):
            step = np.zeros(n)
            step[k] = h
            (p1, R1), (p0, R0) = ends_at(layout, q, z + step), ends_at(layout, q, z - step)
            d = (p1 - p0) / (2 * h)
            if layout.pose:
                W = (R1 - R0) @ np.swapaxes(R1 + R0, -1, -2) / (4 * h)
                d = np.concatenate([d, np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1)], axis=-1)
            rows.append(d)
        return np.stack(rows, axis=-1)

    seen = campaign.valid
    J = jacobian(campaign.q)[seen]
    R = campaign.covariances()[seen]
    A = np.einsum("bri,brs,bsj->ij", J, np.linalg.inv(R), J)
    p = len(model)
    wide = np.full(n - p, 1e3)
    prior = np.concatenate([model.tolerances, wide]) ** 2
    Jt = jacobian(goal.q)[:, :, :3]
    W = np.einsum("n,ntri,ntrj->ij", goal.weights, Jt, Jt) / Jt.shape[1]
    rng = np.random.default_rng(1)
    for size in (0, 12, p):
        kept = np.sort(rng.permutation(p)[:size])
        own = np.concatenate([kept, np.arange(p, n)])
        scale = np.sqrt(prior[own])
        F = np.zeros((n, n))
        L = A[np.ix_(own, own)] * scale * scale[:, None] + np.eye(len(own))
        F[np.ix_(own, own)] = np.linalg.inv(L) * scale * scale[:, None]
        rest = np.eye(n) - F @ A
        # the frames' prior is only a device of the estimator: their truth counts where it is, at zero
        truth = block_diag(np.diag(model.tolerances**2), np.zeros((n - p, n - p)))
        C = rest @ truth @ rest.T + F @ A @ F
        assert np.sqrt(np.sum(W * C)) == pytest.approx(made.expected_error(kept), rel=1e-3), size


def ends_at(layout, q, z):
    """Where every target is at an estimate, and how it is turned, as a plain product of poses."""
    base, targets = layout.frames(z)
    T = base @ layout.model.poses(q, layout.parameters(z))
    ends = T[:, None] @ targets
    return ends[..., :3, 3], ends[..., :3, :3]


def test_what_the_campaign_measures_better_is_expected_better(cell):
    """More rows and less noise lower the error; more model error raises it."""
    model, measured, unseen, made = cell
    everything = np.arange(len(model))
    campaign, _ = simulate(model, measured.q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    half = design(model, campaign.take(np.arange(20)), unseen).expected_error(everything)
    rough = design(model, campaign, unseen, model_error=(1e-4,)).expected_error(everything)
    assert made.expected_error(everything) < half
    assert made.expected_error(everything) < rough < made.before


def test_groups_go_together_the_one_that_is_missed_least_first(cell):
    model, _, _, made = cell
    groups = [np.array(g) for g in np.array_split(np.random.default_rng(2).permutation(len(model)), 12)]
    order, errors = made.ladder(groups)
    left = list(range(12))

    def without(gone):
        return made.expected_error(np.sort(np.concatenate([*(groups[g] for g in left if g != gone), []])).astype(int))

    for step, gone in enumerate(order):
        assert errors[step] == pytest.approx(without(None), rel=1e-9)
        assert without(gone) <= min(without(g) for g in left) * (1 + 1e-9)
        left.remove(gone)
    assert errors[-1] == pytest.approx(made.before, rel=1e-9)
