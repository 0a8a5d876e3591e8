"""Plans and choices of parameters that go on from a calibration of geometry and all effects at once."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.calibration import UNINFORMED_SHARE, informed_parameters
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.observations.base import TrackerNoise
from taskcal.observations.instrument import Measurable
from taskcal.observations.point import Tracker
from taskcal.planning import experiment as calibrated_experiment
from taskcal.planning.expected_error import known_hyperparameters
from taskcal.planning.experiment import calibrated_experiments, span
from taskcal.planning.plan import plan
from taskcal.planning.selection import select
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import simulate

RIPPLE = Harmonics(orders=(1, 2, 3, 4, 5), tolerance=2e-4)
GEOMETRY = ErrorModel(load_robot("abb-irb120"))


def poses(count: int, seed: int, half: float = 1.2) -> np.ndarray:
    limits = np.clip(GEOMETRY.robot.limits, -half, half)
    return np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1], (count, 6))


@pytest.fixture(scope="module")
def campaign():
    return simulate(GEOMETRY + RIPPLE, poses(30, 0, 0.8), rng=np.random.default_rng(1))[0]


@pytest.fixture(scope="module")
def calibration(campaign):
    found = explain(GEOMETRY, campaign, candidates=(EncoderGain(), RIPPLE), folds=3).calibration
    assert found.joint_error
    return replace(found, range_growth=0.0)  # of what no model has, so that no row can tell of it


@pytest.fixture(scope="module")
def task():
    q = poses(60, 2)
    return Task(name="listed", poses=GEOMETRY.poses(q), joints=q)


def measurable(count: int) -> Measurable:
    return Measurable(q=poses(count, 3), rows=np.arange(count), visible=np.ones((count, 1), dtype=bool), lost={})


def posterior_error(calibration, goal, q) -> float:
    """Expected error over a task when poses q are measured too, by the covariance of all that is unknown."""
    z = np.eye(len(calibration.z))

    def predicted(at, change):
        z = calibration.z + change
        base, target = calibration.layout.frames(z)
        return replace(calibration, z=z, T_tracker_base=base, T_tool_target=target).predict(at)[:, 0]

    def columns_of(at):
        return np.stack([(predicted(at, e) - predicted(at, -e)) / 2e-6 for e in 1e-6 * z], axis=-1)

    S, T = calibration.z_covariance, columns_of(goal.q)
    if len(q):
        J = columns_of(q)
        R = np.zeros((3 * len(q), 3 * len(q)))
        own = calibration.predict_covariance(q) - calibration.predict_covariance(q, model_error=False)
        own = own[:, 0] + TrackerNoise().covariance(calibration.predict(q))[:, 0]
        for i in range(len(q)):
            R[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = own[i]
        J = J.reshape(-1, len(z))
        S = S - S @ J.T @ np.linalg.solve(J @ S @ J.T + R, J @ S)
    return float(np.sqrt(np.einsum("n,nij,jk,nik->", goal.weights, T, S, T)))


def test_the_expected_error_is_that_of_all_that_is_unknown(calibration, task, monkeypatch):
    """Exactly in all directions, and nearly in those that matter."""
    goal, q = reach_task(GEOMETRY, task), poses(10, 4)
    visible = np.ones((10, 1), dtype=bool)
    few, _ = calibrated_experiments(calibration, goal, measurable(50), Tracker(), None)
    monkeypatch.setattr(calibrated_experiment, "JUDGED_DIRECTIONS", len(calibration.z))
    monkeypatch.setattr(calibrated_experiment, "CHOSEN_DIRECTIONS", 40)
    every, narrow = calibrated_experiments(calibration, goal, measurable(50), Tracker(), None)
    assert every.before == pytest.approx(posterior_error(calibration, goal, q[:0]), rel=1e-5)
    assert every.error(q, visible) == pytest.approx(posterior_error(calibration, goal, q), rel=1e-4)
    assert every.errors_by_count(q, visible)[-1] == pytest.approx(every.error(q, visible), rel=1e-9)
    assert few.error(q, visible) == pytest.approx(every.error(q, visible), rel=1e-3)
    # what is left out of the directions counts as noise and as an error that stays
    assert every.error(q, visible) < narrow.error(q, visible) < every.before


def test_plan_with_effects_beats_plan_without_effects(calibration, campaign, task):
    """Rows that tell harmonics apart, judged by all that is unknown."""
    goal, pool = reach_task(GEOMETRY, task), poses(400, 5)
    geometric = identify(GEOMETRY, campaign)
    knowing = plan(calibration.model, task, 12, calibration=calibration, candidates=pool)
    unknowing = plan(GEOMETRY, task, 12, calibration=geometric, candidates=pool)
    judged, _ = calibrated_experiments(calibration, goal, measurable(400), Tracker(), None)
    every = np.ones((12, 1), dtype=bool)
    assert knowing.expected == pytest.approx(judged.error(knowing.q, every), rel=0.01)
    assert knowing.expected < 0.95 * judged.error(unknowing.q, every)
    assert knowing.expected < knowing.random.min()
    assert knowing.extends


def test_selection_takes_joint_effects_as_one_estimated_group(calibration, campaign, task):
    """A selection takes the effects of a joint as a whole, with their estimated magnitudes."""
    model, known = calibration.model, known_hyperparameters(calibration)
    chosen = select(model, task, campaign, hyperparameters=known, folds=3)
    ripple = f"{RIPPLE.name} of J2"
    assert chosen.groups[ripple] == tuple(f"J2.{part}{k}" for k in range(1, 6) for part in ("cos", "sin"))
    assert chosen.groups["J2.tx"] == ("J2.tx",)
    assert {name for own in chosen.groups.values() for name in own} == set(model.names)
    assert len(chosen.ladder) == len(chosen.groups) + 1
    assert [nested.size for nested in chosen.ladder][-1] == 0
    for name, own in chosen.groups.items():
        assert len({chosen.dropped.get(parameter) for parameter in own}) == 1, name
    assert set(chosen.kept) == {name for group in chosen.kept_groups for name in chosen.groups[group]}
    np.testing.assert_allclose(chosen.design.prior, calibration.group_deviations)
    assert np.abs(np.log(known.own / (calibration.prior_scale * model.tolerances))).max() > 0.5
    assert ripple in chosen.kept_groups
    assert chosen.ladder[0].cross_validated < 0.5 * chosen.ladder[-1].cross_validated


def test_information_uses_estimated_magnitudes(calibration):
    """The information of the data is judged by the estimated magnitudes."""
    informed = informed_parameters(calibration)
    sizes = dict(zip(calibration.names, calibration.group_deviations, strict=True))
    errors = dict(zip(calibration.names, calibration.standard_errors, strict=True))
    assert {name: errors[name] < UNINFORMED_SHARE * sizes[name] for name in calibration.kept} == informed
    assert 0 < sum(informed.values()) < len(informed)


def test_directions_are_those_that_rows_or_task_see_at_all():
    """The row space of both, whatever their sizes, as a rank has it."""
    rng = np.random.default_rng(0)
    mixed = rng.normal(size=(5, 9))
    measured = rng.normal(size=(40, 3)) @ mixed[:3]
    task = 1e-4 * rng.normal(size=(30, 3)) @ mixed[2:]
    V = span(measured, task)
    assert V.shape == (9, np.linalg.matrix_rank(mixed))
    np.testing.assert_allclose(V.T @ V, np.eye(5), atol=1e-12)
    for rows in (measured, task):
        np.testing.assert_allclose(rows @ V @ V.T, rows, atol=1e-6 * np.abs(rows).max())
