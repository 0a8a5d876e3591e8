"""A value has the digits that its uncertainty leaves, and its interval has the same."""

import pytest

from taskcal.report.content import COVERAGE, decimals_of, signed, with_interval


@pytest.mark.parametrize(
    ("uncertainty", "decimals"), [(0.012, 3), (0.5, 2), (0.0996, 3), (3.0, 1), (250.0, 0), (0.0, 4), (float("nan"), 4)]
)
def test_two_digits_of_the_uncertainty_are_stated(uncertainty: float, decimals: int) -> None:
    assert decimals_of(uncertainty) == decimals


@pytest.mark.parametrize(("value", "uncertainty"), [(0.1234567, 0.012), (-12.3, 0.4), (0.0, 1e-5), (1e4, 33.0)])
def test_value_and_interval_say_what_they_are_of(value: float, uncertainty: float) -> None:
    best, interval = (text.replace("−", "-") for text in with_interval(value, uncertainty))
    low, high = map(float, interval.split(" to "))
    half = 0.5 * 10.0 ** -decimals_of(uncertainty)
    assert float(best) == pytest.approx(value, abs=1.001 * half)
    assert low == pytest.approx(value - COVERAGE * uncertainty, abs=1.001 * half)
    assert high == pytest.approx(value + COVERAGE * uncertainty, abs=1.001 * half)
    assert {len(part.partition(".")[2]) for part in (best, str(interval.split()[0]))} == {decimals_of(uncertainty)}


def test_nothing_has_no_sign() -> None:
    assert [signed(value, 2) for value in (-0.001, 0.0, 0.001, -0.01)] == ["0.00", "0.00", "0.00", "−0.01"]
