"""Parameters that others nearly repeat: against columns made for it, regressions, and robots."""

import numpy as np
import pytest

from taskcal.analysis.identifiability import find_collinearities, identifiability
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, Coupling, Harmonics
from taskcal.robot.error_model import ErrorModel

NAMES = ("a", "b", "c", "d", "e", "f")


def columns(rng: np.random.Generator, noise: float) -> np.ndarray:
    """Six columns of unlike length of which the fifth is 3·a − 20·c with a share of noise, and the last one zero."""
    matrix = np.linalg.qr(rng.normal(size=(40, 6)))[0] * [1.0, 30.0, 0.1, 5.0, 1.0, 0.0]
    own = matrix[:, 4].copy()
    matrix[:, 4] = 3.0 * matrix[:, 0] - 20.0 * matrix[:, 2]
    matrix[:, 4] += noise * np.linalg.norm(matrix[:, 4]) * own
    return matrix


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_collinearity_finds_coefficients_and_share(noise):
    """A combination is found with its coefficients and its share."""
    (found,) = find_collinearities(columns(np.random.default_rng(0), noise), NAMES, ["b", "d", "e", "f"])
    assert (found.name, list(found.by)) == ("e", ["a", "c"])
    assert found.by == pytest.approx({"a": 3.0, "c": -20.0})
    assert found.share == pytest.approx(1.0 / (1.0 + noise**2))
    assert found.inflation == pytest.approx(1.0 + 1.0 / noise**2 if noise else np.inf)


def test_what_is_left_over_the_level_is_not_near():
    matrix = columns(np.random.default_rng(0), 0.2)
    assert find_collinearities(matrix, NAMES, NAMES) == ()
    assert [found.name for found in find_collinearities(matrix, NAMES, ["e"], level=0.95)] == ["e"]
    assert find_collinearities(columns(np.random.default_rng(0), 0.0), NAMES, ["e"], against=["a", "b"]) == ()


def test_inflation_is_that_of_a_regression_on_all_others():
    matrix = np.random.default_rng(1).normal(size=(9, 5))
    matrix[:, 4] = matrix[:, 0] + 0.05 * matrix[:, 4]
    found = {near.name: near for near in find_collinearities(matrix, NAMES[:5], NAMES[:5])}
    assert set(found) == {"a", "e"}
    for k in (0, 4):
        others = np.delete(matrix, k, axis=1)
        left = matrix[:, k] - others @ np.linalg.lstsq(others, matrix[:, k], rcond=None)[0]
        expected = (matrix[:, k] @ matrix[:, k]) / (left @ left)
        assert found[NAMES[k]].inflation == pytest.approx(expected, rel=1e-6)


def test_exact_repeat_has_infinite_inflation():
    """An exact repeat has no finite inflation and leaves that of others alone."""
    matrix = np.random.default_rng(2).normal(size=(9, 4))
    matrix[:, 3] = -2.0 * matrix[:, 0]
    matrix[:, 2] = matrix[:, 1] + 0.05 * matrix[:, 2]
    found = {near.name: near for near in find_collinearities(matrix, NAMES[:4], NAMES[:4])}
    assert (found["d"].share, found["d"].inflation, found["d"].by) == (
        pytest.approx(1.0),
        np.inf,
        {"a": pytest.approx(-2.0)},
    )
    assert 100 < found["b"].inflation < 1e5


def test_small_workspace_makes_effects_repeat_offsets():
    """In a small workspace effects repeat offsets and over a large one they do not."""
    model = ErrorModel(load_robot("abb-irb120")) + Harmonics(orders=(1,)) + Compliance() + Coupling()
    rng = np.random.default_rng(0)
    small = identifiability(model, rng.uniform(-0.15, 0.15, (80, 6)), frames=True)
    large = identifiability(model, rng.uniform(-1.5, 1.5, (80, 6)) * [1, 1, 0.6, 1, 1, 1], frames=True)
    geometry = [name for name in small.names if name not in model.effect_names]
    near = {found.name: found for found in small.collinear(model.effect_names, against=geometry)}
    assert near["J1.cos1"].by == pytest.approx({"J1.rz": 1.0}, abs=0.01)
    assert near["J2.sin1"].by == pytest.approx({"J1.ry": -1.0}, abs=0.01)
    assert near["J3.sag_J6"].by.keys() == {"J3.rz"}
    assert all(found.inflation > 100 for found in near.values())
    assert large.collinear(model.effect_names, against=geometry) == ()


def test_gravity_of_an_upright_arm_is_a_harmonic():
    """The upper arm of the IRB 120 is 0.27 m long: what hangs on its end pulls with a lever of 0.27·cos of its angle."""
    model = ErrorModel(load_robot("abb-irb120")) + Harmonics(orders=(1,)) + Compliance(joints=("J2",))
    rng = np.random.default_rng(0)
    found = identifiability(model, rng.uniform(-1.5, 1.5, (80, 6)) * [1, 1, 0.6, 1, 1, 1])
    assert found.dependent["J2.sag_J3"] == pytest.approx({"J2.cos1": 0.27})
    (exact,) = found.collinear(["J2.sag_J3"])
    assert (exact.share, exact.inflation, exact.by) == (pytest.approx(1.0), np.inf, pytest.approx({"J2.cos1": 0.27}))
