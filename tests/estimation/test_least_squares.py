import numpy as np
import pytest
import scipy.optimize
from hypothesis import given

from taskcal.estimation.least_squares import Ended, Stopping, fit
from tests.laws.robots import generators


class Curve:
    """A smooth nonlinear model with whitened residuals r = y − f(z), and a prior."""

    def __init__(self, rng, p=4, rows=60):
        self.A, self.B = rng.normal(size=(2, rows, p))
        self.mean = rng.normal(scale=0.1, size=p)
        root = rng.normal(size=(p, p)) + 2 * np.eye(p)
        self.precision = 0.1 * root.T @ root
        self.y = self.predict(self.mean + rng.normal(scale=0.3, size=p)) + rng.normal(scale=0.5, size=rows)

    def predict(self, z):
        return self.A @ z + np.sin(self.B @ z)

    def derivative(self, z):
        return self.A + np.cos(self.B @ z)[:, None] * self.B

    def equations(self, z):
        r, J = self.y - self.predict(z), self.derivative(z)
        return 0.5 * float(r @ r), J.T @ r, J.T @ J


def converge(problem):
    p = len(problem.mean)
    found = fit(problem.equations, problem.mean, problem.mean, problem.precision, np.ones(p), Stopping(decrement=1e-20))
    assert found.converged, found.reason
    return found


@given(generators)
def test_fit_agrees_with_scipy_least_squares(rng):
    """The fit agrees with SciPy's least squares with the prior as additional rows."""
    problem = Curve(rng)
    L = np.linalg.cholesky(problem.precision).T
    reference = scipy.optimize.least_squares(
        lambda z: np.concatenate([problem.y - problem.predict(z), L @ (z - problem.mean)]),
        problem.mean,
        jac=lambda z: np.concatenate([-problem.derivative(z), L]),
        method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    found = converge(problem)
    # both go downhill from the same start; the valley is wide enough to be one
    np.testing.assert_allclose(found.objective, reference.cost, rtol=1e-12)
    np.testing.assert_allclose(found.z, reference.x, rtol=1e-7, atol=1e-8)
    J = problem.derivative(found.z)
    np.testing.assert_allclose(found.information, J.T @ J, rtol=1e-12, atol=1e-10)
    r = problem.y - problem.predict(found.z)
    np.testing.assert_allclose(found.cost, 0.5 * r @ r, rtol=1e-12)


@given(generators)
def test_direction_without_data_or_prior_keeps_start_value(rng):
    """A direction without data and prior keeps its start value."""
    A = rng.normal(size=(30, 2)) @ rng.normal(size=(2, 4))  # rank 2 of 4
    y = rng.normal(size=30)
    start = rng.normal(size=4)

    def equations(z):
        r = y - A @ z
        return 0.5 * r @ r, A.T @ r, A.T @ A

    found = fit(equations, start, start, np.zeros((4, 4)), np.ones(4), Stopping(decrement=1e-10), damping=1e-2)
    null = np.linalg.svd(A)[2][2:]
    np.testing.assert_allclose(null @ (found.z - start), 0.0, atol=1e-6)
    best = np.linalg.lstsq(A, y, rcond=None)[0]
    np.testing.assert_allclose(A @ found.z, A @ best, atol=1e-4 * np.abs(y).max())


def test_a_fit_that_runs_out_of_iterations_says_so():
    problem = Curve(np.random.default_rng(0))
    p = len(problem.mean)
    found = fit(problem.equations, problem.mean, problem.mean, problem.precision, np.ones(p), Stopping(iterations=1))
    assert not found.converged
    assert (found.ended, found.converged) == (Ended.TOO_MANY_ITERATIONS, False)
    assert found.reason == "no convergence in 1 iterations"


def test_a_fit_stops_at_the_decrease_asked_for():
    problem = Curve(np.random.default_rng(0))
    arguments = problem.equations, problem.mean, problem.mean, problem.precision, np.ones(len(problem.mean))
    loose, tight = fit(*arguments, Stopping(decrease=0.5)), fit(*arguments, Stopping(decrement=1e-20))
    assert loose.converged
    assert (loose.ended, loose.converged) == (Ended.HARDLY_FALLS, True)
    assert loose.reason == "the fit improved by less than 0.5 of itself"
    assert loose.iterations < tight.iterations


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_stopping_is_invariant_to_objective_unit(factor):
    """The iteration at which a fit stops does not depend on the unit of its objective."""
    problem = Curve(np.random.default_rng(0))
    equations, precision = problem.equations, factor * problem.precision

    def scaled(z):
        return tuple(factor * part for part in equations(z))

    stopping = Stopping(decrement=0.0, decrease=1e-2)
    found = fit(scaled, problem.mean, problem.mean, precision, np.ones(len(problem.mean)), stopping)
    assert (found.ended, found.iterations) == (Ended.HARDLY_FALLS, 3)
