"""The orientations from which a registration is searched."""

import numpy as np

from taskcal.measurement.registration_start import orientations


def test_the_search_starts_from_48_different_rotations():
    starts = np.array(orientations())
    np.testing.assert_allclose(np.linalg.det(starts), 1.0, rtol=1e-12)
    np.testing.assert_allclose(starts @ np.swapaxes(starts, 1, 2), np.broadcast_to(np.eye(3), starts.shape), atol=1e-12)
    apart = np.einsum("aij,bij->ab", starts, starts) - 4.0 * np.eye(len(starts))
    assert len(starts) == 48
    assert apart.max() < 2.99  # none twice
