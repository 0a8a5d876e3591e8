"""Wrong shapes are found in every test, wrong results in every file, whatever was called before, and later calls cost nothing."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from jaxtyping import Float, TypeCheckError

from taskcal.geometry import se3
from tests.checked_calls import CALLS, begin_test, check_first_calls


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
def test_types_are_checked_in_every_test_despite_earlier_calls(_time: int) -> None:
    """The package is type-checked in every test, whatever earlier tests called."""
    with pytest.raises(TypeCheckError, match="inverse"):
        se3.inverse(np.eye(3))
    for _ in range(CALLS):
        se3.inverse(np.eye(4))


def test_calls_are_checked_as_often_as_said() -> None:
    assert called(CALLS + 2)[0] == [True] * CALLS + [False] * 2


def test_nested_function_checks_are_counted_over_all_copies() -> None:
    """Calls of a nested function are counted over all copies that the outer function makes."""
    assert called(CALLS)[0] == [True] * CALLS
    again, inner = called(1)
    assert again == [False]
    assert check_first_calls(inner) is inner
    begin_test(__file__)
    assert called(1)[0] == [True]


def test_results_are_checked_too() -> None:
    def column(length: int) -> Float[np.ndarray, " length"]:
        return np.zeros((length, 1))

    with pytest.raises(TypeCheckError, match="return"):
        check_first_calls(column)(3)


def test_nested_functions_run_own_code_with_shared_check() -> None:
    """Each copy of a nested function runs its own code although the copies share a check."""

    def adding(number: int) -> Callable[[int, int], int]:
        def add(times: int, value: int) -> int:
            return number + (adding(10 * number)(times - 1, value) if times else value)

        return check_first_calls(add)

    one, two = adding(1), adding(2)
    assert [one(0, 5), two(0, 5), one(0, 5)] == [6, 7, 6]
    assert one(2, 5) == 1 + 10 + 100 + 5
    assert refused(lambda value: one(0, value))


def test_a_length_is_the_same_in_all_arguments_and_in_the_result() -> None:
    def joined(a: Float[np.ndarray, " n"], b: Float[np.ndarray, " n"]) -> Float[np.ndarray, "2 n"]:
        return np.stack([a, b[: len(a)]])[:, : len(b) - 1 if b[0] else None]

    checked = check_first_calls(joined)
    assert checked(np.zeros(3), np.zeros(3)).shape == (2, 3)
    assert checked(np.zeros(4), np.zeros(4)).shape == (2, 4)
    with pytest.raises(TypeCheckError, match="parameter b"):
        checked(np.zeros(3), np.zeros(4))
    begin_test("another file")
    with pytest.raises(TypeCheckError, match="return"):
        checked(np.ones(3), np.ones(3))


def test_every_construction_of_a_dataclass_is_checked() -> None:
    @check_first_calls
    @dataclass(frozen=True)
    class Pair:
        a: Float[np.ndarray, " n"]
        b: Float[np.ndarray, " n"]

    for _ in range(CALLS + 2):
        Pair(np.zeros(2), np.zeros(2))
        with pytest.raises(TypeCheckError, match="parameter b"):
            Pair(np.zeros(2), np.zeros(3))
