import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.rapid.values import quaternion_texts, real


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-1e-9, "0"), (-0.0, "0"), (600.0, "600"), (0.1, "0.1"), (1711.03125, "1711.0312"), (-12.34567, "-12.34567"),
     (9e9, "9E+09"), (1e6, "1000000"), (0.00002, "0.00002")],
)  # fmt: skip
def test_numbers_by_hand(value, text):
    assert real(value, 5) == text


@given(st.floats(-1e6, 1e6))
def test_the_text_gives_the_single_precision_value_back(value):
    text = real(value, 6)
    assert np.float32(text) == np.float32(round(value, 6))
    assert len(text.strip("-0.").replace(".", "")) <= 9


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_quaternions_stay_of_unit_length(q):
    unit = np.array(q) / np.linalg.norm(q)
    written = np.array([float(text) for text in quaternion_texts(tuple(unit))])
    np.testing.assert_allclose(written, unit, atol=1.2e-7)
    assert abs(np.linalg.norm(written) - 1.0) < 6.1e-8
