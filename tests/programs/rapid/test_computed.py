"""Operators and functions whose value the text gives, after the reference manual."""

import numpy as np
import pytest

from taskcal.programs.rapid.computed import operated
from taskcal.programs.rapid.functions import COMPUTED
from taskcal.programs.unresolved import Unresolved


@pytest.mark.parametrize(
    ("operator", "values", "result"),
    [
        ("div", [7.0, 2.0], 3.0),
        ("div", [-7.0, 2.0], -3.0),
        ("mod", [-7.0, 2.0], -1.0),
        ("=", ["a", "a"], True),
        ("<>", [1.0, 2.0], True),
        ("<=", [2.0, 2.0], True),
        (">", [1.0, 2.0], False),
        ("and", [True, False], False),
        ("xor", [True, True], False),
        ("not", [False], True),
        ("-", [2.0], -2.0),
    ],
)
def test_operators(operator, values, result):
    made = operated(operator, values)
    assert made == result
    assert type(made) is type(result)


@pytest.mark.parametrize(
    ("operator", "values"), [("/", [1.0, 0.0]), ("+", [1.0, True]), ("mod", [1.5, 1.0]), ("=", [1.0, "a"])]
)
def test_operands_that_do_not_fit(operator, values):
    with pytest.raises(Unresolved):
        operated(operator, values)


def test_dim_counts_elements():
    array = tuple(tuple(float(k) for k in range(4)) for _ in range(3))
    assert [COMPUTED["dim"]([array, float(k)], {}) for k in (1, 2)] == [3.0, 4.0]
    with pytest.raises(Unresolved):
        COMPUTED["dim"]([array, 3.0], {})


def test_reltool_shifts_along_the_tool_and_offs_along_the_part():
    half = np.sqrt(0.5)
    target = ((100.0, 0.0, 0.0), (half, 0.0, half, 0.0), (0.0,) * 4, (9e9,) * 6)  # z of the tool is x of the part
    along_tool = COMPUTED["reltool"]([target, 0.0, 0.0, 5.0], {})
    along_part = COMPUTED["offs"]([target, 0.0, 0.0, 5.0], {})
    np.testing.assert_allclose(along_tool[0], [105, 0, 0], atol=1e-9)
    np.testing.assert_allclose(along_part[0], [100, 0, 5], atol=1e-9)
