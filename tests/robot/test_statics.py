"""The torque of a coil spring: by hand, from its energy, and in the ideal case a sine."""

import numpy as np
import pytest

from taskcal.robot.statics import CoilSpring


def spring(**changed) -> CoilSpring:
    return CoilSpring(
        **{"joint": 1, "rate": 1000.0, "free_length": 0.1, "crank": 0.3, "anchor": 0.4, "aligned": 0.0, **changed}
    )


def test_torque_by_hand():
    """Crank and anchor square to each other: 0.5 m long, 400 N, with a lever of 0.3·0.4/0.5 = 0.24 m."""
    assert spring().torque(np.array([np.pi / 2, -np.pi / 2, 0.0])) == pytest.approx([-96.0, 96.0, 0.0])
    assert spring(aligned=0.3).torque(np.array([np.pi / 2 + 0.3])) == pytest.approx([-96.0])


def test_torque_is_the_slope_of_the_energy():
    phi, bar, h = np.linspace(-3, 3, 50), spring(rate=7e4, free_length=0.45), 1e-6

    def energy(turn):
        length = np.hypot(0.4 - 0.3 * np.cos(turn), 0.3 * np.sin(turn))
        return 0.5 * 7e4 * (length - 0.45) ** 2

    np.testing.assert_allclose(bar.torque(phi), -(energy(phi + h) - energy(phi - h)) / (2 * h), atol=1e-4)


def test_a_spring_of_no_free_length_is_a_sine():
    phi = np.linspace(-3, 3, 50)
    np.testing.assert_allclose(spring(free_length=0.0).torque(phi), -120.0 * np.sin(phi), atol=1e-10)
