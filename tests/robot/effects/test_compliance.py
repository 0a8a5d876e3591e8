"""Drives that yield: against the rest position of an elastic robot, virtual work, and what a turned base must not change."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance
from taskcal.robot.effects.drives import MIN_STATED_SHARE, STATED_ERROR_SHARE
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.robot.statics import Load
from tests.laws import robots, statics
from tests.robot.effects.loads import CUT, LOAD, PAYLOAD


def reference(name: str, rng: np.random.Generator):
    """A weighed robot of some build, and poses of it."""
    if name == "parallelogram":
        bar = robots.irb6660_description()
        bar["four_bar"] = {**bar["four_bar"], "rod_mm": 690.0, "rocker_mm": 480.0}  # no true parallelogram
        return statics.weighed(bar, rng), robots.irb6660_positions(rng, 4)
    if name == "industrial":
        return statics.weighed(robots.industrial(rng), rng), robots.industrial_positions(rng, 4)
    return statics.weighed(load_robot(name).description, rng), rng.uniform(-1.2, 1.2, (4, 6))


@pytest.mark.parametrize("name", ["industrial", "parallelogram", "ur5", "fanuc-r2000ic-165f"])
def test_stated_stiffness_rests_at_least_energy(name):
    """A robot of stated stiffness comes to rest where its energy is least."""
    description, q = reference(name, np.random.default_rng(0))
    description = {**description, "gravity": [0.3, -0.2, -1.0]}
    model = ErrorModel(robot_from(description)) + Compliance(load=LOAD)
    stiff = ErrorModel(model.robot)
    for row, T, nominal in zip(q, model.poses(q), stiff.poses(q), strict=True):
        rest = statics.tool_pose(description, row, statics.at_rest(description, row, CUT, PAYLOAD))
        moved = rest[:3, 3] - nominal[:3, 3]
        assert np.linalg.norm(moved) > 5e-5
        # what is left is of second order in the deflection
        np.testing.assert_allclose(T[:3, 3] - nominal[:3, 3], moved, atol=3e-3 * np.linalg.norm(moved))


def test_wall_mounted_robot_yields_as_turned_gravity():
    """A robot on the wall yields as one that stands and is turned with its gravity."""
    rng = np.random.default_rng(3)
    description = statics.weighed(robots.industrial(rng), rng)
    row = description["joint"][0]["mdh"]
    steps = [{"rx_deg": 90.0}, {"rz_deg": 20.0}]
    turned = [*steps, {"tx_mm": row["a_mm"]}, {"tz_mm": row["d_mm"]}]
    first = {k: v for k, v in description["joint"][0].items() if k != "mdh"} | {"steps": turned}
    R = Rotation.from_euler("XZ", [90.0, 20.0], degrees=True).as_matrix()
    wall = {
        **description,
        "joint": [first, *description["joint"][1:]],
        "gravity": (R @ [0.0, 0.0, -2.0]).tolist(),
    }
    q = robots.industrial_positions(rng, 6)
    upright, hung = (ErrorModel(robot_from(d)) + Compliance() for d in (description, wall))
    np.testing.assert_allclose(hung.poses(q)[:, :3, 3], upright.poses(q)[:, :3, 3] @ R.T, atol=1e-12)
    without = {k: v for k, v in wall.items() if k != "gravity"}
    assert np.abs((ErrorModel(robot_from(without)) + Compliance()).poses(q) - hung.poses(q)).max() > 1e-5


def test_compliance_tolerances_ignore_the_load():
    """Tolerances come from the stated stiffness or from the largest torque and not from the load."""
    rng = np.random.default_rng(5)
    description = statics.weighed(robots.industrial(rng), rng)
    stated = ErrorModel(robot_from(description)) + Compliance()
    stiffness = np.array(stated.robot.statics.stiffness)
    np.testing.assert_allclose(stated.tolerances[-6:], STATED_ERROR_SHARE / stiffness)
    joints = [{k: v for k, v in joint.items() if k != "stiffness_nm_rad"} for joint in description["joint"]]
    model = ErrorModel(robot_from({**description, "joint": joints})) + Compliance(tolerance=1e-3)
    q = robots.industrial_positions(rng, 300)
    np.testing.assert_array_equal(model.poses(q), ErrorModel(model.robot).poses(q))
    torque = np.abs(model.effects[0].term(model.robot).basis(q)).max(axis=0)
    deflection = model.tolerances[-6:] * torque
    assert 0.7e-3 < deflection.max() < 1.5e-3
    assert model.tolerances[-6:].max() <= 1e-3 / (MIN_STATED_SHARE * 0.5 * torque.max())
    under = model.under(LOAD)
    assert (under.names, under.tolerances.tolist()) == (model.names, model.tolerances.tolist())


def test_another_load_adds_its_torque_only():
    """A model under another load keeps its parameters and moves by the added torque."""
    rng = np.random.default_rng(6)
    description = statics.weighed(robots.industrial(rng), rng)
    model = ErrorModel(robot_from(description)) + Compliance()
    q, x = robots.industrial_positions(rng, 5), np.zeros(len(model))
    x[-6:] = 0.5 / np.array(model.robot.statics.stiffness)
    pushed = model.under(Load(force=tuple(CUT)))
    assert pushed.under(Load()).effects == (Compliance(load=Load()),)
    np.testing.assert_array_equal(pushed.under(Load()).poses(q, x), model.poses(q, x))
    J = ErrorModel(model.robot).joint_jacobian(q)[:, :3]
    flexible = 1.5 / np.array(model.robot.statics.stiffness)
    moved = np.einsum("nij,j,nkj,k->ni", J, flexible, J, CUT)  # J·C·Jᵀ·f
    np.testing.assert_allclose(
        (pushed.poses(q, x) - model.poses(q, x))[:, :3, 3], moved, atol=2e-2 * np.abs(moved).max()
    )
    np.testing.assert_array_equal(
        model.under(Load(mass=0.0)).poses(q, x),
        (ErrorModel(robot_from({**description, "payload": {"mass_kg": 0.0}})) + Compliance()).poses(q, x),
    )


def test_loads_need_masses_and_a_model_that_yields():
    model = ErrorModel(load_robot("ur5"))
    with pytest.raises(TaskcalError, match=r"add Compliance\(\) to it"):
        model.under(LOAD)
    with pytest.raises(TaskcalError, match=r"ur5: a load .* state mass_kg and centre_mm of every joint"):
        (model + Compliance()).under(LOAD)
