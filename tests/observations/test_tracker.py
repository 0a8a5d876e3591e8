import numpy as np
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.observations.base import TrackerNoise
from tests.laws.robots import generators

NOISE = TrackerNoise(range_m=10e-6, range_per_m=1e-6, transverse_m=20e-6, transverse_per_m=8e-6, mpe_to_sigma=0.5)


@given(generators)
def test_tracker_covariance_rotates_with_point_about_station(rng):
    """Rotating the point about the station rotates its covariance."""
    R = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    points = rng.normal(size=(5, 3)) * 4
    turned = NOISE.covariance(points @ R.T)
    np.testing.assert_allclose(turned, R @ NOISE.covariance(points) @ R.T, rtol=1e-9, atol=1e-18)


@given(generators)
def test_moving_the_station_moves_the_noise_with_it(rng):
    station, points = rng.normal(size=3), rng.normal(size=(5, 3)) * 4
    moved = TrackerNoise(**{**vars(NOISE), "station": tuple(station.tolist())})
    np.testing.assert_allclose(moved.covariance(points + station), NOISE.covariance(points), rtol=1e-9, atol=1e-18)


def test_tracker_covariance_has_range_and_transverse_parts():
    """The uncertainty is that of the range along the beam and the transverse one across it."""
    covariance = NOISE.covariance(np.array([[0.0, 3.0, 0.0]]))[0]
    along, across = 0.5 * (10e-6 + 3 * 1e-6), 0.5 * (20e-6 + 3 * 8e-6)
    np.testing.assert_allclose(covariance, np.diag([across**2, along**2, across**2]))


def test_tracker_default_is_15_um_plus_6_um_per_m_at_k_2():
    """The default expanded uncertainty (k = 2) is 15 µm + 6 µm/m."""
    covariance = TrackerNoise().covariance(np.array([4.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), 0.5 * (15e-6 + 24e-6))


def test_lost_beam_has_no_covariance_and_station_a_finite_one():
    """A lost beam has no covariance, and a point at the station itself has a finite one."""
    assert np.isnan(NOISE.covariance(np.full((1, 3), np.nan))).all()
    np.testing.assert_allclose(np.diag(NOISE.covariance(np.zeros(3))), (0.5 * 20e-6) ** 2)
