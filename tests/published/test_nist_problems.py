"""The solver on problems whose answers are certified to eleven digits, from the far start and from the near one.

It ends where the objective no longer falls, some 10⁻⁶ of a standard deviation from the minimum. Where the curvature of the
model slows it down, MGH09 and Thurber, that leaves seven digits of a parameter; the sum of squares has ten everywhere.
"""

import numpy as np
import pytest

from taskcal.estimation.least_squares import Stopping, fit
from tests.laws import plain
from tests.published.nist_problems import PROBLEMS


def equations_of(problem):
    """Cost, gradient and information by complex steps; no number where the model has none."""

    def at(b):
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            r = (problem.y - problem.model(b, problem.x)) / problem.sigma
            J = plain.derivatives(lambda z: problem.model(z, problem.x), b) / problem.sigma
            return 0.5 * float(r @ r), J.T @ r, J.T @ J

    return at


@pytest.mark.parametrize("start", [0, 1], ids=["far", "near"])
@pytest.mark.parametrize("name", PROBLEMS)
def test_the_certified_answer_is_found(name, start):
    problem = PROBLEMS[name]
    first = np.array(problem.starts[start])
    p = len(first)
    found = fit(
        equations_of(problem), first, first, np.zeros((p, p)), np.abs(first), Stopping(decrement=1e-20, iterations=1000)
    )
    assert found.converged, found.reason
    np.testing.assert_allclose(2.0 * found.cost * problem.sigma**2, problem.squares, rtol=1e-10)
    np.testing.assert_allclose(found.z, problem.parameters, rtol=3e-7)
    assert (np.abs(found.z - problem.parameters) < 1e-5 * problem.deviations).all()
    size = np.sqrt(np.diag(found.information))
    deviations = np.sqrt(np.diag(np.linalg.inv(found.information / np.outer(size, size)))) / size
    np.testing.assert_allclose(deviations, problem.deviations, rtol=1e-6)
