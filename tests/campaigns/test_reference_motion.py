import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.campaigns.drift import observe_reference_points

NESTS = np.array([[2.48, 0.55, -0.56], [2.91, 0.83, -0.56], [2.78, -0.01, -0.56], [2.6, 0.2, -0.3]])


def moved(rng, n, count, turn=1e-4, shift=1e-4, noise=0.0):
    """Reference points of a body that moves anew in every row, and its motions."""
    R = Rotation.from_rotvec(rng.normal(scale=turn, size=(n, 3)))
    shifts = rng.normal(scale=shift, size=(n, 3))
    places = NESTS[:count]
    centre = places.mean(axis=0)
    points = np.stack([R.apply(np.tile(p - centre, (n, 1))) + centre + shifts for p in places], axis=1)
    points += rng.normal(size=points.shape) * noise
    return {f"base{i + 1}": points[:, i] for i in range(count)}, shifts, R.as_rotvec()


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.parametrize("size", [1e-4, 0.3])
def test_a_rigid_motion_is_found_whatever_its_size(count, size):
    """Up to one motion that all rows have in common, by which the usual places are unknown."""
    reference_points, _, _ = moved(np.random.default_rng(0), 30, count, turn=size, shift=size)
    found = observe_reference_points(reference_points)
    assert found.rigid
    assert found.noise == pytest.approx(0.0, abs=1e-9 if size < 0.1 else 1e-5)
    assert not found.lost.any()


@pytest.mark.parametrize("count", [3, 4])
def test_small_motions_are_told_up_to_their_noise(count):
    rng = np.random.default_rng(1)
    noise = 3e-6
    reference_points, shifts, turns = moved(rng, 400, count, noise=noise)
    found = observe_reference_points(reference_points)
    assert found.noise == pytest.approx(noise, rel=0.06)
    truth = np.concatenate([(shifts - shifts.mean(0)) @ found.axes, (turns - turns.mean(0)) @ found.axes], axis=1)
    error = found.values - found.values.mean(axis=0) - truth
    np.testing.assert_allclose(error.std(axis=0), noise * np.sqrt(found.per_noise[0]), rtol=0.12)


def test_collinear_references_tell_translations_alone():
    rng = np.random.default_rng(2)
    two, shifts, _ = moved(rng, 200, 2, turn=0.0, noise=3e-6)
    line = {
        f"base{i}": np.array([1.0 + i, 2.0, 0.5]) + shifts + rng.normal(scale=3e-6, size=(200, 3)) for i in range(3)
    }
    for reference_points in (two, line):
        found = observe_reference_points(reference_points)
        assert not found.rigid
        assert found.noise == pytest.approx(3e-6, rel=0.12)
        np.testing.assert_allclose(
            found.values - found.values.mean(0), shifts - shifts.mean(0), atol=5 * 3e-6 / np.sqrt(len(reference_points))
        )


def test_a_single_reference_point_does_not_tell_its_noise():
    reference_points, shifts, _ = moved(np.random.default_rng(3), 50, 1, turn=0.0)
    found = observe_reference_points(reference_points)
    assert found.noise is None
    np.testing.assert_allclose(found.values - found.values.mean(0), shifts - shifts.mean(0), atol=1e-12)


def test_misplaced_reference_is_lost_a_jump_of_all_is_not():
    rng = np.random.default_rng(4)
    reference_points, _, _ = moved(rng, 100, 3, noise=3e-6)
    for name in reference_points:
        reference_points[name][90:] += 5e-3
    reference_points["base3"][[10, 40]] += [0.3, 0.0, 0.1]
    reference_points["base1"][7] = np.nan
    found = observe_reference_points(reference_points)
    assert [tuple(i) for i in np.argwhere(found.lost)] == [(10, 2), (40, 2)]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.values[:, 0])), [7, 10, 40])


def test_of_four_reference_points_one_may_be_lost():
    rng = np.random.default_rng(5)
    reference_points, _, _ = moved(rng, 100, 4, noise=3e-6)
    whole = observe_reference_points(reference_points)
    reference_points["base4"][20:30] = np.nan
    found = observe_reference_points(reference_points)
    assert np.isfinite(found.values).all()
    assert (found.per_noise[20:30] > found.per_noise[0]).all()
    np.testing.assert_allclose(found.values, whole.values, atol=5e-5)
