"""A robot that bends: its loads and sizes are what they are said to be, and what geometry leaves on it effects explain."""

from functools import partial

import numpy as np
import pytest

from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import SOFT, EncoderGain
from taskcal.robot.effects.drives import MotorTorque
from taskcal.robot.effects.load_path import LoadPath
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.statics import Load
from taskcal.task.task import reach_task
from taskcal_demo.procedure import reference_task, try_models
from taskcal_demo.true_robot import GEARS, STIFFNESS, WEIGHTS, elastic_model

GEOMETRY = ErrorModel(load_robot("abb-irb6660-205-1.9"))
TASK = reference_task(np.radians(20.0))
DRAWS = 2


@pytest.fixture(scope="module")
def poses():
    return reach_task(GEOMETRY, TASK, 60).q, reach_task(GEOMETRY, TASK, 100, seed=1).q


@pytest.fixture(scope="module")
def trials(poses):
    fits = {
        "geometry": partial(identify, GEOMETRY),
        "explained": lambda c: explain(GEOMETRY + GEARS, c, candidates=(EncoderGain(), SOFT), folds=3).calibration,
    }
    truth = elastic_model(GEOMETRY.robot)
    return [try_models(truth, fits, *poses, rng=np.random.default_rng(seed)) for seed in range(DRAWS)]


def test_lower_arm_motor_torque_is_reduced_by_spring(poses):
    """By hand: all weights but the lower arm's own hang on its end, 700 mm from the axis, whatever the forearm does."""
    robot, lean = elastic_model(GEOMETRY.robot).robot, poses[0][:, 1]
    far = sum(mass for mass, _ in WEIGHTS[2:]) + 120.0
    weight = 9.80665 * (far * 0.7 + 250.0 * 0.35) * np.sin(lean)
    length = np.sqrt(0.2**2 + 0.7**2 - 2 * 0.2 * 0.7 * np.cos(lean))
    spring = -40e3 * (length - 0.3) * 0.2 * 0.7 * np.sin(lean) / length
    torque = MotorTorque.of(robot, Load()).at(LoadPath.at(robot, poses[0]))[:, 1]
    np.testing.assert_allclose(torque, weight + spring, atol=1e-6 * np.abs(weight).max())
    assert -0.6 < spring @ weight / (weight @ weight) < -0.4


def test_softness_alone_tells_the_drives_apart():
    soft, stiff = (elastic_model(GEOMETRY.robot, k) for k in (STIFFNESS, 2.0 * STIFFNESS))
    assert soft.names == stiff.names
    assert set(soft.names) - set((GEOMETRY + GEARS).names) == {f"J{i}.compliance" for i in range(1, 7)}
    by_name = {p.name: p.tolerance for p in soft.parameters}
    assert by_name["J3.compliance"] == pytest.approx(0.3 / STIFFNESS)
    nothing = np.zeros(len(soft))
    q = np.array([[0.1, 0.2, 0.3, 0.1, -0.8, 0.2]])
    rigid = GEOMETRY.poses(q)[0, :3, 3]
    bent = [model.poses(q, nothing)[0, :3, 3] - rigid for model in (soft, stiff)]
    assert np.linalg.norm(bent[0] - 2.0 * bent[1]) < 2e-3 * np.linalg.norm(bent[0])  # in proportion, but for turns
    assert bent[0][2] < -1e-3


def test_what_geometry_leaves_is_found_and_predicted(trials):
    for plain, explained in trials:
        assert SOFT in explained.calibration.model.effects
        assert explained.residual.maximum < 0.7 * plain.residual.maximum
        assert explained.new.mean < 0.5 * plain.new.mean


def test_predictions_with_effects_are_inside_their_intervals(trials):
    """200 poses of two robots; the errors at the poses of one robot go together, hence the width of the bounds."""
    inside = np.mean([explained.inside for _, explained in trials])
    assert 0.90 < inside < 0.99


def test_fit_with_true_model_is_inside_its_intervals(poses):
    """Told everything, the intervals hold as often as they say."""
    truth = elastic_model(GEOMETRY.robot)
    told = [
        try_models(truth, {"told": partial(identify, truth)}, *poses, rng=np.random.default_rng(seed))[0]
        for seed in range(12)
    ]
    assert np.mean([trial.inside for trial in told]) == pytest.approx(0.95, abs=0.03)
    assert np.median([trial.new.mean for trial in told]) < 0.015e-3
