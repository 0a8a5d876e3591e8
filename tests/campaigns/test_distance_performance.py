"""Distance performance after ISO 9283:1998, 7.3, against numbers worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.campaigns.performance import assess_distance
from taskcal.errors import CampaignError
from taskcal.geometry import se3

FIRST = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0]])
SECOND = np.array([[3.0, -4.0, 0], [3.0, -4.0, 0], [6.0, -8.0, 0]])


def test_a_table_worked_out_by_hand():
    # D = 5, 5, 10 for 5 commanded: mean 20/3, S² = (25/9 + 25/9 + 100/9) / 2 = 25/3
    found = assess_distance(FIRST, SECOND, np.zeros(3), np.array([5.0, 0.0, 0.0]))
    assert found.accuracy == pytest.approx(5 / 3)
    assert found.repeatability == pytest.approx(3 * np.sqrt(25 / 3))
    np.testing.assert_allclose(found.offset, [-1.0, 16 / 3, 0.0])  # |x| = 3, 3, 6 for 5; |y| = 4, 4, 8 for 0
    np.testing.assert_allclose(found.axis_repeatability, [3 * np.sqrt(3), 3 * np.sqrt(16 / 3), 0.0])
    assert found.summary()["RD_x_mm"] == pytest.approx(3000 * np.sqrt(3))


def test_a_single_cycle_has_no_repeatability():
    found = assess_distance(FIRST[:1], SECOND[:1], np.zeros(3), SECOND[0])
    assert list(found.summary()) == ["cycles", "AD_p_mm", "AD_x_mm", "AD_y_mm", "AD_z_mm"]
    with pytest.raises(CampaignError, match="at least one cycle"):
        assess_distance(FIRST[:0], SECOND[:0], np.zeros(3), SECOND[0])


@given(seed=st.integers(0, 10_000))
def test_measurements_need_no_frame_of_the_commands(seed):
    rng = np.random.default_rng(seed)
    first, second, commands = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=(2, 3))
    R, p = se3.exp(rng.normal(size=3)), rng.normal(size=3)
    here = assess_distance(first, second, *commands)
    there = assess_distance(first @ R.T + p, second @ R.T + p, *commands)
    assert there.accuracy == pytest.approx(here.accuracy)
    assert there.repeatability == pytest.approx(here.repeatability)
