"""Thermal expansion, with the temperature and by warming up."""

import json

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import TaskcalError, UnknownName
from taskcal.geometry import se3
from taskcal.kernels import walk
from taskcal.kinematics.inverse import solve_near
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, Thermal, WarmUp, effect_from
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import Case, cases
from tests.robot.effects.warm_robots import REVOLUTE, WARMTH, positions, thermal, warm, with_value


@pytest.mark.parametrize("name", REVOLUTE)
def test_uniform_growth_enlarges_the_robot(name):
    """Angles do not change, a parallelogram's neither."""
    plain = ErrorModel(load_robot(name))
    model, q = thermal(plain), positions(plain)
    larger = plain.poses(q)
    larger[:, :3, 3] *= 1.0 + 2e-5 * WARMTH
    np.testing.assert_allclose(model.poses(q, with_value(model, thermal__expansion=2e-5), warm(q)), larger, atol=1e-12)


def test_a_model_of_lengths_alone_grows_too():
    plain = ErrorModel(load_robot("abb-irb6660-205-1.9"), lengths_only=True)
    model, q = thermal(plain), positions(plain)
    larger = plain.poses(q)
    larger[:, :3, 3] *= 1.0 + 2e-5 * WARMTH
    np.testing.assert_allclose(model.poses(q, with_value(model, thermal__expansion=2e-5), warm(q)), larger, atol=1e-12)


def test_growing_link_equals_a_longer_link():
    """A link that grows by itself is one that was built longer."""
    plain = ErrorModel(load_robot("ur5"))
    model, q = thermal(plain, ("J2",)), positions(plain)
    assert model.effect_names[0] == "J2.expansion"
    longer = with_value(plain, J2__tx=-0.425 * 3e-5 * WARMTH)  # the lower arm points along −x of its frame
    warmed = model.poses(q, with_value(model, J2__expansion=3e-5), warm(q))
    np.testing.assert_allclose(warmed, plain.poses(q, longer), atol=1e-12)


def test_the_base_drifts_in_its_own_axes():
    plain = ErrorModel(load_robot("ur5"))
    model, q = thermal(plain), positions(plain)
    drift = np.array([1e-5, -2e-5, 3e-5, 2e-5, -1e-5, 3e-5])
    x = with_value(
        model, **{f"thermal__{c}": v for c, v in zip(("tx", "ty", "tz", "rx", "ry", "rz"), drift, strict=True)}
    )
    np.testing.assert_allclose(
        model.poses(q, x, warm(q)), se3.error_transform(drift * WARMTH) @ plain.poses(q), atol=1e-12
    )


@given(cases())
def test_columns_are_the_derivative_of_the_poses(case: Case):
    """Of every parameter, on robots of any structure, against central differences."""
    model = thermal(case.model)
    x = np.concatenate([case.x, np.random.default_rng(0).normal(size=7) * 2e-5])
    warmth = warm(case.q)
    at = model.walk(case.q, x, prepared=model.prepare(case.q, warmth))
    found = walk.columns(model.chain, at.s, at.e, model.layout(), at.factor, angular=True)
    for k in range(len(case.x), len(x)):
        step = np.eye(len(x))[k] * 1e-6
        ahead, behind = (model.poses(case.q, x + s, warmth) for s in (step, -step))
        moved = (ahead[:, :3, 3] - behind[:, :3, 3]) / 2e-6
        turned = se3.log(ahead[:, :3, :3] @ np.swapaxes(behind[:, :3, :3], 1, 2)) / 2e-6
        expected = np.concatenate([moved, turned], axis=1)
        np.testing.assert_allclose(found[:, :, k], expected, atol=1e-6 * max(1.0, np.abs(expected).max()))


def test_inverse_kinematics_leads_back_beside_other_effects():
    model = thermal(ErrorModel(load_robot("abb-irb6660-205-1.9")) + Compliance())
    q = positions(model)
    x = np.random.default_rng(1).normal(size=len(model)) * model.tolerances
    found = solve_near(model, model.poses(q, x), q + 0.01, x)
    assert found.reached.all()
    np.testing.assert_allclose(model.poses(found.q, x), model.poses(q, x), atol=1e-6)


def test_joints_that_cannot_be_meant_are_refused():
    robot = load_robot("abb-irb120")
    with pytest.raises(UnknownName, match="J9"):
        ErrorModel(robot) + Thermal(joints=("J9",))
    with pytest.raises(TaskcalError, match="behind J4 of abb-irb120 there is no length that could grow"):
        ErrorModel(robot) + Thermal(joints=("J2", "J4"))


def test_thermal_and_warm_up_exclude_each_other():
    """A model grows with the temperature or the time but not with both."""
    with pytest.raises(TaskcalError, match=r"two effects have a parameter 'thermal\.expansion'"):
        ErrorModel(load_robot("ur5")) + Thermal() + WarmUp()


def test_units_say_what_expansion_is_counted_by():
    robot = ErrorModel(load_robot("ur5"))
    for effect, units in ((Thermal(), ("µm/m/K", "µm/K", "µrad/K")), (WarmUp(), ("mm/m", "mm", "mrad"))):
        shown = {p.name: p.shown.name for p in (robot + effect).parameters}
        assert tuple(shown[f"thermal.{c}"] for c in ("expansion", "tx", "rx")) == units


def test_both_survive_their_description():
    grown = Thermal(joints=("J2", "J3"), tolerance=1e-5, reference=23.4)
    for effect in (grown, WarmUp(), WarmUp(time_constant=600.0, reference=5e3)):
        assert effect_from(json.loads(json.dumps(effect.to_json(), allow_nan=False))) == effect
