"""What is stated of a pose is how far robots of the posterior are from it: with their joints off, and reached in any way."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.identification.calibration import covariance_on
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.effects import Backlash, Settling, Thermal
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

ROBOT = load_robot("abb-irb120")
REFLECTOR = np.array([0.12, -0.05, 0.2])
JOINTS = tuple(np.array([20.0, 50.0, 40.0, 80.0, 60.0, 150.0]) * 1e-6)


@pytest.fixture(scope="module", params=[False, True], ids=["points", "poses"])
def calibration(request):
    """A robot with lost motion that grows in the warmth, of which a target beside the tool's point was measured."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.2, 1.2, (50, 6))
    told = replace(conditions_in_order(ROBOT, q), temperature=rng.normal(24.0, 4.0, len(q)))
    model = ErrorModel(ROBOT) + Backlash() + Settling() + Thermal().referred(told)
    campaign, _ = simulate(
        model, q, rng=rng, targets={"smr": REFLECTOR}, pose=request.param, conditions=told, model_error=5e-5
    )
    return replace(identify(model, campaign), joint_error=JOINTS, range_growth=2.0)


def errors_of_robots(calibration, q, told, ways=60):
    """Twists from the predicted target and tool to those of robots drawn from all that is stated, (count, 2, 6).

    The estimates lie about the found one along each cause of their error, by as much as their covariance needs.
    """
    rng, thermal, out = np.random.default_rng(1), calibration.model.effects[-1], []
    rows = np.repeat(q, ways, axis=0)
    predicted = [T[0] for T in (calibration.target_poses(q, told)[:, 0], calibration.predict_tool(q, told))]
    for off in np.sqrt(len(calibration.z)) * np.concatenate([calibration.z_spread.T, -calibration.z_spread.T]):
        z = calibration.z + off
        base, targets = calibration.layout.frames(z)
        one = replace(calibration, z=z, T_tracker_base=base, T_tool_target=targets)
        side = rng.choice([-1.0, 1.0], rows.shape)
        conditions = Conditions(
            approach=side,
            move=side * rng.random(rows.shape),
            temperature=rng.normal(thermal.reference, thermal.spread, ways),
        )
        if told is not None:
            conditions = told.take(np.zeros(ways, dtype=int))
        tool = one.predict_tool(rows + np.array(JOINTS) * rng.normal(size=rows.shape), conditions)
        pair = []
        for T, at in zip((tool @ targets[0], tool), predicted, strict=True):
            white = np.zeros((ways, 6))
            errors = np.repeat(calibration.model_error, 3)
            white[:, : len(errors)] = errors * rng.normal(size=(ways, len(errors)))
            turn = se3.log(T[:, :3, :3] @ at[:3, :3].T)
            pair.append(np.hstack([T[:, :3, 3] - at[:3, 3], turn]) + white)
        out.append(np.stack(pair, axis=1))
    return np.concatenate(out)


@pytest.mark.parametrize("told", [False, True], ids=["nothing is told", "all is told"])
def test_the_stated_covariance_is_that_of_robots(calibration, told):
    """Of the estimate, the model, the joints and what is not told of a pose; of the target, and of the tool beside it."""
    q = np.array([[0.4, -0.3, 0.5, 0.9, -0.8, 0.6]])
    ways = (
        Conditions(approach=np.ones((1, 6)), move=np.full((1, 6), 0.5), temperature=np.array([29.0])) if told else None
    )
    error = errors_of_robots(calibration, q, ways)
    stated = calibration.predict_covariance(q, ways)[0, 0], calibration.tool_covariance(q, ways)[0]
    for k, C in enumerate(stated):
        found = error[:, k].T @ error[:, k] / len(error)
        b = len(C)
        scale = np.sqrt(np.diag(C))
        np.testing.assert_allclose(found[:b, :b] / np.outer(scale, scale), C / np.outer(scale, scale), atol=0.06)


def test_all_of_it_grows_beyond_the_measured_range(calibration):
    """As the regions of predictions do that were judged at the ends of what was measured."""
    q = np.array([[0.4, -0.3, 0.5, 2.4, -0.8, 0.6]])
    growth = calibration.growth_at(q)
    assert growth[0] > 1.1
    within = replace(calibration, range_growth=0.0)
    for name in ("predict_covariance", "tool_covariance"):
        C, inside = (getattr(one, name)(q) for one in (calibration, within))
        np.testing.assert_allclose(C, growth[0] * inside, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("frame", ["tracker", "base"])
def test_a_target_at_the_tools_point_is_as_uncertain_as_that(calibration, frame):
    """But for what is not known of where it is on the tool."""
    z = calibration.z.copy()
    z[calibration.layout.places[0].columns] = 0.0
    still = calibration.z_spread.copy()
    still[calibration.layout.places[0].columns] = 0.0
    if frame == "base":
        still[calibration.layout.bases[0].columns] = 0.0
    registration = replace(calibration.layout.registration, T_tool_target=np.eye(4)[None])
    layout = replace(calibration.layout, registration=registration)
    there = replace(calibration, layout=layout, z=z, z_spread=still, T_tool_target=np.eye(4)[None])
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (9, 6))
    C, b = there.predict_covariance(q)[:, 0], layout.block_size
    if frame == "base":
        R = np.kron(np.eye(b // 3), calibration.T_tracker_base[:3, :3])
        C = R.T @ C @ R
    expected = replace(calibration, z_spread=still).tool_covariance(q, frame=frame)[:, :b, :b]
    np.testing.assert_allclose(C, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_an_examination_states_what_a_prediction_does(calibration):
    """Of rows that tell how they were reached, and of rows that do not; the measurement adds its own."""
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.2, 1.2, (6, 6))
    told = replace(conditions_in_order(ROBOT, q), temperature=np.full(6, 26.0))
    campaign, _ = simulate(
        calibration.model, q, rng=rng, targets={"smr": REFLECTOR}, pose=calibration.layout.pose, conditions=told
    )
    noise = campaign.covariances()
    for one in (campaign, replace(campaign, conditions=Conditions())):
        stated = calibration.predict_covariance(q, one.conditions) + noise
        np.testing.assert_allclose(covariance_on(calibration, one, noise), stated, rtol=1e-9)
