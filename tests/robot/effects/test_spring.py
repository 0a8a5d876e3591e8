"""Gravity compensators: torque of a known spring, an ideal one of unknown size, and what they cannot be told from."""

import numpy as np
import pytest

from taskcal.analysis.identifiability import identifiability
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, Harmonics, Spring, effect_from
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws import robots, statics

SPRING = {
    "joint": "J2",
    "rate_n_mm": 60.0,
    "free_length_mm": 380.0,
    "crank_mm": 180.0,
    "anchor_mm": 520.0,
    "aligned_deg": 12.0,
}
NONE = np.zeros(3)


def described(name: str) -> dict:
    rng = np.random.default_rng(0)
    return robots.irb6660_description() if name == "parallelogram" else robots.industrial(rng)


def positions(name: str, count: int = 8) -> np.ndarray:
    rng = np.random.default_rng(1)
    return robots.irb6660_positions(rng, count) if name == "parallelogram" else robots.industrial_positions(rng, count)


@pytest.mark.parametrize("name", ["parallelogram", "industrial"])
def test_a_known_spring_turns_its_drive_by_its_torque(name):
    description, q = {**described(name), "spring": SPRING}, positions(name)
    weightless = {"mass_kg": 0.0, "centre_mm": [0.0, 0.0, 0.0]}
    empty = {**description, "joint": [{**joint, **weightless} for joint in description["joint"]]}
    model = ErrorModel(robot_from(description)) + Spring()
    assert model.effect_names == ("J2.spring",)
    x = np.zeros(len(model))
    x[-1] = 1e-6
    moved = model.poses(q, x)
    for row, T in zip(q, moved, strict=True):
        torque = statics.torques(empty, row, NONE)
        np.testing.assert_allclose(torque[[0, 2, 3, 4, 5]], 0.0, atol=1e-9)
        np.testing.assert_allclose(T, statics.tool_pose(empty, row, 1e-6 * torque), atol=1e-6)
    assert np.abs(moved - ErrorModel(model.robot).poses(q)).max() > 1e-4


def test_the_compliance_of_known_masses_yields_to_the_spring_too():
    rng = np.random.default_rng(2)
    description = {**statics.weighed(robots.industrial(rng), rng), "spring": SPRING}
    q = robots.industrial_positions(rng, 5)
    factor = Compliance().term(robot_from(description)).basis(q)
    for row, found in zip(q, factor, strict=True):
        np.testing.assert_allclose(found, statics.torques(description, row, NONE), atol=1e-8)


def test_unknown_spring_is_a_harmonic_of_a_plain_axis():
    """An ideal spring of unknown size is a harmonic of a plain axis."""
    model = ErrorModel(robot_from(described("industrial"))) + Harmonics(orders=(1,), joints=("J2",)) + Spring()
    assert model.effect_names == ("J2.cos1", "J2.sin1", "J2.spring_cos", "J2.spring_sin")
    found = identifiability(model, positions("industrial", 60))
    assert found.repeats["J2.spring_cos"] == ("J2.cos1", pytest.approx(1.0))
    assert found.repeats["J2.spring_sin"] == ("J2.sin1", pytest.approx(1.0))


def test_spring_of_a_parallelogram_is_no_harmonic():
    """Its drive turns the lower arm, and the forearm keeps its direction."""
    model = ErrorModel(robot_from(described("parallelogram"))) + Spring(joints=("J2",))
    q = positions("parallelogram")
    x = np.zeros(len(model))
    x[model.names.index("J2.spring_sin")] = 1e-4
    turned = q.copy()
    turned[:, 1] += 1e-4 * np.sin(q[:, 1] - np.pi / 2)
    np.testing.assert_allclose(model.poses(q, x), ErrorModel(model.robot).poses(turned), atol=1e-8)


def test_an_ideal_spring_is_the_known_one_without_free_length():
    description = {**described("industrial"), "spring": {**SPRING, "free_length_mm": 0.0}}
    q = positions("industrial", 40)
    known = Spring().term(robot_from(description)).basis(q)[:, 0]
    shapes = Spring().term(robot_from(described("industrial"))).basis(q)
    found = np.linalg.lstsq(shapes, known, rcond=None)[0]
    np.testing.assert_allclose(shapes @ found, known, atol=1e-9 * np.abs(known).max())


def test_springs_that_cannot_be():
    with pytest.raises(TaskcalError, match="spring is on J2, not on J3"):
        Spring(joints=("J3",)).term(robot_from({**described("industrial"), "spring": SPRING}))
    single = {"name": "one", "joint": [{"name": "J1"}]}
    with pytest.raises(TaskcalError, match="no second axis"):
        Spring().term(robot_from(single))
    slide = {"name": "gantry", "joint": [{"name": "x", "type": "prismatic"}, {"name": "y", "type": "prismatic"}]}
    with pytest.raises(TaskcalError, match="y of gantry slides"):
        Spring().term(robot_from(slide))
    assert effect_from(Spring(joints=("J2",)).to_json()) == Spring(joints=("J2",))
    assert Spring().term(load_robot("ur5")).names == ("J2.spring_cos", "J2.spring_sin")
