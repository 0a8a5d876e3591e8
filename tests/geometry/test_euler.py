import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.geometry.euler import ANGLES, from_angles, to_angles
from tests.laws.plain import product, turn
from tests.laws.robots import generators


@pytest.mark.parametrize("form", ANGLES)
def test_angles_of_a_rotation_give_it_back(form):
    @given(generators)
    def law(rng):
        R = Rotation.from_quat(rng.normal(size=(5, 4))).as_matrix()
        np.testing.assert_allclose(from_angles(form, to_angles(form, R)), R, atol=1e-14)

    law()


def test_each_form_is_the_product_that_its_maker_writes():
    """KUKA: A about z, B about the new y, C about the newest x. FANUC and URDF: about fixed axes, x first."""
    x, y, z = 0.3, -0.5, 1.1
    R = product([turn(2, z), turn(1, y), turn(0, x)])[:3, :3]
    np.testing.assert_allclose(from_angles("abc", np.array([z, y, x])), R, atol=1e-15)
    np.testing.assert_allclose(from_angles("rpy", np.array([x, y, z])), R, atol=1e-15)
    np.testing.assert_allclose(from_angles("wpr", np.array([x, y, z])), R, atol=1e-15)


@pytest.mark.parametrize("pitch", [90.0, -90.0, 89.9999999])
@pytest.mark.parametrize("form", ANGLES)
def test_where_two_axes_line_up_the_rotation_is_still_given_back(form, pitch):
    R = Rotation.from_euler("ZYX", [20.0, pitch, 50.0], degrees=True).as_matrix()
    np.testing.assert_allclose(from_angles(form, to_angles(form, R)), R, atol=2e-9)
