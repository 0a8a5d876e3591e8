"""One fit of 60 poses, 45 parameters, tracker frame and target, against SciPy's least squares; all effects, against that fit."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares

from taskcal.estimation.group_variances import GroupEquations, Groups
from taskcal.estimation.least_squares import fit
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.identification.layout import BASE_PRIOR, TARGET_PRIOR, layout_of
from taskcal.identification.problem import Problem, problem_of, whitener
from taskcal.identification.validation import validate
from taskcal.kernels import walk
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


@dataclass(frozen=True, eq=False, kw_only=True)
class Fixed:
    """A fit whose hyperparameters are given: the tracker's noise, the tolerances as they are."""

    problem: Problem
    white: np.ndarray
    start: np.ndarray
    deviations: np.ndarray
    """Standard deviations of the prior about the start."""

    @classmethod
    def of(cls, model, campaign) -> "Fixed":
        layout = layout_of(model, np.arange(len(model)), register(model, campaign), campaign, fixed=False)
        problem = problem_of(layout, campaign, None)
        frames = np.concatenate([np.full(6, BASE_PRIOR), np.full(3, TARGET_PRIOR)])
        return cls(
            problem=problem,
            white=whitener(problem.noise),
            start=layout.start(),
            deviations=np.concatenate([model.tolerances, frames]),
        )

    @property
    def scale(self) -> np.ndarray:
        """Natural size of every entry of z."""
        return np.minimum(self.deviations, 1e-3)

    def ours(self):
        precision = np.diag(1.0 / self.deviations**2)
        equations = self.problem.equations(self.white)
        return fit(equations, self.start, self.start, precision, self.scale)

    def scipys(self, jacobian: Callable[[np.ndarray], np.ndarray] | str):
        return least_squares(self.residuals, self.start, jac=jacobian, x_scale=self.scale, method="lm")

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Whitened residuals, then the prior's rows."""
        at = self.problem.walked(z)
        T = walk.poses(at.chain, at.s, at.e)
        predicted = T[:, :3, :3] @ at.points.position[0] + T[:, :3, 3]
        data = self.white[:, 0] @ (predicted - self.problem.seen.position[:, 0])[:, :, None]
        return np.concatenate([data.reshape(-1), (z - self.start) / self.deviations])

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Derivative of the residuals."""
        at = self.problem.walked(z)
        J = walk.columns(at.chain, at.s, at.e, at.layout, at.factor, angular=False, point=at.points.position[0])
        J[:, :, at.points.columns[0]] = walk.poses(at.chain, at.s, at.e)[:, :3, :3]
        return np.concatenate([(self.white[:, 0] @ J).reshape(-1, len(z)), np.diag(1.0 / self.deviations)])


@pytest.fixture(scope="module")
def fixed(model, campaign) -> Fixed:
    return Fixed.of(model, campaign)


@pytest.mark.guard
def test_bare_fit_against_scipy(race, fixed):
    ours, theirs = fixed.ours(), fixed.scipys(fixed.jacobian)
    assert ours.converged
    assert theirs.success
    assert ours.objective == pytest.approx(theirs.cost, rel=1e-9)
    race(
        "fit",
        fixed.ours,
        {
            "SciPy, analytic Jacobian": lambda: fixed.scipys(fixed.jacobian),
            "SciPy, 2-point Jacobian": lambda: fixed.scipys("2-point"),
        },
        rounds=7,
    )


@pytest.mark.guard
def test_identification_against_scipy(race, model, campaign, fixed):
    """Registration, marginal likelihood and report, against one of SciPy's fits with all that given."""
    race(
        "identify",
        lambda: identify(model, campaign),
        {
            "SciPy, analytic Jacobian": lambda: fixed.scipys(fixed.jacobian),
            "SciPy, 2-point Jacobian": lambda: fixed.scipys("2-point"),
        },
        rounds=7,
    )


def test_a_large_campaign_against_a_small_one(race, smoke, model, campaign, joints):
    """Passes over the rows are few: most of what is sought is sought among some of them."""
    count = 6000 if smoke else 100_000
    large = simulate(model, joints(count), rng=np.random.default_rng(3), model_error=3e-5)[0]
    found = identify(model, large)
    assert found.model_error[0] == pytest.approx(3e-5, rel=0.05)
    race(
        "identify, 100 000",
        lambda: identify(model, large),
        {"60 poses": lambda: identify(model, campaign)},
        below=250.0,
        rounds=3,
    )


def test_sockets_against_points(race):
    """200 postures of a ball in sockets with stated distances, against a tracker's points of the same postures."""
    model, rng = ErrorModel(load_robot("abb-irb120")), np.random.default_rng(2)
    sockets, truth = simulate(model, rng.uniform(-1.0, 1.0, (200, 6)), rng=rng, observe="socket")
    points, _ = simulate(model, sockets.q, rng=rng, x=truth.x)
    for campaign in (sockets, points):
        assert validate(identify(model, campaign), campaign).mean < 1e-4
    race(
        "identify, 200 of sockets",
        lambda: identify(model, sockets),
        {"of points": lambda: identify(model, points)},
        below=1.5,
        rounds=7,
    )


def test_all_effects_in_one_model_against_geometry_alone(race, model, campaign):
    """Some 700 parameters, their sizes, sharp orders and cross-validation, in the time of some fifty fits of geometry."""
    plain, found = identify(model, campaign), explain(model, campaign)
    assert found.stages[0].parameters == len(plain.kept)
    assert np.abs(found.calibration.predict(campaign.q) - plain.predict(campaign.q)).max() < 1e-4
    race(
        "all effects, 60 rows",
        lambda: explain(model, campaign),
        {"identify": lambda: identify(model, campaign)},
        below=120.0,
        rounds=3,
    )


def test_sizes_of_few_rows_against_normal_equations(race):
    """Sizes of 50 groups of 14 parameters by 180 rows: by the covariance of the rows, and by as many equations as parameters."""
    rng, own = np.random.default_rng(0), np.repeat(np.arange(50), 14)
    A = 30.0 * rng.normal(size=(180, len(own)))
    y = A @ (np.exp(rng.normal(size=50))[own] * rng.normal(size=len(own)) / 30.0) + rng.normal(size=len(A))
    groups = Groups(group=own, held=np.zeros((0, 0)), location=np.zeros(50), spread=9.0 * np.eye(50))

    sizes = rng.normal(size=(6, 50))

    def at(equations):
        return [equations.at(one).log_posterior for one in sizes]

    def few():
        return at(GroupEquations.of_rows(A, y, groups))

    def many():
        return at(GroupEquations(groups=groups, given=A.T @ A, b=A.T @ y, square=float(y @ y)))

    np.testing.assert_allclose(few(), many(), rtol=1e-9)
    race("sizes, 180 rows of 700 parameters", few, {"normal equations": many}, below=0.8, rounds=5)
