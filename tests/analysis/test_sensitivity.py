"""What a parameter does to the TCP, against poses of robots that have it."""

import numpy as np
from hypothesis import given, settings

from taskcal.analysis.sensitivity import sensitivity
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import generators, industrial, industrial_positions


@settings(max_examples=5)
@given(generators)
def test_influences_are_how_far_a_parameter_moves_the_tcp(rng):
    """For one unit as shown, and for the tolerance: the largest on each axis and in space, and the root mean square."""
    model = ErrorModel(robot_from(industrial(rng)))
    q = industrial_positions(rng, 12)
    found = sensitivity(model, q).columns()
    units = np.array([1.0 / p.shown.factor for p in model.parameters])  # 1 mm and 1 mrad in metres and radians
    for size, scale, (x, y, z, space) in (
        (units, 1e3, ("max_x", "max_y", "max_z", "max_space")),
        (model.tolerances, 1e6, ("max_x_um", "max_y_um", "max_z_um", "max_space_um")),
    ):
        moved = np.stack([_moved(model, q, k, size[k]) for k in range(len(model))], axis=2) * scale
        np.testing.assert_allclose([found[x], found[y], found[z]], np.abs(moved).max(axis=0), rtol=1e-5, atol=1e-6)
        length = np.linalg.norm(moved, axis=1)
        np.testing.assert_allclose(found[space], length.max(axis=0), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found["rms_space_um"], np.sqrt((length**2).mean(axis=0)), rtol=1e-5, atol=1e-6)
    assert found["parameter"] == model.names
    per_axis = sensitivity(model, q).rms_per_axis(scaled=True) * 1e6
    np.testing.assert_allclose(per_axis, np.sqrt((moved**2).mean(axis=0)), rtol=1e-5, atol=1e-6)


def _moved(model, q, k, size):
    """Displacement of the TCP by one parameter of this size, to first order, metres."""
    h = 1e-3 * size * np.eye(len(model))[k]
    return (model.poses(q, h) - model.poses(q, -h))[:, :3, 3] / 2e-3
