"""Any transform as elementary steps of a robot file."""

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.robot.importers.urdf import steps_of
from tests.laws import plain
from tests.laws.chains import rigid
from tests.laws.robots import generators


def product(steps) -> np.ndarray:
    T = np.eye(4)
    for step in steps:
        key, value = next((key, value) for key, value in step.items() if key != "symbol")
        axis = "xyz".index(key[1])
        T = T @ (plain.shift(axis, value * 1e-3) if key[0] == "t" else plain.turn(axis, np.radians(value)))
    return T


@given(generators)
def test_the_product_of_the_steps_is_the_transform(rng: np.random.Generator) -> None:
    T = rigid(rng)
    np.testing.assert_allclose(product(steps_of(T)), T, atol=1e-12)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_the_product_is_the_transform_where_z_and_x_line_up(pitch: float) -> None:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", [30.0, pitch, 20.0], degrees=True).as_matrix()
    np.testing.assert_allclose(product(steps_of(T)), T, atol=1e-12)


def test_what_does_not_move_is_left_out_and_lengths_have_symbols() -> None:
    T = np.eye(4)
    assert steps_of(T) == []
    T[2, 3] = 0.25
    assert steps_of(T, "4") == [{"tz_mm": 250.0, "symbol": "z4"}]
