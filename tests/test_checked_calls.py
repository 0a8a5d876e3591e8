"""Wrong shapes are found in every test, whatever earlier ones called, and later calls cost nothing."""

from collections.abc import Callable

import numpy as np
import pytest
from jaxtyping import Float, TypeCheckError

from taskcal.geometry import se3
from tests.checked_calls import CALLS, check_first_calls, count_anew


def called(times: int) -> tuple[list[bool], Callable[[int], int]]:
    """Whether each call of a function with a wrong argument was refused."""

    def double(value: int) -> int:
        return 2 * value

    checked = check_first_calls(double)
    return [refused(checked) for _ in range(times)], double


def refused(function: Callable[[int], int]) -> bool:
    try:
        function("three")  # pyright: ignore[reportArgumentType]
    except TypeCheckError:
        return True
    return False


@pytest.mark.parametrize("_time", range(2))
def test_the_package_is_checked_in_every_test_whatever_earlier_ones_called(_time: int) -> None:
    with pytest.raises(TypeCheckError, match="inverse"):
        se3.inverse(np.eye(3))
    for _ in range(CALLS):
        se3.inverse(np.eye(4))


def test_calls_are_checked_as_often_as_said() -> None:
    assert called(CALLS + 2)[0] == [True] * CALLS + [False] * 2


def test_a_function_within_a_function_is_counted_over_all_that_the_outer_one_makes() -> None:
    assert called(CALLS)[0] == [True] * CALLS
    again, inner = called(1)
    assert again == [False]
    assert check_first_calls(inner) is inner
    count_anew()
    assert called(1)[0] == [True]


def test_results_are_checked_too() -> None:
    def column(length: int) -> Float[np.ndarray, " length"]:
        return np.zeros((length, 1))

    with pytest.raises(TypeCheckError, match="return value"):
        check_first_calls(column)(3)
