"""Operators and functions whose value the text gives, after the reference manual, against SciPy's rotations."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Unresolved
from robot_programs.core.source import Source
from robot_programs.core.values import operated
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.values import COMPUTED, OPERATORS, shifted
from tests.laws.robots import generators


def random_pose(rng: np.random.Generator) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Millimetres, and a quaternion with its scalar first."""
    x, y, z, w = Rotation.random(rng=rng).as_quat()
    return tuple(map(float, rng.uniform(-900, 900, 3))), (float(w), float(x), float(y), float(z))


def matrix(pose) -> np.ndarray:
    (x, y, z), (w, i, j, k) = pose
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_quat([i, j, k, w]).as_matrix(), (x, y, z)
    return T


@given(generators)
def test_poses_multiply_as_their_matrices_do(rng):
    a, b, point = random_pose(rng), random_pose(rng), tuple(map(float, rng.uniform(-900, 900, 3)))
    np.testing.assert_allclose(matrix(COMPUTED["posemult"]([a, b], {})), matrix(a) @ matrix(b), atol=1e-9)
    np.testing.assert_allclose(matrix(COMPUTED["poseinv"]([a], {})), np.linalg.inv(matrix(a)), atol=1e-9)
    np.testing.assert_allclose(COMPUTED["posevect"]([a, point], {}), (matrix(a) @ [*point, 1.0])[:3], atol=1e-9)


@given(generators)
def test_orient_zyx_turns_about_z_then_y_then_x(rng):
    """Angles about z the new y and the new x make an orientation."""
    z, y, x = (float(v) for v in rng.uniform(-360, 360, 3))
    w, i, j, k = COMPUTED["orientzyx"]([z, y, x], {})
    np.testing.assert_allclose(
        Rotation.from_quat([i, j, k, w]).as_matrix(),
        Rotation.from_euler("ZYX", [z, y, x], degrees=True).as_matrix(),
        atol=1e-12,
    )


def test_turning_routine_is_followed_into_its_calls():
    """As pick and place programs have it."""
    text = (
        "MODULE M\nCONST robtarget a:=[[100,0,60],[0,1,0,0],[-1,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        "PROC main()\nput a,30;\nENDPROC\nPROC put(robtarget p,num angle)\np.rot:=OrientZYX(-angle,0,180);\n"
        "p.trans.x:=p.trans.x*Cos(angle);\nMoveL Offs(p,0,0,20),v100,fine,tool0;\nENDPROC\nENDMODULE\n"
    )
    (move,) = read_rapid([Source(path=Path("M.mod"), text=text, encoding="utf-8")]).motions
    np.testing.assert_allclose(move.end.T[:3, 3], [0.1 * np.cos(np.radians(30)), 0.0, 0.08], atol=1e-12)
    expected = Rotation.from_euler("ZYX", [-30, 0, 180], degrees=True).as_matrix()
    np.testing.assert_allclose(move.end.T[:3, :3], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "given", "options", "value"),
    [
        ("sin", [30.0], {}, 0.5),
        ("cos", [60.0], {}, 0.5),
        ("tan", [45.0], {}, 1.0),
        ("asin", [0.5], {}, 30.0),
        ("acos", [0.5], {}, 60.0),
        ("atan", [1.0], {}, 45.0),
        ("atan2", [1.0, -1.0], {}, 135.0),
        ("abs", [-2.5], {}, 2.5),
        ("sqrt", [2.25], {}, 1.5),
        ("pow", [2.0, 3.0], {}, 8.0),
        ("round", [0.3852138], {"dec": 3.0}, 0.385),
        ("round", [-1.7], {}, -2.0),
        ("trunc", [0.3852138], {"dec": 3.0}, 0.385),
        ("trunc", [-1.7], {}, -1.0),
        ("distance", [(0.0, 0.0, 0.0), (3.0, 4.0, 0.0)], {}, 5.0),
        ("vectmagn", [(3.0, 4.0, 0.0)], {}, 5.0),
        ("dotprod", [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)], {}, 32.0),
    ],
)
def test_functions_of_numbers(name, given, options, value):
    assert COMPUTED[name](given, options) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "given", "options"),
    [
        ("sqrt", [-1.0], {}),
        ("acos", [1.1], {}),
        ("pow", [0.0, -1.0], {}),
        ("sin", [True], {}),
        ("sin", [1.0], {"rx": 1.0}),
        ("round", [2.5], {}),  # halfway, which the controller may round either way
        ("round", [2.4], {"dec": 7.0}),
        ("trunc", [2.9999999999], {}),
        ("posemult", [((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))], {}),
        ("orientzyx", [1.0, 2.0], {}),
    ],
)
def test_what_has_no_value_or_is_not_certain(name, given, options):
    with pytest.raises(Unresolved):
        COMPUTED[name](given, options)


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
