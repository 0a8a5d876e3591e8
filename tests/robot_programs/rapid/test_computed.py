"""Operators and functions whose value the text gives, after the reference manual."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Unresolved
from robot_programs.core.values import operated
from robot_programs.rapid.values import COMPUTED, OPERATORS, shifted


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
        (">=", [1.0, 2.0], False),
        ("<", [1.0, 2.0], True),
        ("=", [True, True], True),
        ("<>", [True, True], False),
        ("and", [True, False], False),
        ("or", [True, False], True),
        ("xor", [True, True], False),
        ("not", [False], True),
        ("-", [2.0], -2.0),
        ("+", [2.0], 2.0),
        ("+", [3.0, 2.0], 5.0),
        ("-", [3.0, 2.0], 1.0),
        ("*", [3.0, 2.0], 6.0),
        ("/", [3.0, 2.0], 1.5),
    ],
)
def test_operators(operator, values, result):
    made = operated(operator, values, OPERATORS)
    assert made == result
    assert type(made) is type(result)


@pytest.mark.parametrize(
    ("operator", "values"),
    [("/", [1.0, 0.0]), ("+", [1.0, True]), ("mod", [1.5, 1.0]), ("=", [1.0, "a"]), ("+", [True, True])],
)
def test_operands_that_do_not_fit(operator, values):
    with pytest.raises(Unresolved):
        operated(operator, values, OPERATORS)


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


def test_reltool_turns_about_x_then_the_new_y_then_the_new_z():
    target = ((0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 4, (9e9,) * 6)
    w, *xyz = COMPUTED["reltool"]([target, 0.0, 0.0, 0.0], {"rx": 20.0, "ry": -30.0, "rz": 40.0})[1]
    turned = Rotation.from_quat([*xyz, w])
    expected = Rotation.from_euler("XYZ", [20.0, -30.0, 40.0], degrees=True)
    np.testing.assert_allclose((turned * expected.inv()).magnitude(), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "by", "options", "words"),
    [
        ("offs", [1.0, 2.0], {}, "three distances"),
        ("offs", [1.0, 2.0, True], {}, "three distances"),
        ("offs", [1.0, 2.0, 1e9], {}, "out of any range"),
        ("offs", [1.0, 2.0, np.nan], {}, "out of any range"),
        ("offs", [1.0, 2.0, 3.0], {"rx": 1.0}, "no options"),
        ("reltool", [1.0, 2.0, 3.0], {"ra": 1.0}, "no option 'ra'"),
        ("reltool", [1.0, 2.0, 3.0], {"rx": np.inf}, "no finite angle"),
        ("reltool", [1.0, 2.0, 3.0], {"rx": True}, "no finite angle"),
    ],
)
def test_shifts_that_are_no_shifts_are_not_resolved(name, by, options, words):
    with pytest.raises(Unresolved, match=words):
        shifted(name, np.eye(4), by, options)
